"""Waking those who wait."""

import threading
import time

from edge_server.services.bell import Bell


def test_a_ring_before_the_wait_is_not_missed() -> None:
    bell = Bell()
    seen = bell.rings
    bell.ring()
    begun = time.monotonic()
    bell.wait(seen, 30.0)
    assert time.monotonic() - begun < 15.0


def test_everybody_is_woken() -> None:
    bell = Bell()
    threads = [threading.Thread(target=bell.wait, args=(bell.rings, 30.0)) for _ in range(4)]
    for thread in threads:
        thread.start()
    bell.ring()
    for thread in threads:
        thread.join(15.0)
        assert not thread.is_alive()


def test_after_the_end_nobody_waits() -> None:
    bell = Bell()
    bell.close()
    begun = time.monotonic()
    bell.wait(bell.rings, 30.0)
    assert time.monotonic() - begun < 15.0
