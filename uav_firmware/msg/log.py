"""The flight log as a stream to a peer."""

from typing import NamedTuple


class LogStreamRequest(NamedTuple):
    """Whether the log is to be streamed. Written by mavlink on a command; read by logger."""

    number: int  # [-] Of the stream, each begun anew with its definitions; 0 none


class LogStreamChunk(NamedTuple):
    """Whole ULog messages in turn. Written by logger at 2 Hz; read by mavlink."""

    number: int  # [-] Of the stream that it belongs to
    time_us: int  # [us] At its beginning
    is_definition: bool  # Header and definitions, without which the rest cannot be read
    data: bytes
