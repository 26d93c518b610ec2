"""When the launcher says that the system is up, and when it gives up."""

import os
import signal
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from sim.launch import launcher
from sim.launch.console import Screen
from sim.launch.farm_client import FarmClient, NotReadyError, RefusedError
from sim.launch.launcher import (
    NotHealthyError,
    StateLock,
    StateTakenError,
    System,
    console_line,
    greeting,
    prepare_signing_keys,
)
from sim.launch.settings import from_environment
from sim.launch.supervisor import SupervisorError
from tests.support.system import ROOT
from uav_firmware.drivers.key_file import read_key


@dataclass
class World:
    """A system whose programs, edge server and clock are scripted; a step takes 10 s."""

    now_s: float = 0.0
    down: list[str] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    uplink: str = "open"
    connected: set[int] = field(default_factory=set)
    cloud_answers: bool = True
    change: Callable[["World"], None] = lambda _world: None

    def step(self) -> None:
        self.now_s += 10.0
        self.change(self)


@pytest.fixture
def world() -> World:
    return World()


def system_of(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, vehicles: int = 1
) -> System:
    settings = from_environment({"VEHICLES": str(vehicles), "STATE_DIR": str(tmp_path)})
    system = System(settings, Screen(plain=True))

    class Programs:
        def down(self) -> list[str]:
            return world.down

        def silent(self) -> list[str]:
            return world.silent

        def step(self) -> None:
            world.step()

    class Client:
        def cloud(self, _path: str) -> Any:
            if not world.cloud_answers:
                raise NotReadyError("cloud: ConnectionError")
            return {}

        def edge(self, _path: str) -> Any:
            return {"status": "ready", "uplink": world.uplink}

        def connected_vehicles(self, since: datetime | None = None) -> dict[int, dict[str, Any]]:
            assert since is None or since.tzinfo is not None
            return {number: {} for number in world.connected}

    class Clock:
        def monotonic(self) -> float:
            return world.now_s

        def sleep(self, _seconds: float) -> None:
            pass

    monkeypatch.setattr(system, "_supervisor", Programs())
    monkeypatch.setattr(system, "client", Client())
    monkeypatch.setattr(launcher, "time", Clock())
    return system


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"down": ["broker"]}, "broker does not run"),
        ({"uplink": "stopped"}, "uplink to the cloud is stopped"),
        ({"uplink": "paused"}, "uplink to the cloud is paused"),
        ({"cloud_answers": False}, "cloud: ConnectionError"),
        ({"connected": set()}, "vehicle 1 is not connected"),
    ],
)
def test_a_system_that_lacks_a_part_is_not_up(
    wrong: dict[str, Any],
    reason: str,
    world: World,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each part alone, while all others are there."""
    world.connected = {1}
    system_of(world, tmp_path, monkeypatch).wait_until_healthy()
    for name, value in wrong.items():
        setattr(world, name, value)
    with pytest.raises(NotHealthyError, match=reason):
        system_of(world, tmp_path, monkeypatch).wait_until_healthy()


def test_vehicles_that_come_one_by_one_are_waited_for(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twenty on a busy machine: each takes longer than all of them may take together."""

    def one_more(world: World) -> None:
        if world.now_s % 200.0 == 0.0:
            world.connected.add(len(world.connected) + 1)

    world.change = one_more
    system_of(world, tmp_path, monkeypatch, vehicles=20).wait_until_healthy()
    assert world.now_s == 20 * 200.0


def test_what_comes_and_goes_is_no_progress(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A broker that dies a while after each start: the sentence changes, nothing comes nearer."""

    def dies_now_and_then(world: World) -> None:
        world.down = ["broker"] if world.now_s % 60.0 == 0.0 else []

    world.change = dies_now_and_then
    with pytest.raises(NotHealthyError, match="no progress"):
        system_of(world, tmp_path, monkeypatch).wait_until_healthy()
    assert world.now_s < 1000.0


def test_a_program_that_prints_its_first_line_is_progress(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.silent = [f"vehicle-{number}" for number in range(1, 9)]

    def one_speaks(world: World) -> None:
        if world.now_s % 100.0 == 0.0:
            if world.silent:
                world.silent = world.silent[1:]
            else:
                world.connected = {1}

    world.change = one_speaks
    system_of(world, tmp_path, monkeypatch).wait_until_healthy()
    assert world.now_s == 900.0


def test_what_a_former_run_has_left_does_not_count_as_connected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    began = datetime(2026, 3, 1, 12, tzinfo=UTC)
    listing = [
        {"vehicle_id": 1, "link_state": "connected", "updated_at": "2026-03-01T11:59:59.000Z"},
        {"vehicle_id": 2, "link_state": "connected", "updated_at": "2026-03-01T12:00:01.000Z"},
        {"vehicle_id": 3, "link_state": "lost", "updated_at": "2026-03-01T12:00:01.000Z"},
    ]
    client = FarmClient(from_environment({"STATE_DIR": str(tmp_path)}))
    monkeypatch.setattr(client, "edge", lambda _path: listing)
    assert set(client.connected_vehicles()) == {1, 2}
    assert set(client.connected_vehicles(since=began)) == {2}
    assert set(client.connected_vehicles(since=began + timedelta(hours=1))) == set()


def test_every_vehicle_has_a_key_of_its_own_that_only_its_owner_reads(tmp_path: Path) -> None:
    settings = from_environment({"STATE_DIR": str(tmp_path), "VEHICLES": "3"})
    prepare_signing_keys(settings)
    paths = [settings.signing_key_path(system_id) for system_id in (1, 2, 3)]
    assert {stat.S_IMODE(path.stat().st_mode) for path in paths} == {0o600}
    assert stat.S_IMODE(settings.keys_dir.stat().st_mode) == 0o700
    assert len({read_key(path) for path in paths}) == 3


def test_a_key_stays_what_it_is_and_a_half_written_one_is_made_anew(tmp_path: Path) -> None:
    settings = from_environment({"STATE_DIR": str(tmp_path)})
    path = settings.signing_key_path(1)
    path.parent.mkdir(parents=True)
    path.with_suffix(".new").write_text("half")
    prepare_signing_keys(settings)
    key = read_key(path)
    prepare_signing_keys(settings)
    assert read_key(path) == key
    assert list(settings.keys_dir.iterdir()) == [path]


HOLDER = (
    "import sys, time; from pathlib import Path; from sim.launch.launcher import StateLock; "
    "lock = StateLock(Path(sys.argv[1])); lock.take(); print('taken', flush=True); time.sleep(600)"
)


def test_a_second_system_is_refused_with_the_first_one_s_process(tmp_path: Path) -> None:
    first, second = StateLock(tmp_path / "var"), StateLock(tmp_path / "var")
    first.take()
    with pytest.raises(StateTakenError, match=rf"STATE_DIR .*var: .*\(process {os.getpid()}\)"):
        second.take()
    first.release()
    second.take()
    second.release()


def test_a_system_that_was_killed_leaves_the_folder_free(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"taken\n"
        with pytest.raises(StateTakenError, match=rf"process {holder.pid}"):
            StateLock(tmp_path).take()
        holder.send_signal(signal.SIGKILL)
    lock = StateLock(tmp_path)
    lock.take()
    lock.release()


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(SupervisorError, match=r"STATE_DIR .*file"):
        StateLock(tmp_path / "file" / "var").take()


class Answers:
    """Answers the question for the console's address."""

    def __init__(self, answer: str | Exception | None) -> None:
        self._answer = answer

    def console_address(self) -> str | None:
        if isinstance(self._answer, Exception):
            raise self._answer
        return self._answer


@pytest.mark.parametrize(
    ("answer", "shown"),
    [
        ("http://127.0.0.1:8000/console/#link=abc", "#link=abc (signs in once"),
        (None, "make console"),
        (NotReadyError("var/keys/admin.key: No such file"), "admin.key"),
        (RefusedError("403: no"), "403"),
    ],
)
def test_the_system_is_up_with_and_without_its_console(
    answer: str | Exception | None, shown: str
) -> None:
    line = console_line(Answers(answer))  # type: ignore[arg-type]  # answers one question
    assert shown in line
    assert line in greeting(from_environment({}), line)


@pytest.fixture
def signals_restored() -> Iterator[None]:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    launcher.stop_on_signals()  # Forgets what has arrived
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("signals_restored")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_in_a_finalizer_stops_the_system_at_its_next_step(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python prints and ignores what a finalizer raises, and a second Ctrl-C is ignored too."""

    class Interrupted:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    system = system_of(world, tmp_path, monkeypatch)
    system.step()
    launcher.stop_on_signals()
    Interrupted()
    with pytest.raises(launcher.Stopped, match="SIGINT"):
        system.step()


@pytest.mark.usefixtures("signals_restored")
def test_an_interrupt_is_no_error_that_a_library_may_catch() -> None:
    launcher.stop_on_signals()
    with pytest.raises(launcher.Stopped), suppress(Exception):
        signal.raise_signal(signal.SIGINT)
