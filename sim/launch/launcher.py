"""`make sim`: start the whole system, wait until it is healthy, show it, stop it cleanly."""

import fcntl
import math
import os
import secrets
import signal
import time
from collections.abc import Container
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Final, Self

from sim.launch.console import Screen
from sim.launch.farm_client import FarmClient, NotReadyError, RefusedError
from sim.launch.processes import fleet_limits, live_pictures, programs, uplink
from sim.launch.settings import Settings, example_plan
from sim.launch.supervisor import Supervisor, SupervisorError, check_ports

_LOCK_FILE: Final = "system.lock"
_KEY_LENGTH: Final = 32


class StateTakenError(SupervisorError):
    """Another system runs on the state folder."""


class StateLock:
    """One system per state folder: two would use the same keys, parameters and database.

    Held while a system runs; the kernel releases it with the process, however that ends.
    """

    def __init__(self, state_dir: Path) -> None:
        self._state_dir = state_dir
        self._descriptor: int | None = None

    def take(self) -> None:
        """Claim the folder, before anything in it is touched.

        Raises:
            StateTakenError: naming the process that has it.
            SupervisorError: if the folder cannot be used.
        """
        try:
            self._state_dir.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC
            descriptor = os.open(self._state_dir / _LOCK_FILE, flags, 0o600)
        except OSError as error:
            raise SupervisorError(f"STATE_DIR {self._state_dir}: {error.strerror}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, 32).decode("ascii", "replace").strip()
            os.close(descriptor)
            raise StateTakenError(
                f"STATE_DIR {self._state_dir}: a system runs on it already (process {holder}); "
                "stop that one, or set STATE_DIR and the ports for this one"
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode("ascii"), 0)
        self._descriptor = descriptor

    def release(self) -> None:
        """Leave the folder to another system."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def prepare_signing_keys(settings: Settings) -> None:
    """Make the missing keys of the MAVLink links, readable by their owner only.

    One key per vehicle: with a common key a captured vehicle could sign as any other.

    Raises:
        OSError: if the folder or a file cannot be written.
    """
    for system_id in range(1, settings.vehicles + 1):
        path = settings.signing_key_path(system_id)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        draft = path.with_suffix(".new")
        draft.unlink(missing_ok=True)
        if path.exists():
            continue
        descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(secrets.token_bytes(_KEY_LENGTH).hex() + "\n")
        draft.replace(path)


READY_TIMEOUT_S = 120.0
READY_TIMEOUT_PER_VEHICLE_S = 6.0
"""The longest time without progress while the system starts; a busy machine starts slowly."""
POLL_S = 0.2


class Stopped(BaseException):  # not an error, and nothing but a request to end
    """SIGINT or SIGTERM arrived."""


class NotHealthyError(SupervisorError):
    """The system did not become healthy in time."""


_arrived: Final[list[str]] = []
"""Name of the signal that arrived."""


def stop_on_signals() -> None:
    """Raise Stopped at the first SIGINT or SIGTERM, and ignore further ones."""
    _arrived.clear()
    for number in (signal.SIGINT, signal.SIGTERM):  # Also if the parent process ignores them
        signal.signal(number, _stop)


def _stop(number: int, _frame: FrameType | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    _arrived.append(signal.Signals(number).name)
    raise Stopped(*_arrived)


class System:
    """The running system, as the launcher and the demo drive it."""

    def __init__(self, settings: Settings, screen: Screen) -> None:
        self.settings = settings
        self.screen = screen
        self.client = FarmClient(settings)
        self._began = datetime.now(UTC)
        self._programs = programs(settings)
        environment = {
            "LOG_FORMAT": "text",  # People read the lines of all programs together
            **fleet_limits(),
            **live_pictures(settings),
            **os.environ,
            "PYTHONUNBUFFERED": "1",
            "STATE_DIR": str(settings.state_dir),
            "EDGE_URL": settings.edge_url,
            "DATABASE_URL": "",  # A file of the state folder, whatever else this machine serves
            **uplink(settings),
        }
        logs = settings.state_dir / "logs"
        self._supervisor = Supervisor(self._programs, environment, logs, screen.log)
        self._lock = StateLock(settings.state_dir)

    def __enter__(self) -> Self:
        """Start everything, or nothing.

        Raises:
            SupervisorError: if the state folder, a port or the keys cannot be had.
        """
        self._lock.take()
        try:
            check_ports(self._programs)
            prepare_signing_keys(self.settings)
        except OSError as error:
            self._lock.release()
            raise SupervisorError(f"keys cannot be written: {error}") from error
        except SupervisorError:
            self._lock.release()
            raise
        self._supervisor.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.screen.say("stopping")
        self._supervisor.stop()
        self._lock.release()
        self.screen.say("stopped")

    @property
    def _shown(self) -> int:
        return self.settings.vehicles + self.settings.testers

    def step(self) -> None:
        """Wait a moment, restart programs that ended, refresh the vehicles' lines.

        Raises:
            Stopped: again, if Python has dropped it: one that is raised in a finalizer, or in a
                callback of the interpreter, is printed and ignored.
        """
        if _arrived:
            raise Stopped(*_arrived)
        self._supervisor.step()
        try:
            self.screen.vehicles(self._shown, self.client.connected_vehicles())
        except (NotReadyError, RefusedError):
            self.screen.vehicles(self._shown, {})
        time.sleep(POLL_S)

    def wait_until_healthy(self) -> None:
        """Wait until every program runs, the uplink is open and every vehicle is connected.

        Raises:
            NotHealthyError: naming what is missing, when nothing has come nearer for too long.
        """
        patience = READY_TIMEOUT_S + READY_TIMEOUT_PER_VEHICLE_S * self.settings.vehicles
        fewest, deadline = math.inf, time.monotonic() + patience
        while lacks := self._lacks():
            to_go = len(lacks) + len(self._supervisor.silent())
            if to_go < fewest:
                fewest, deadline = to_go, time.monotonic() + patience
            if time.monotonic() > deadline:
                raise NotHealthyError(f"no progress for {patience:.0f} s: {'; '.join(lacks)}")
            self.step()

    def _lacks(self) -> list[str]:
        """What keeps the system from being up, a sentence each."""
        lacks = [f"{name} does not run" for name in self._supervisor.down()]
        connected: Container[int] = ()
        try:
            self.client.cloud("/healthz")
        except (NotReadyError, RefusedError) as error:
            lacks.append(str(error))
        try:
            uplink = self.client.edge("/readyz")["uplink"]
            if uplink != "open":
                lacks.append(f"the edge server's uplink to the cloud is {uplink}")
            connected = self.client.connected_vehicles(since=self._began)
        except (NotReadyError, RefusedError) as error:
            lacks.append(str(error))
        absent = [number for number in self.settings.started_ids if number not in connected]
        return lacks + [f"vehicle {number} is not connected" for number in absent]


def _by_mqtt(settings: Settings) -> str:
    return f", records come over {settings.mqtt_url}" if settings.mqtt_url else ""


def _tester_lines(settings: Settings) -> list[str]:
    """How to stand in for a vehicle."""
    if settings.tester_script is not None:
        return []
    port = f"MAVLINK_PORT={settings.mavlink_port} "
    return [
        f"  tester        in another terminal: {port}make tester SYSTEM_ID={system_id}"
        for system_id in settings.tester_ids
    ]


def console_line(client: FarmClient) -> str:
    """Show where the console is; the system runs without it too."""
    try:
        address = client.console_address()
    except (NotReadyError, RefusedError) as error:
        return f"  console       no address: {error}"
    if address is None:
        return "  console       is not built: make console"
    return f"  console       {address} (signs in once, within 10 minutes)"


def greeting(settings: Settings, console: str) -> str:
    """Show the addresses, and how to fly the first plan."""
    key = settings.key_path("operator")
    return "\n".join(
        (
            "The system is up.",
            console,
            f"  edge server   {settings.edge_url}",
            f"  mock cloud    {settings.cloud_url}" + _by_mqtt(settings),
            (
                f"  MAVLink       broker UDP {settings.mavlink_port}, "
                f"ground station UDP {settings.gcs_port}, "
                f"vehicle N UDP {settings.vehicle_port_base} + N"
            ),
            *_tester_lines(settings),
            f"  access keys   {key.parent}/ (operator, broker, admin, ...)",
            f"  logs          {settings.state_dir / 'logs'}/",
            "Fly the first plan:",
            (
                f"  curl -sS -X POST {settings.edge_url}/plans/ "
                f'-H "Authorization: Bearer $(cat {key})" '
                f'-H "Content-Type: application/json" -d @{example_plan()}'
            ),
            "Stop with Ctrl-C.",
        )
    )


def run(settings: Settings) -> int:
    """Run until the user stops it; 0 then, 1 if the system cannot run."""
    with Screen() as screen:
        try:
            with System(settings, screen) as system:
                system.wait_until_healthy()
                screen.say(greeting(settings, console_line(system.client)))
                while True:
                    system.step()
        except Stopped:
            return 0
        except SupervisorError as error:
            screen.say(f"ERROR {error}")
            return 1
