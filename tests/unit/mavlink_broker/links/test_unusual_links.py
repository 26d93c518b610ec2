"""What vehicles in the field do: companions that send first, shared numbers, clocks that end."""

import dataclasses
import logging
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.cli.program import configure_logging
from mavlink_broker.config import Config
from mavlink_broker.live.follow_target import VehicleTrack
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.signing import KeyRing, LinkSigning, SignatureCheck
from mavlink_broker.vehicle.telemetry import Snapshot
from tests.support.broker_world import FINISHED, World, first_flight
from tests.support.vehicle_script import PX4

COMPANION, OF_A_USER = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, 25
ROUND_MS = 1 << 32
KEY = bytes(range(32))


def calling_itself(kind: int, autopilot: int) -> Message:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)


def addressed_components(world: World) -> set[int]:
    """Components to which the broker has sent commands."""
    decoder = Decoder()
    sent = [message for _, frame in world.air.sent for message in decoder.decode(frame)]
    return {message.target_component for message in sent if message.get_type() == "COMMAND_LONG"}


class TestTheAutopilot:
    @pytest.mark.first_case
    @pytest.mark.parametrize("component", [COMPANION, OF_A_USER, mavlink.MAV_COMP_ID_CAMERA])
    @pytest.mark.parametrize("kind", [mavlink.MAV_TYPE_GENERIC, mavlink.MAV_TYPE_QUADROTOR])
    def test_is_the_component_that_reports_it_in_whichever_order(
        self, component: int, kind: int
    ) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.silent = True
        for _ in range(30):
            world.send_from(vehicle, calling_itself(kind, 0), component)
            world.run(0.1)
        vehicle.silent = False
        world.run(2.0)
        world.edge.plan(first_flight())
        while world.edge.status(1201) not in {3, 4, 5}:
            world.send_from(vehicle, calling_itself(kind, 0), component)
            world.run(1.0)
        assert world.edge.statuses(1201) == FINISHED
        assert world.edge.bodies("/vehicles/1")[-1]["autopilot"] == "px4"

    def test_gets_the_requests_for_messages_after_a_companion_was_taken_for_it(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.silent = True
        world.send_from(vehicle, calling_itself(mavlink.MAV_TYPE_QUADROTOR, 0), OF_A_USER)
        world.run(3.0)
        world.air.sent.clear()
        vehicle.silent = False
        world.run(2.0)
        assert mavlink.MAV_COMP_ID_AUTOPILOT1 in addressed_components(world)

    def test_may_have_a_number_of_a_user_where_there_is_no_other(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.silent = True
        world.send_from(vehicle, calling_itself(mavlink.MAV_TYPE_QUADROTOR, 12), OF_A_USER)
        world.run(1.0)
        assert 1 in world.app.sessions

    def test_with_a_number_of_a_user_gets_the_requests_for_messages(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.silent = True
        world.send_from(vehicle, calling_itself(mavlink.MAV_TYPE_QUADROTOR, 12), OF_A_USER)
        world.run(1.0)
        assert addressed_components(world) == {OF_A_USER}

    def test_with_the_number_of_the_broker_is_logged(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        world = World(config=Config(system_id=7))
        world.add_vehicle(7)
        with caplog.at_level(logging.WARNING):
            world.run(30.0)
        assert caplog.text.count("a vehicle has system id 7, which is the broker's own") == 1
        assert not world.app.sessions


class TestAnObserver:
    @pytest.mark.first_case
    @pytest.mark.parametrize("action", [0, 2])
    def test_changes_nothing_about_a_vehicle_and_still_sees_it(self, action: int) -> None:
        world = World(config=Config(observes=True))
        script = dataclasses.replace(PX4, link_loss_action=action)
        vehicle = world.add_vehicle(script=script)
        camera = world.add_camera(vehicle)
        camera.shoot()
        world.run(10.0)
        allowed = {mavlink.MAV_CMD_REQUEST_MESSAGE}
        assert set(vehicle.commands) <= allowed
        assert vehicle.written == []
        kinds = {name for name in _sent_names(world) if name not in {"HEARTBEAT", "COMMAND_LONG"}}
        assert kinds <= {"PARAM_REQUEST_READ"}
        seen = world.app.sessions[1].vehicle
        assert seen.is_identified
        assert seen.snapshot.position is not None
        ours = [m for m in _messages(world) if m.get_type() == "HEARTBEAT"]
        assert {m.type for m in ours} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}


def _messages(world: World) -> list[Message]:
    decoder = Decoder()
    return [message for _, frame in world.air.sent for message in decoder.decode(frame)]


def _sent_names(world: World) -> set[str]:
    return {message.get_type() for message in _messages(world)}


class TestClocksOfSignatures:
    def guard(self, folder: Path, utc: list[datetime]) -> SignatureCheck:
        path = folder / "signing-1.key"
        path.write_bytes(KEY)
        path.chmod(0o600)
        return SignatureCheck(KeyRing(folder), set(), lambda: utc[0])

    def frame(self, at: datetime, component: int) -> Message:
        signing = LinkSigning(KEY, lambda: at).next_signature()
        (message,) = Decoder().decode(Encoder(1, component).encode(calling_itself(2, 12), signing))
        return message

    def test_a_clock_that_was_ahead_and_is_corrected_keeps_no_genuine_frame_out(
        self, tmp_path: Path
    ) -> None:
        true = datetime(2026, 9, 1, tzinfo=UTC)
        utc = [true + timedelta(hours=2)]
        guard = self.guard(tmp_path, utc)
        signing = guard.signing_for(1, 0.0)
        assert signing is not None
        before = signing.next_signature().timestamp
        assert not guard.accepts(self.frame(true, 1), 0.0)  # A new stream, two hours old
        utc[0] = true + timedelta(seconds=1)
        assert guard.accepts(self.frame(true + timedelta(seconds=1), 1), 1.0)
        assert guard.accepts(self.frame(true + timedelta(seconds=2), 2), 2.0)
        assert signing.next_signature().timestamp >= before  # Our timestamps never decrease

    def test_what_is_old_by_the_vehicles_own_frames_stays_out(self, tmp_path: Path) -> None:
        true = datetime(2026, 9, 1, tzinfo=UTC)
        guard = self.guard(tmp_path, [true - timedelta(days=30)])
        assert guard.accepts(self.frame(true, 1), 0.0)
        assert not guard.accepts(self.frame(true - timedelta(seconds=61), 2), 0.0)
        assert not guard.accepts(self.frame(true, 1), 0.0)


class TestTheCountersEnd:
    @given(st.integers(0, ROUND_MS - 1), st.lists(st.integers(0, ROUND_MS // 4), max_size=40))
    def test_a_vehicles_time_goes_on(self, first_ms: int, steps_ms: list[int]) -> None:
        snapshot, true_ms = Snapshot(), first_ms
        snapshot.clock(first_ms)
        for step_ms in steps_ms:
            true_ms += step_ms
            assert snapshot.clock(true_ms % ROUND_MS) == pytest.approx(true_ms / 1e3)

    def test_a_late_frame_is_of_before_it(self) -> None:
        snapshot = Snapshot()
        snapshot.clock(ROUND_MS - 100)
        assert snapshot.clock(100) == pytest.approx((ROUND_MS + 100) / 1e3)
        assert snapshot.since_boot_s(ROUND_MS - 50) == pytest.approx((ROUND_MS - 50) / 1e3)
        assert snapshot.clock(ROUND_MS - 50) == pytest.approx((ROUND_MS - 50) / 1e3)
        assert snapshot.clock(200) == pytest.approx((ROUND_MS + 200) / 1e3)

    @pytest.mark.first_case
    @pytest.mark.parametrize("before_s", [3.0, 8.0, 12.0])
    def test_a_mission_that_flies_across_it_is_flown_to_its_end(self, before_s: float) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.booted_at = world.clock.now + before_s - ROUND_MS / 1e3
        vehicle.clock_wraps_at_ms = ROUND_MS
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert world.edge.bodies("/vehicles/1")[-1]["warning"] is None


def test_a_lead_that_was_restarted_has_its_velocity_again() -> None:
    track = VehicleTrack()
    for second in range(5):
        track.take(1000.0 + second, 40.0 + second * 9e-6, -3.7)
    for second in range(5):
        track.take(2.0 + second, 40.1 + second * 9e-6, -3.7)
    seen = track.at(6.0)
    assert seen is not None
    assert seen.velocity_ned_m_s is not None
    assert seen.velocity_ned_m_s[0] == pytest.approx(1.0, abs=0.05)


def test_old_frames_are_counted_and_not_logged_one_by_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    configure_logging("INFO")
    true = datetime(2026, 9, 1, tzinfo=UTC)
    guard = TestClocksOfSignatures().guard(tmp_path, [true])
    frame = TestClocksOfSignatures().frame(true, 1)
    with caplog.at_level(logging.INFO):
        assert guard.accepts(frame, 0.0)
        for number in range(1000):
            assert not guard.accepts(frame, number * 0.01)
    assert len(caplog.records) < 10
    assert sum(guard.refused.values()) == 1000
