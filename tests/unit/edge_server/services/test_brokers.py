"""Long polls are woken by new work."""

import threading
import time

from edge_server.services.brokers import WorkSignal


def test_a_signal_before_the_wait_is_not_missed() -> None:
    signal = WorkSignal()
    seen = signal.count
    signal.notify()
    begun = time.monotonic()
    signal.wait(seen, 30.0)
    assert time.monotonic() - begun < 15.0


def test_everybody_is_woken() -> None:
    signal = WorkSignal()
    threads = [threading.Thread(target=signal.wait, args=(signal.count, 30.0)) for _ in range(4)]
    for thread in threads:
        thread.start()
    signal.notify()
    for thread in threads:
        thread.join(15.0)
        assert not thread.is_alive()


def test_after_the_end_nobody_waits() -> None:
    signal = WorkSignal()
    signal.close()
    begun = time.monotonic()
    signal.wait(signal.count, 30.0)
    assert time.monotonic() - begun < 15.0
