"""What the link has refused."""

from typing import NamedTuple


class RefusedFrames(NamedTuple):
    """Frames that were not listened to, since the start. Written by mavlink on change, at 1 Hz."""

    time_us: int  # [us]
    malformed: int = 0  # [-] Bytes that are no whole frame with a right checksum
    unsigned: int = 0  # [-] On a link that asks for a signature
    bad_signature: int = 0  # [-] Not made with the link's key
    replayed: int = 0  # [-] Correctly signed, but not newer than the last frame received
    ahead: int = 0  # [-] Correctly signed, but too far ahead of the vehicle's clock
    version_1: int = 0  # [-] Frames of the old version, on a link that asks for a signature
    flood: int = 0  # [-] Datagrams beyond what a step can bear
