"""A parameter is written when the vehicle reports the new value, and not before."""

import math
import random
import struct

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Refused, RoundTrip
from mavlink_broker.microservices.parameter import (
    READ_ATTEMPTS,
    WRITE_ATTEMPTS,
    ParameterEncoding,
    ParameterRead,
    ParameterWrite,
    Setting,
    Written,
    encoding_of,
    from_field,
    to_field,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, kinds, received, tick_until

INT32 = mavlink.MAV_PARAM_TYPE_INT32
REAL32 = mavlink.MAV_PARAM_TYPE_REAL32
BYTEWISE, C_CAST = ParameterEncoding.BYTEWISE, ParameterEncoding.C_CAST
encodings = pytest.mark.parametrize("encoding", [BYTEWISE, C_CAST])


class Vehicle:
    """Keeps one parameter, within its range."""

    def __init__(
        self,
        value: float,
        *,
        kind: int = REAL32,
        encoding: ParameterEncoding = BYTEWISE,
        largest: float = 1e9,
        explains: bool = False,
        name: str = "FOLL_OFS_X",
    ) -> None:
        self.value = value
        self.writes = 0
        self._kind = kind
        self._encoding = encoding
        self._largest = largest
        self._explains = explains
        self._name = name

    def answer(self, message: Message) -> list[Message]:
        if message.param_id != self._name:
            return []
        if message.get_type() == "PARAM_SET":
            self.writes += 1
            wanted = from_field(message.param_value, message.param_type, self._encoding)
            assert message.param_type == self._kind
            if wanted <= self._largest:
                self.value = wanted
            elif self._explains:
                name = self._name.encode()
                return [received(mavlink.MAVLink_param_error_message(254, 191, name, -1, 2))]
        return [self.shows()]

    def shows(self) -> Message:
        field = to_field(self.value, self._kind, self._encoding)
        name = self._name.encode()
        return received(mavlink.MAVLink_param_value_message(name, field, self._kind, 10, 3))


def writing(value: float, encoding: ParameterEncoding = BYTEWISE) -> ParameterWrite:
    return ParameterWrite(Setting("FOLL_OFS_X", value), ROUTE, RoundTrip(), encoding)


def run(write: ParameterWrite, vehicle: Vehicle, *, loss: float = 0.0, seed: int = 1) -> None:
    """Let them talk until the write is over; each frame may be lost."""
    random_numbers = random.Random(seed)
    now = 0.0
    messages = write.start(now)
    while write.outcome is None and now < 200.0:
        now += 0.05
        arrived = [received(message) for message in messages if random_numbers.random() >= loss]
        answers = [answer for message in arrived for answer in vehicle.answer(message)]
        messages = write.tick(now)
        for answer in answers:
            if random_numbers.random() >= loss:
                messages += write.receive(answer, now)


@encodings
@pytest.mark.parametrize(("kind", "before", "after"), [(INT32, 3.0, -7.0), (REAL32, 1.5, 2.25)])
def test_the_vehicle_has_the_value_and_what_it_had_is_known(
    kind: int, before: float, after: float, encoding: ParameterEncoding
) -> None:
    vehicle = Vehicle(before, kind=kind, encoding=encoding)
    write = writing(after, encoding)
    run(write, vehicle)
    assert write.outcome == Written(previous=before)
    assert vehicle.value == after


@pytest.mark.parametrize("seed", range(20))
def test_a_fifth_of_all_frames_may_be_lost(seed: int) -> None:
    vehicle = Vehicle(3.0, kind=INT32)
    write = writing(8.0)
    run(write, vehicle, loss=0.2, seed=seed)
    assert write.outcome == Written(previous=3.0)
    assert vehicle.value == 8.0


def test_what_is_right_already_is_not_written() -> None:
    vehicle = Vehicle(8.0)
    write = writing(8.0)
    run(write, vehicle)
    assert write.outcome == Written(previous=8.0)
    assert vehicle.writes == 0


@pytest.mark.parametrize(
    ("explains", "reason"),
    [(True, "the value is out of its range"), (False, "the vehicle keeps it at 3")],
)
def test_a_refusal_names_the_parameter_and_the_reason(explains: bool, reason: str) -> None:
    write = writing(80.0)
    run(write, Vehicle(3.0, largest=10.0, explains=explains))
    assert write.outcome == Refused(f"parameter FOLL_OFS_X: {reason}")


def test_a_late_answer_to_the_reading_is_no_refusal() -> None:
    vehicle = Vehicle(3.0)
    write = writing(8.0)
    write.start(0.0)
    old = vehicle.shows()
    (set_message,) = write.receive(old, 0.1)
    write.receive(old, 0.2)
    (new,) = vehicle.answer(received(set_message))
    write.receive(new, 0.3)
    assert write.outcome == Written(previous=3.0)


def test_a_missing_parameter_is_requested_a_few_times() -> None:
    write = writing(8.0)
    sent = [*write.start(0.0), *tick_until(write, 0.0, 100.0)]
    assert kinds(sent) == ["PARAM_REQUEST_READ"] * WRITE_ATTEMPTS
    assert isinstance(write.outcome, Refused)
    assert "no answer" in write.outcome.reason


def test_an_integer_that_does_not_fit_its_type_is_not_sent() -> None:
    vehicle = Vehicle(3.0, kind=mavlink.MAV_PARAM_TYPE_INT8)
    write = writing(300.0)
    run(write, vehicle)
    assert write.outcome == Refused("parameter FOLL_OFS_X: 300 does not fit its type")
    assert vehicle.writes == 0


def test_a_type_that_does_not_fit_the_message_is_refused() -> None:
    write = writing(8.0)
    write.start(0.0)
    kind = mavlink.MAV_PARAM_TYPE_REAL64
    write.receive(mavlink.MAVLink_param_value_message(b"FOLL_OFS_X", 1.0, kind, 1, 0), 0.1)
    assert isinstance(write.outcome, Refused)


def test_other_parameters_change_nothing() -> None:
    write = writing(8.0)
    write.start(0.0)
    other = Vehicle(1.0, name="FOLL_OFS_Y").shows()
    assert write.receive(other, 0.1) == []
    assert write.outcome is None


@given(st.integers(-(2**31), 2**31 - 1))
def test_the_bits_of_an_integer_are_decoded(value: int) -> None:
    (as_float,) = struct.unpack("<f", struct.pack("<i", value))
    assume(not math.isnan(as_float))  # Python hands on a number that is none with other bits
    field = to_field(float(value), INT32, BYTEWISE)
    (on_the_wire,) = struct.unpack("<f", struct.pack("<f", field))
    assert from_field(on_the_wire, INT32, BYTEWISE) == value


def test_the_capabilities_give_the_encoding() -> None:
    assert encoding_of(16, C_CAST) is BYTEWISE
    assert encoding_of(131072, BYTEWISE) is C_CAST
    assert encoding_of(2, C_CAST) is C_CAST


NAME = "BAT1_CAPACITY"


def reading() -> ParameterRead:
    return ParameterRead(NAME, ROUTE, RoundTrip())


def value(name: str, number: float) -> Message:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    return mavlink.MAVLink_param_value_message(name.encode(), number, kind, 1, 0)


def error(name: str) -> Message:
    return mavlink.MAVLink_param_error_message(255, 190, name.encode(), -1, 1)


def test_the_value_ends_the_reading() -> None:
    read = reading()
    assert len(read.tick(0.0)) == 1
    read.receive(value(NAME, 5200.0))
    assert read.value == 5200.0
    assert read.outcome is not None
    assert read.tick(100.0) == []


def test_a_parameter_that_does_not_exist_is_not_requested_again() -> None:
    read = reading()
    read.tick(0.0)
    read.receive(error(NAME))
    assert read.outcome is not None
    assert read.value is None
    assert read.tick(100.0) == []


def test_what_concerns_another_parameter_changes_nothing() -> None:
    read = reading()
    read.tick(0.0)
    read.receive(value("BAT2_CAPACITY", 1.0))
    read.receive(error("BAT2_CAPACITY"))
    assert read.outcome is None
    assert len(read.tick(100.0)) == 1


def test_a_silent_vehicle_gets_a_few_requests() -> None:
    read = reading()
    asked = sum(len(read.tick(float(now))) for now in range(0, 1000, 10))
    assert asked == READ_ATTEMPTS
    assert read.outcome is not None
    assert read.value is None
