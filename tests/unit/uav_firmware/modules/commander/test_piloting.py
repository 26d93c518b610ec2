"""Sticks and streams as the commander sees them: who leads, who takes over, who may arm."""

import math

import pytest

from tests.support.toy_vehicle import ToyVehicle
from uav_firmware.modules.commander.health_checks import unsafe_throttle
from uav_firmware.modules.commander.mode_changes import StickOverride
from uav_firmware.modules.commander.mode_requirements import REQUIREMENTS, control_of
from uav_firmware.msg.control_mode import (
    ControlLevel,
    ControlSource,
    ManualControlSetpoint,
    OffboardSetpoint,
)
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import Command, CommandResult, NavigationState

State = NavigationState
CENTRED = ManualControlSetpoint(0, 0.0, 0.0, 0.0, 0.0)
UNSET = (math.nan, math.nan, math.nan)
MOTION = TrajectorySetpoint(0, (0.0, 0.0, -2.0), UNSET, UNSET, math.nan, math.nan)
ATTITUDE = VehicleAttitudeSetpoint(0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.2)
RATES = VehicleRatesSetpoint(0, (0.0, 0.0, 0.0), 0.2)
MANUAL, OFFBOARD, NAVIGATOR = (
    ControlSource.MANUAL,
    ControlSource.OFFBOARD,
    ControlSource.NAVIGATOR,
)


@pytest.mark.parametrize(
    ("mode", "setpoint", "source", "level"),
    [
        (State.POSCTL, None, MANUAL, ControlLevel.POSITION),
        (State.ALTCTL, None, MANUAL, ControlLevel.POSITION),
        (State.STAB, None, MANUAL, ControlLevel.ATTITUDE),
        (State.ACRO, None, MANUAL, ControlLevel.RATES),
        (State.OFFBOARD, MOTION, OFFBOARD, ControlLevel.POSITION),
        (State.OFFBOARD, ATTITUDE, OFFBOARD, ControlLevel.ATTITUDE),
        (State.OFFBOARD, RATES, OFFBOARD, ControlLevel.RATES),
    ],
)
def test_each_mode_has_its_leader_and_its_outermost_loop(
    mode: NavigationState,
    setpoint: OffboardSetpoint | None,
    source: ControlSource,
    level: ControlLevel,
) -> None:
    assert control_of(mode, setpoint) == (source, level)


def test_every_other_mode_is_the_navigators() -> None:
    led = {mode for mode in REQUIREMENTS if control_of(mode, MOTION)[0] is NAVIGATOR}
    assert {mode for mode in led if mode.name.startswith("AUTO")} == {
        mode for mode in REQUIREMENTS if mode.name.startswith("AUTO")
    }


def test_a_stick_takes_over_when_it_leaves_the_centre_and_not_while_it_is_held() -> None:
    watch, held = StickOverride(), CENTRED._replace(right=0.5)
    # Held from the start, centred, moved, held on, lost, held again.
    seen = [
        watch.moved(sticks, 0.3, NavigationState.AUTO_LOITER)
        for sticks in (held, CENTRED, held, held, None, held)
    ]
    assert seen == [False, False, True, False, False, False]


def test_the_throttle_takes_nothing_over() -> None:
    watch = StickOverride()
    watch.moved(CENTRED, 0.3, NavigationState.AUTO_LOITER)
    assert not watch.moved(CENTRED._replace(up=-1.0), 0.3, NavigationState.AUTO_LOITER)


@pytest.mark.parametrize(
    ("mode", "up", "safe"),
    [
        (State.STAB, -1.0, True), (State.STAB, 0.0, False), (State.ACRO, 0.0, False),
        (State.POSCTL, 0.0, True), (State.POSCTL, 0.5, False), (State.ALTCTL, -1.0, True),
        (State.AUTO_LOITER, 1.0, True),
    ],
)  # fmt: skip
def test_a_throttle_that_would_jump_is_unsafe(
    mode: NavigationState, up: float, *, safe: bool
) -> None:
    assert (unsafe_throttle(mode, CENTRED._replace(up=up)) is None) is safe


def vehicle() -> ToyVehicle:
    made = ToyVehicle()
    made.run(0.5)
    return made


@pytest.mark.parametrize("main_mode", [1, 2, 3, 5, 7])
def test_a_piloted_mode_without_sticks_can_be_chosen_and_not_armed_in(main_mode: int) -> None:
    made = vehicle()
    assert made.send(Command.DO_SET_MODE, 1.0, float(main_mode), 0.0) is CommandResult.ACCEPTED
    assert made.arm() is CommandResult.TEMPORARILY_REJECTED
    assert any("manual control" in text for text in made.texts)


def test_offboard_without_a_stream_can_be_chosen_and_not_armed_in() -> None:
    made = vehicle()
    assert made.send(Command.DO_SET_MODE, 1.0, 6.0, 0.0) is CommandResult.ACCEPTED
    assert made.arm() is CommandResult.TEMPORARILY_REJECTED
    assert any("stream" in text for text in made.texts)


@pytest.mark.parametrize("main_mode", [1, 2, 3, 5, 7])
def test_with_sticks_every_piloted_mode_is_entered_and_kept_after_disarming(main_mode: int) -> None:
    made = vehicle()
    made.sticks.publish(CENTRED._replace(up=-1.0))
    assert made.send(Command.DO_SET_MODE, 1.0, float(main_mode), 0.0) == 0
    flown = made.mode
    made.sticks.publish(CENTRED._replace(up=-1.0))
    assert made.arm() == 0
    assert made.control.value is not None
    assert made.control.value.source is MANUAL
    assert made.send(Command.COMPONENT_ARM_DISARM, 0.0) == 0
    assert made.mode is flown
    assert made.control.value.source is NAVIGATOR


def test_a_pilot_needs_no_gps_to_fly_by_the_horizon() -> None:
    made = vehicle()
    made.silent.add("gps")
    made.position_valid = False
    made.run(3.0)
    made.sticks.publish(CENTRED._replace(up=-1.0))
    assert made.send(Command.DO_SET_MODE, 1.0, 7.0, 0.0) == 0
    made.sticks.publish(CENTRED._replace(up=-1.0))
    assert made.arm() == 0


def test_offboard_by_attitude_needs_no_position_and_by_motion_it_does() -> None:
    made = vehicle()
    made.position_valid = False
    assert made.send(Command.DO_SET_MODE, 1.0, 6.0, 0.0) == 0
    made.stream.publish(MOTION)
    assert made.arm() == 1
    made.stream.publish(ATTITUDE)
    assert made.arm() == 0


def test_parts_break_by_command_only_where_that_is_allowed() -> None:
    made = vehicle()
    assert made.send(Command.INJECT_FAILURE, 4.0, 1.0) is CommandResult.DENIED
    made.registry.set("SYS_FAILURE_EN", 1)
    assert made.send(Command.INJECT_FAILURE, 4.0, 0.5) is CommandResult.DENIED
    assert made.send(Command.INJECT_FAILURE, 4.0, 1.0) is CommandResult.UNSUPPORTED
