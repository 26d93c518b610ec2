"""The whole program: first start, graceful shutdown, recovery from kills."""

import contextlib
import json
import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import requests

from edge_server.process.supervisor import MAXIMUM_EXITS
from edge_server.store.files import integrity
from tests.support.fake_cloud import running_cloud
from tests.support.polling import PATIENCE_S
from tests.support.process_tree import command_words, descendants, full_pipe, gone
from tests.support.system import wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program, program_in


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Program]:
    """A program with an empty state folder and no cloud."""
    with program_in(tmp_path / "state") as made:
        yield made


def post(program: Program, kind: str, number: int, vehicle_id: int = 1) -> int:
    """Post a report as the broker does; returns its id once it is acknowledged."""
    answer = requests.post(
        f"{program.url}/{kind}/",
        json=documents.telemetry(kind, number, vehicle_id),
        headers={
            "X-API-Key": program.key("broker"),
            "Idempotency-Key": f"{kind}-{vehicle_id}-{number}",
        },
        timeout=30.0,
    )
    assert answer.status_code == 201, answer.text
    identifier: int = answer.json()["id"]
    return identifier


@pytest.mark.thorough
def test_it_starts_from_nothing_and_ends_with_zero(program: Program) -> None:
    program.start()
    assert program.process is not None
    children = descendants(program.process.pid)
    keys = program.state_dir / "keys"
    for file in keys.iterdir():
        assert file.stat().st_mode & 0o777 == 0o600
    code, errors = program.end()
    assert code == 0, errors
    assert "Traceback" not in errors
    assert gone(children, PATIENCE_S)
    # The database is in one file then, which may be copied
    assert not (program.state_dir / "edge" / "edge.sqlite3-wal").exists()


@pytest.mark.thorough
def test_ctrl_c_is_a_graceful_shutdown_too(program: Program) -> None:
    program.start()
    code, errors = program.end(signal.SIGINT)
    assert (code, "Traceback" in errors) == (0, False)


@pytest.mark.thorough
def test_a_long_poll_does_not_delay_the_shutdown(program: Program) -> None:
    program.start()
    answers: list[int] = []

    def wait_for_work() -> None:
        answer = requests.get(
            f"{program.url}/broker/commands?wait=25",
            headers={"X-API-Key": program.key("broker")},
            timeout=PATIENCE_S,
        )
        answers.append(answer.status_code)

    thread = threading.Thread(target=wait_for_work)
    thread.start()
    while "/broker" not in _requests_in_flight(program) and thread.is_alive():
        time.sleep(0.05)
    code, errors = program.end()
    thread.join()
    assert (code, answers) == (0, [200]), errors


@pytest.mark.thorough
def test_readiness_ends_before_the_server(program: Program) -> None:
    program.start()
    assert program.process is not None
    program.process.send_signal(signal.SIGTERM)
    statuses = []
    with contextlib.suppress(requests.RequestException):
        while True:
            statuses.append(requests.get(f"{program.url}/readyz", timeout=30.0).status_code)
    code, errors = program.wait()
    assert code == 0, errors
    assert statuses[-1] == 503
    assert set(statuses) <= {200, 503}


@pytest.mark.thorough
def test_requests_in_progress_are_completed(program: Program) -> None:
    program.start()
    body = json.dumps(documents.telemetry("pose")).encode()
    head = (
        f"POST /pose/ HTTP/1.1\r\nHost: edge\r\nX-API-Key: {program.key('broker')}\r\n"
        f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", program.port), timeout=30.0) as connection:
        connection.sendall(head.encode() + body[:10])
        wait_for(lambda: "/broker" in _requests_in_flight(program), "the request on its way in")
        assert program.process is not None
        program.process.send_signal(signal.SIGTERM)
        wait_for(lambda: _readiness(program) != 200, "the beginning of the end")
        connection.sendall(body[10:])
        answer = connection.recv(4096)
    assert answer.startswith(b"HTTP/1.1 201"), answer
    code, errors = program.wait()
    assert code == 0, errors


def _readiness(program: Program) -> int:
    try:
        return requests.get(f"{program.url}/readyz", timeout=30.0).status_code
    except requests.RequestException:
        return 0


@pytest.mark.thorough
def test_a_second_signal_exits_at_once(program: Program) -> None:
    program.start()
    assert program.process is not None
    children = descendants(program.process.pid)
    with socket.create_connection(("127.0.0.1", program.port), timeout=30.0) as connection:
        connection.sendall(b"POST /pose/ HTTP/1.1\r\nHost: edge\r\nContent-Length: 1000\r\n")
        program.process.send_signal(signal.SIGTERM)
        wait_for(lambda: _readiness(program) != 200, "the beginning of the end")
        program.process.send_signal(signal.SIGTERM)
        code, errors = program.wait()
    assert code == 1, errors
    assert gone(children, PATIENCE_S)
    program.start()


@pytest.mark.thorough
def test_every_line_of_the_log_is_an_object_and_no_secret(program: Program) -> None:
    program.start()
    post(program, "pose", 0)
    with socket.create_connection(("127.0.0.1", program.port), timeout=30.0) as connection:
        connection.sendall(f"NONSENSE {program.key('admin')}\r\n\r\n".encode())
        answer = connection.recv(4096)
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["message"]
    assert answer.startswith(b"HTTP/1.1 400")
    _, log = program.end()
    lines = [json.loads(line) for line in log.splitlines()]
    assert {line["level"] for line in lines} >= {"INFO", "WARNING"}
    for role in ("broker", "admin"):
        assert program.key(role) not in log


@pytest.mark.thorough
def test_it_serves_and_restarts_a_process_while_the_reader_of_its_log_has_stalled(
    program: Program,
) -> None:
    read_end, write_end = full_pipe()
    program.process = program.spawn(stderr=write_end)
    os.close(write_end)
    program.wait_ready()
    for number in range(40):  # More than there are threads
        post(program, "pose", number)
    before = descendants(program.process.pid)
    for pid in before:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    assert gone(before, PATIENCE_S)
    program.wait_ready()
    post(program, "pose", 40)
    program.process.send_signal(signal.SIGTERM)
    assert program.process.wait(PATIENCE_S) == 0
    program.process = None
    os.close(read_end)


@pytest.mark.thorough
def test_a_large_database_that_is_broken_is_found_while_it_serves(program: Program) -> None:
    """A fault that the quick check at the start misses is noted by the request that meets it."""
    program.start()
    database = program.state_dir / "edge" / "edge.sqlite3"
    integrity.note_fault(database, "row 7 missing")
    quarantine = program.state_dir / "edge" / "quarantine"
    wait_for(lambda: list(quarantine.glob("*.sqlite3")), "the file set aside")
    program.wait_ready()
    post(program, "pose", 0)
    assert "row 7 missing" in program.log()


def _requests_in_flight(program: Program) -> str:
    """Whether another client has connected; the poll is then in progress."""
    table = Path("/proc/net/tcp").read_text(encoding="ascii")
    established = f":{program.port:04X} "
    lines = [line for line in table.splitlines() if established in line and " 01 " in line]
    return "/broker" if lines else ""


@pytest.mark.thorough
def test_a_killed_parent_leaves_no_orphan_and_no_stale_port(program: Program) -> None:
    program.start()
    assert program.process is not None
    children = descendants(program.process.pid)
    assert len(children) >= 3
    program.end(signal.SIGKILL)
    assert gone(children, PATIENCE_S)
    program.start()


@pytest.mark.thorough
def test_a_killed_process_is_restarted(program: Program) -> None:
    program.start()
    assert program.process is not None
    before = descendants(program.process.pid)
    for pid in before:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
    assert gone(before, PATIENCE_S)
    program.wait_ready()
    assert not set(descendants(program.process.pid)) & set(before)


@pytest.mark.thorough
def test_server_and_relay_are_named_in_the_process_list(program: Program) -> None:
    program.start()
    assert program.process is not None
    names = [command_words(one)[-1] or command_words(one)[-2] for one in _children_of(program)]
    assert sorted(names) == ["relay", "serve", "serve"]


@pytest.mark.thorough
@pytest.mark.parametrize("delay_s", [0.0, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.3])
def test_a_signal_while_the_processes_start_ends_them(program: Program, delay_s: float) -> None:
    program.begin()
    children = wait_for(lambda: _children_of(program), "a child process")
    time.sleep(delay_s)
    code, log = program.end()
    assert code == 0, log
    assert "killing it" not in log  # It did not wait for a child that had missed the signal
    assert gone(children, PATIENCE_S)


@pytest.mark.thorough
@pytest.mark.parametrize("delay_s", [0.6, 1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("command", [[], ["serve"], ["relay"]], ids=["all", "serve", "relay"])
def test_a_signal_while_it_is_loaded_ends_it_well(
    program: Program, command: list[str], delay_s: float
) -> None:
    program.begin(*command)
    time.sleep(delay_s)
    code, log = program.end()
    assert (code, "Traceback" in log) == (0, False), log


@pytest.mark.thorough
def test_it_runs_where_its_starter_ignores_ended_children(program: Program) -> None:
    former = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        program.begin()
    finally:
        signal.signal(signal.SIGCHLD, former)
    program.wait_ready()
    for one in _children_of(program):
        with contextlib.suppress(ProcessLookupError):
            os.kill(one, signal.SIGKILL)
    program.wait_ready()
    assert program.end()[0] == 0


@pytest.mark.thorough
def test_it_runs_without_a_standard_error(program: Program) -> None:
    command = f"exec {sys.executable} -m edge_server 2>&-"
    program.process = subprocess.Popen(command, shell=True, env=program.environment, text=True)
    program.wait_ready()
    program.process.send_signal(signal.SIGTERM)
    assert program.process.wait(PATIENCE_S) == 0
    program.process = None


def _children_of(program: Program) -> list[int]:
    assert program.process is not None
    return descendants(program.process.pid)


@pytest.mark.thorough
def test_a_port_in_use_is_one_sentence(program: Program) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", program.port))
        other.listen()
        program.begin()
        code, errors = program.wait()
    assert code == 2
    lines = [line for line in errors.splitlines() if "cannot listen" in line]
    assert len(lines) == 1
    assert str(program.port) in lines[0]
    assert "Traceback" not in errors


def test_a_state_folder_that_cannot_be_created_is_one_sentence(program: Program) -> None:
    """Once by the part of the program that finds it first; nothing is started again."""
    file = program.state_dir.with_name("file")
    file.touch()
    program.environment["STATE_DIR"] = str(file / "var")
    program.begin()
    code, errors = program.wait()
    assert code == 2
    assert f"STATE_DIR: the folder {file / 'var' / 'edge'} cannot be created" in errors
    assert "Traceback" not in errors
    assert "restart" not in errors


@pytest.mark.thorough
def test_a_second_relay_is_refused(program: Program) -> None:
    program.start()
    second = program.spawn("relay")
    _, errors = second.communicate(timeout=PATIENCE_S)
    assert second.returncode == 2
    assert "another relay" in errors


@pytest.mark.thorough
def test_a_relay_started_first_waits_for_the_database(program: Program) -> None:
    with running_cloud() as cloud:
        program.environment["CLOUD_URL"] = cloud.url
        relay = program.spawn("relay")
        program.start("serve")
        post(program, "pose", 0)
        cloud.store.wait_for(1)
        relay.send_signal(signal.SIGTERM)
        relay.communicate(timeout=PATIENCE_S)
        assert relay.returncode == 0
        program.end()


@pytest.mark.thorough
def test_a_relay_that_keeps_exiting_never_ends_the_server(program: Program) -> None:
    """As many exits of the server would end the program."""
    blocked = program.state_dir / "edge" / "relay.wake"
    blocked.mkdir(parents=True)
    program.start()
    wait_for(lambda: _readiness_of(program)["relay_deaths"] >= MAXIMUM_EXITS, "the relay's deaths")
    ready = _readiness_of(program)
    assert (ready["status"], ready["uplink"]) == ("ready", "stopped")
    post(program, "pose", 0)
    headers = {"X-API-Key": program.key("admin")}
    page = requests.get(f"{program.url}/metrics", headers=headers, timeout=30.0).text
    assert 'fm_part_deaths_total{part="relay"}' in page
    assert "fm_uplink_state 0.0" in page
    blocked.rmdir()
    wait_for(lambda: _readiness_of(program)["uplink"] == "blocked", "the relay at work again")
    code, errors = program.end()
    assert code == 0, errors
    lines = [json.loads(line) for line in errors.splitlines()]
    assert any("restarts in" in line["message"] for line in lines)
    assert any("Traceback" in line.get("exc_info", "") for line in lines)


def _readiness_of(program: Program) -> dict[str, Any]:
    """The answer of /readyz; the program must be running."""
    answer = requests.get(f"{program.url}/readyz", timeout=30.0)
    assert answer.status_code == 200
    found: dict[str, Any] = answer.json()
    return found


@pytest.mark.thorough
def test_a_database_of_a_newer_version_is_one_sentence(program: Program) -> None:
    program.start()
    program.end()
    database = sqlite3.connect(program.state_dir / "edge" / "edge.sqlite3")
    with database:
        database.execute("UPDATE alembic_version SET version_num = '9999'")
    database.close()
    program.begin()
    code, errors = program.wait()
    assert code == 2
    assert "9999" in errors
    assert "Traceback" not in errors


@pytest.mark.thorough
def test_telegraf18528_corrupt_store_starts(program: Program) -> None:
    program.start()
    program.end()
    database = program.state_dir / "edge" / "edge.sqlite3"
    spoiled = bytearray(database.read_bytes())
    spoiled[0:4096] = os.urandom(4096)
    database.write_bytes(spoiled)
    key = program.key("operator")
    program.start()
    answer = requests.get(f"{program.url}/plans/", headers={"X-API-Key": key}, timeout=30.0)
    assert (answer.status_code, answer.json()) == (200, [])
    (kept,) = (program.state_dir / "edge" / "quarantine").glob("*.sqlite3")
    assert kept.read_bytes() == bytes(spoiled)
    _, errors = program.end()
    assert "CRITICAL" in errors


@pytest.mark.thorough
def test_a_body_in_chunks_is_bounded_too(program: Program) -> None:
    program.start()
    with socket.create_connection(("127.0.0.1", program.port), timeout=30.0) as connection:
        head = (
            f"POST /pose/ HTTP/1.1\r\nHost: edge\r\nX-API-Key: {program.key('broker')}\r\n"
            "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n"
        )
        connection.sendall(head.encode())
        answer = b""
        try:
            for _ in range(64):
                connection.sendall(b"8000\r\n" + b" " * 0x8000 + b"\r\n")
            connection.sendall(b"0\r\n\r\n")
        except ConnectionError:
            pass
        answer = connection.recv(4096)
    assert answer.startswith(b"HTTP/1.1 413"), answer
    with requests.Session() as session:
        body = json.dumps(documents.telemetry("pose")).encode()
        answered = session.post(
            f"{program.url}/pose/",
            data=iter([body[:10], body[10:]]),
            headers={"X-API-Key": program.key("broker"), "Content-Type": "application/json"},
            timeout=30.0,
        )
    assert answered.status_code == 201


@pytest.mark.thorough
def test_a_broken_body_in_chunks_is_a_400_and_ends_the_connection(program: Program) -> None:
    program.start()
    cases = [
        ("/pose/", "application/json", "", b"+5\r\n     \r\n0\r\n\r\n", 400),
        ("/pose/", "application/json", "", b"5;a\nb\r\n     \r\n0\r\n\r\n", 400),
        ("/pose/", "application/json", "", b"2\r\n{}XX0\r\n\r\n", 400),
        ("/pose/", "application/json", "", b"2\r\n{}\r\n0\r\nContent-Length: 4\r\n\r\n", 400),
        ("/pose/", "application/json", "", b"1\r\n \r\n" * 3000, 413),
        ("/pose/", "application/json", "gzip, ", b"2\r\n{}\r\n0\r\n\r\n", 501),
        ("/fields/", "multipart/form-data; boundary=a", "", b"-1\r\n", 400),
    ]
    key = program.key("admin")
    for path, content_type, coding, body, status in cases:
        head = (
            f"POST {path} HTTP/1.1\r\nHost: edge\r\nX-API-Key: {key}\r\n"
            f"Content-Type: {content_type}\r\nTransfer-Encoding: {coding}chunked\r\n\r\n"
        )
        with socket.create_connection(("127.0.0.1", program.port), timeout=30.0) as connection:
            connection.sendall(
                b"GET /healthz HTTP/1.1\r\nHost: edge\r\n\r\n" + head.encode() + body
            )
            answers = b"".join(iter(lambda: connection.recv(65_536), b""))
        statuses = re.findall(rb"HTTP/1\.1 (\d+)", answers)
        assert statuses == [b"200", b"%d" % status], (body[:40], answers)
        assert b'"request_id"' in answers


@pytest.mark.thorough
def test_a_refused_body_does_not_break_the_connection(program: Program) -> None:
    program.start()
    headers = {"X-API-Key": program.key("operator")}
    with requests.Session() as session:
        for _ in range(5):
            for more, status in (({}, 401), (headers, 413)):
                answer = session.post(
                    f"{program.url}/plans/",
                    data=b"x" * 2_000_000,
                    headers={"Content-Type": "application/json"} | more,
                    timeout=30.0,
                )
                assert answer.status_code == status
            answer = session.get(f"{program.url}/plans/", headers=headers, timeout=30.0)
            assert (answer.status_code, answer.json()) == (200, [])


@pytest.mark.thorough
def test_a_rotated_key_replaces_the_old_one(program: Program) -> None:
    program.start()
    old = program.key("farmer")
    rotation = program.spawn("keys", "rotate", "farmer")
    output, errors = rotation.communicate(timeout=PATIENCE_S)
    assert rotation.returncode == 0, errors
    assert program.key("farmer") != old
    assert program.key("farmer") not in output + errors
    deadline = time.monotonic() + 10.0
    while _status(program, old) != 401:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert _status(program, program.key("farmer")) == 200


def _status(program: Program, key: str) -> int:
    headers = {"X-API-Key": key}
    return requests.get(f"{program.url}/plans/", headers=headers, timeout=30.0).status_code


def test_an_invalid_setting_is_named(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "edge_server", "--state-dir", str(tmp_path)],
        env=os.environ | {"EDGE_PORT": "high"},
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert ended.returncode == 2
    assert "EDGE_PORT" in ended.stderr
