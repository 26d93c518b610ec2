"""Every command gets exactly one final answer, and the right one."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.cases import failures
from tests.support.toy_vehicle import HOME, ToyVehicle, at, item, takeoff, waypoint
from uav_firmware.msg.mission import MissionState
from uav_firmware.msg.status import Command, CommandResult, NavigationState, VehicleCommand

ACCEPTED = CommandResult.ACCEPTED
NOT_NOW = CommandResult.TEMPORARILY_REJECTED
DENIED = CommandResult.DENIED
UNSUPPORTED = CommandResult.UNSUPPORTED
FAILED = CommandResult.FAILED
NAN = math.nan


def grounded() -> ToyVehicle:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    return vehicle


def loaded() -> ToyVehicle:
    vehicle = grounded()
    vehicle.upload(takeoff(), waypoint(1, 30, 0), waypoint(2, 30, 30), item(3, 20))
    vehicle.run(0.1)
    return vehicle


def airborne() -> ToyVehicle:
    vehicle = loaded()
    vehicle.send(Command.MISSION_START)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 5.0)
    return vehicle


values = st.one_of(
    st.sampled_from([NAN, 0.0, 1.0, -1.0, 2.0, 3.0, 4.0, 21196.0, math.inf, -math.inf, 1e300]),
    st.floats(allow_nan=True, allow_infinity=True, width=32),
)


class Fleet:
    """Vehicles kept between examples; one that was disarmed in the air is replaced."""

    def __init__(self) -> None:
        self._grounded = loaded()
        self._airborne = airborne()

    def pick(self, *, flying: bool) -> ToyVehicle:
        if not flying:
            return self._grounded
        if not self._airborne.armed or self._airborne.landed:
            self._airborne = airborne()
        return self._airborne


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    return Fleet()


@pytest.mark.thorough
@settings(deadline=None, max_examples=300)
@given(
    command=st.one_of(st.sampled_from(list(Command)), st.integers(0, 65535)),
    params=st.lists(values, min_size=7, max_size=7),
    frame=st.sampled_from([0, 3, 10, 255]),
    flying=st.booleans(),
)
def test_no_command_whatever_it_holds_goes_without_one_answer(
    fleet: Fleet, command: int, params: list[float], frame: int, flying: bool
) -> None:
    vehicle = fleet.pick(flying=flying)
    result = vehicle.send(command, *params, frame=frame)
    assert result in set(CommandResult) - {CommandResult.IN_PROGRESS, CommandResult.CANCELLED}
    vehicle.run(0.1)
    for setpoint in vehicle.setpoints[-10:]:
        assert all(map(math.isfinite, setpoint.velocity_ned))
        assert math.isfinite(setpoint.yaw)
    del vehicle.track[:], vehicle.setpoints[:], vehicle.acks[:]


def check_infinite_parameter(command: int, number: int) -> None:
    params = [1.0 if n == 1 else 0.0 for n in range(1, 8)]
    params[number - 1] = math.inf
    vehicle = grounded()
    assert vehicle.send(command, *params) is DENIED
    assert any(f"parameter {number}" in text for text in vehicle.texts)


def test_an_infinite_parameter_is_always_denied() -> None:
    assert failures(check_infinite_parameter, itertools.product(Command, range(1, 8))) == []


@pytest.mark.parametrize("command", [18, 31, 2000, 42, 65535])
def test_an_unknown_command_is_unsupported(command: int) -> None:
    assert grounded().send(command, NAN, NAN, NAN, NAN, NAN, NAN, NAN) is UNSUPPORTED


WRONG = [
    (Command.COMPONENT_ARM_DISARM, (2.0,)),
    (Command.COMPONENT_ARM_DISARM, (NAN,)),
    (Command.COMPONENT_ARM_DISARM, (1.0, 5.0)),
    (Command.COMPONENT_ARM_DISARM, (1.0, 0.0, 1.0)),
    (Command.DO_SET_MODE, (1.0, 4.0, 99.0)),
    (Command.DO_SET_MODE, (1.0, 6.0, 5.0)),
    (Command.DO_SET_MODE, (1.0, NAN, NAN)),
    (Command.DO_SET_MODE, (0.0, 4.0, 3.0)),
    (Command.NAV_TAKEOFF, (0.0, 1.0)),
    (Command.NAV_TAKEOFF, (0.0, 0.0, 0.0, NAN, 91.0, 0.0, 660.0)),
    (Command.NAV_TAKEOFF, (0.0, 0.0, 0.0, NAN, 10.0, 10.0, 660.0)),
    (Command.NAV_TAKEOFF, (0.0, 0.0, 0.0, NAN, NAN, NAN, 9000.0)),
    (Command.NAV_RETURN_TO_LAUNCH, (1.0,)),
    (Command.NAV_LAND, (0.0, 2.0)),
    (Command.DO_REPOSITION, (0.0, 1.0, 0.0, NAN, NAN, NAN, NAN)),
    (Command.DO_REPOSITION, (-1.0, 1.0, 0.0, NAN, 0.0, 0.0, 660.0)),
    (Command.DO_REPOSITION, (-1.0, 1.0, 0.0, NAN, NAN, NAN, HOME[2] - 101.0)),
    (Command.NAV_LAND, (-1.0,)),
    (Command.NAV_LAND, (1e38,)),
    (Command.DO_CHANGE_SPEED, (1.0, 0.0)),
    (Command.DO_CHANGE_SPEED, (1.0, NAN)),
    (Command.DO_CHANGE_SPEED, (9.0, 3.0)),
    (Command.DO_CHANGE_SPEED, (1.0, 3.0, 50.0)),
    (Command.DO_PAUSE_CONTINUE, (2.0,)),
    (Command.DO_SET_HOME, (0.0, 0.0, 0.0, 0.0, 91.0, 0.0, 0.0)),
    (Command.DO_SET_HOME, (0.0, 0.0, 0.0, 0.0, NAN, NAN, NAN)),
    (Command.DO_SET_MISSION_CURRENT, (-2.0,)),
    (Command.DO_SET_MISSION_CURRENT, (0.5,)),
    (Command.DO_SET_MISSION_CURRENT, (0.0, 2.0)),
    (Command.DO_SET_MISSION_CURRENT, (0.0, 0.0, 1.0)),
    (Command.MISSION_START, (9.0,)),
    (Command.MISSION_START, (0.0, 1.0)),
    (Command.DO_FLIGHTTERMINATION, (0.3,)),
    (Command.NAV_WAYPOINT, (0.0, 0.0, 1.0, NAN, HOME[0], HOME[1], HOME[2] + 9.0)),
    (Command.NAV_WAYPOINT, (-1.0, 0.0, 0.0, NAN, HOME[0], HOME[1], HOME[2] + 9.0)),
    (Command.NAV_WAYPOINT, (0.0, 0.0, 0.0, NAN, NAN, NAN, HOME[2] + 9.0)),
    (Command.NAV_LOITER_TIME, (0.0,)),
    (Command.NAV_LOITER_TIME, (NAN,)),
    (Command.NAV_LOITER_TIME, (5.0, 0.0, 10.0)),
    (Command.RUN_PREARM_CHECKS, (1.0,)),
]


def check_wrong_parameter(command: Command, params: tuple[float, ...]) -> None:
    vehicle = loaded()
    assert vehicle.send(command, *params) is DENIED
    assert any(command.name in text for text in vehicle.texts)
    assert not vehicle.armed


def test_a_wrong_parameter_is_denied_with_a_status_text() -> None:
    assert failures(check_wrong_parameter, WRONG) == []


WRONG_MOMENT = [
    (Command.NAV_WAYPOINT, (0.0, 0.0, 0.0, NAN, HOME[0], HOME[1], HOME[2] + 9.0)),
    (Command.NAV_LOITER_TIME, (5.0,)),
    (Command.DO_ORBIT, (10.0, NAN, NAN, NAN, NAN, NAN, NAN)),
    (Command.DO_REPOSITION, (-1.0, 1.0, 0.0, NAN, NAN, NAN, NAN)),
    (Command.DO_CHANGE_SPEED, (1.0, 3.0)),
    (Command.DO_PAUSE_CONTINUE, (0.0,)),
    (Command.DO_PAUSE_CONTINUE, (1.0,)),
    (Command.DO_FLIGHTTERMINATION, (1.0,)),
]


@pytest.mark.parametrize(("command", "params"), WRONG_MOMENT)
def test_what_needs_the_air_is_not_done_on_the_ground(
    command: Command, params: tuple[float, ...]
) -> None:
    assert loaded().send(command, *params) is NOT_NOW


@pytest.mark.parametrize(
    ("order", "mode"),
    [
        ((Command.NAV_RETURN_TO_LAUNCH,), NavigationState.AUTO_RTL),
        ((Command.NAV_LAND,), NavigationState.AUTO_LAND),
        ((Command.DO_SET_MODE, 1.0, 4.0, 5.0), NavigationState.AUTO_RTL),
        ((Command.DO_SET_MODE, 29.0, 4.0, 6.0), NavigationState.AUTO_LAND),
        ((Command.DO_SET_MODE, 1.0, 4.0, 8.0), NavigationState.AUTO_FOLLOW_TARGET),
        ((Command.DO_SET_MODE, 1.0, 3.0, 1.0), NavigationState.ORBIT),
        ((Command.DO_SET_MODE, 1.0, 3.0, 0.0), NavigationState.POSCTL),
        ((Command.DO_SET_MODE, 1.0, 7.0, 0.0), NavigationState.STAB),
    ],
)
def test_before_arming_every_mode_can_be_chosen_and_none_flies(
    order: tuple[float, ...], mode: NavigationState
) -> None:
    vehicle = loaded()
    assert vehicle.send(int(order[0]), *order[1:]) is ACCEPTED
    vehicle.run(1.0)
    assert vehicle.mode is mode
    assert vehicle.arm() is NOT_NOW
    assert vehicle.send(Command.NAV_TAKEOFF, NAN, NAN, NAN, NAN, NAN, NAN, NAN) is ACCEPTED
    assert vehicle.arm() is ACCEPTED
    vehicle.run_until(lambda v: v.position[2] < -2.0)


def test_a_waypoint_is_flown_to_and_held() -> None:
    vehicle = airborne()
    place = at(20.0, 10.0)
    params = (5.0, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] + 12.0)
    assert vehicle.send(Command.NAV_WAYPOINT, *params) is ACCEPTED
    vehicle.run_until(lambda v: math.dist(v.position, (20.0, 10.0, -12.0)) < 1.0)
    vehicle.run(8.0)
    assert vehicle.mode is NavigationState.AUTO_LOITER
    assert math.dist(vehicle.position, (20.0, 10.0, -12.0)) < 1.0


def test_a_timed_hold_lets_the_mission_go_on() -> None:
    vehicle = airborne()
    assert vehicle.send(Command.NAV_LOITER_TIME, 3.0) is ACCEPTED
    assert vehicle.mode is NavigationState.AUTO_LOITER
    vehicle.run_until(lambda v: math.hypot(*v.velocity) < 0.1)
    vehicle.run(2.5)
    assert vehicle.mode is NavigationState.AUTO_LOITER
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_MISSION)
    vehicle.run_until(lambda v: v.position[0] > 25.0)


def test_a_timed_hold_is_forgotten_when_something_else_is_ordered() -> None:
    vehicle = airborne()
    vehicle.send(Command.NAV_LOITER_TIME, 2.0)
    vehicle.run(0.5)
    vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0)
    vehicle.run(10.0)
    assert vehicle.mode is NavigationState.AUTO_LOITER


def test_the_checks_before_arming_are_reported_on_request() -> None:
    vehicle = grounded()
    assert vehicle.send(Command.RUN_PREARM_CHECKS) is ACCEPTED
    assert any("Ready to arm" in text for text in vehicle.texts)
    vehicle.send(Command.DO_SET_MODE, 1.0, 4.0, 5.0)
    assert vehicle.send(Command.RUN_PREARM_CHECKS) is ACCEPTED
    assert any("Not ready" in text for text in vehicle.texts)
    assert airborne().send(Command.RUN_PREARM_CHECKS) is NOT_NOW


def test_without_a_mission_there_is_nothing_to_start_or_choose() -> None:
    vehicle = grounded()
    assert vehicle.send(Command.MISSION_START) is FAILED
    assert vehicle.send(Command.DO_SET_MISSION_CURRENT, 0.0) is FAILED
    assert vehicle.set_mode(4) is ACCEPTED
    assert vehicle.arm() is NOT_NOW
    assert any("No mission stored" in text for text in vehicle.texts)


def test_the_current_item_is_kept_chosen_or_beyond_the_end() -> None:
    vehicle = loaded()
    assert (
        vehicle.send(Command.DO_SET_MISSION_CURRENT, 2.0, NAN, NAN, NAN, NAN, NAN, NAN) is ACCEPTED
    )
    assert vehicle.send(Command.DO_SET_MISSION_CURRENT, -1.0) is ACCEPTED
    assert vehicle.progress.value is not None
    assert vehicle.progress.value.seq_current == 2
    assert vehicle.send(Command.DO_SET_MISSION_CURRENT, 4.0) is FAILED
    assert vehicle.send(Command.MISSION_START, 1.0, 3.0) is ACCEPTED
    assert vehicle.progress.value.seq_current == 1


def test_disarming_in_the_air_needs_force() -> None:
    vehicle = airborne()
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 0.0) is NOT_NOW
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 0.0, 2989.0) is DENIED  # Forces arming alone
    assert vehicle.armed
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 0.0, 21196.0) is ACCEPTED
    assert not vehicle.armed


def test_termination_stops_the_motors_in_the_air() -> None:
    vehicle = airborne()
    assert vehicle.send(Command.DO_FLIGHTTERMINATION, 1.0) is ACCEPTED
    assert not vehicle.armed


def test_arming_and_disarming_twice_is_no_fault() -> None:
    vehicle = grounded()
    assert [vehicle.arm(), vehicle.arm()] == [ACCEPTED, ACCEPTED]
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 0.0) is ACCEPTED
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 0.0) is ACCEPTED


def test_a_repeated_take_off_does_not_begin_again() -> None:
    vehicle = grounded()
    params = (-1.0, 0.0, 0.0, NAN, NAN, NAN, HOME[2] + 10.0)
    vehicle.send(Command.NAV_TAKEOFF, *params)
    vehicle.arm()
    vehicle.run_until(lambda v: v.velocity[2] < -2.0)
    assert vehicle.send(Command.NAV_TAKEOFF, *params) is ACCEPTED
    vehicle.run(0.3)
    assert vehicle.velocity[2] < -2.0


@pytest.mark.parametrize(
    ("order", "mode"),
    [
        ((Command.DO_PAUSE_CONTINUE, 0.0), NavigationState.AUTO_LOITER),
        ((Command.NAV_LOITER_UNLIM,), NavigationState.AUTO_LOITER),
        ((Command.NAV_RETURN_TO_LAUNCH,), NavigationState.AUTO_RTL),
        ((Command.NAV_LAND,), NavigationState.AUTO_LAND),
        ((Command.DO_SET_MODE, 1.0, 4.0, 6.0), NavigationState.AUTO_LAND),
        ((Command.DO_SET_MODE, 29.0, 4.0, 5.0), NavigationState.AUTO_RTL),
        ((Command.DO_REPOSITION, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN), NavigationState.AUTO_LOITER),
    ],
)
def test_a_command_in_flight_changes_the_mode(
    order: tuple[float, ...], mode: NavigationState
) -> None:
    vehicle = airborne()
    assert vehicle.send(int(order[0]), *order[1:]) is ACCEPTED
    assert vehicle.mode is mode
    assert vehicle.state == MissionState.PAUSED


def test_home_can_be_set_to_a_place_and_stays_there() -> None:
    vehicle = grounded()
    place = at(10.0, 5.0)
    params = (0.0, 0.0, 0.0, 0.0, place["x"], place["y"], HOME[2])
    assert vehicle.send(Command.DO_SET_HOME, *params) is ACCEPTED
    assert vehicle.arm() is ACCEPTED
    assert vehicle.home.value is not None
    assert vehicle.home.value.position_ned == pytest.approx((10.0, 5.0, 0.0), abs=1e-3)


@pytest.mark.parametrize(
    ("frame", "given_m", "height_m"),
    [
        (0, HOME[2] + 20.0, 20.0),
        (6, 20.0, 20.0),
        (3, 20.0, 20.0),
        (3, HOME[2] + 20.0, 20.0),
        (3, HOME[2] - 20.0, -20.0),
    ],
    ids=[
        "above sea level",
        "above home",
        "above home too",
        "as MAVSDK sends it",
        "and in a valley",
    ],
)
def test_home_takes_the_altitude_that_is_meant(frame: int, given_m: float, height_m: float) -> None:
    vehicle = grounded()
    place = at(10.0, 5.0)
    params = (0.0, 0.0, 0.0, 0.0, place["x"], place["y"], given_m)
    assert vehicle.send(Command.DO_SET_HOME, *params, frame=frame) is ACCEPTED
    assert vehicle.home.value is not None
    assert vehicle.home.value.altitude_amsl_m == pytest.approx(HOME[2] + height_m, abs=1e-3)


def test_commands_that_arrive_together_are_each_answered_in_order() -> None:
    vehicle = loaded()
    for token, command in enumerate((Command.MISSION_START, Command.COMPONENT_ARM_DISARM, 9999)):
        vehicle.commands.publish(
            VehicleCommand(0, command, 1.0, 0, 0, 0, 0, 0, 0, 0, 255, 190, token)
        )
    vehicle.run(0.1)
    assert [(a.token, a.result) for a in vehicle.acks] == [(0, 0), (1, 0), (2, 3)]


def reposition(token: int, north_m: float) -> VehicleCommand:
    place = at(north_m, 0.0)
    values = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], NAN)
    return VehicleCommand(0, Command.DO_REPOSITION, *values, 0, 255, 190, token)


def test_targets_that_arrive_together_are_checked_in_their_order_within_one_step() -> None:
    vehicle = airborne()
    vehicle.registry.set("GF_MAX_HOR_DIST", 30.0)
    vehicle.run(0.1)
    vehicle.acks.clear()
    vehicle.commands.publish(reposition(1, 20.0))
    vehicle.commands.publish(reposition(2, 40.0))
    vehicle.commands.publish(reposition(3, 10.0))
    vehicle.run(0.02)
    assert [(ack.token, ack.result) for ack in vehicle.acks] == [(1, 0), (2, 2), (3, 0)]
    vehicle.run(20.0)
    assert vehicle.position[0] == pytest.approx(10.0, abs=0.5)


def test_a_target_that_is_not_checked_is_refused_in_the_same_step() -> None:
    vehicle = airborne()
    vehicle.acks.clear()
    vehicle.commands.publish(reposition(1, 20.0))
    vehicle.now_us += 20_000
    vehicle.commander.update(vehicle.now_us)
    vehicle.commander.finish()
    assert [ack.result for ack in vehicle.answers.drain()] == [NOT_NOW]
    assert vehicle.mode is NavigationState.AUTO_MISSION


def test_a_start_that_arrives_with_the_mission_finds_it() -> None:
    vehicle = grounded()
    vehicle.upload(takeoff(), waypoint(1, 10, 0))
    assert vehicle.send(Command.MISSION_START) is ACCEPTED
    other = grounded()
    other.upload(item(0, 2800), mission_id=8)
    assert other.send(Command.MISSION_START) is NOT_NOW


def test_a_start_arms_or_changes_nothing() -> None:
    vehicle = loaded()
    vehicle.battery = 0.05
    vehicle.run(0.2)
    assert vehicle.send(Command.MISSION_START) is NOT_NOW
    assert (vehicle.armed, vehicle.mode) == (False, NavigationState.AUTO_LOITER)
    vehicle.battery = 1.0
    vehicle.run(0.2)
    assert vehicle.send(Command.MISSION_START) is ACCEPTED
    assert vehicle.armed
    vehicle.run_until(lambda v: v.position[0] > 5.0)


@pytest.mark.parametrize("mode", [(1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 4.0), (6.0, 0.0)])
def test_before_arming_a_mode_needs_nothing_and_the_arming_all(mode: tuple[float, float]) -> None:
    """A vehicle that has just booted: neither attitude nor position, mission nor sticks."""
    vehicle = ToyVehicle(position_valid=False, altitude_valid=False, aligned=False)
    vehicle.run(0.2)
    assert vehicle.send(Command.DO_SET_MODE, 1.0, *mode) is ACCEPTED
    assert vehicle.arm() is NOT_NOW


REPOSITION = (-1.0, 1.0, 0.0, NAN, at(30.0, 0.0)["x"], at(30.0, 0.0)["y"], HOME[2] + 8.0)


@pytest.mark.parametrize(
    "between",
    [
        [(Command.NAV_RETURN_TO_LAUNCH,), (Command.DO_SET_MODE, 1.0, 4.0, 3.0)],
        [(Command.DO_PAUSE_CONTINUE, 0.0)],
        [(Command.DO_SET_MODE, 1.0, 4.0, 4.0), (Command.DO_SET_MODE, 1.0, 4.0, 3.0)],
        [(Command.DO_ORBIT, 5.0, 2.0, NAN, NAN, NAN, NAN, NAN), (Command.DO_PAUSE_CONTINUE, 0.0)],
        [(Command.NAV_LOITER_TIME, 1.0)],
    ],
)
def test_a_place_is_flown_to_again_after_something_else(
    between: list[tuple[float, ...]],
) -> None:
    vehicle = airborne()
    assert vehicle.send(Command.DO_REPOSITION, *REPOSITION) is ACCEPTED
    vehicle.run(2.0)
    for order in between:
        assert vehicle.send(int(order[0]), *order[1:]) is ACCEPTED
        vehicle.run(1.5)
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_LOITER, 20.0)
    assert vehicle.send(Command.DO_REPOSITION, *REPOSITION) is ACCEPTED
    vehicle.run_until(lambda v: math.dist(v.position, (30.0, 0.0, -8.0)) < 1.0, 60.0)


def test_a_repeated_place_does_not_begin_again() -> None:
    vehicle = airborne()
    vehicle.send(Command.DO_REPOSITION, *REPOSITION)
    vehicle.run_until(lambda v: v.velocity[0] > 3.0)
    requests = vehicle.requests.dropped, len(vehicle.requests)
    assert vehicle.send(Command.DO_REPOSITION, *REPOSITION) is ACCEPTED
    assert vehicle.velocity[0] > 3.0
    assert (vehicle.requests.dropped, len(vehicle.requests)) == requests


@pytest.mark.parametrize("below_m", [5.0, 60.0])
def test_an_order_may_lead_below_home_on_a_hillside(below_m: float) -> None:
    place = at(20.0, 0.0)
    vehicle = airborne()
    params = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] - below_m)
    assert vehicle.send(Command.DO_REPOSITION, *params) is ACCEPTED


def test_a_landing_that_is_broken_off_climbs_to_its_abort_height() -> None:
    vehicle = airborne()
    assert vehicle.send(Command.NAV_LAND, 9.0) is ACCEPTED
    vehicle.run_until(lambda v: v.height < 3.0)
    assert vehicle.send(Command.DO_SET_MODE, 1.0, 4.0, 3.0) is ACCEPTED
    vehicle.run_until(lambda v: v.height > 8.5, 20.0)
    assert vehicle.send(Command.NAV_LAND, 9.0) is ACCEPTED
    vehicle.run_until(lambda v: v.height < 3.0)
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) is ACCEPTED
    vehicle.run(0.5)
    here = vehicle.height
    assert vehicle.send(Command.DO_SET_MODE, 1.0, 4.0, 3.0) is ACCEPTED
    vehicle.run(4.0)
    assert vehicle.height < here + 3.0


def test_a_return_may_carry_coordinates() -> None:
    vehicle = airborne()
    place = at(50.0, 0.0)
    params = (0.0, 0.0, 0.0, 0.0, place["x"], place["y"], 10.0)
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH, *params) is ACCEPTED
