"""SDLOG_MODE and the state machine of the log file."""

import itertools

import pytest

from uav_firmware.modules.logger.states import (
    TRANSITIONS,
    Logging,
    LoggingEvent,
    next_state,
    wanted,
)


@pytest.mark.parametrize(
    ("mode", "before", "in_flight", "after", "second_flight"),
    [
        (-1, False, False, False, False),
        (0, False, True, False, True),
        (1, True, True, False, True),
        (2, True, True, True, True),
    ],
)
def test_each_mode_logs_at_its_times(
    mode: int, before: bool, in_flight: bool, after: bool, second_flight: bool
) -> None:
    assert wanted(mode, armed=False, flown=False) is before
    assert wanted(mode, armed=True, flown=False) is in_flight
    assert wanted(mode, armed=False, flown=True) is after
    assert wanted(mode, armed=True, flown=True) is second_flight


def test_an_event_without_a_transition_changes_nothing() -> None:
    for state, event in itertools.product(Logging, LoggingEvent):
        if (state, event) not in TRANSITIONS:
            assert next_state(state, event) is state


def test_every_state_becomes_idle_when_no_log_is_wanted() -> None:
    for state in Logging:
        once = next_state(state, LoggingEvent.UNWANTED)
        assert next_state(once, LoggingEvent.UNWANTED) is Logging.IDLE


def test_a_failed_log_is_not_retried_in_the_same_flight() -> None:
    failed = next_state(Logging.RECORDING, LoggingEvent.STORAGE_ERROR)
    assert next_state(failed, LoggingEvent.WANTED) is failed
