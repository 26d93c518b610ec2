"""A world of flight logs: a vehicle's log server, the broker's download, an edge server in memory.

Time is simulated. A vehicle's clock says noon at 1000 s of the broker's.
"""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path

from mavlink_broker.effects import (
    BeginLog,
    DropLog,
    Effects,
    FindLogs,
    LogJob,
    LogJobDone,
    LogJobFailed,
    LogJobOutcome,
    LogState,
    SendLogPart,
)
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.vehicle.flight_logs import FlightLogs
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.log_air import ROUTE, LogAir
from tests.support.lossy_link import Conditions

BOOT = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)
LIMIT_BYTES = 2_000_000
BUSY_STEP_S, IDLE_STEP_S = 0.004, 0.04
BUSY_S = 0.1
"""Time that passes in short steps after anything about logs was sent or received."""


class Archive:
    """What an edge server has of the logs of one vehicle."""

    def __init__(self) -> None:
        self.logs: dict[str, tuple[BeginLog, bytearray]] = {}
        self.complete: set[str] = set()
        self.refusal: Callable[[LogJob], LogJobOutcome | None] = lambda _: None
        self.requests: list[LogJob] = []

    def carry_out(self, job: LogJob) -> LogJobOutcome:
        self.requests.append(job)
        if (refused := self.refusal(job)) is not None:
            return refused
        match job.request:
            case FindLogs():
                states = (self._state(name) for name in self.logs if name not in self.complete)
                return LogJobDone(job.number, tuple(states))
            case BeginLog(name=name) as log:
                assert self.logs.setdefault(name, (log, bytearray()))[0] == log
                return LogJobDone(job.number, (self._state(name),))
            case SendLogPart(name, offset, data, is_last):
                if offset != len(self.logs[name][1]) or name in self.complete:
                    return LogJobFailed(job.number, "HTTP 409", is_final=False)
                self.logs[name][1].extend(data)
                self.complete |= {name} if is_last else set()
                return LogJobDone(job.number, (self._state(name),))
            case DropLog(name):
                self.logs.pop(name, None)
                return LogJobDone(job.number)

    def _state(self, name: str) -> LogState:
        log, data = self.logs[name]
        return LogState(log, len(data), is_complete=name in self.complete)

    @property
    def sent(self) -> list[bytes]:
        """The complete logs in the order of their flights."""
        logs = sorted(
            (self.logs[name] for name in self.complete), key=lambda one: one[0].started_at
        )
        return [bytes(data) for _, data in logs]


class World:
    """A vehicle with logs, the broker's part that fetches them, and an edge server."""

    def __init__(self, folder: Path, conditions: Conditions | None = None) -> None:
        self.air = LogAir(folder, conditions or Conditions())
        self.archive = Archive()
        self.asked: list[str] = []
        self.names = (f"log-{number}" for number in count(1))
        self.may_fetch = True
        self.is_answering = True
        self._waiting: list[LogJob] = []
        self._busy_until = 0.0
        self.limit_s = 600.0
        self.booted_s = 0.0
        self.clock_back_s = 0.0
        """How much the vehicle's clock is behind that of the broker."""
        self.start_broker()

    def start_broker(self) -> None:
        """Begin with an empty memory."""
        self.vehicle = Vehicle(1, ROUTE)
        self.vehicle.snapshot.booted_at_utc_s = BOOT.timestamp()
        self.vehicle.snapshot.armed = False
        self.logs = FlightLogs(
            self.vehicle,
            lambda: next(self.names),
            limit_bytes=LIMIT_BYTES,
            limit_s=self.limit_s,
        )
        self._waiting.clear()

    def fly(self, size: int, *, seconds: float = 60.0) -> bytes:
        """Fly for a while; gives what the vehicle logs of it."""
        began = BOOT + timedelta(seconds=self.air.now_s - self.clock_back_s)
        contents = self.air.write_log(f"{began:%H_%M_%S}", size, seed=size)
        self.arm(seconds)
        return contents

    def reboot(self, clock_back_s: float = 0.0) -> None:
        """Restart the vehicle, whose clock then goes back."""
        self.air.reboot()
        self.clock_back_s += clock_back_s
        booted = BOOT + timedelta(seconds=self.air.now_s - self.clock_back_s)
        self.vehicle.snapshot.booted_at_utc_s = booted.timestamp()
        self.booted_s = self.air.now_s
        self.logs.restarted()

    def arm(self, seconds: float) -> None:
        """Be armed for a while."""
        self.vehicle.snapshot.armed = True
        self.wait(seconds)
        self.vehicle.snapshot.armed = False
        self.run(0.5)

    def run(self, seconds: float, step_s: float | None = None) -> None:
        end = self.air.now_s + seconds
        while self.air.now_s < end:
            self.step(step_s)

    def wait(self, seconds: float) -> None:
        """Let time pass in which nothing hangs on milliseconds."""
        self.run(seconds, 0.2)

    def run_until(self, is_done: Callable[[], bool], within_s: float = 600.0) -> None:
        end = self.air.now_s + within_s
        while not is_done():
            assert self.air.now_s < end
            self.step()

    def step(self, step_s: float | None = None) -> None:
        if step_s is None:
            step_s = BUSY_STEP_S if self.air.now_s < self._busy_until else IDLE_STEP_S
        effects = Effects()
        arrived = self.air.step(step_s)
        for message in arrived:
            self.logs.receive(message, self.air.now_s, effects)
        snapshot = self.vehicle.snapshot
        snapshot.time_s = self.air.now_s - self.booted_s
        self.logs.utc = BOOT + timedelta(seconds=self.air.now_s)
        if self.is_answering:
            for job in self._waiting:
                self.logs.take_outcome(self.archive.carry_out(job), self.air.now_s, effects)
            self._waiting.clear()
        may_fetch = self.may_fetch and snapshot.armed is False
        self.logs.step(self.air.now_s, effects, may_fetch=may_fetch)
        self._waiting += [job for job in effects.jobs if isinstance(job, LogJob)]
        self._send(effects.messages)
        if effects.messages or any(one.get_type().startswith("LOG_") for one in arrived):
            self._busy_until = self.air.now_s + BUSY_S

    def _send(self, messages: list[Message]) -> None:
        assert not (messages and self.vehicle.snapshot.armed) or {
            message.get_type() for message in messages
        } == {"LOG_REQUEST_END"}
        self.asked += [message.get_type() for message in messages]
        self.air.send(messages)
