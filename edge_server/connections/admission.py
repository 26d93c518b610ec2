"""Limits and timeouts of connections, and which one is closed when there are too many; pure.

A new connection is not refused while an old one is without a complete request: the oldest of those
is closed, then the one that has been idle for longest. So a client that sends its request at once
is served, however many others keep connections open and send nothing.

NoRoomError  all connections are being served
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Final, Generic, NamedTuple, Protocol, TypeVar

from edge_server.connections.framing import Lane

HEAD_S: Final = 10.0
"""Timeout from the start of a connection or request to the end of the head."""
BODY_S: Final = 60.0
"""Timeout from the end of the head to the end of the body."""
KEEP_ALIVE_S: Final = 75.0
"""Timeout from an answer to the first byte of the next request."""
LINGER_S: Final = 5.0
"""How long data of a refused client is still read, so that it can read the answer."""
LINGER_BYTES: Final = 64 * 1024 * 1024
"""How much of it; more than any picture, whose sender reads the answer after the last byte."""


class Reason(StrEnum):
    """Why a connection was closed before its request was served."""

    SLOW_HEAD = "slow_head"
    SLOW_BODY = "slow_body"
    ADDRESS_LIMIT = "address_limit"
    LIMIT = "limit"
    MEMORY = "memory"
    BUSY = "busy"
    """Its request was complete, and too many bytes of complete requests were waiting."""


class NoRoomError(Exception):
    """There are too many connections, and all of them are being served."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason)
        self.reason = reason


class Waiting(Protocol):
    """A connection that is not being served."""

    @property
    def network(self) -> str:
        """Address or network that it counts for."""

    @property
    def since(self) -> float:
        """Start of the wait, monotonic [s]."""

    @property
    def has_been_served(self) -> bool:
        """Whether it has received an answer and has sent nothing since."""

    @property
    def kept_bytes(self) -> int:
        """Size of the incomplete request."""


class Limits(NamedTuple):
    """Limits of all connections together."""

    connections: int
    per_address: int
    kept_bytes: int
    """Of incomplete requests; and as much again of complete ones without an answer."""


_SHARES: Final = {Lane.GENERAL: 0.75, Lane.BROKER: 0.125, Lane.URGENT: 0.125}
"""Share of `kept_bytes` for the complete requests of each lane."""
_C = TypeVar("_C", bound=Waiting)


class Eviction(NamedTuple, Generic[_C]):
    """A connection to close, and the reason."""

    connection: _C
    reason: Reason


def eviction(
    limits: Limits, open_by_network: Counter[str], waiting: Iterable[_C], newest: str
) -> Eviction[_C] | None:
    """Choose the connection to close for a new one of the network `newest`; None if there is room.

    Raises:
        NoRoomError: if all candidates are being served.
    """
    if open_by_network[newest] >= limits.per_address:
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
    """Choose the handshakes that advance now: each costs a signature, which delays all others.

    The newest of every network comes first, then the second newest, and so on; among those, the
    ones of networks with few. Many abandoned handshakes do not delay one that a client completes.
    """
    newest_first = sorted(ready, key=lambda one: -one.since)
    of_network = Counter(one.network for one in newest_first)
    so_far: Counter[str] = Counter()
    ranked = []
    for age, one in enumerate(newest_first):
        ranked.append((so_far[one.network], of_network[one.network], age, one))
        so_far[one.network] += 1
    return [one for *_, one in sorted(ranked, key=lambda each: each[:3])[:most]]


def may_dispatch(
    limits: Limits, dispatched_bytes: Mapping[Lane, int], lane: Lane, request_bytes: int
) -> bool:
    """Whether a complete request may wait for a thread of its lane, by its size.

    `dispatched_bytes` counts the complete requests without an answer. An empty lane accepts a
    request of any size.
    """
    already = dispatched_bytes[lane]
    return not already or already + request_bytes <= _SHARES[lane] * limits.kept_bytes


def over_memory_limit(limits: Limits, waiting: Iterable[_C]) -> list[Eviction[_C]]:
    """Choose the connections to close because of too many bytes: the oldest requests."""
    holding = sorted((one for one in waiting if one.kept_bytes), key=lambda one: one.since)
    excess = sum(one.kept_bytes for one in holding) - limits.kept_bytes
    found = []
    for one in holding:
        if excess <= 0:
            break
        excess -= one.kept_bytes
        found.append(Eviction(one, Reason.MEMORY))
    return found
