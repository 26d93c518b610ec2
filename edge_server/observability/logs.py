"""Log lines: sentences on a terminal, one JSON object per line elsewhere.

Every line that is written while a request is served carries its id. What must not be in a log
(keys, above all) is taken out of the finished line, wherever it came from: whoever knows what a
secret looks like says so with `redact_with`.
"""

import logging
import sys
import threading
from collections.abc import Callable
from contextvars import ContextVar
from datetime import UTC, datetime
from types import TracebackType
from typing import Any, Final, TextIO

from pythonjsonlogger.json import JsonFormatter

FORMATS: Final = ("auto", "json", "text")
REQUEST_ID: Final[ContextVar[str | None]] = ContextVar("request_id", default=None)
"""The request that is being served in this thread."""

Redactor = Callable[[str], str]
_redactors: Final[list[Redactor]] = []
_RENAMED: Final = {"asctime": "time", "levelname": "level", "name": "logger"}
_FIELDS: Final = "%(asctime)s %(levelname)s %(name)s %(process)d %(message)s"
_QUIET: Final = ("alembic", "urllib3", "requests")
_FOR_PROGRAMS: Final = "edge_server.access"
"""One line for every request is nothing that people read."""


def redact_with(redactor: Redactor) -> None:
    """Pass every finished line through this function before it is written."""
    if redactor not in _redactors:
        _redactors.append(redactor)


def configure(level: str, form: str, stream: TextIO | None = None) -> None:
    """Set up the process's log; `form` is one of FORMATS, the stream is stderr."""
    target = stream or sys.stderr
    as_json = form == "json" or (form == "auto" and not target.isatty())
    handler = logging.StreamHandler(target)
    handler.addFilter(_add_request_id)
    if not as_json:
        handler.addFilter(lambda record: record.name != _FOR_PROGRAMS)
    handler.setFormatter(_JsonLine() if as_json else _TextLine())
    root = logging.getLogger()
    for old in root.handlers[:]:
        root.removeHandler(old)
    root.addHandler(handler)
    root.setLevel(level)
    for name in _QUIET:
        logging.getLogger(name).setLevel(logging.WARNING)
    logging.captureWarnings(capture=True)
    sys.excepthook = _on_exception
    threading.excepthook = _on_thread_exception


def _add_request_id(record: logging.LogRecord) -> bool:
    if (identifier := REQUEST_ID.get()) is not None:
        record.request_id = identifier
    return True


def _redacted(line: str) -> str:
    for redactor in _redactors:
        line = redactor(line)
    return line


class _JsonLine(JsonFormatter):
    """Time in UTC to the millisecond, level, logger, process, message, then what the line adds."""

    def __init__(self) -> None:
        super().__init__(_FIELDS, rename_fields=_RENAMED)

    def formatTime(self, record: logging.LogRecord, datefmt: str | None = None) -> str:  # noqa: ARG002, N802  # the base class's
        """Write the time as RFC 3339."""
        moment = datetime.fromtimestamp(record.created, UTC)
        return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")

    def format(self, record: logging.LogRecord) -> str:
        """Write one line."""
        return _redacted(super().format(record))


class _TextLine(logging.Formatter):
    """One sentence for people; the request's id at its end."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s edge %(levelname)s %(message)s")

    def format(self, record: logging.LogRecord) -> str:
        """Write a line."""
        line = super().format(record)
        identifier: Any = getattr(record, "request_id", None)
        return _redacted(f"{line} [{identifier}]" if identifier else line)


def _on_exception(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Tell of an exception that ends the process as of anything else."""
    if issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    logging.getLogger("edge_server").critical("the program fails", exc_info=(kind, error, trace))


def _on_thread_exception(failed: threading.ExceptHookArgs) -> None:
    if failed.exc_value is None or issubclass(failed.exc_type, SystemExit):
        return
    logging.getLogger("edge_server").critical(
        "a thread fails", exc_info=(failed.exc_type, failed.exc_value, failed.exc_traceback)
    )
