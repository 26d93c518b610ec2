"""A service that another writer has beaten is done again.

PostgreSQL ends a transaction that cannot go on beside another one: two that wait for each other,
or two that make the same thing (one Idempotency-Key twice at a time). Nothing of it has happened
then, and a second run sees what the first writer has left. SQLite's one writer is never beaten.
"""

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, Final, ParamSpec, TypeVar

from sqlalchemy.exc import DBAPIError

from edge_server.services.context import Context
from edge_server.store.failures import is_beaten

ATTEMPTS: Final = 5
_P = ParamSpec("_P")
_R = TypeVar("_R")


def repeatable(
    service: Callable[Concatenate[Context, _P], _R],
) -> Callable[Concatenate[Context, _P], _R]:
    """Run a service again while it is beaten; all its effects are in its transactions."""

    @wraps(service)
    def attempt(context: Context, /, *arguments: _P.args, **options: _P.kwargs) -> _R:
        for _ in range(ATTEMPTS - 1):
            try:
                return service(context, *arguments, **options)
            except DBAPIError as error:
                if not is_beaten(error):
                    raise
        return service(context, *arguments, **options)

    return attempt
