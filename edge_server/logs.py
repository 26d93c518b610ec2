"""Log lines: text on a terminal, one JSON object per line elsewhere.

Every line of a request has its id. Secrets are removed from the finished line, whatever its origin:
an access key keeps its prefix, by which an operator finds it; credentials, signatures and query
strings are removed.
"""

import logging
import re
import sys
import threading
from contextvars import ContextVar
from datetime import UTC, datetime
from types import TracebackType
from typing import Any, Final, TextIO

from pythonjsonlogger.json import JsonFormatter

from farm_flight_bridge.log_stream import UnblockedStreamHandler, standard_error

REQUEST_ID: Final[ContextVar[str | None]] = ContextVar("request_id", default=None)
"""Id of the request that this thread serves."""

_RENAMED: Final = {"asctime": "time", "levelname": "level", "name": "logger"}
_FIELDS: Final = "%(asctime)s %(levelname)s %(name)s %(process)d %(message)s"
_QUIET: Final = ("alembic", "urllib3", "requests")
_JSON_ONLY: Final = "edge_server.access"
"""The access log is written as JSON only."""
_QUOTE: Final = r"(?:\\?[\"'])?"
_SECRETS: Final = (
    # A header with its value, as in a request, a dict or JSON within JSON
    (
        re.compile(
            rf"((?:proxy-)?authorization|x-api-key|x-jws-signature|cookie)({_QUOTE}\s*[:=,]\s*"
            rf"(?:b(?=[\"']))?{_QUOTE})(?:(?:bearer|basic|digest|token)\s+)?[^\s\"'\\,;)\]}}]+",
            re.IGNORECASE,
        ),
        r"\1\2***",
    ),
    (re.compile(r"\b(bearer|basic)\s+[\w.~+/=-]{8,}", re.IGNORECASE), r"\1 ***"),
    (re.compile(r"\b(fm_[0-9a-f]{1,8}_)[0-9A-Za-z]+"), r"\1***"),
    (re.compile(r"\bey[\w-]+\.[\w-]*\.[\w-]+"), "***"),  # A JWS; its header is JSON: {" is eyJ
    (re.compile(r"(://[^\s/:@\"']*):[^\s/@\"']+@"), r"\1:***@"),
    (re.compile(r"((?:\b\w+://|/)[^\s?\"'\\]*)\?[^\s\"'\\]+"), r"\1?***"),
)


def configure(level: str, form: str, stream: TextIO | None = None) -> None:
    """Configure logging of the process; `form` is auto, json or text; default stream: stderr."""
    target = stream or standard_error()
    as_json = form == "json" or (form == "auto" and not target.isatty())
    handler = UnblockedStreamHandler(target)
    handler.addFilter(_add_request_id)
    if not as_json:
        handler.addFilter(lambda record: record.name != _JSON_ONLY)
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


def redact(line: str) -> str:
    """Remove secrets from a line."""
    for pattern, replacement in _SECRETS:
        line = pattern.sub(replacement, line)
    return line


class _JsonLine(JsonFormatter):
    """Time in UTC to the millisecond, level, logger, process, message, then extra fields."""

    def __init__(self) -> None:
        super().__init__(_FIELDS, rename_fields=_RENAMED)

    def formatTime(self, record: logging.LogRecord, datefmt: str | None = None) -> str:  # noqa: ARG002, N802  # the base class's
        """Write the time as RFC 3339."""
        moment = datetime.fromtimestamp(record.created, UTC)
        return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")

    def format(self, record: logging.LogRecord) -> str:
        """Write one line."""
        return redact(super().format(record))


class _TextLine(logging.Formatter):
    """A line of text; the request's id at its end."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s edge %(levelname)s %(message)s")

    def format(self, record: logging.LogRecord) -> str:
        """Write a line."""
        line = super().format(record)
        identifier: Any = getattr(record, "request_id", None)
        return redact(f"{line} [{identifier}]" if identifier else line)


def _on_exception(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Log an exception that ends the process."""
    logging.getLogger("edge_server").critical("the program failed", exc_info=(kind, error, trace))


def _on_thread_exception(failed: threading.ExceptHookArgs) -> None:
    if failed.exc_value is None or issubclass(failed.exc_type, SystemExit):
        return
    logging.getLogger("edge_server").critical(
        "a thread failed", exc_info=(failed.exc_type, failed.exc_value, failed.exc_traceback)
    )
