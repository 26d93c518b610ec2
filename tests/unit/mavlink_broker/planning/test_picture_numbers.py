"""A camera takes a single picture once per number (MAVLink, IMAGE_START_CAPTURE, parameter 4)."""

from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import PX4
from mavlink_broker.planning.mission import FlightPlan, translate
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.translated_missions import HOME
from tests.unit.mavlink_broker.planning.aimed_pictures import SHOOT, image

AIM = (-90.0, None)


def numbers(flight: str) -> list[float]:
    commands = takeoff(1), waypoint(2), image(3, AIM), image(4, AIM), go_home(5)
    plan = Mission.model_validate(mission(*commands))
    (segment,) = translate(plan, PX4, HOME, flight=flight).segments
    assert isinstance(segment, FlightPlan)
    return [item.parameters[3] for item in segment.items if item.command == SHOOT]


def test_the_pictures_of_one_mission_have_numbers_of_their_own() -> None:
    first, second = numbers("1/A")
    assert first != second


def test_a_mission_that_is_read_again_has_the_same_numbers() -> None:
    assert numbers("1/A") == numbers("1/A")


def test_another_flight_of_a_mission_with_this_number_takes_its_own_pictures() -> None:
    assert not set(numbers("1/A")) & set(numbers("2/A"))
