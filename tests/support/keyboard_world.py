"""The whole broker against the tester: MAVSDK on the loopback, a person who types by rule.

Time is the wall's, since MAVSDK has a clock of its own; nothing is asserted about it. Everything of
ours runs in one thread, MAVSDK in its own.
"""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from itertools import count
from typing import Any, Final, Self

from afarcloud.enumerations import Status
from mavlink_broker.app import App
from mavlink_broker.config import Config
from mavlink_broker.links.hub import open_links
from mavlink_broker.links.url import parse_links
from sim.tester.terminal.lines import WakeableQueue
from sim.tester.terminal.operator import Operator
from sim.tester.terminal.screens import Place
from sim.tester.vehicle.events import LinkEvent, MissionReceived
from sim.tester.vehicle.mavsdk_link import MavsdkVehicle
from sim.tester.vehicle.stand_in import StandIn
from sim.tester.vehicle.telemetry import Home
from tests.support.fake_edge import FakeEdge

PATIENCE_S: Final = 90.0
HOME: Final = Home(40.44340, -3.73820, 650.0)
TYPES_EVERY_S: Final = 0.02


class Clock:
    """The wall's."""

    def monotonic(self) -> float:
        """Seconds."""
        return time.monotonic()

    def utc(self) -> datetime:
        """Time of day."""
        return datetime.now(UTC)


class KeyboardWorld:
    """A tester, an edge server in memory, and a broker between them, or none."""

    def __init__(self) -> None:
        self.edge = FakeEdge()
        self.shown = ""  # What the person reads
        self.uploads = 0
        self.types_until: int | None = None
        """Place of the command that the person leaves running; None: every one is finished."""
        self._link = open_links(parse_links("udpin://127.0.0.1:0"))
        self._woken: WakeableQueue[LinkEvent] = WakeableQueue()
        self._ulids = count(1)
        self._typed_at = 0.0
        vehicle = StandIn(HOME, time.monotonic())
        address = f"udpout://127.0.0.1:{self._link.urls[0].port}"
        self._mavsdk = MavsdkVehicle(1, address, self._woken.put)
        self.operator = Operator(
            vehicle, self._mavsdk, lambda low, high: (low + high) / 2.0, self._show
        )
        self.app: App | None = None
        self.start_broker()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._mavsdk.close()
        self._woken.close()
        self._link.close()

    def _show(self, text: str) -> None:
        self.shown += text

    # The broker's life.

    def start_broker(self) -> None:
        """Begin with an empty memory; all unfinished work is handed out again."""
        self._link.receive(0.0)
        self.app = App(Config(), self._link, self.edge, Clock(), self._ulid)
        self.edge.hand_out_again()

    def kill_broker(self) -> None:
        """Lose everything that it knows."""
        self.app = None

    def _ulid(self) -> str:
        return f"01{next(self._ulids):024d}"

    # Time.

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.go_round()

    def run_until(self, condition: Callable[[], Any], within_s: float = PATIENCE_S) -> None:
        """Let time pass until the condition holds."""
        end = time.monotonic() + max(within_s, PATIENCE_S)
        while not condition():
            assert time.monotonic() < end, f"not within {within_s} s: {self.shown[-500:]}"
            self.go_round()

    def run_until_over(self, mission_id: int, within_s: float = PATIENCE_S) -> None:
        """Let time pass until a mission has its terminal status."""
        self.run_until(lambda: self.is_over(mission_id), within_s)

    def go_round(self) -> None:
        """Let everybody have a turn."""
        if self.app is None:
            self._link.receive(0.002)
        else:
            self.app.step(0.002)
        now = time.monotonic()
        for event in self._woken.take():
            self.uploads += isinstance(event, MissionReceived)
            self.operator.receive(event, now)
        self._type_by_rule(now)
        self.operator.tick(now)

    # The person.

    def type(self, *lines: str) -> None:
        """Type lines, each when it is asked for."""
        for line in lines:
            self.run_until(lambda: self.operator.menu.is_asking)
            self.operator.answer(line, time.monotonic())

    def _type_by_rule(self, now: float) -> None:
        if now - self._typed_at < TYPES_EVERY_S:
            return
        self._typed_at = now
        place = self.operator.menu.place
        if place is Place.LANDING:
            self.operator.answer("0", now)
        elif place is Place.MAIN and self._may_finish:
            self.operator.answer("1", now)

    @property
    def _may_finish(self) -> bool:
        mission = self.operator.vehicle.mission
        if self.types_until is None or mission.step is None:
            return self.types_until is None
        return mission.steps.index(mission.step) < self.types_until

    # What there is to see.

    def is_over(self, mission_id: int) -> bool:
        """Whether a mission has its terminal status."""
        status = self.edge.status(mission_id)
        return status is not None and Status(status).is_terminal

    @property
    def is_armed(self) -> bool:
        """As the vehicle reports it."""
        return self.operator.vehicle.armed
