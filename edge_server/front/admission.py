"""Which connections stay when there are too many, and until when each of them may; pure.

A new connection is never refused while an old one waits: the oldest that has not yet sent a whole
request goes, then the one that has been idle for longest. So whoever sends a request at once is
served, however many others hold connections open and say nothing.

NoRoomError  all connections are being served
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Final, Generic, NamedTuple, Protocol, TypeVar

from edge_server.front.framing import Lane

HEAD_S: Final = 10.0
"""From a connection's beginning, or a request's first byte, to the end of the head."""
BODY_S: Final = 60.0
"""From the end of the head to the end of the body."""
KEEP_ALIVE_S: Final = 75.0
"""From an answer to the next request's first byte."""
LINGER_S: Final = 5.0
"""So long what a refused client still sends is read, so that it can read why."""
LINGER_BYTES: Final = 64 * 1024 * 1024
"""More than a picture of any camera, whose sender looks for an answer when all of it is sent."""


class Reason(StrEnum):
    """Why a connection was closed before its request was served."""

    SLOW_HEAD = "slow_head"
    SLOW_BODY = "slow_body"
    ADDRESS_LIMIT = "address_limit"
    LIMIT = "limit"
    MEMORY = "memory"
    BUSY = "busy"
    """Its request was whole, and too many bytes of whole requests waited for their answers."""


class NoRoomError(Exception):
    """There are too many connections, and all of them are being served."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason)
        self.reason = reason


class Waiting(Protocol):
    """A connection as far as it matters here; it is not being served."""

    @property
    def network(self) -> str:
        """The address, or the network, that it counts for."""

    @property
    def since(self) -> float:
        """Since when it has been waited for, monotonic [s]."""

    @property
    def has_been_served(self) -> bool:
        """Whether it has had an answer and has sent nothing since."""

    @property
    def kept_bytes(self) -> int:
        """How much of a request is kept for it."""


class Limits(NamedTuple):
    """How much is held at once."""

    connections: int
    of_an_address: int
    kept_bytes: int
    """Of unfinished requests; and once more of whole ones that have no answer yet."""


_SHARES: Final = {Lane.GENERAL: 0.75, Lane.BROKER: 0.125, Lane.URGENT: 0.125}
"""Of `kept_bytes`, for the whole requests of each lane: no lane uses up another one's part."""
_C = TypeVar("_C", bound=Waiting)


class Eviction(NamedTuple, Generic[_C]):
    """A connection that goes, and why."""

    connection: _C
    reason: Reason


def eviction(
    limits: Limits, open_by_network: Counter[str], waiting: Iterable[_C], newest: str
) -> Eviction[_C] | None:
    """Choose which connection goes so that one more of the network `newest` fits, if one must.

    Raises:
        NoRoomError: if all that could make room are being served.
    """
    if open_by_network[newest] >= limits.of_an_address:
        waiting = [one for one in waiting if one.network == newest]
        reason = Reason.ADDRESS_LIMIT
    elif open_by_network.total() >= limits.connections:
        reason = Reason.LIMIT
    else:
        return None
    oldest = min(waiting, key=lambda one: (one.has_been_served, one.since), default=None)
    if oldest is None:
        raise NoRoomError(reason)
    return Eviction(oldest, reason)


def next_handshakes(ready: Iterable[_C], most: int) -> list[_C]:
    """Choose whose handshakes go on in this turn: each costs a signature, and holds up all others.

    The newest of every network goes first, then the second newest, and so on; of those the ones of
    networks with few. Many beginnings that nobody goes on with must not stand before the one that
    somebody does.
    """
    newest_first = sorted(ready, key=lambda one: -one.since)
    of_network = Counter(one.network for one in newest_first)
    so_far: Counter[str] = Counter()
    ranked = []
    for age, one in enumerate(newest_first):
        ranked.append((so_far[one.network], of_network[one.network], age, one))
        so_far[one.network] += 1
    return [one for *_, one in sorted(ranked, key=lambda each: each[:3])[:most]]


def may_hand_over(
    limits: Limits, handed_over_bytes: Mapping[Lane, int], lane: Lane, request_bytes: int
) -> bool:
    """Whether a whole request may wait for a thread of its lane, by its size.

    `handed_over_bytes` has the whole requests without an answer. A lane without any takes one of
    any size.
    """
    already = handed_over_bytes[lane]
    return not already or already + request_bytes <= _SHARES[lane] * limits.kept_bytes


def too_much_kept(limits: Limits, waiting: Iterable[_C]) -> list[Eviction[_C]]:
    """Choose which connections go because too many bytes are kept: the oldest requests."""
    holding = sorted((one for one in waiting if one.kept_bytes), key=lambda one: one.since)
    excess = sum(one.kept_bytes for one in holding) - limits.kept_bytes
    found = []
    for one in holding:
        if excess <= 0:
            break
        excess -= one.kept_bytes
        found.append(Eviction(one, Reason.MEMORY))
    return found
