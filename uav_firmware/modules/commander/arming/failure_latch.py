"""Failures of former flights that the next one must not begin with: a latch, pure.

A failure that showed in flight and hides on the ground, such as a gyroscope that recovers once
nothing moves, is remembered until a restart or until the operator acknowledges it by setting
COM_FAIL_ACK. Failed motors and crashes are latched where they are detected, in failure_detector.
"""

from collections.abc import Iterable

from uav_firmware.modules.commander.failsafe.causes import ROWS, Cause


class FailureLatch:
    """Sentences of what has failed, in the order of its appearance."""

    def __init__(self) -> None:
        self.texts: tuple[str, ...] = ()

    def note(self, causes: Iterable[Cause]) -> None:
        """Remember those causes of a failsafe that outlast the flight."""
        for cause in causes:
            row = ROWS[cause]
            if row.latched and row.text not in self.texts:
                self.texts = (*self.texts, row.text)

    def clear(self) -> None:
        """Forget all: the operator has acknowledged them."""
        self.texts = ()
