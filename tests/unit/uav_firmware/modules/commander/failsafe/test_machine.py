"""Failsafes: what each cause does, that the worst wins, how a cause clears, who may overrule."""

from itertools import product

import pytest

from tests.support.toy_vehicle import ToyVehicle, takeoff, waypoint
from uav_firmware.modules.commander.failsafe.causes import ROWS, Cause
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe_actions import (
    FENCE_ACTIONS,
    LINK_ACTIONS,
    MODE_OF,
    MOTOR_ACTIONS,
    OFFBOARD_ACTIONS,
    Action,
)
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.estimate import WindEstimate
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import FenceAction, FenceBreach, GeofenceStatus
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import Command, NavigationState, StorageStatus
from uav_firmware.parameters import Registry

State = NavigationState
NAN = float("nan")
MISSION, HOLD, RETURN, LAND = (
    State.AUTO_MISSION,
    State.AUTO_LOITER,
    State.AUTO_RTL,
    State.AUTO_LAND,
)


def on_mission(**settings: float) -> ToyVehicle:
    """A vehicle 8 m out on a long leg; failsafes act at once unless a test delays them."""
    vehicle = ToyVehicle()
    for name, value in {"COM_FAIL_ACT_T": 0.0, **settings}.items():
        vehicle.registry.set(name, value)
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 200, 0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 8.0)
    return vehicle


def blow(vehicle: ToyVehicle, speed: float) -> None:
    """Give the commander a wind estimate; the toy vehicle has no wind."""
    vehicle.wind_estimate.publish(WindEstimate(vehicle.now_us, speed, 0.0))


def breach(vehicle: ToyVehicle, action: FenceAction, kind: FenceBreach) -> None:
    vehicle.geofence_status.publish(
        GeofenceStatus(vehicle.now_us, kind, kind, action, -1.0, 1, vehicle.now_us)
    )


def break_motor(vehicle: ToyVehicle, bits: int) -> None:
    vehicle.failure.publish(
        FailureDetectorStatus(
            vehicle.now_us, roll_exceeded=False, pitch_exceeded=False, failed_motors=bits
        )
    )


def fly_by_sticks(vehicle: ToyVehicle, main_mode: int, seconds: float = 1.0) -> None:
    """Centred sticks at 50 Hz, the mode entered on the way."""
    centre(vehicle, 0.1)
    assert vehicle.send(Command.DO_SET_MODE, 1.0, float(main_mode), 0.0) == 0
    centre(vehicle, seconds)


def centre(vehicle: ToyVehicle, seconds: float) -> None:
    for _ in range(round(seconds * 50)):
        vehicle.sticks.publish(ManualControlSetpoint(vehicle.now_us, 0.0, 0.0, 0.0, 0.0))
        vehicle.run(0.02)


def stream(vehicle: ToyVehicle, seconds: float) -> None:
    for _ in range(round(seconds * 20)):
        unset = (NAN, NAN, NAN)
        vehicle.stream.publish(
            TrajectorySetpoint(vehicle.now_us, (20.0, 0.0, -5.0), unset, unset, NAN, NAN)
        )
        vehicle.run(0.05)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("remaining", "mode"), [(0.20, MISSION), (0.12, MISSION), (0.06, RETURN), (0.04, LAND)]
)
def test_the_emptier_the_battery_the_stronger_the_action(
    remaining: float, mode: NavigationState
) -> None:
    vehicle = on_mission()
    vehicle.battery = remaining
    vehicle.run(0.5)
    assert vehicle.mode is mode
    warned = any("Battery low" in text for text in vehicle.texts)
    assert warned == (remaining < 0.15)
    assert vehicle.status.value is not None
    assert vehicle.status.value.failsafe == (mode is not MISSION)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("setting", "remaining", "mode"),
    [
        (0, 0.06, MISSION), (0, 0.04, MISSION), (2, 0.06, LAND), (2, 0.04, LAND),
        (3, 0.06, RETURN), (3, 0.04, LAND),
    ],
)  # fmt: skip
def test_the_battery_action_can_be_chosen(
    setting: int, remaining: float, mode: NavigationState
) -> None:
    vehicle = on_mission(COM_LOW_BAT_ACT=setting)
    vehicle.battery = remaining
    vehicle.run(0.5)
    assert vehicle.mode is mode


def test_a_critical_battery_brings_the_vehicle_home() -> None:
    vehicle = on_mission()
    vehicle.battery = 0.06
    vehicle.run_until(lambda v: not v.armed, 200.0)
    assert abs(vehicle.position[0]) < 0.3


def test_a_battery_found_critical_on_the_ground_acts_after_the_take_off() -> None:
    vehicle = ToyVehicle(battery=0.06)
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 200, 0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 1.0, 21196.0) == 0
    vehicle.run_until(lambda v: v.mode is RETURN, 10.0)


def test_an_emergency_lands_even_during_a_return() -> None:
    vehicle = on_mission()
    vehicle.battery = 0.06
    vehicle.run(2.0)
    vehicle.battery = 0.04
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert vehicle.position[0] > 5.0


def test_a_weaker_cause_does_not_undo_a_stronger_action() -> None:
    vehicle = on_mission()
    vehicle.set_mode(6)
    vehicle.battery = 0.06
    vehicle.run(1.0)
    assert vehicle.mode is LAND
    assert vehicle.status.value is not None
    assert not vehicle.status.value.failsafe


def test_the_operator_may_override_and_a_cause_does_not_act_twice() -> None:
    vehicle = on_mission()
    vehicle.battery = 0.06
    vehicle.run(1.0)
    assert vehicle.set_mode(3) == 0
    modes = []
    # Within the hysteresis, below again, cleared, below once more.
    for remaining in (0.075, 0.06, 0.5, 0.06):
        vehicle.battery = remaining
        vehicle.run(0.5)
        modes.append(vehicle.mode)
    assert modes == [HOLD] * 3 + [RETURN]


def test_a_gyroscope_that_jumps_warns_and_one_beyond_its_limit_lands() -> None:
    vehicle = on_mission()
    vehicle.gyro_jump_us = vehicle.now_us
    vehicle.run(0.5)
    assert any("Gyroscope bias has jumped" in text for text in vehicle.texts)
    assert vehicle.mode is MISSION
    vehicle.run(10.0)
    assert any("following it: over" in text for text in vehicle.texts)
    vehicle.gyro_broken = True
    vehicle.run(0.5)
    assert vehicle.mode is LAND


def test_a_heading_that_was_set_against_the_compass_warns() -> None:
    vehicle = on_mission()
    vehicle.heading_set_us = vehicle.now_us
    vehicle.run(0.5)
    assert "Compass wrong, heading set by the GPS course: WARN" in vehicle.texts
    assert vehicle.mode is MISSION
    vehicle.run(10.0)
    assert "Compass wrong, heading set by the GPS course: over" in vehicle.texts


def test_a_return_waits_in_hold_for_the_operator() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0)
    vehicle.battery = 0.06
    vehicle.run(4.5)
    assert vehicle.mode is HOLD
    assert vehicle.status.value is not None
    assert vehicle.status.value.failsafe
    vehicle.run(1.0)
    assert vehicle.mode is RETURN


def test_an_operator_who_steps_in_while_it_waits_is_obeyed() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0)
    vehicle.battery = 0.06
    vehicle.run(1.0)
    assert vehicle.set_mode(4) == 0
    vehicle.run(10.0)
    assert vehicle.mode is MISSION


def test_a_cause_that_clears_while_it_waits_lets_the_mission_go_on() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0, NAV_DLL_ACT=2, COM_DL_LOSS_T=2.0)
    vehicle.heartbeat.publish(vehicle.now_us)
    vehicle.run(4.0)
    modes = [vehicle.mode]
    vehicle.heartbeat.publish(vehicle.now_us)
    vehicle.run(0.1)
    modes.append(vehicle.mode)
    assert modes == [HOLD, MISSION]
    assert any("link lost: over" in text for text in vehicle.texts)


def test_a_worse_cause_does_not_wait_behind_a_milder_one() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=20.0)
    vehicle.battery = 0.06
    vehicle.run(1.0)
    vehicle.battery = 0.04
    vehicle.run(0.1)
    assert vehicle.mode is LAND


def test_a_short_loss_of_position_changes_nothing() -> None:
    vehicle = on_mission()
    vehicle.position_valid = False
    vehicle.run(0.6)
    vehicle.position_valid = True
    vehicle.run(2.0)
    assert vehicle.mode is MISSION


def test_return_without_a_position_becomes_a_landing() -> None:
    vehicle = on_mission()
    vehicle.position_valid = False
    vehicle.battery = 0.06
    vehicle.run(0.2)
    assert vehicle.mode is LAND


LINK = [(0, MISSION), (1, HOLD), (2, RETURN), (3, LAND)]


@pytest.mark.first_case
@pytest.mark.parametrize(("setting", "mode"), LINK)
def test_a_lost_link_takes_the_action_of_the_parameter(setting: int, mode: NavigationState) -> None:
    vehicle = on_mission(NAV_DLL_ACT=setting)
    for _ in range(5):
        vehicle.heartbeat.publish(vehicle.now_us)
        vehicle.run(1.0)
    assert vehicle.mode is MISSION
    vehicle.run(11.0)
    assert vehicle.mode is mode


@pytest.mark.first_case
@pytest.mark.parametrize(("setting", "sentence"), [(5, "terminated"), (6, "Disarmed by failsafe")])
def test_a_lost_link_may_stop_the_motors(setting: int, sentence: str) -> None:
    vehicle = on_mission(NAV_DLL_ACT=setting)
    vehicle.heartbeat.publish(vehicle.now_us)
    vehicle.run(11.0)
    assert not vehicle.armed
    assert any(sentence in text for text in vehicle.texts)


def test_a_link_that_was_never_there_cannot_be_lost() -> None:
    vehicle = on_mission(NAV_DLL_ACT=3)
    vehicle.run(11.0)
    assert vehicle.mode is MISSION


@pytest.mark.first_case
@pytest.mark.parametrize(("setting", "mode"), [(1, HOLD), (2, RETURN), (3, LAND)])
def test_lost_sticks_take_the_action_of_the_parameter(setting: int, mode: NavigationState) -> None:
    vehicle = on_mission(NAV_RCL_ACT=setting)
    fly_by_sticks(vehicle, 3)
    assert vehicle.mode is State.POSCTL
    vehicle.run(0.7)
    assert vehicle.mode is mode


@pytest.mark.first_case
@pytest.mark.parametrize(("excepted", "mode"), [(7, MISSION), (1, MISSION), (6, RETURN)])
def test_a_mission_goes_on_without_sticks_if_it_may(excepted: int, mode: NavigationState) -> None:
    vehicle = on_mission(COM_RCL_EXCEPT=excepted)
    centre(vehicle, 0.2)
    vehicle.run(1.0)
    assert vehicle.mode is mode


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("setting", "with_sticks", "mode"),
    [
        (0, True, State.POSCTL), (1, True, State.ALTCTL), (2, True, State.STAB),
        (0, False, HOLD), (2, False, HOLD), (3, False, RETURN), (4, False, LAND), (5, True, HOLD),
    ],
)  # fmt: skip
def test_lost_setpoints_take_the_action_of_the_parameter(
    setting: int, *, with_sticks: bool, mode: NavigationState
) -> None:
    vehicle = on_mission(COM_OBL_RC_ACT=setting)
    stream(vehicle, 0.2)
    assert vehicle.send(Command.DO_SET_MODE, 1.0, 6.0, 0.0) == 0
    stream(vehicle, 1.0)
    assert vehicle.mode is State.OFFBOARD
    if with_sticks:
        centre(vehicle, 1.3)
    else:
        vehicle.run(1.3)
    assert vehicle.mode is mode


def test_a_pause_of_the_stream_shorter_than_the_limit_changes_nothing() -> None:
    vehicle = on_mission()
    stream(vehicle, 0.2)
    vehicle.send(Command.DO_SET_MODE, 1.0, 6.0, 0.0)
    vehicle.run(0.7)
    stream(vehicle, 0.2)
    vehicle.run(0.7)
    assert vehicle.mode is State.OFFBOARD


def test_a_pilot_without_position_flies_on_by_the_height() -> None:
    vehicle = on_mission()
    fly_by_sticks(vehicle, 3)
    vehicle.position_valid = False
    centre(vehicle, 1.5)
    assert vehicle.mode is State.ALTCTL


def test_a_pilot_without_height_flies_on_by_the_horizon() -> None:
    vehicle = on_mission()
    fly_by_sticks(vehicle, 2)
    vehicle.altitude_valid = False
    centre(vehicle, 1.5)
    assert vehicle.mode is State.STAB


@pytest.mark.first_case
@pytest.mark.parametrize(("setting", "mode"), [(0, MISSION), (1, HOLD), (2, LAND), (3, RETURN)])
def test_a_failed_motor_takes_the_action_of_the_parameter(
    setting: int, mode: NavigationState
) -> None:
    vehicle = on_mission(COM_ACT_FAIL_ACT=setting, COM_FAIL_ACT_T=5.0)
    break_motor(vehicle, 0)
    vehicle.run(0.1)
    assert vehicle.mode is MISSION
    break_motor(vehicle, 0b0100)
    vehicle.run(0.1)
    assert vehicle.mode is mode
    assert any("Motor failed" in text for text in vehicle.texts)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("action", "mode"),
    [
        (FenceAction.NONE, MISSION), (FenceAction.WARN, MISSION), (FenceAction.HOLD, HOLD),
        (FenceAction.RETURN, RETURN), (FenceAction.LAND, LAND),
    ],
)  # fmt: skip
def test_a_breach_takes_the_action_of_the_geofence(
    action: FenceAction, mode: NavigationState
) -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0)
    breach(vehicle, action, FenceBreach.NONE)
    vehicle.run_commander(vehicle.now_us + 200_000)
    breach(vehicle, action, FenceBreach.BOUNDARY)
    vehicle.run_commander(vehicle.now_us + 400_000)
    assert vehicle.mode is mode


@pytest.mark.parametrize(
    ("action", "mode", "times"), [(FenceAction.HOLD, HOLD, 1), (FenceAction.LAND, LAND, 0)]
)
def test_a_hold_at_the_fence_says_once_what_the_operator_can_do(
    action: FenceAction, mode: NavigationState, times: int
) -> None:
    vehicle = on_mission(GF_ACTION=action)
    vehicle.registry.set("GF_MAX_HOR_DIST", 20.0)
    vehicle.run(10.0)
    assert vehicle.mode is mode
    assert f"Geofence breached: {action.name}" in vehicle.texts
    advice = [text for text in vehicle.texts if text.startswith("Held at the geofence:")]
    assert len(advice) == times


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("speed", "setting", "mode"),
    [
        (8.0, 3, MISSION), (12.0, 3, MISSION), (15.0, 3, RETURN), (15.0, 0, MISSION),
        (15.0, 2, HOLD), (15.0, 5, LAND),
    ],
)  # fmt: skip
def test_the_stronger_the_wind_the_stronger_the_action(
    speed: float, setting: int, mode: NavigationState
) -> None:
    vehicle = on_mission(COM_WIND_MAX_ACT=setting)
    blow(vehicle, speed)
    vehicle.run_commander(vehicle.now_us + 200_000)
    vehicle.run(0.0)
    assert vehicle.mode is mode


@pytest.mark.first_case
@pytest.mark.parametrize(("limit", "mode"), [(-1, MISSION), (12, RETURN)])
def test_a_flight_ends_when_its_time_is_over(limit: int, mode: NavigationState) -> None:
    vehicle = on_mission(COM_FLT_TIME_MAX=limit)
    vehicle.run(9.0)
    assert vehicle.mode is mode


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("setting", "charge", "mode"),
    [
        (3, 0.16, MISSION),  # Lasts 576 s; 490 s and the return are needed
        (3, 0.14, RETURN),
        (1, 0.14, MISSION),
        (0, 0.14, MISSION),
    ],
)
def test_a_battery_that_lasts_no_longer_than_the_return_makes_the_vehicle_return(
    setting: int, charge: float, mode: NavigationState
) -> None:
    vehicle = on_mission(COM_FLTT_LOW_ACT=setting, RTL_TIME_MARGIN=490.0)
    vehicle.battery = charge
    vehicle.run(5.0)
    assert vehicle.mode is mode
    reported = any("no longer than the return" in line for line in vehicle.texts)
    assert reported is (setting > 0 and charge < 0.15)


@pytest.mark.parametrize(("setting", "warns"), [(0, False), (1, True), (2, True)])
def test_a_full_storage_is_reported_and_the_mission_continues(setting: int, *, warns: bool) -> None:
    vehicle = on_mission(COM_ARM_SDCARD=setting)
    vehicle.storage.publish(StorageStatus(vehicle.now_us, 0, refused=True))
    vehicle.run(3.0)
    assert any("Storage full" in text for text in vehicle.texts) is warns
    assert vehicle.mode is MISSION
    assert vehicle.armed


@pytest.mark.parametrize(("sensor", "sentence"), [("mag", "Compass"), ("baro", "Barometer")])
def test_a_lost_sensor_is_reported_and_the_mission_continues(sensor: str, sentence: str) -> None:
    vehicle = on_mission()
    vehicle.silent.add(sensor)
    vehicle.run(3.0)
    assert any(sentence in text for text in vehicle.texts)
    assert vehicle.mode is MISSION


def test_every_setting_of_every_parameter_has_an_action() -> None:
    registry = Registry()
    registry.add(FailsafeParams)
    tables = {
        "NAV_DLL_ACT": LINK_ACTIONS,
        "NAV_RCL_ACT": LINK_ACTIONS,
        "COM_OBL_RC_ACT": OFFBOARD_ACTIONS,
        "COM_ACT_FAIL_ACT": MOTOR_ACTIONS,
        "COM_WIND_MAX_ACT": FENCE_ACTIONS,
    }
    for name, table in tables.items():
        declared = registry.declaration(name)
        for setting in range(int(declared.minimum), int(declared.maximum) + 1):
            assert table[setting] in Action


def test_every_cause_is_in_the_table_and_every_mode_is_an_action() -> None:
    assert set(ROWS) == set(Cause)
    for action, other in product(MODE_OF, MODE_OF):
        if MODE_OF[action] is MODE_OF[other] and action is not other:
            assert {action, other} == {Action.LAND, Action.DESCEND}
