"""Internal errors are shown with their vehicle for a while."""

from mavlink_broker.supervision import WARNING_DURATION_S, InternalErrors


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
