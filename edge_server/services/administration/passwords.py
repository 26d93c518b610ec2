"""Passwords: hashed with Argon2id (RFC 9106), a bounded number of them at a time.

A hash takes 64 MiB and some tens of milliseconds. More sign-ins than `AT_ONCE` wait their turn; one
that waits too long is refused, so that guessing cannot take memory and processor from the rest.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from edge_server.services.errors import TooMuchError

AT_ONCE: Final = 2
TURN_WITHIN_S: Final = 5.0
_HASHER: Final = PasswordHasher()  # The library's defaults are RFC 9106's for little memory
_turns: Final = threading.BoundedSemaphore(AT_ONCE)
_NOBODYS: Final = (
    "$argon2id$v=19$m=65536,t=3,p=4$ZmFybS1mbGlnaHQtYnJpZGdl"
    "$AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA"
)
"""Well-formed, and the hash of no password: an unknown name takes as long as a wrong password."""


def hashed(password: str) -> str:
    """Hash a password; the result holds its parameters and salt.

    Raises:
        TooMuchError: if too many are hashed at the moment.
    """
    with _turn():
        return _HASHER.hash(password)


def is_right(password: str, expected: str | None) -> bool:
    """Compare a password with its hash, in the same time when there is none.

    Raises:
        TooMuchError: if too many are compared at the moment.
    """
    with _turn():
        try:
            return _HASHER.verify(expected or _NOBODYS, password) and expected is not None
        except (VerificationError, InvalidHashError):
            return False


@contextmanager
def _turn() -> Iterator[None]:
    if not _turns.acquire(timeout=TURN_WITHIN_S):
        raise TooMuchError("too many people sign in at the moment; try again")
    try:
        yield
    finally:
        _turns.release()
