"""The error boundary of each rate group: an error costs its module one run, not the flight.

A module that raises has published what it published before; the others go on with that, and it
runs again when it is due. A navigator that raises every time publishes no setpoint, so position
control descends after half a second. The vehicle is not armed again before a restart, since
nobody knows what the error has left.
"""

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from uav_firmware.msg.status import InternalErrors, Severity, StatusText
from uav_firmware.topics import Topics

INTERNAL_ERROR: Final = "internal error"
"""In each line that names one."""
REPEAT_US: Final = 10_000_000  # [us] Between two reports of a module that goes on raising


@dataclass(slots=True)
class _Reported:
    count: int = 0  # Errors so far
    due_us: int = 0  # [us] When the next of them is reported


class ModuleErrors:
    """Reports the errors of all modules: to the operator, the log and the arming checks."""

    def __init__(
        self,
        topics: Topics,
        *,
        write_line: Callable[[int, str], None],
        time_us: Callable[[], int],
    ) -> None:
        self._topics = topics
        self._write_line = write_line
        self._time_us = time_us
        self._modules: dict[str, _Reported] = {}

    def report(self, module: str, error: Exception) -> None:
        """Report an error, the first one of a module with its traceback."""
        now_us = self._time_us()
        reported = self._modules.get(module)
        if reported is None:
            reported = self._modules[module] = _Reported()
            for text in traceback.format_exception(error):
                for line in text.splitlines():
                    self._write_line(now_us, line)
            self._topics.internal_errors.publish(InternalErrors(now_us, tuple(self._modules)))
        reported.count += 1
        if now_us < reported.due_us:
            return
        reported.due_us = now_us + REPEAT_US
        self._write_line(now_us, f"{module}: {INTERNAL_ERROR} {reported.count}: {error!r}")
        text = f"Internal error in {module}"
        self._topics.status_text.publish(StatusText(now_us, Severity.CRITICAL, text))


def end_flight(_module: str, error: Exception) -> None:
    """End the flight with an error, where nobody is harmed: in tests and simulations.

    Raises:
        Exception: the error.
    """
    raise error
