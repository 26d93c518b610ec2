"""A fault during a failsafe: the mode that is flown decides, whatever the operator had chosen."""

import itertools
from typing import Final, NamedTuple

import pytest

from tests.unit.uav_firmware.modules.commander.test_failsafe_pairs import WAIT_S, Flight
from uav_firmware.modules.commander.failsafe.causes import Cause
from uav_firmware.modules.commander.failsafe.machine import Failsafe
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe_actions import PILOTED
from uav_firmware.msg.control_mode import OffboardSetpoint
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import NavigationState

State = NavigationState
UNSET: Final = (float("nan"),) * 3
ATTITUDE: Final = VehicleAttitudeSetpoint(0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.5)
RATES: Final = VehicleRatesSetpoint(0, (0.0, 0.0, 0.0), 0.5)
VELOCITY: Final = TrajectorySetpoint(0, UNSET, (1.0, 0.0, 0.0), UNSET, UNSET[0], UNSET[0])


class Intended(NamedTuple):
    """What the operator had chosen."""

    mode: NavigationState
    setpoint: OffboardSetpoint | None = None


INTENDED: Final = {
    "mission": Intended(State.AUTO_MISSION),
    "position": Intended(State.POSCTL),
    "altitude": Intended(State.ALTCTL),
    "stabilized": Intended(State.STAB),
    "acro": Intended(State.ACRO),
    "attitudes": Intended(State.OFFBOARD, ATTITUDE),
    "rates": Intended(State.OFFBOARD, RATES),
    "velocities": Intended(State.OFFBOARD, VELOCITY),
}


class Acting(NamedTuple):
    """A failsafe, its mode, and the mode that follows once something else is lost as well."""

    cause: Cause
    params: FailsafeParams
    mode: NavigationState
    gps: NavigationState
    position: NavigationState
    altitude: NavigationState


ACTING: Final = {
    "hold": Acting(
        Cause.MOTOR_FAILED, FailsafeParams(motor_failure_action=1),
        State.AUTO_LOITER, State.AUTO_LAND, State.AUTO_LAND, State.AUTO_LAND,
    ),
    "return": Acting(
        Cause.MOTOR_FAILED, FailsafeParams(motor_failure_action=3),
        State.AUTO_RTL, State.AUTO_LAND, State.AUTO_LAND, State.AUTO_LAND,
    ),
    "land": Acting(
        Cause.MOTOR_FAILED, FailsafeParams(motor_failure_action=2),
        State.AUTO_LAND, State.AUTO_LAND, State.AUTO_LAND, State.AUTO_LAND,
    ),
    "wait": Acting(
        Cause.BATTERY_CRITICAL, FailsafeParams(action_delay_s=20.0),
        State.AUTO_LOITER, State.AUTO_LAND, State.AUTO_LAND, State.AUTO_LAND,
    ),
    "pilot's position": Acting(
        Cause.OFFBOARD_LOST, FailsafeParams(offboard_loss_action=0),
        State.POSCTL, State.POSCTL, State.ALTCTL, State.STAB,
    ),
    "pilot's altitude": Acting(
        Cause.OFFBOARD_LOST, FailsafeParams(offboard_loss_action=1),
        State.ALTCTL, State.ALTCTL, State.ALTCTL, State.STAB,
    ),
    "pilot's stabilized": Acting(
        Cause.OFFBOARD_LOST, FailsafeParams(offboard_loss_action=2),
        State.STAB, State.STAB, State.STAB, State.STAB,
    ),
}  # fmt: skip
LOST: Final = {
    "gps": Cause.GPS_LOST,
    "position": Cause.POSITION_LOST,
    "altitude": Cause.ALTITUDE_LOST,
}
PAIRS: Final = [
    (intended, acting)
    for intended, (mode, _) in INTENDED.items()
    for acting, failsafe in ACTING.items()
    if mode is State.OFFBOARD or failsafe.cause is not Cause.OFFBOARD_LOST
]


def in_failsafe(intended: str, acting: str) -> Flight:
    mode, setpoint = INTENDED[intended]
    failsafe = ACTING[acting]
    flight = Flight(mode, failsafe.params, setpoint)
    assert flight.pass_time(1.0, set()) is mode
    assert flight.pass_time(1.0, {failsafe.cause}) is failsafe.mode
    return flight


@pytest.mark.parametrize(("intended", "acting"), PAIRS)
@pytest.mark.parametrize("lost", list(LOST))
def test_the_mode_of_the_failsafe_decides_what_a_loss_demands(
    intended: str, acting: str, lost: str
) -> None:
    flight, failsafe, cause = in_failsafe(intended, acting), ACTING[acting], LOST[lost]
    modes = [flight.pass_time(0.1, {failsafe.cause, cause}) for _ in range(200)]
    wanted: NavigationState = getattr(failsafe, lost)
    assert modes[-1] is wanted
    # It does not go to and fro, and the cause does not clear by its own action
    assert sum(a is not b for a, b in itertools.pairwise(modes)) <= 1
    assert f"{cause.name}: over" not in flight.texts
    if lost == "gps" and wanted is State.AUTO_LAND:
        assert "GPS_LOST: LAND" in flight.texts


@pytest.mark.parametrize(("intended", "acting"), PAIRS)
def test_sticks_lost_in_a_failsafe_count_in_the_mode_flown_and_in_the_chosen_one(
    intended: str, acting: str
) -> None:
    flight, failsafe = in_failsafe(intended, acting), ACTING[acting]
    causes = {failsafe.cause, Cause.STICKS_LOST}
    flight.pass_time(30.0, causes)
    relied_on = INTENDED[intended].mode in PILOTED or failsafe.mode in PILOTED
    assert ("STICKS_LOST: RETURN" in flight.texts) is relied_on
    assert "STICKS_LOST: over" not in flight.texts
    held = failsafe.mode is State.AUTO_LOITER and failsafe.cause is Cause.MOTOR_FAILED
    if relied_on and (held or failsafe.mode in PILOTED):
        assert flight.mode is State.AUTO_RTL
    elif not relied_on and held:
        assert flight.mode is State.AUTO_LOITER


@pytest.mark.parametrize("intended", list(INTENDED))
def test_without_gps_a_hold_of_a_failsafe_waits_before_it_lands(intended: str) -> None:
    flight = in_failsafe(intended, "hold")
    causes = {Cause.MOTOR_FAILED, Cause.GPS_LOST}
    assert flight.pass_time(WAIT_S - 0.5, causes) is State.AUTO_LOITER
    assert flight.machine.state is Failsafe.WAITING
    assert flight.pass_time(1.0, causes) is State.AUTO_LAND


@pytest.mark.parametrize("setpoint", [ATTITUDE, RATES])
def test_a_fix_that_is_back_in_time_leaves_the_hold_of_the_failsafe_in_force(
    setpoint: OffboardSetpoint,
) -> None:
    """Not the stream that is back meanwhile: its loss has been acted upon."""
    flight = Flight(State.OFFBOARD, FailsafeParams(offboard_loss_action=5), setpoint)
    flight.pass_time(1.0, {Cause.OFFBOARD_LOST})
    flight.pass_time(3.0, {Cause.GPS_LOST})
    assert flight.pass_time(20.0, set()) is State.AUTO_LOITER
    assert flight.machine.state is Failsafe.ACTING


def test_sticks_that_are_back_in_time_give_the_pilot_the_mode_of_the_failsafe() -> None:
    flight = in_failsafe("attitudes", "pilot's altitude")
    lost = {Cause.OFFBOARD_LOST, Cause.STICKS_LOST}
    assert flight.pass_time(3.0, lost) is State.AUTO_LOITER
    assert flight.pass_time(1.0, {Cause.OFFBOARD_LOST}) is State.ALTCTL
    assert flight.machine.state is Failsafe.ACTING


@pytest.mark.parametrize("chosen", [State.STAB, State.ALTCTL, State.ACRO, State.POSCTL])
def test_gps_lost_before_the_sticks_neither_shortens_the_wait_nor_keeps_the_pilot_out(
    chosen: NavigationState,
) -> None:
    lost = {Cause.GPS_LOST, Cause.STICKS_LOST}
    flight = Flight(chosen, FailsafeParams())
    assert flight.pass_time(2.0, {Cause.GPS_LOST}) is chosen
    assert flight.pass_time(WAIT_S - 1.0, lost) is State.AUTO_LOITER
    assert flight.pass_time(1.0, {Cause.GPS_LOST}) is chosen
    assert flight.machine.state is Failsafe.CLEAR
    flight.pass_time(WAIT_S - 1.0, lost)
    assert flight.pass_time(2.0, lost) is State.AUTO_LAND
    assert "GPS_LOST: LAND" in flight.texts


def test_a_mode_chosen_in_which_a_loss_only_warns_does_not_override_the_landing() -> None:
    """The pilot changes to attitudes without GPS, and the stream breaks."""
    flight = Flight(State.STAB, FailsafeParams(), ATTITUDE)
    flight.pass_time(2.0, {Cause.GPS_LOST})
    flight.machine.override()
    flight.mode = State.OFFBOARD
    assert flight.pass_time(2.0, {Cause.GPS_LOST}) is State.OFFBOARD
    lost = {Cause.GPS_LOST, Cause.OFFBOARD_LOST, Cause.STICKS_LOST}
    assert flight.pass_time(1.0, lost) is State.AUTO_LOITER
    assert flight.pass_time(WAIT_S + 1.0, lost) is State.AUTO_LAND


def test_sticks_that_the_mission_does_without_do_not_end_it_after_a_wait() -> None:
    """COM_RCL_EXCEPT names the mission and not the hold."""
    params = FailsafeParams(sticks_excepted=1, link_loss_action=2)
    flight = Flight(State.AUTO_MISSION, params)
    assert flight.pass_time(2.0, {Cause.STICKS_LOST}) is State.AUTO_MISSION
    assert flight.pass_time(3.0, {Cause.STICKS_LOST, Cause.LINK_LOST}) is State.AUTO_LOITER
    assert flight.pass_time(3.0, {Cause.STICKS_LOST}) is State.AUTO_MISSION
