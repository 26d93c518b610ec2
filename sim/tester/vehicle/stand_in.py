"""State of the vehicle that a person plays: events and actions in, orders to the link out.

Independent of MAVLink's encoding and of the terminal.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Any, Final

from sim.tester.vehicle.actions import (
    Action,
    FinishCommand,
    Land,
    Pose,
    SetAlarm,
    SetBatteryCapacity,
    SetBatteryPercentage,
    SetObservation,
    SetPose,
)
from sim.tester.vehicle.alarms import Alarm
from sim.tester.vehicle.command_results import ANSWERS, CAMERA, Answer
from sim.tester.vehicle.events import (
    Acknowledge,
    AreaReceived,
    Armed,
    Command,
    CompleteItems,
    ItemMadeCurrent,
    LinkEvent,
    MeasureHumidity,
    MissionChange,
    MissionCleared,
    MissionReceived,
    Observe,
    Order,
    Publish,
    Result,
    ShowArming,
    ShowText,
    Warn,
)
from sim.tester.vehicle.live_commands import ORBIT, Live, circle, lasting_s, live, target
from sim.tester.vehicle.mission import Mission, MissionState
from sim.tester.vehicle.mission_steps import Step
from sim.tester.vehicle.telemetry import Home

HUMIDITY_PERCENT: Final = 55.0
NO_HUMIDITY: Final = -1.0
MEASUREMENT_INTERVAL_S: Final = 0.5
VALID_MEASUREMENTS: Final = 4


class Hygrometer:
    """Sends measurements while one of its alarms is set."""

    def __init__(self) -> None:
        self._measurements = 0
        self._measure_at = -math.inf

    def begin(self, now: float) -> None:
        """Start over with valid measurements."""
        self._measurements, self._measure_at = 0, now

    def measure(self, alarms: AbstractSet[Alarm], now: float) -> float | None:
        """Return a humidity [%] to report now, or None."""
        fails = alarms & {Alarm.HUMIDITY_SENSOR, Alarm.HUMIDITY_SENSING}
        if not fails or now < self._measure_at:
            return None
        self._measure_at = now + MEASUREMENT_INTERVAL_S
        self._measurements += 1
        if self._measurements <= VALID_MEASUREMENTS:
            return HUMIDITY_PERCENT
        return None if Alarm.HUMIDITY_SENSOR in fails else NO_HUMIDITY


_STATUSTEXT: int = 50


def mission_text(steps: Sequence[Step]) -> str:
    """Show a mission that was received."""
    titles = (f"  {n}. {step.title}" for n, step in enumerate(steps, start=1))
    return "\n".join(("Mission received:", *titles))


def pose_text(pose: Pose) -> str:
    """Describe the place and attitude of the vehicle."""
    return (
        f"latitude {pose.latitude_deg:.7f}, longitude {pose.longitude_deg:.7f}, "
        f"altitude {pose.relative_altitude_m:g} m, yaw {pose.yaw_deg:g}, "
        f"pitch {pose.pitch_deg:g}, roll {pose.roll_deg:g}"
    )


def alarm_text(alarm: Alarm, parameters: tuple[float, float]) -> str:
    """Describe a failure, in the length of a STATUSTEXT."""
    return f"{alarm.label}: {parameters[0]:g}, {parameters[1]:g}"[:_STATUSTEXT]


ORDER_WITHIN_S: Final = 12.0
"""How long '0' waits for the broker's order to come down: longer than an alarm takes there."""


@dataclass(frozen=True, slots=True)
class Observation:
    """What is observed wherever a command is finished; the seed's example."""

    resource_id: str = "temp"
    observed_property: str = "temperature"
    result_value: float = 20.0
    result_uom: str = "C"


class StandIn:
    """One vehicle."""

    def __init__(self, home: Home, booted_at: float) -> None:
        self.home = home
        self.pose = Pose(home.latitude_deg, home.longitude_deg, 0.0)
        self.capacity_mah = 3000.0
        self.percentage = 80
        self.observation = Observation()
        self.armed = False
        self.is_down = True
        self.mission = Mission()
        self.live: Live | None = None
        self.alarms: set[Alarm] = set()
        self._booted_at = booted_at
        self._skipped_s = 0.0  # Of the vehicle's time, which a person may let pass
        self._live_since = booted_at
        self._is_called_down = False
        self._lands_at: float | None = None
        self._hygrometer = Hygrometer()

    # What it says of itself.

    def time_ms(self, now: float) -> int:
        """Its own time, since it was switched on."""
        return round((now - self._booted_at + self._skipped_s) * 1e3)

    @property
    def ill(self) -> int:
        """Bits of SYS_STATUS that are not healthy."""
        bits = 0
        for alarm in self.alarms:
            bits |= alarm.ill
        return bits

    @property
    def is_landing(self) -> bool:
        """Whether it has been set as landed, and the broker's command is awaited."""
        return self._lands_at is not None

    # Events of the link.

    def receive(self, event: LinkEvent, now: float) -> list[Order]:
        """Handle an event of the link."""
        match event:
            case Command():
                return self._obey(event, now)
            case MissionReceived(items):
                self.live = None
                self.mission = Mission(items)
                return [ShowText(mission_text(self.mission.steps))]
            case AreaReceived(what, count):
                return [ShowText(f"Received: {what}, {count} items")]
            case MissionCleared():
                self.mission = Mission()
            case ItemMadeCurrent(seq):
                if self.mission.state is MissionState.NOT_STARTED:
                    self.mission.current = seq
            case Armed(armed) if armed != self.armed:
                self.armed = armed
                self.is_down |= not armed
                return [ShowArming(armed)]
        return []

    def _obey(self, command: Command, now: float) -> list[Order]:
        if command.component == CAMERA and Alarm.CAMERA in self.alarms:
            return []
        answer = ANSWERS.get(command.number, Answer.UNSUPPORTED)
        return self._manners[answer](self, command, now)

    def _refuse(self, command: Command, _now: float) -> list[Order]:
        return [Acknowledge(command, Result.UNSUPPORTED)]

    def _set_out(self, command: Command, _now: float) -> list[Order]:
        """MISSION_START."""
        if not self.armed or not self.mission.items:
            return [Acknowledge(command, Result.DENIED)]
        if self.mission.is_running:
            return [Acknowledge(command, Result.ACCEPTED)]
        self.mission.state = MissionState.ACTIVE
        self.is_down = self._is_called_down = False
        self._lands_at = None
        return [Acknowledge(command, Result.ACCEPTED), *self._next_step(), MissionChange.RUNS]

    def _next_step(self) -> list[Order]:
        step = self.mission.step
        return [] if step is None else [ShowText(f"Running: {step.title}")]

    def _pause(self, command: Command, _now: float) -> list[Order]:
        """DO_PAUSE_CONTINUE: 0 holds, 1 continues; it ends a live command."""
        orders: list[Order] = [Acknowledge(command, Result.ACCEPTED)]
        if self.live is not None:
            return [*orders, *self._end_live()]
        if self.mission.is_running:
            goes_on = command.parameters[0] == 1.0
            self.mission.state = MissionState.ACTIVE if goes_on else MissionState.PAUSED
            orders.append(ShowText("The mission goes on." if goes_on else "The mission is paused."))
        return orders

    def _go(self, command: Command, _now: float) -> list[Order]:
        """DO_REPOSITION: obeyed at once. In the middle of a mission it is an abort's."""
        self.pose = target(command, self.home.altitude_amsl_m, self.pose)
        orders: list[Order] = [Acknowledge(command, Result.ACCEPTED), Publish(self.pose)]
        orders.append(ShowText(f"The vehicle has gone to {pose_text(self.pose)}"))
        interrupted = self.mission.is_running or self.live is not None
        return [*orders, *(self._interrupt() if interrupted else ())]

    def _come_down(self, command: Command, _now: float) -> list[Order]:
        """NAV_LAND or RETURN_TO_LAUNCH in flight: the mission has been aborted or has failed."""
        orders: list[Order] = [Acknowledge(command, Result.ACCEPTED)]
        if self.is_down or self._is_called_down:
            return orders
        self._is_called_down = True
        return orders if self._lands_at is not None else [*orders, *self._interrupt()]

    def _interrupt(self) -> list[Order]:
        self.live = None
        if self.mission.is_running:
            self.mission.state = MissionState.NOT_STARTED
        return [ShowText("The mission has been aborted."), MissionChange.INTERRUPTED]

    def _change_speed(self, command: Command, _now: float) -> list[Order]:
        speed_m_s = command.parameters[1]
        return [
            Acknowledge(command, Result.ACCEPTED),
            ShowText(f"The speed is to be {speed_m_s:g} m/s."),
        ]

    def _begin_live(self, command: Command, now: float) -> list[Order]:
        orders: list[Order] = [Acknowledge(command, Result.ACCEPTED)]
        begun = live(command)
        if begun is None or (self.live and self.live.command.number == command.number):
            return orders
        self.live, self._live_since = begun, now
        return [*orders, ShowText(f"Running: {begun.title}"), MissionChange.RUNS]

    def _stop_live(self, command: Command, _now: float) -> list[Order]:
        return [Acknowledge(command, Result.ACCEPTED), *self._end_live()]

    def _end_live(self) -> list[Order]:
        if self.live is None:
            return []
        self.live = None
        return [] if self.mission.is_running else [MissionChange.ENDED]

    def _use_payload(self, command: Command, _now: float) -> list[Order]:
        return [
            Acknowledge(command, Result.ACCEPTED),
            ShowText(f"The payload has been given command {command.number}."),
        ]

    _manners: Mapping[Answer, Callable[["StandIn", Command, float], list[Order]]] = {
        Answer.UNSUPPORTED: _refuse,
        Answer.SET_OUT: _set_out,
        Answer.PAUSE: _pause,
        Answer.GO: _go,
        Answer.COME_DOWN: _come_down,
        Answer.SPEED: _change_speed,
        Answer.LIVE: _begin_live,
        Answer.STOP_LIVE: _stop_live,
        Answer.PAYLOAD: _use_payload,
    }

    # What the person does.

    def act(self, action: Action, now: float) -> list[Order]:
        """Do what the person wants."""
        match action:
            case FinishCommand():
                return self._finish(now)
            case SetPose(pose):
                self.pose = pose
                return [Publish(pose), ShowText(f"The vehicle is at {pose_text(pose)}")]
            case SetAlarm(alarm, parameters):
                self.alarms.add(alarm)
                self._hygrometer.begin(now)
                return [Warn(alarm_text(alarm, parameters), parameters)]
            case SetBatteryCapacity(capacity_mah):
                self.capacity_mah = capacity_mah
            case SetBatteryPercentage(percentage):
                self.percentage = percentage
            case SetObservation(part, value):
                changed: dict[str, Any] = {part.name.lower(): value}
                self.observation = replace(self.observation, **changed)
            case Land():
                self._lands_at = now + ORDER_WITHIN_S
        return []

    def tick(self, now: float) -> list[Order]:
        """Advance time: land once it is due; a failed humidity sensor sends measurements."""
        percent = self._hygrometer.measure(self.alarms, now)
        orders: list[Order] = [] if percent is None else [MeasureHumidity(percent)]
        if self._lands_at is not None and (self._is_called_down or now >= self._lands_at):
            orders += self._land()
        return orders

    def _finish(self, now: float) -> list[Order]:
        if self.live is not None:
            return self._finish_live(self.live, now)
        step = self.mission.step
        if step is None:
            return []
        count = self.mission.finish_step()
        orders: list[Order] = [Publish(self.pose), Observe(), CompleteItems(count)]
        orders.append(ShowText(f"Finished: {step.title}"))
        if step.lands:
            return [*orders, *self._land(), MissionChange.ENDED]
        if self.mission.step is None:
            return [*orders, ShowText("Mission finished: the vehicle holds."), MissionChange.ENDED]
        return [*orders, *self._next_step()]

    def _finish_live(self, running: Live, now: float) -> list[Order]:
        orders: list[Order] = [Observe()]
        if running.command.number == ORBIT:
            places = circle(running.command, self.home.altitude_amsl_m, self.pose)
            orders += map(Publish, places)
            self.pose = places[-1]
        else:
            left_s = lasting_s(running.command) - (now - self._live_since)
            self._skipped_s += max(0.0, left_s)
            orders.append(Publish(self.pose))
        return [*orders, ShowText(f"Finished: {running.title}"), *self._end_live()]

    def _land(self) -> list[Order]:
        self.armed, self.is_down = False, True
        self._lands_at, self._is_called_down = None, False
        self.live = None
        self.alarms.clear()
        self.pose = self.pose._replace(relative_altitude_m=0.0)
        return [ShowArming(armed=False), ShowText("The vehicle is down."), Publish(self.pose)]
