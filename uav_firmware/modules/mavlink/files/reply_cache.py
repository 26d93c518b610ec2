"""Cache of replies for clients that repeat a request because the reply was lost.

Only replies to requests that change something are cached. A request is a repetition when all of it
is identical, not only its sequence number, because restarted clients count from 0 again.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from uav_firmware.modules.mavlink.files.codec import Opcode, Reply, Request

LIFETIME_US: Final = 10_000_000
"""Clients repeat every 0.05 to 1 s, and a bad link loses many replies in sequence."""
RESET_LIFETIME_US: Final = 300_000
"""Shorter, because a restarted client begins with a reset, which must be executed again."""
MAX_REPLIES: Final = 32
_OPENING: Final = frozenset({Opcode.OPEN_FILE_RO, Opcode.CREATE_FILE, Opcode.OPEN_FILE_WO})
_WITHIN_SESSION: Final = frozenset({Opcode.WRITE_FILE, Opcode.TERMINATE_SESSION})
_LIFETIMES_US: Final[Mapping[int, int]] = {
    Opcode.TERMINATE_SESSION: LIFETIME_US,
    Opcode.RESET_SESSIONS: RESET_LIFETIME_US,
    Opcode.OPEN_FILE_RO: LIFETIME_US,
    Opcode.CREATE_FILE: LIFETIME_US,
    Opcode.WRITE_FILE: LIFETIME_US,
    Opcode.REMOVE_FILE: LIFETIME_US,
    Opcode.CREATE_DIRECTORY: LIFETIME_US,
    Opcode.REMOVE_DIRECTORY: LIFETIME_US,
    Opcode.OPEN_FILE_WO: LIFETIME_US,
    Opcode.TRUNCATE_FILE: LIFETIME_US,
    Opcode.RENAME: LIFETIME_US,
}


class _Cached(NamedTuple):
    reply: Reply
    until_us: int


class ReplyCache:
    """Replies to one client."""

    def __init__(self) -> None:
        self._cached: OrderedDict[Request, _Cached] = OrderedDict()

    def find(self, request: Request, now_us: int) -> Reply | None:
        """Return the cached reply to a repetition, or None."""
        kept = self._cached.get(request)
        return kept.reply if kept is not None and now_us < kept.until_us else None

    def store(self, request: Request, reply: Reply, now_us: int) -> None:
        """Cache a reply if its request must not be executed twice."""
        duration_us = _LIFETIMES_US.get(request.opcode)
        if duration_us is None:
            return
        self._cached[request] = _Cached(reply, now_us + duration_us)
        self._cached.move_to_end(request)
        if len(self._cached) > MAX_REPLIES:
            self._cached.popitem(last=False)

    def session_opened(self, session: int) -> None:
        """Drop the replies to a previous session with the same number."""
        self._drop(lambda request, _: request.session == session and _is_within(request))

    def session_closed(self, session: int) -> None:
        """Drop the reply to the opening, so that the same request opens a new session."""
        self._drop(lambda request, kept: kept.reply.session == session and _opens(request))

    def clear(self) -> None:
        """Drop all replies."""
        self._cached.clear()

    def _drop(self, condition: Callable[[Request, _Cached], bool]) -> None:
        for request, kept in list(self._cached.items()):
            if condition(request, kept):
                del self._cached[request]


def _is_within(request: Request) -> bool:
    return request.opcode in _WITHIN_SESSION


def _opens(request: Request) -> bool:
    return request.opcode in _OPENING
