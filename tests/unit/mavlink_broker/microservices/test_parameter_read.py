from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.parameter_read import ATTEMPTS, ParameterRead
from mavlink_broker.microservices.round_trip import RoundTrip
from tests.unit.mavlink_broker.protocol.harness import ROUTE

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
    assert read.is_over
    assert read.tick(100.0) == []


def test_a_parameter_that_does_not_exist_is_not_asked_for_again() -> None:
    read = reading()
    read.tick(0.0)
    read.receive(error(NAME))
    assert read.is_over
    assert read.value is None
    assert read.tick(100.0) == []


def test_what_concerns_another_parameter_changes_nothing() -> None:
    read = reading()
    read.tick(0.0)
    read.receive(value("BAT2_CAPACITY", 1.0))
    read.receive(error("BAT2_CAPACITY"))
    assert not read.is_over
    assert len(read.tick(100.0)) == 1


def test_a_silent_vehicle_is_asked_a_few_times() -> None:
    read = reading()
    asked = sum(len(read.tick(float(now))) for now in range(0, 1000, 10))
    assert asked == ATTEMPTS
    assert read.is_over
    assert read.value is None
