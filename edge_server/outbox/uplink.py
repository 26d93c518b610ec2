"""The uplink to the cloud as the relay sees it: records out, one reply each.

`HttpUplink` (`edge_server/uplinks/cloud_http.py`) is one; every other uplink returns its replies in
the same form, an HTTP status or the reason why there was no answer.

UplinkEndedError  this uplink sends nothing any more; the relay should start again
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

from edge_server.outbox.answers import Answer, Reply
from edge_server.outbox.queue import OutboxRecord


class BatchLimit(NamedTuple):
    """How many records and bytes may go in one `send`, at most."""

    records: int
    size_bytes: int


ONE_BY_ONE: Final = BatchLimit(1, 0)
MAXIMUM_BATCH: Final = BatchLimit(100, 256 * 1024)
"""No uplink gets more than this at a time, whatever its limit is."""

HELD_BACK: Final = Answer(424)
"""Reply to a record that was not sent because an earlier one of its stream has to go first."""


class UplinkEndedError(Exception):
    """This uplink sends nothing any more; a new one may."""


class Uplink(Protocol):
    """How records get to the cloud; all methods may be called by several threads at once."""

    def batch_limit(self) -> BatchLimit:
        """Return how much `send` takes at present; it always takes one record of any size."""

    def send(self, records: Sequence[OutboxRecord]) -> Sequence[Reply]:
        """Send records, those of one stream in their order, and wait: one reply each, in order.

        Never raises for what the network does. The relay has at most one `send` in flight per
        stream. After a record that has to be retried, later records of its stream in the same call
        are not sent but answered with `HELD_BACK`.

        Raises:
            UplinkEndedError: if it can send nothing any more.
        """

    def close(self) -> None:
        """Close the connections; a `send` in flight ends with a reason."""
