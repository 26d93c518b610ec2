"""Internal errors are shown with their vehicle while they are news."""

from mavlink_broker.internal_errors import SHOWN_FOR_S, Faults


def test_a_warning_ends_some_time_after_the_newest_error_and_the_count_goes_on() -> None:
    faults = Faults()
    assert faults.warning("vehicle 1", 0.0) is None
    faults.note("vehicle 1", ValueError("one"), 100.0)
    faults.note("vehicle 1", ValueError("two"), 200.0)
    assert faults.warning("vehicle 2", 200.0) is None
    shown = faults.warning("vehicle 1", 200.0 + SHOWN_FOR_S - 1.0)
    assert shown == "internal error of the broker: ValueError: two (2 so far)"
    assert faults.warning("vehicle 1", 200.0 + SHOWN_FOR_S) is None
    faults.note("vehicle 1", ValueError("three"), 5000.0)
    assert "three (3 so far)" in str(faults.warning("vehicle 1", 5000.0))
