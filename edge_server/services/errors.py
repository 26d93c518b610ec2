"""Why a request cannot be met, apart from a faulty document (afarcloud.faults).

ServiceError
  +- NotFoundError      there is no such thing
  +- ConflictError      not in the state that it is in
  +- TooMuchError       a bounded queue is full; later it may be met
  +- KeyReusedError     the idempotency key has been used for something else
  +- ChangedError       it is not as the caller last saw it
  +- SpentError         the signature has been used for something else
  +- FullError          there is no room for it on the disk, or within its budget
"""

from afarcloud.faults import Fault


class ServiceError(Exception):
    """Base of this package's errors; `faults` name the fields where there are any."""

    def __init__(self, message: str, faults: tuple[Fault, ...] = ()) -> None:
        super().__init__(message)
        self.faults = faults


class NotFoundError(ServiceError):
    """There is no such thing."""


class ConflictError(ServiceError):
    """Not in the state that it is in."""


class TooMuchError(ServiceError):
    """A bounded queue is full."""


class KeyReusedError(ServiceError):
    """The idempotency key belongs to another request."""


class FullError(ServiceError):
    """There is no room for it."""


class ChangedError(ServiceError):
    """It is not as the caller last saw it."""


class SpentError(ServiceError):
    """The signature of the request has been used before."""
