"""Why a request fails, apart from a faulty document (afarcloud.faults).

ServiceError
  +- NotFoundError      there is no such object
  +- ConflictError      not possible in the present state
  +- TooMuchError       a bounded queue is full; a later request may succeed
  +- KeyReusedError     the idempotency key has been used for something else
  +- ChangedError       the object has changed since the caller read it
  +- SpentError         the signature has been used for something else
  +- TooLargeError      it is larger than what is kept
  +- FullError          there is no room for it on the disk, or within its budget
  +- UnavailableError   what it is about cannot be read or written now
"""

from typing import NamedTuple

from afarcloud.faults import Fault


class ServiceError(Exception):
    """Base of this package's errors; `faults` name the fields where there are any."""

    def __init__(self, message: str, faults: tuple[Fault, ...] = ()) -> None:
        super().__init__(message)
        self.faults = faults


class NotFoundError(ServiceError):
    """There is no such object."""


class ConflictError(ServiceError):
    """Not possible in the present state."""


class TooMuchError(ServiceError):
    """A bounded queue is full."""


class KeyReusedError(ServiceError):
    """The idempotency key belongs to another request."""


class TooLargeError(ServiceError):
    """It is larger than what is kept."""


class FullError(ServiceError):
    """There is no room for it."""


class UnavailableError(ServiceError):
    """What the request is about cannot be read or written now."""


class LastChange(NamedTuple):
    """Who changed an object last, when, and by which route, such as `plans.put`."""

    by: str
    at: str
    action: str


class ChangedError(ServiceError):
    """The object has changed since the caller read it; `last` is known for plans and fields."""

    last: LastChange | None = None


class SpentError(ServiceError):
    """The signature of the request has been used before."""
