"""`python -m edge_server dead-letters`: the list, retry and discard of the API, at the shell.

NoDatabaseError  there is no database, or one of another version
"""

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from edge_server import preparation
from edge_server.config import Config
from edge_server.services import dead_letters
from edge_server.services.context import Context
from edge_server.services.errors import NotFoundError
from edge_server.store.migrate import is_ready

AUDIT = logging.getLogger("edge_server.audit")
_PAGE: Final = 500
_ACTIONS: Final[dict[str, Callable[[Context, int], Any]]] = {
    "retry": dead_letters.retry,
    "discard": dead_letters.discard,
}


class NoDatabaseError(Exception):
    """There is no database, or one of another version."""


def run(config: Config, action: str, record_ids: Sequence[int]) -> Iterator[str | NotFoundError]:
    """Do it; yields what is to be told. A record that is missing is told, and the rest goes on.

    Raises:
        NoDatabaseError: if the state folder has no database of this version.
    """
    if not is_ready(config.database):
        raise NoDatabaseError(f"no database of this version: {config.database_name}")
    database = preparation.open_database(config)
    context = Context(config, database, time.time)
    try:
        yield from _listed(context) if action == "list" else _each(context, action, record_ids)
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


def _each(
    context: Context, action: str, record_ids: Sequence[int]
) -> Iterator[str | NotFoundError]:
    for record_id in record_ids:
        try:
            _ACTIONS[action](context, record_id)
        except NotFoundError as error:
            yield error
        else:
            AUDIT.info("shell: %s dead letter %d", action, record_id)
            yield f"{action}: {record_id} done"
