"""Any two causes, in any order of appearing and clearing: neither hides the other.

The machine is compared with a table of its own: which modes are enough for which action.
"""

import itertools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import pytest

from tests.support.estimates import local_position
from tests.support.messages import changed
from uav_firmware.modules.commander.arm_state_machine import ArmingEvent
from uav_firmware.modules.commander.failsafe.causes import ROWS, Cause, Conditions
from uav_firmware.modules.commander.failsafe.machine import Failsafe, FailsafeMachine
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe_actions import Action
from uav_firmware.modules.commander.vehicle_view import SensorAges, VehicleView
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.control_mode import ManualControlSetpoint, OffboardSetpoint
from uav_firmware.msg.estimate import AidSource, EstimatorStatus, WindEstimate
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import FenceAction, FenceBreach, GeofenceStatus
from uav_firmware.msg.mission import MissionProgress
from uav_firmware.msg.sensors import SensorGps, SensorsStatus
from uav_firmware.msg.status import (
    HomePosition,
    LandDetected,
    LandedState,
    NavigationState,
    StorageStatus,
)

State = NavigationState
PERIOD_US: Final = 100_000
WAIT_S: Final = 5.0
PARAMS: Final = FailsafeParams(
    link_loss_action=2,
    sticks_excepted=0,
    flight_time_max_s=1000,
    remaining_time_action=3,
    wind_action=2,
    action_delay_s=WAIT_S,
)
HEALTHY_AGES: Final = SensorAges(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FENCE: Final = GeofenceStatus(
    0, FenceBreach.BOUNDARY, FenceBreach.NONE, FenceAction.RETURN, -1.0, 1, 0
)
ENOUGH: Final[Mapping[Action, frozenset[State]]] = {
    Action.HOLD: frozenset({State.AUTO_LOITER, State.AUTO_RTL, State.AUTO_LAND}),
    Action.RETURN: frozenset({State.AUTO_RTL, State.AUTO_LAND}),
    Action.LAND: frozenset({State.AUTO_LAND}),
    Action.DESCEND: frozenset({State.AUTO_LAND}),
}


def healthy(now_us: int) -> VehicleView:
    """A vehicle in the air with everything that a mode may need."""
    gps = SensorGps(now_us, 0, 40.0, -3.0, 650.0, (0.0, 0.0, 0.0), 1.0, 1.0, 0.1, 3, 12, 0.8, 1.0)
    zero = (0.0, 0.0, 0.0)
    return VehicleView(
        now_us=now_us,
        attitude=None,
        position=local_position(time_us=now_us),
        estimator=EstimatorStatus(now_us, 0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.1, zero, True),
        gps=gps,
        battery=BatteryStatus(now_us, 15.0, 0.0, 0.0, 5.0, 1.0),
        land=LandDetected(now_us, False, False, LandedState.IN_AIR, False),
        home=HomePosition(0, 40.0, -3.0, 650.0, zero, 0.0),
        progress=MissionProgress(now_us, 1, 0, 3, 0, 0, 1, 0),
        navigator=None,
        fence=None,
        failure=None,
        storage=None,
        storage_check=1,
        wind=None,
        wind_limit_m_s=14.0,
        sticks=ManualControlSetpoint(now_us, 0.0, 0.0, 0.0, 0.0),
        sticks_fresh=True,
        offboard=None,
        offboard_fresh=True,
        ages=HEALTHY_AGES,
    )


def _aged(view: VehicleView, **ages: float) -> VehicleView:
    return view._replace(ages=view.ages._replace(**ages))


def _battery(remaining: float) -> Callable[[VehicleView], VehicleView]:
    def drain(view: VehicleView) -> VehicleView:
        assert view.battery is not None
        lowest = min(remaining, view.battery.remaining)
        return view._replace(battery=view.battery._replace(remaining=lowest))

    return drain


def _failure(view: VehicleView, **fields: Any) -> VehicleView:
    failure = view.failure or FailureDetectorStatus(view.now_us, False, False, 0)
    return view._replace(failure=failure._replace(**fields))


def _sensors(view: VehicleView, **fields: Any) -> VehicleView:
    sensors = view.sensors or SensorsStatus(view.now_us, 0, 0, 0, 0)
    return view._replace(sensors=sensors._replace(**fields))


def _unestimated(**fields: Any) -> Callable[[VehicleView], VehicleView]:
    def lose(view: VehicleView) -> VehicleView:
        assert view.position is not None
        return view._replace(position=changed(view.position, **fields))

    return lose


def _estimator(**fields: Any) -> Callable[[VehicleView], VehicleView]:
    def change(view: VehicleView) -> VehicleView:
        assert view.estimator is not None
        return view._replace(estimator=view.estimator._replace(**fields))

    return change


def _wind(speed: float) -> Callable[[VehicleView], VehicleView]:
    def blow(view: VehicleView) -> VehicleView:
        before = 0.0 if view.wind is None else view.wind.velocity_north_m_s
        return view._replace(wind=WindEstimate(view.now_us, max(before, speed), 0.0))

    return blow


def _short_of_time(view: VehicleView) -> VehicleView:
    assert view.battery is not None
    return view._replace(battery=view.battery._replace(current_a=500.0))


RAISE: Final[Mapping[Cause, Callable[[VehicleView], VehicleView]]] = {
    Cause.LINK_LOST: lambda view: _aged(view, link=100.0),
    Cause.STICKS_LOST: lambda view: _aged(view, sticks=100.0)._replace(sticks_fresh=False),
    Cause.BATTERY_LOW: _battery(0.14),
    Cause.BATTERY_CRITICAL: _battery(0.065),
    Cause.BATTERY_EMERGENCY: _battery(0.04),
    Cause.BATTERY_UNKNOWN: lambda view: _aged(view, battery=100.0),
    Cause.GPS_LOST: lambda view: _aged(view, gps=100.0),
    Cause.GPS_POSITION_STOPPED: _estimator(stopped=AidSource.GPS_POSITION),
    Cause.GPS_VELOCITY_STOPPED: _estimator(stopped=AidSource.GPS_VELOCITY),
    Cause.GPS_HEIGHT_STOPPED: _estimator(stopped=AidSource.GPS_HEIGHT),
    Cause.BAROMETER_STOPPED: _estimator(stopped=AidSource.BAROMETER),
    Cause.COMPASS_LOST: lambda view: _aged(view, mag=100.0),
    Cause.COMPASS_WRONG: lambda view: _estimator(heading_set_us=view.now_us)(view),
    Cause.BAROMETER_LOST: lambda view: _aged(view, baro=100.0),
    Cause.POSITION_LOST: _unestimated(position_valid=False),
    Cause.ALTITUDE_LOST: _unestimated(altitude_valid=False),
    Cause.ATTITUDE_LOST: _estimator(aligned=False),
    Cause.ATTITUDE_EXCEEDED: lambda view: _failure(view, roll_exceeded=True),
    Cause.GYRO_JUMPED: lambda view: _estimator(gyro_jump_us=view.now_us)(view),
    Cause.GYRO_BROKEN: _estimator(gyro_broken=True),
    Cause.ACCEL_BROKEN: _estimator(accel_broken=True),
    Cause.GYRO_LOST: lambda view: _sensors(view, gyro_lost=True),
    Cause.ACCEL_LOST: lambda view: _sensors(view, accel_lost=True),
    Cause.MOTOR_FAILED: lambda view: _failure(view, failed_motors=1),
    Cause.FENCE_BREACHED: lambda view: view._replace(fence=FENCE),
    Cause.WIND_STRONG: _wind(11.0),
    Cause.WIND_TOO_STRONG: _wind(20.0),
    Cause.BATTERY_TIME_SHORT: _short_of_time,
    Cause.STORAGE_FULL: lambda view: view._replace(storage=StorageStatus(0, 0, refused=True)),
}
NOT_RAISED: Final = {Cause.OFFBOARD_LOST, Cause.FLIGHT_TIME_OVER}
"""Of another mode, and of a time that does not go back."""


def _without_setpoints(view: VehicleView) -> VehicleView:
    return _aged(view, offboard=100.0)._replace(offboard_fresh=False)


class Flight:
    """A machine, the mode that it flies, and whether it has stopped the motors."""

    def __init__(
        self,
        mode: NavigationState = State.AUTO_MISSION,
        params: FailsafeParams = PARAMS,
        setpoint: OffboardSetpoint | None = None,
    ) -> None:
        self.machine = FailsafeMachine()
        self.mode = mode
        self.params = params
        self.setpoint = setpoint
        self.event: ArmingEvent | None = None
        self.now_us = 10_000_000
        self.said: set[Cause] = set()
        self.texts: list[str] = []  # "<cause>: <action>" and "<cause>: over", as the commander's

    def pass_time(self, seconds: float, causes: Iterable[Cause]) -> NavigationState:
        """Let the machine look at these causes; gives the mode that it flies then."""
        for _ in range(round(seconds * 1e6 / PERIOD_US)):
            self.now_us += PERIOD_US
            view = healthy(self.now_us)._replace(offboard=self.setpoint)
            for cause in causes:
                view = RAISE.get(cause, _without_setpoints)(view)
            reaction = self.machine.update(view, self.params, self.mode, 10.0)
            self.said |= {threat.cause for threat in reaction.threats}
            self.texts += [f"{cause.name}: {action.name}" for cause, action in reaction.threats]
            self.texts += [f"{cause.name}: over" for cause in reaction.cleared]
            self.event = self.event or reaction.event
            self.mode = reaction.mode or self.mode
        return self.mode


def action_of(cause: Cause) -> Action:
    """What a cause asks for on a mission."""
    view, mission = RAISE[cause](healthy(10_000_000)), State.AUTO_MISSION
    moment = Conditions(view, PARAMS, mission, mission, 10.0)
    return ROWS[cause].action(moment)


def test_every_cause_is_tried() -> None:
    assert set(RAISE) | NOT_RAISED == set(Cause)


@pytest.mark.first_case
@pytest.mark.parametrize("first", list(RAISE), ids=lambda cause: cause.name)
@pytest.mark.parametrize("gap_s", [0.5, 4.0, WAIT_S + 2.0])
def test_a_cause_that_stays_is_acted_upon_whatever_came_before_it_and_went(
    first: Cause, gap_s: float
) -> None:
    """The first appears, then the second; the first clears: the second one's action is flown."""
    for second in RAISE:
        flight = Flight()
        flight.pass_time(gap_s, {first})
        flight.pass_time(2.0, {first, second})
        flight.pass_time(2.0 * WAIT_S, {second})
        wanted = action_of(second)
        if wanted in ENOUGH and flight.event is None:
            assert flight.mode in ENOUGH[wanted], second
        assert second in flight.said


@pytest.mark.first_case
@pytest.mark.parametrize("first", list(RAISE), ids=lambda cause: cause.name)
def test_no_stronger_action_is_flown_than_the_demanded_one(first: Cause) -> None:
    for second in RAISE:
        flight = Flight()
        flight.pass_time(2.0 * WAIT_S, {first, second})
        worst = max(action_of(first), action_of(second))
        if worst <= Action.WARN:
            assert flight.mode is State.AUTO_MISSION
        elif worst is Action.HOLD:
            assert flight.mode is State.AUTO_LOITER
        elif worst is Action.RETURN:
            assert flight.mode is State.AUTO_RTL


@pytest.mark.first_case
@pytest.mark.parametrize("overridden", list(RAISE), ids=lambda cause: cause.name)
def test_an_override_of_one_cause_is_none_of_the_next(overridden: Cause) -> None:
    for later in RAISE:
        flight = Flight()
        flight.pass_time(2.0 * WAIT_S, {overridden})
        flight.machine.override()
        flight.mode, flight.event = State.AUTO_MISSION, None
        flight.pass_time(2.0, {overridden})
        assert flight.machine.state is Failsafe.CLEAR
        assert flight.mode is State.AUTO_MISSION
        flight.pass_time(2.0 * WAIT_S, {overridden, later})
        wanted = action_of(later)
        implied = later is Cause.BATTERY_LOW or overridden is Cause.BATTERY_EMERGENCY
        if wanted in ENOUGH and later is not overridden and not implied and flight.event is None:
            assert flight.mode in ENOUGH[wanted], later


@pytest.mark.parametrize(
    "order", list(itertools.permutations([Cause.LINK_LOST, Cause.BATTERY_CRITICAL]))
)
def test_a_critical_battery_is_not_forgotten_when_the_link_returns(
    order: tuple[Cause, ...],
) -> None:
    """Both ask for a return; whichever waited first and clears, the other one returns."""
    flight = Flight()
    flight.pass_time(2.0, {order[0]})
    assert flight.pass_time(1.0, set(order)) is State.AUTO_LOITER
    assert flight.pass_time(WAIT_S, {order[1]}) is State.AUTO_RTL


def test_the_mission_goes_on_when_all_causes_clear_in_time() -> None:
    flight = Flight()
    causes = {Cause.LINK_LOST, Cause.BATTERY_CRITICAL}
    assert flight.pass_time(2.0, causes) is State.AUTO_LOITER
    assert flight.pass_time(1.0, {Cause.BATTERY_LOW}) is State.AUTO_MISSION
