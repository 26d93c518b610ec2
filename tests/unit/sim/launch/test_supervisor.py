"""The supervisor with real, tiny programs."""

import os
import socket
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.launch.processes import Program
from sim.launch.supervisor import (
    PortTakenError,
    ProgramFailedError,
    ProgramLog,
    Supervisor,
    check_ports,
)
from tests.support.polling import wait_until

PATIENCE_S = 30.0


def program(code: str, name: str = "worker") -> Program:
    return Program(name, (sys.executable, "-c", code))


def alive(process_id: int) -> bool:
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    return True


def step_until_it_fails(supervisor: Supervisor) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        supervisor.step()
        time.sleep(0.02)


class Lines:
    def __init__(self) -> None:
        self.all: list[tuple[str, str]] = []

    def __call__(self, name: str, line: str) -> None:
        self.all.append((name, line))


SLEEPER = "import time; print('up', flush=True); time.sleep(600)"


def test_output_is_shown_and_logged(tmp_path: Path) -> None:
    lines = Lines()
    with Supervisor([program(SLEEPER)], os.environ, tmp_path, lines):
        wait_until(lambda: ("worker", "up") in lines.all)
    assert (tmp_path / "worker.log").read_text() == "up\n"


@pytest.mark.thorough
def test_a_killed_program_is_started_again(tmp_path: Path) -> None:
    lines = Lines()
    with Supervisor([program(SLEEPER)], os.environ, tmp_path, lines) as supervisor:
        wait_until(lambda: len(lines.all) == 1)
        first = supervisor.process_id("worker")
        os.kill(first, 9)

        def restarted() -> bool:
            supervisor.step()
            return supervisor.process_id("worker") != first

        wait_until(restarted)
        wait_until(lambda: [line for _, line in lines.all].count("up") == 2)


@pytest.mark.thorough
def test_stopping_leaves_no_process_not_even_a_grandchild(tmp_path: Path) -> None:
    parent = (
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    lines = Lines()
    with Supervisor([program(parent)], os.environ, tmp_path, lines) as supervisor:
        wait_until(lambda: len(lines.all) == 1)
        processes = [supervisor.process_id("worker"), int(lines.all[0][1])]
        assert all(map(alive, processes))
    wait_until(lambda: not any(map(alive, processes)))


def test_a_program_that_cannot_run_ends_the_system_with_its_last_words(tmp_path: Path) -> None:
    broken = program("import sys; print('no such port'); sys.exit(2)")
    with (
        Supervisor([broken], os.environ, tmp_path, Lines()) as supervisor,
        pytest.raises(ProgramFailedError, match="worker cannot run"),
    ):
        step_until_it_fails(supervisor)


@pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM])
def test_a_taken_port_is_named(kind: socket.SocketKind) -> None:
    with socket.socket(socket.AF_INET, kind) as holder:
        holder.bind(("127.0.0.1", 0))
        if kind == socket.SOCK_STREAM:
            holder.listen()
        port = holder.getsockname()[1]
        wanted = (
            Program("edge", (), tcp_port=port)
            if kind == socket.SOCK_STREAM
            else Program("edge", (), udp_port=port)
        )
        with pytest.raises(PortTakenError, match=f"edge: port {port}"):
            check_ports([wanted])
        named = wanted._replace(port_setting="EDGE_PORT")
        with pytest.raises(PortTakenError, match="in use; EDGE_PORT chooses another"):
            check_ports([named])
    check_ports([wanted])


def test_a_port_that_two_programs_would_use_is_named() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(PortTakenError, match=f"cloud: port {port} is that of edge too"):
        check_ports([Program("edge", (), tcp_port=port), Program("cloud", (), tcp_port=port)])
    check_ports([Program("edge", (), tcp_port=port), Program("broker", (), udp_port=port)])


def test_a_log_goes_on_where_the_last_run_ended(tmp_path: Path) -> None:
    path = tmp_path / "edge.log"
    for line in (b"first\n", b"second\n"):
        log = ProgramLog(path)
        assert log.append(line)
        log.close()
    assert path.read_bytes() == b"first\nsecond\n"


@given(lines=st.lists(st.binary(min_size=1, max_size=30), max_size=60))
def test_the_newest_lines_are_kept_in_bounded_room(
    tmp_path_factory: pytest.TempPathFactory, lines: list[bytes]
) -> None:
    folder = tmp_path_factory.mktemp("logs")
    log = ProgramLog(folder / "edge.log", bytes_max=50, kept=2)
    for line in lines:
        log.append(line)
    log.close()
    names = ("edge.log.2", "edge.log.1", "edge.log")
    assert {path.name for path in folder.iterdir()} <= set(names)
    assert all(path.stat().st_size <= 50 for path in folder.iterdir())
    found = b"".join(p.read_bytes() for name in names if (p := folder / name).exists())
    assert b"".join(lines).endswith(found)
    assert len(found) >= min(sum(map(len, lines)), 60)


def test_a_full_medium_costs_lines_and_is_used_again_when_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "edge.log"
    path.symlink_to("/dev/full")
    log = ProgramLog(path)
    assert not log.append(b"first\n")
    assert not log.append(b"second\n")
    assert log.lines_lost == 2
    path.unlink()
    assert log.append(b"third\n")
    log.close()
    assert path.read_bytes() == b"third\n"


def test_a_folder_that_is_gone_costs_lines(tmp_path: Path) -> None:
    assert not ProgramLog(tmp_path / "gone" / "edge.log").append(b"line\n")
