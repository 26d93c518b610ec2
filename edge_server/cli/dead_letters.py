"""`python -m edge_server dead-letters`: the API's operations on dead letters, on the terminal.

NoDatabaseError    there is no database, or one of another version
UnreadableError    the file with the corrected report cannot be used
"""

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from afarcloud import wire
from afarcloud.faults import DocumentError
from afarcloud.state import Report
from afarcloud.wire import Kind
from edge_server.config import Config
from edge_server.process import preparation
from edge_server.services.audit import shell_trail, use_trail
from edge_server.services.context import Context
from edge_server.services.errors import NotFoundError, ServiceError
from edge_server.services.reports import dead_letters
from edge_server.store.connection.database import to_json
from edge_server.store.migrate import is_ready

AUDIT = logging.getLogger("edge_server.audit")
_PAGE: Final = 500
_ACTIONS: Final[dict[str, Callable[[Context, int], Any]]] = {
    "retry": dead_letters.retry,
    "discard": dead_letters.discard,
}


class NoDatabaseError(Exception):
    """There is no database, or one of another version."""


class UnreadableError(Exception):
    """The file with the corrected report cannot be used."""


def run(
    config: Config, action: str, record_ids: Sequence[int], file: Path | None = None
) -> Iterator[str | ServiceError]:
    """Run an action; yields lines to print. A missing record is an error line; the rest continues.

    Raises:
        NoDatabaseError: if the state folder has no database of this version.
        UnreadableError: if the file with the corrected report cannot be used.
    """
    if not is_ready(config.database):
        raise NoDatabaseError(f"no database of this version: {config.database_name}")
    database = preparation.open_database(config)
    context = Context(config, database, time.time)
    subject = "/".join(["dead_letters", *(str(one) for one in record_ids)])
    trail = shell_trail(f"dead_letters.{action}", subject, time.time)
    try:
        with use_trail(trail):
            if file is not None:
                yield from _edited(context, record_ids[0], file)
            elif action in _OF_ALL:
                yield from _OF_ALL[action](context)
            else:
                yield from _each(context, action, record_ids)
    finally:
        database.close()


def _listed(context: Context) -> Iterator[str]:
    after_id = 0
    while letters := dead_letters.page(
        context, after_id=after_id, limit=_PAGE, kind=None, vehicle_id=None
    ):
        for letter in letters:
            yield (
                f"{letter['id']:8} {letter['kind']:16} vehicle {letter['vehicle_id']:<4} "
                f"{letter['attempts']} tries  {letter['reason']}"
            )
        after_id = letters[-1]["id"]


def _exported(context: Context) -> Iterator[str]:
    for letter in dead_letters.export(context, kind=None, vehicle_id=None):
        yield to_json(letter)


def _all_retried(context: Context) -> Iterator[str]:
    number = dead_letters.retry_all(context, kind=None, vehicle_id=None)
    AUDIT.info("shell: retried %d dead letters", number)
    yield f"retry-all: {number} done"


_OF_ALL: Final[dict[str, Callable[[Context], Iterator[str]]]] = {
    "list": _listed,
    "export": _exported,
    "retry-all": _all_retried,
}


def _edited(context: Context, record_id: int, file: Path) -> Iterator[str | ServiceError]:
    try:
        kind = Kind(dead_letters.find(context, record_id)["kind"])
        report = wire.read(kind, wire.parse_json(file.read_bytes()))
        if not isinstance(report, Report):
            raise UnreadableError(f"{file}: {kind.value} is not a kind of report")
        dead_letters.edit(context, record_id, report)
    except (DocumentError, OSError, ValueError) as error:
        raise UnreadableError(f"{file}: {error}") from None
    except ServiceError as error:
        yield error
    else:
        AUDIT.info("shell: corrected dead letter %d", record_id)
        yield f"edit: {record_id} done"


def _each(context: Context, action: str, record_ids: Sequence[int]) -> Iterator[str | ServiceError]:
    for record_id in record_ids:
        try:
            _ACTIONS[action](context, record_id)
        except NotFoundError as error:
            yield error
        else:
            AUDIT.info("shell: %s dead letter %d", action, record_id)
            yield f"{action}: {record_id} done"
