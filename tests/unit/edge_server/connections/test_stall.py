"""A loop that stood still does not take what it reads afterwards for new."""

from edge_server.connections.stall import PAUSE_S, UNREAD_S, StallMonitor


class Turns:
    """A loop whose clock the test moves."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.monitor = StallMonitor(lambda: self.now_s)

    def go_on(self, seconds: float, waited_s: float = 0.0) -> None:
        self.now_s += seconds
        self.monitor.note(waited_s)


def test_a_request_of_a_running_loop_has_just_arrived() -> None:
    loop = Turns()
    loop.go_on(0.2)
    loop.now_s += 0.1
    assert loop.monitor.arrived_s() == loop.now_s


def test_a_wait_for_requests_is_no_pause() -> None:
    loop = Turns()
    loop.go_on(5.0, waited_s=5.0)
    assert loop.monitor.arrived_s() == loop.now_s


def test_what_is_read_behind_a_pause_may_have_arrived_at_its_beginning() -> None:
    loop = Turns()
    loop.go_on(60.0, waited_s=0.5)
    assert loop.monitor.arrived_s() == 100.0
    loop.go_on(UNREAD_S / 2.0, waited_s=UNREAD_S)
    assert loop.monitor.arrived_s() == 100.0


def test_a_pause_in_the_middle_of_reading_counts_too() -> None:
    loop = Turns()
    loop.go_on(0.1)
    loop.now_s += 2.0 * PAUSE_S
    assert loop.monitor.arrived_s() == 100.1


def test_later_requests_have_just_arrived_again() -> None:
    loop = Turns()
    loop.go_on(60.0)
    loop.go_on(UNREAD_S, waited_s=UNREAD_S)
    assert loop.monitor.arrived_s() == loop.now_s
