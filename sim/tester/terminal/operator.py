"""Connects the menus of the person to the vehicle and its link."""

from collections.abc import Callable
from typing import Final, Protocol

from sim.tester.terminal.menu import Draw, Menu
from sim.tester.vehicle.events import LinkEvent, MissionChange, Order, ShowText
from sim.tester.vehicle.stand_in import StandIn

PUBLISH_EVERY_S: Final = 0.25
ACTION_S: Final = 0.25
"""Shortest time between two actions, also of a script: the broker gets telemetry in between."""


class Link(Protocol):
    """The vehicle's link to the broker."""

    def publish(self, vehicle: StandIn, now: float) -> None:
        """Send the periodic messages of a vehicle."""

    def carry_out(self, order: Order, vehicle: StandIn, now: float) -> None:
        """Execute an order of the vehicle on the link."""


class Operator:
    """One person who plays one vehicle."""

    def __init__(
        self, vehicle: StandIn, link: Link, draw: Draw, write: Callable[[str], None]
    ) -> None:
        self.menu = Menu(draw, percentage=vehicle.percentage)
        self.vehicle = vehicle
        self._link = link
        self._write = write
        self._publish_at = -1.0
        self._busy_until = -1.0

    def takes_line(self, now: float) -> bool:
        """Whether a line is expected."""
        return self.menu.is_asking and now >= self._busy_until

    def receive(self, event: LinkEvent, now: float) -> None:
        """Handle an event of the link."""
        self._carry_out(self.vehicle.receive(event, now), now, asked=False)

    def answer(self, line: str, now: float) -> None:
        """Handle a line of input."""
        action = self.menu.answer(line)
        orders = [] if action is None else self.vehicle.act(action, now)
        self._carry_out(orders, now, asked=True)

    def tick(self, now: float) -> float:
        """Advance time; return when the next call is due."""
        self._carry_out(self.vehicle.tick(now), now, asked=False)
        if now >= self._publish_at:
            self._publish_at = now + PUBLISH_EVERY_S
            self._link.publish(self.vehicle, now)
        return self._publish_at if now >= self._busy_until else self._busy_until

    def _carry_out(self, orders: list[Order], now: float, *, asked: bool) -> None:
        is_on_new_line = asked
        if orders:
            self._busy_until = now + ACTION_S
        for order in orders:
            match order:
                case ShowText(text):
                    self._write(("" if is_on_new_line else "\n") + text + "\n")
                    is_on_new_line = True
                case MissionChange():
                    self._follow(order)
                    is_on_new_line = True
                case _:
                    self._link.carry_out(order, self.vehicle, now)
        if is_on_new_line and self.menu.is_asking:
            self._write(self.menu.prompt)

    def _follow(self, turn: MissionChange) -> None:
        match turn:
            case MissionChange.RUNS:
                self.menu.mission_runs()
            case MissionChange.ENDED:
                self.menu.mission_ended()
            case MissionChange.INTERRUPTED:
                self.menu.mission_interrupted()


LINGER_S: Final = 2.0
NEXT_MISSION_WITHIN_S: Final = 30.0


class ExitCondition:
    """Waits for the moment."""

    def __init__(self) -> None:
        self._since: float | None = None

    def is_due(self, vehicle: StandIn, now: float, *, is_asked: bool, lines_left: bool) -> bool:
        """Judge, after the last line has come; `is_asked` if the menus wait for one."""
        if vehicle.is_landing or (lines_left and (is_asked or not vehicle.mission.items)):
            self._since = None
            return False
        if self._since is None:
            self._since = now
        patience_s = NEXT_MISSION_WITHIN_S if lines_left else LINGER_S
        return now - self._since >= (patience_s if vehicle.mission.items else 0.0)
