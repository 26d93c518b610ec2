"""When a process that has exited is restarted, and when the supervisor gives up."""

import errno
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.process import supervisor
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.process.supervisor import (
    FIRST_WAIT_S,
    LONGEST_WAIT_S,
    MAXIMUM_EXITS,
    WITHIN_S,
    Exits,
    Kind,
    Supervisor,
)
from edge_server.store.files import tally

RUNS = None
"""In a list of exit codes: this process does not end by itself."""


class Machine:
    """Processes and a clock that are not there; `codes` are those of a part's processes in turn.

    The last code of a part is that of all its later processes. SIGTERM comes at `term_at_s`.
    """

    def __init__(self, codes: dict[str, Sequence[int | None]], term_at_s: float = 300.0) -> None:
        self.starts = dict.fromkeys(codes, 0)
        self.forks_refused = 0
        self.ended: list[str] = []
        self._codes = codes
        self._now_s = 0.0
        self._term_at_s = term_at_s
        self._on_signal: dict[int, Callable[[int, None], None]] = {}

    def monotonic(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        was, self._now_s = self._now_s, self._now_s + duration_s
        if was < self._term_at_s <= self._now_s:
            self._on_signal[signal.SIGTERM](signal.SIGTERM, None)

    def install(self, number: int, handler: Callable[[int, None], None]) -> None:
        self._on_signal[number] = handler

    def fork(self, kind: Kind) -> "Process":
        name = kind.name
        if self.forks_refused:
            self.forks_refused -= 1
            raise BlockingIOError(errno.EAGAIN, "no process can be made")
        codes = self._codes[name]
        code = codes[min(self.starts[name], len(codes) - 1)]
        self.starts[name] += 1
        return Process(name, code, self.ended)


class Process:
    """One that has ended with a code, or runs until it is asked to end."""

    def __init__(self, name: str, code: int | None, ended: list[str]) -> None:
        self._name, self.exitcode, self._ended = name, code, ended

    def terminate(self) -> None:
        self.exitcode = 0
        self._ended.append(self._name)

    def join(self, _timeout_s: float) -> None:
        assert self.exitcode is not None


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Machine], int]:
    """Run a supervisor on a machine; returns its exit code."""

    def run(machine: Machine) -> int:
        config = Config(state_dir=tmp_path)
        config.edge_dir.mkdir()
        with monkeypatch.context() as patch:
            patch.setattr(supervisor, "time", machine)
            patch.setattr(supervisor, "fork", machine.fork)
            patch.setattr(signal, "signal", machine.install)
            kinds = (Kind("serve", int, is_vital=True), Kind("relay", int, is_vital=False))
            return Supervisor(kinds, config).run()

    return run


def test_a_relay_that_keeps_exiting_never_stops_the_server(
    run: Callable[[Machine], int], tmp_path: Path
) -> None:
    machine = Machine({"serve": [RUNS], "relay": [FAILED, WRONG_SETUP, -9, FAILED]})
    assert run(machine) == OK
    assert machine.starts["serve"] == 1
    assert machine.starts["relay"] > 2 * MAXIMUM_EXITS
    assert machine.ended == ["serve"]
    counted = tally.read(Config(state_dir=tmp_path).supervisor_tally_path)
    assert machine.starts["relay"] - counted[tally.PART_DEATHS]["relay",] in {0, 1}


@pytest.mark.parametrize(("wrong", "other"), [("serve", "relay"), ("relay", "serve")])
def test_a_wrong_setup_at_the_first_start_stops_the_program(
    run: Callable[[Machine], int], wrong: str, other: str
) -> None:
    machine = Machine({wrong: [WRONG_SETUP], other: [RUNS]})
    assert run(machine) == WRONG_SETUP
    assert machine.starts == {wrong: 1, other: 1}
    assert machine.ended == [other]


def test_a_server_that_exits_five_times_within_a_minute_stops_the_program(
    run: Callable[[Machine], int],
) -> None:
    machine = Machine({"serve": [FAILED], "relay": [RUNS]})
    assert run(machine) == FAILED
    assert machine.starts == {"serve": MAXIMUM_EXITS, "relay": 1}
    assert machine.ended == ["relay"]


@pytest.mark.parametrize("server", [RUNS, -9])
def test_an_exit_of_the_relay_says_whether_the_server_serves(
    run: Callable[[Machine], int], caplog: pytest.LogCaptureFixture, server: int | None
) -> None:
    run(Machine({"serve": [server], "relay": [FAILED]}, term_at_s=15.0))
    first, *_, last = [one for one in caplog.messages if one.startswith("relay exited")]
    assert "aborts are served" not in first  # A server that was just started may not serve yet
    assert ("aborts are served" in last) == (server is RUNS)


def test_an_exit_of_the_relay_on_a_read_only_disk_promises_nothing(
    run: Callable[[Machine], int],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(supervisor, "is_read_only", lambda _folder: True)
    run(Machine({"serve": [RUNS], "relay": [FAILED]}, term_at_s=15.0))
    *_, last = [one for one in caplog.messages if one.startswith("relay exited")]
    assert "nothing is stored" in last


def test_processes_that_cannot_be_started_now_are_started_later(
    run: Callable[[Machine], int], caplog: pytest.LogCaptureFixture
) -> None:
    machine = Machine({"serve": [RUNS], "relay": [RUNS]})
    machine.forks_refused = 30
    assert run(machine) == OK
    assert machine.starts == {"serve": 1, "relay": 1}
    assert "serve cannot be started now (no process can be made)" in caplog.text


def test_a_failure_of_the_supervisor_ends_its_processes(
    run: Callable[[Machine], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine({"serve": [RUNS], "relay": [FAILED]})
    monkeypatch.setattr(machine, "sleep", _fail_at(machine, 3.0))
    with pytest.raises(MemoryError):
        run(machine)
    assert machine.ended == ["serve"]


def _fail_at(machine: Machine, fails_at_s: float) -> Callable[[float], None]:
    sleep = machine.sleep

    def sleep_and_fail(duration_s: float) -> None:
        if machine.monotonic() >= fails_at_s:
            raise MemoryError
        sleep(duration_s)

    return sleep_and_fail


def test_a_server_that_exits_once_is_restarted(run: Callable[[Machine], int]) -> None:
    machine = Machine({"serve": [-9, RUNS], "relay": [RUNS]})
    assert run(machine) == OK
    assert machine.starts == {"serve": 2, "relay": 1}
    assert sorted(machine.ended) == ["relay", "serve"]


def test_the_delay_doubles_with_every_exit_up_to_a_bound() -> None:
    exits, now, waits = Exits(), 0.0, []
    for _ in range(40):
        waits.append(exits.note(now, now + 0.1))
        now += 0.1 + waits[-1]
    assert waits[:4] == [FIRST_WAIT_S * 2**number for number in range(4)]
    assert waits == sorted(waits)
    assert set(waits[10:]) == {LONGEST_WAIT_S}
    assert exits.total == 40


def test_a_process_that_has_run_for_a_minute_is_restarted_at_once() -> None:
    exits = Exits()
    for _ in range(10):
        exits.note(0.0, 1.0)
    assert exits.note(100.0, 100.0 + WITHIN_S) == FIRST_WAIT_S


def test_five_exits_are_too_many_within_a_minute_only() -> None:
    quick, slow = Exits(), Exits()
    for number in range(MAXIMUM_EXITS):
        assert not quick.are_too_many
        quick.note(number, number + 1.0)
        slow.note(number * WITHIN_S, (number + 1) * WITHIN_S)
    assert quick.are_too_many
    assert not slow.are_too_many
