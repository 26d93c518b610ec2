"""How fast one client gets the pieces of a log: pure, one request or piece at a time.

Linux holds some 270 datagrams of LOG_DATA for a program that is late (`net.core.rmem_default`,
212,992 bytes). A client that asks for at most 256 pieces at a time loses none however fast they
come, as the broker does. One that asks for more, often for the whole log, has a pace:

    it asks for what follows, all before being sent  a quarter more
    it asks again for more than 3 % of what it got   half, at most once a second
    it asks for nothing                              slowly back to the first pace, not beyond it

Some pieces are lost on any link, many only where they come too fast. MAVProxy asks again only once
nothing has come for 0.7 s: its silence within a log does not prove that more would be received.
"""

from typing import Final

from uav_firmware.modules.mavlink.wire.token_bucket import TokenBucket

FIRST_PER_S: Final = 500
"""[1/s] Half of what MAVProxy reads (930), and 0.55 Mbit/s with the headers of UDP and IP."""
LEAST_PER_S: Final = 100
MOST_PER_S: Final = 2_000
BURST: Final = 16
"""Pieces at once: with 125 Hz, the rate of the module, just enough for `MOST_PER_S`."""
UNPACED: Final = 256
"""Pieces that fit into the receiver's buffer."""
FEW_LOST: Final = 16
"""Pieces: 3 % of the 512 that QGroundControl asks for at a time."""
LOST_SHARE: Final = 0.03
"""Of the pieces sent since the last change."""
RISE_PER_S: Final = 10
"""[1/s] In each second without a change: from half the first pace back in 25 s."""
SETTLING_US: Final = 1_000_000
"""Requests in this time after a change are for what was sent before it."""


class LogPace:
    """The pace of one client."""

    def __init__(self) -> None:
        self._per_s = FIRST_PER_S
        self._bucket = TokenBucket(FIRST_PER_S, BURST)
        self._is_paced = False
        self._sent = 0  # Pieces since the last change by a request
        self._again = 0  # Those asked for again
        self._settled_us = 0
        self._rises_us = 0

    @property
    def per_s(self) -> int:
        """The pace [1/s]."""
        return self._per_s

    @property
    def ready(self) -> bool:
        """Whether the next piece may be sent."""
        return not self._is_paced or self._bucket.ready

    def request(self, now_us: int, *, pending: int, again: int, follows: bool) -> None:
        """Learn from a request.

        Args:
            now_us: Time since boot [us].
            pending: Pieces that are to be sent, with those of this request.
            again: Pieces of this request that were sent before.
            follows: It begins where the former ones ended, and those have been sent.
        """
        self._is_paced = pending > UNPACED
        if follows:
            self._change(self._per_s + self._per_s // 4)
        elif now_us >= self._settled_us:
            self._again += again
            if self._again > max(FEW_LOST, LOST_SHARE * self._sent):
                self._change(self._per_s // 2)
                self._settled_us = self._rises_us = now_us + SETTLING_US

    def refill(self, now_us: int) -> None:
        """Let time pass, up to `now_us` [us]."""
        self._bucket.refill(now_us)
        if self._per_s < FIRST_PER_S and now_us >= self._rises_us:
            self._rises_us = now_us + SETTLING_US
            self._set(min(self._per_s + RISE_PER_S, FIRST_PER_S))

    def spend(self) -> None:
        """Count a piece that is sent."""
        self._sent += 1
        if self._is_paced:
            self._bucket.spend()

    def _change(self, per_s: int) -> None:
        self._set(max(LEAST_PER_S, min(per_s, MOST_PER_S)))
        self._sent = self._again = 0

    def _set(self, per_s: int) -> None:
        self._per_s = self._bucket.per_second = per_s
