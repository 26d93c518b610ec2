"""Replies that are kept for clients that repeat a request because the reply was lost.

Only requests that change something are kept: to read twice does no harm, and what is read
again is newer. A request is a repetition when all of it is the same, not only its number:
clients that start anew count from 0 again.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from uav_firmware.modules.mavlink.files.codec import Opcode, Reply, Request

KEEP_US: Final = 10_000_000
"""Clients repeat every 0.05 to 1 s, and of a bad link many replies are lost in turn."""
KEEP_RESET_US: Final = 300_000
"""A client that starts begins with a reset, which must then be carried out again."""
MAX_KEPT: Final = 32
_OPENING: Final = frozenset({Opcode.OPEN_FILE_RO, Opcode.CREATE_FILE, Opcode.OPEN_FILE_WO})
_WITHIN_SESSION: Final = frozenset({Opcode.WRITE_FILE, Opcode.TERMINATE_SESSION})
_KEEP_US: Final[Mapping[int, int]] = {
    Opcode.TERMINATE_SESSION: KEEP_US,
    Opcode.RESET_SESSIONS: KEEP_RESET_US,
    Opcode.OPEN_FILE_RO: KEEP_US,
    Opcode.CREATE_FILE: KEEP_US,
    Opcode.WRITE_FILE: KEEP_US,
    Opcode.REMOVE_FILE: KEEP_US,
    Opcode.CREATE_DIRECTORY: KEEP_US,
    Opcode.REMOVE_DIRECTORY: KEEP_US,
    Opcode.OPEN_FILE_WO: KEEP_US,
    Opcode.TRUNCATE_FILE: KEEP_US,
    Opcode.RENAME: KEEP_US,
}


class _Kept(NamedTuple):
    reply: Reply
    until_us: int


class ReplyMemory:
    """The replies given to one client."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Request, _Kept] = OrderedDict()

    def find(self, request: Request, now_us: int) -> Reply | None:
        """The reply that a request got before, if it is a repetition."""
        kept = self._kept.get(request)
        return kept.reply if kept is not None and now_us < kept.until_us else None

    def keep(self, request: Request, reply: Reply, now_us: int) -> None:
        """Keep a reply, if it is one that must not be made twice."""
        duration_us = _KEEP_US.get(request.opcode)
        if duration_us is None:
            return
        self._kept[request] = _Kept(reply, now_us + duration_us)
        self._kept.move_to_end(request)
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)

    def session_opened(self, session: int) -> None:
        """Forget what was said to a former session of the same number."""
        self._forget(lambda request, _: request.session == session and _is_within(request))

    def session_closed(self, session: int) -> None:
        """Forget that a session was opened, so that the same request opens another one."""
        self._forget(lambda request, kept: kept.reply.session == session and _opens(request))

    def clear(self) -> None:
        """Forget everything: the client begins anew."""
        self._kept.clear()

    def _forget(self, condition: Callable[[Request, _Kept], bool]) -> None:
        for request, kept in list(self._kept.items()):
            if condition(request, kept):
                del self._kept[request]


def _is_within(request: Request) -> bool:
    return request.opcode in _WITHIN_SESSION


def _opens(request: Request) -> bool:
    return request.opcode in _OPENING
