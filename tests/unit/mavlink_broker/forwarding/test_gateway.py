"""What crosses between vehicles and ground stations, in whose name and with which number."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.forwarding.gateway import WATCHED_S, Crossing, Gateway
from mavlink_broker.forwarding.refusals import KINDS_KEPT
from mavlink_broker.forwarding.verdict import Tenure
from mavlink_broker.mavlink.codec import Decoder, Encoder, encoded_as
from mavlink_broker.mavlink.dialect import Source, mavlink
from mavlink_broker.mavlink.frames import sequence, signed, unsigned

OWN, GROUND = 254, Source(255, 190)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
LAND = mavlink.MAV_CMD_NAV_LAND


def heard(frame: bytes) -> Any:
    (message,) = Decoder(keeps_unknown=True).decode(frame)
    return message


class Passage:
    """A gateway, its vehicles and a ground station."""

    def __init__(self, *, may_command: bool = False, vehicles: tuple[int, ...] = (1, 2)) -> None:
        self.tenures = dict.fromkeys(vehicles, Tenure.FREE)
        self.gateway = Gateway(OWN, self.tenures.__getitem__, {}, may_command=may_command)
        self.ground = Encoder(*GROUND)
        self.autopilot = Encoder(1, 1)

    def say(self, message: Any, now: float = 0.0) -> Crossing:
        said = heard(self.ground.encode(message))
        return self.gateway.from_ground(said, self.tenures.keys(), now)

    def show(self, message: Any) -> bytes | None:
        return self.gateway.from_vehicle(heard(self.autopilot.encode(message)))


def command(number: int, system: int = 1) -> Any:
    return mavlink.MAVLink_command_long_message(system, 1, number, 0, *[0.0] * 7)


def acknowledgement(system: int, component: int) -> Any:
    return mavlink.MAVLink_command_ack_message(400, 0, 0, 0, system, component)


def test_a_message_goes_as_it_is_to_the_vehicle_that_it_is_meant_for() -> None:
    passage = Passage()
    ((target, frame),) = passage.say(command(LAND, system=2)).to_vehicles
    assert target == Source(2, 1)
    assert heard(frame).get_srcSystem() == 255
    assert frame == encoded_as(command(LAND, system=2), GROUND, 0)


def test_a_message_to_all_goes_to_those_that_are_free_and_is_refused_for_the_others() -> None:
    passage = Passage(vehicles=(1, 2, 3))
    passage.tenures[2] = Tenure.MISSION
    crossing = passage.say(command(LAND, system=0))
    assert [target.system for target, _ in crossing.to_vehicles] == [1, 3]
    assert {heard(frame).get_srcSystem() for frame in crossing.to_ground} == {2}


def test_a_vehicle_that_is_not_there_gets_nothing() -> None:
    assert Passage().say(command(LAND, system=9)) == Crossing()


def test_a_refusal_is_answered_in_the_vehicles_name_explained_once_and_counted() -> None:
    passage = Passage()
    passage.tenures[1] = Tenure.MISSION
    first = [heard(frame) for frame in passage.say(command(LAND)).to_ground]
    assert [(m.get_type(), m.get_srcSystem(), m.get_srcComponent()) for m in first] == [
        ("COMMAND_ACK", 1, 1),
        ("STATUSTEXT", 1, 1),
    ]
    assert "broker" in first[1].text
    again = [heard(frame).get_type() for frame in passage.say(command(LAND), 1.0).to_ground]
    assert again == ["COMMAND_ACK"]
    assert first[1].text.endswith("NAV_LAND")
    assert passage.gateway.refusals.count == {"NAV_LAND": 2}


def test_who_may_command_may_do_so_at_any_time() -> None:
    passage = Passage(may_command=True)
    passage.tenures[1] = Tenure.MISSION
    assert len(passage.say(command(LAND)).to_vehicles) == 1
    assert len(passage.say(HEARTBEAT).to_vehicles) == 2


def test_a_heartbeat_shows_that_somebody_watches_and_goes_no_further() -> None:
    passage = Passage()
    assert not passage.gateway.is_watched(100.0)
    assert passage.say(HEARTBEAT, 100.0) == Crossing()
    assert passage.gateway.is_watched(100.0 + WATCHED_S)
    assert not passage.gateway.is_watched(100.1 + WATCHED_S)


@pytest.mark.parametrize("system", [0, 1, 2, OWN])
def test_nobody_speaks_in_the_name_of_a_vehicle_or_of_the_broker(system: int) -> None:
    passage = Passage()
    message = heard(encoded_as(command(LAND), Source(system, 1), 0))
    assert passage.gateway.from_ground(message, passage.tenures.keys(), 0.0) == Crossing()
    assert not passage.gateway.is_watched(0.0)


def test_a_vehicles_frames_are_shown_byte_for_byte_but_for_their_signature() -> None:
    passage = Passage()
    plain = Encoder(1, 1).encode(HEARTBEAT)
    assert passage.gateway.from_vehicle(heard(plain)) == plain
    assert passage.gateway.from_vehicle(heard(signed(plain, bytes(32), 0, 7))) == unsigned(plain)


def test_what_is_meant_for_the_broker_alone_is_not_shown() -> None:
    passage = Passage()
    assert passage.show(acknowledgement(OWN, 191)) is None
    assert passage.show(acknowledgement(0, 0)) is not None
    assert passage.show(acknowledgement(*GROUND)) is not None


def test_what_is_withheld_or_added_is_no_loss_and_a_loss_still_is_one() -> None:
    passage = Passage()
    passage.tenures[1] = Tenure.MISSION
    numbers = []
    for n in range(300):
        if n == 200:
            passage.autopilot.encode(HEARTBEAT)  # Never arrives
        shown = passage.show(acknowledgement(OWN, 191) if n % 7 == 3 else HEARTBEAT)
        numbers += [sequence(shown)] if shown else []
        if n % 50 == 10:
            numbers += [sequence(f) for f in passage.say(command(LAND), float(n)).to_ground]
    gaps = [(b - a) % 256 for a, b in pairwise(numbers)]
    assert gaps.count(1) == len(gaps) - 1
    assert gaps.count(2) == 1


def test_endless_kinds_of_refused_messages_do_not_fill_memory() -> None:
    passage = Passage()
    passage.tenures[1] = Tenure.MISSION
    for number in range(2 * KINDS_KEPT):
        passage.say(command(40_000 + number))
    assert len(passage.gateway.refusals.count) <= KINDS_KEPT + 1
    assert passage.gateway.refusals.count.total() == 2 * KINDS_KEPT


def test_the_log_names_the_most_frequent_refusals_only(caplog: pytest.LogCaptureFixture) -> None:
    passage = Passage()
    passage.tenures[1] = Tenure.MISSION
    for number in [LAND] * 3 + list(range(40_000, 40_050)):
        passage.say(command(number))
    (first, second) = passage.say(HEARTBEAT, 60.0), passage.say(HEARTBEAT, 120.0)
    assert first == second == Crossing()
    (_, line) = [record.getMessage() for record in caplog.records]
    assert "2 NAV_LAND" in line
    assert "kinds more" in line
    assert len(line) < 300


@given(st.sampled_from(sorted(mavlink.mavlink_map)), st.binary(min_size=1, max_size=255))
def test_no_message_whatever_is_in_it_breaks_anything(number: int, payload: bytes) -> None:
    kind = mavlink.mavlink_map[number]
    payload = payload.ljust(kind.unpacker.size, b"\0")[: min(kind.unpacker.size, 255)]
    header = bytes((0xFD, len(payload), 0, 0, 0, 255, 190)) + number.to_bytes(3, "little")
    checksum = mavlink.x25crc(header[1:] + payload + bytes((kind.crc_extra,))).crc
    frame = header + payload + checksum.to_bytes(2, "little")
    passage = Passage(vehicles=(1, 2, 3))
    passage.tenures |= {1: Tenure.MISSION, 2: Tenure.TRANSFER}
    for message in Decoder(keeps_unknown=True).decode(frame):
        crossing = passage.gateway.from_ground(message, passage.tenures.keys(), 0.0)
        for answer in crossing.to_ground:
            assert heard(answer).get_srcSystem() in {1, 2, 3}
        for target, passed in crossing.to_vehicles:
            assert target.system in {1, 2, 3}
            assert heard(passed).get_srcSystem() == 255
