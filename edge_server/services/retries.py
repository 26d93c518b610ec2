"""A service whose transaction conflicts with another one is retried.

PostgreSQL ends a transaction that conflicts with another one: two that wait for each other, or two
that make the same thing (one Idempotency-Key twice at a time). Nothing of it has happened then, and
the retry sees what the other transaction has committed. SQLite has one writer and no conflicts.

An order to stop is retried too when the disk has just become full, once room was made for it.
"""

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, Final, ParamSpec, TypeVar

from sqlalchemy.exc import DBAPIError

from edge_server.services.context import Context
from edge_server.store.connection.failures import is_conflict, is_full

ATTEMPTS: Final = 5
_P = ParamSpec("_P")
_R = TypeVar("_R")


def retry_on_conflict(
    service: Callable[Concatenate[Context, _P], _R],
) -> Callable[Concatenate[Context, _P], _R]:
    """Retry a service while it meets conflicts; all its effects are in its transactions."""

    @wraps(service)
    def attempt(context: Context, /, *arguments: _P.args, **options: _P.kwargs) -> _R:
        for _ in range(ATTEMPTS - 1):
            try:
                return service(context, *arguments, **options)
            except DBAPIError as error:
                if not is_conflict(error):
                    raise
        return service(context, *arguments, **options)

    return attempt


def retry_with_room(
    service: Callable[Concatenate[Context, _P], _R],
) -> Callable[Concatenate[Context, _P], _R]:
    """Retry a service once if the disk is full and there is a ballast to release for it.

    Housekeeping would do so within a second, which is too late for an order to stop.
    """

    @wraps(service)
    def attempt(context: Context, /, *arguments: _P.args, **options: _P.kwargs) -> _R:
        try:
            return service(context, *arguments, **options)
        except DBAPIError as error:
            if not (is_full(error) and context.space.release_ballast()):
                raise
        return service(context, *arguments, **options)

    return attempt
