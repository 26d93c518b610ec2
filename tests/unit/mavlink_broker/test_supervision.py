"""No thread of the broker ends unseen."""

import ast
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import mavlink_broker
from mavlink_broker.supervision import (
    WARNING_DURATION_S,
    InternalErrors,
    SupervisedThread,
    ThreadFailureHook,
)

WITHIN_S = 30.0
MAKERS = {"supervision.py", "links/transports.py"}
"""Who may make a thread: the supervisor, and look-ups that end by themselves and are made anew."""


@pytest.fixture
def hook() -> Iterator[Callable[..., object]]:
    genuine = threading.excepthook
    yield genuine
    threading.excepthook = genuine


@pytest.mark.parametrize("failure", [OSError("no such file"), ValueError("x"), MemoryError()])
def test_a_failed_thread_is_logged_and_restarted(
    failure: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    calls: list[int] = []
    done = threading.Event()

    def work() -> None:
        calls.append(1)
        if len(calls) < 4:
            raise failure
        done.set()

    thread = SupervisedThread("test", work, threading.Event(), first_pause_s=0.001)
    with caplog.at_level(logging.ERROR):
        thread.start()
        assert done.wait(WITHIN_S)
        thread.join(WITHIN_S)
    assert not thread.is_alive
    assert thread.failures == 3
    assert caplog.text.count("Traceback") == 3
    assert "thread test has failed" in caplog.text


def test_a_thread_that_fails_repeatedly_ends_at_the_stop() -> None:
    stopping, failed = threading.Event(), threading.Event()

    def work() -> None:
        failed.set()
        raise ValueError("always")

    thread = SupervisedThread("test", work, stopping, first_pause_s=1000.0)
    thread.start()
    assert failed.wait(WITHIN_S)
    stopping.set()
    thread.join(WITHIN_S)
    assert not thread.is_alive


@pytest.mark.usefixtures("hook")
def test_a_thread_without_supervision_ends_the_program_with_a_log_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    woken = threading.Event()
    alarm = ThreadFailureHook(woken.set)

    def work() -> None:
        raise RuntimeError("not supervised")

    with caplog.at_level(logging.CRITICAL):
        thread = threading.Thread(target=work, name="lonely")
        thread.start()
        thread.join()
    assert alarm.has_fired
    assert woken.is_set()
    assert "thread lonely has failed" in caplog.text


def test_every_thread_of_the_broker_is_supervised() -> None:
    folder = Path(mavlink_broker.__file__).parent
    makers = {
        str(path.relative_to(folder))
        for path in folder.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("threading.Thread")
    }
    assert makers == MAKERS


def test_a_warning_ends_after_the_latest_error_and_the_count_continues() -> None:
    internal_errors = InternalErrors()
    assert internal_errors.warning("vehicle 1", 0.0) is None
    internal_errors.record("vehicle 1", ValueError("one"), 100.0)
    internal_errors.record("vehicle 1", ValueError("two"), 200.0)
    assert internal_errors.warning("vehicle 2", 200.0) is None
    shown = internal_errors.warning("vehicle 1", 200.0 + WARNING_DURATION_S - 1.0)
    assert shown == "internal error of the broker: ValueError: two (2 so far)"
    assert internal_errors.warning("vehicle 1", 200.0 + WARNING_DURATION_S) is None
    internal_errors.record("vehicle 1", ValueError("three"), 5000.0)
    assert "three (3 so far)" in str(internal_errors.warning("vehicle 1", 5000.0))
