"""What a database error means for the caller, on either engine.

SQLite reports an error name, PostgreSQL a SQLSTATE (its documentation, appendix A).
"""

import errno
from typing import Final

from sqlalchemy.exc import DBAPIError

_FULL: Final = ("53100", "53400")  # disk_full, configuration_limit_exceeded
_SQLITE_FULL: Final = ("SQLITE_FULL", "SQLITE_IOERR_WRITE", "SQLITE_IOERR_SHMSIZE")
_BUSY: Final = (
    "53200",  # out_of_memory, of the lock table too
    "53300",  # too_many_connections
    "55P03",  # lock_not_available: lock_timeout
    "57014",  # query_canceled: statement_timeout
)
_CONFLICT: Final = (
    "40001",  # serialization_failure
    "40P01",  # deadlock_detected
    "23505",  # unique_violation: another writer made the same row first
)
_LOST: Final = (
    "08",  # connection_exception
    "57P",  # operator_intervention: shut down, starting, dropped
    "25006",  # read_only_sql_transaction: a standby answers
    "25P03",  # idle_in_transaction_session_timeout
)


def is_full(error: DBAPIError) -> bool:
    """Whether the disk, or what the database may use of it, is full."""
    name = _sqlite_name(error)
    return name in _SQLITE_FULL or _state(error) in _FULL


def is_unwritable(error: DBAPIError) -> bool:
    """Whether nothing can be written: the disk is full, read-only or gone."""
    return is_full(error) or _sqlite_name(error).startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN"))


def is_full_disk(error: Exception) -> bool:
    """Whether an error of a database or of the system means that the disk is full."""
    if isinstance(error, DBAPIError):
        return is_full(error)
    if isinstance(error, OSError):
        return error.errno in {errno.ENOSPC, errno.EDQUOT}
    return getattr(error, "sqlite_errorname", None) in _SQLITE_FULL


def is_busy(error: DBAPIError) -> bool:
    """Whether other writers held the database for too long."""
    return _sqlite_name(error).startswith(("SQLITE_BUSY", "SQLITE_LOCKED")) or _state(
        error
    ).startswith((*_BUSY, *_CONFLICT))


def is_conflict(error: DBAPIError) -> bool:
    """Whether it is a conflict with another writer; nothing was done, and a retry may succeed."""
    return _state(error).startswith(_CONFLICT)


def is_lost(error: DBAPIError) -> bool:
    """Whether the database server cannot be reached, or has closed the connection."""
    if error.connection_invalidated or _state(error).startswith(_LOST):
        return True
    # A connection that could not be made has no state; neither has one that broke
    return _is_postgresql(error) and not _state(error) and _is_operational(error)


def _is_operational(error: DBAPIError) -> bool:
    names = {kind.__name__ for kind in type(error.orig).__mro__}
    return bool(names & {"OperationalError", "InterfaceError"})


def _is_postgresql(error: DBAPIError) -> bool:
    return type(error.orig).__module__.partition(".")[0] == "psycopg"


def _state(error: DBAPIError) -> str:
    return getattr(error.orig, "sqlstate", None) or ""


def _sqlite_name(error: DBAPIError) -> str:
    return getattr(error.orig, "sqlite_errorname", None) or ""
