"""With two uploaders and a lossy link, the vehicle always has one complete plan."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.memory_storage import MemoryStorage
from tests.support.mission_field import Vehicle
from uav_firmware.modules.mavlink.missions.plan_file import decode
from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack

PLANS = {254: (3, 10.0), 255: (5, 20.0)}  # Uploader: number of items and their height [m]


def item(system: int, seq: int) -> Any:
    return mavlink.MAVLink_mission_item_int_message(
        1, 1, seq, 6, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, 404_434_000 + seq, -37_382_000, PLANS[system][1]
    )


def count(system: int) -> Any:
    return mavlink.MAVLink_mission_count_message(1, 1, PLANS[system][0], 0)


CLEAR = mavlink.MAVLink_mission_clear_all_message(1, 1, 0)
CANCEL = mavlink.MAVLink_mission_ack_message(1, 1, mavlink.MAV_MISSION_OPERATION_CANCELLED, 0)

systems = st.sampled_from(sorted(PLANS))
moments = st.one_of(
    systems.map(lambda system: (system, count(system))),
    st.tuples(systems, st.just(CLEAR)),
    st.tuples(systems, st.just(CANCEL)),
    systems.flatmap(
        lambda system: st.tuples(
            st.just(system),
            st.integers(0, PLANS[system][0]).map(lambda seq: item(system, seq)),
        )
    ),
    st.tuples(systems, st.sampled_from(["answer", "answer", "answer", "wait", "echo"])),
)


class Scene:
    """The vehicle, and the last request to each uploader."""

    def __init__(self) -> None:
        self.storage = MemoryStorage()
        self.vehicle = Vehicle(storage=self.storage)
        self.now_us = 0
        self._sequence = 0
        self._asked = dict.fromkeys(PLANS, 0)
        self._last = b""

    def play(self, system: int, deed: Any) -> None:
        """Let an uploader send a message or answer a request, or advance time."""
        self.now_us += 20_000
        if deed == "wait":
            self.now_us += 16_000_000
        elif deed == "echo":
            self._send(self._last)
        else:
            self._sequence = (self._sequence + 1) & 0xFF
            message = item(system, self._asked[system]) if deed == "answer" else deed
            self._send(frame(pack(message), self._sequence, system, 190))
        self._hear(self.vehicle.tick(self.now_us))

    def _send(self, datagram: bytes) -> None:
        self._last = datagram
        if datagram:
            self._hear(self.vehicle.receive(datagram, self.now_us))

    def _hear(self, frames: list[bytes]) -> None:
        for datagram in frames:
            message = Vehicle.read(datagram)
            if message.get_type() == "MISSION_REQUEST_INT":
                self._asked[message.target_system] = message.seq

    def held(self) -> tuple[int, set[float], list[int]]:
        """Number, heights and numbering of the items in force."""
        mission = self.vehicle.mission.value
        items = () if mission is None else mission.items
        return len(items), {one.z for one in items}, [one.seq for one in items]


@pytest.mark.thorough
@settings(max_examples=150)
@given(st.lists(moments, max_size=60))
def test_the_plan_in_force_comes_from_one_uploader(deeds: list[tuple[int, Any]]) -> None:
    scene = Scene()
    whole = {(0, frozenset()), *((n, frozenset({z})) for n, z in PLANS.values())}
    for system, deed in deeds:
        scene.play(system, deed)
        number, heights, numbering = scene.held()
        assert (number, frozenset(heights)) in whole
        assert numbering == list(range(number))
    kept = scene.storage.load("mission.plan")
    assert len(() if kept is None else decode(0, kept)) == scene.held()[0]


@given(systems)
def test_the_atomicity_property_covers_both_plans(system: int) -> None:
    scene = Scene()
    scene.play(system, count(system))
    for _ in range(PLANS[system][0]):
        scene.play(system, "answer")
    assert scene.held()[0] == PLANS[system][0]
