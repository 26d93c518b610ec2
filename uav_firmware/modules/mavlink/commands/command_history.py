"""Recent frames and answers, so that a repeated command is executed once.

A command arrives twice for three reasons. The network duplicates a datagram: the frames are
identical, with the same sequence number. The sender has not received the answer and repeats a
COMMAND_LONG with a higher confirmation. Or the operator repeats the command. In the first two
cases the earlier answer is sent again. The third cannot be distinguished from a COMMAND_INT that
is repeated for lack of an answer; it is executed, because ignoring an order is worse.

A repetition that comes behind another command of that number is no repetition of what was answered:
pause, continue and pause again within seconds, where the first datagram of the last was lost.

A simple sender may not count its frames: it sends two different commands with the same sequence
number. From then on identical frames of that sender are separate commands.
"""

import math
from collections import OrderedDict
from typing import Any, Final, NamedTuple, TypeVar

from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import Message

K = TypeVar("K")

ANSWER_LIFETIME_US: Final = 5_000_000
"""Time for which an answer is stored for a sender that has not received it."""
FRAME_LIFETIME_US: Final = 2_000_000
"""Largest delay of a duplicate; the sequence number wraps after 256 frames."""
_MAX_ANSWERS: Final = 32
_MAX_FRAMES: Final = 64
_MAX_SENDERS: Final = 32
_SEQUENCES: Final = 256
_BEYOND_FLOAT32: Final = 1e300


class _Answered(NamedTuple):
    """The answer to a command."""

    result: int  # MAV_RESULT
    time_us: int


class _Newest(NamedTuple):
    """Newest command of one number from one identity."""

    command: Command
    sequence: int
    sender: Sender
    time_us: int

    def is_replaced_by(
        self, command: Command, message: Message, sender: Sender, now_us: int
    ) -> bool:
        """Whether a declared repetition is of another command, and was sent behind this one."""
        if self.command == command:
            return False
        if self.sender != sender or now_us - self.time_us > FRAME_LIFETIME_US:
            return True  # Two stations have the same ids where neither has been given its own
        sequence: int = message.get_seq()
        return (sequence - self.sequence) % _SEQUENCES < _SEQUENCES // 2


class _Count(NamedTuple):
    """Newest sequence number of a sender."""

    sequence: int  # Of its newest command
    frame: bytes
    counts: bool  # False once two different frames had the same number


def comparable(command: Command) -> Command:
    """The command with NaN replaced, because NaN does not equal itself."""
    p1, p2, p3, p4, p5, p6, p7 = (
        _BEYOND_FLOAT32 if math.isnan(parameter) else parameter for parameter in command.parameters
    )
    return command._replace(parameters=(p1, p2, p3, p4, p5, p6, p7))


def _keep_newest(memory: OrderedDict[K, Any], key: K, most: int) -> None:
    """Make `key` the newest entry; drop the oldest beyond the limit."""
    memory.move_to_end(key)
    if len(memory) > most:
        memory.popitem(last=False)


class CommandHistory:
    """Frames and answers of the last seconds."""

    def __init__(self) -> None:
        self._answers: OrderedDict[tuple[tuple[int, int], Command], _Answered] = OrderedDict()
        self._frames: OrderedDict[bytes, int] = OrderedDict()
        self._counts: OrderedDict[tuple[int, int], _Count] = OrderedDict()
        self._newest: OrderedDict[tuple[tuple[int, int], int], _Newest] = OrderedDict()

    def is_repetition(
        self, command: Command, message: Message, sender: Sender, now_us: int
    ) -> bool:
        """Whether a command is a declared repetition or a duplicated datagram."""
        frame = bytes(message.get_msgbuf())
        counts = self._counting(message.get_seq(), frame, sender)
        seen_us = self._frames.get(frame)
        if counts and seen_us is not None and now_us - seen_us <= FRAME_LIFETIME_US:
            return True
        self._frames[frame] = now_us
        _keep_newest(self._frames, frame, _MAX_FRAMES)
        declared = message.get_type() == "COMMAND_LONG" and message.confirmation > 0
        key, same = (sender.identity, command.number), comparable(command)
        newest = self._newest.get(key)
        if declared and (
            newest is None or not newest.is_replaced_by(same, message, sender, now_us)
        ):
            return True
        self._newest[key] = _Newest(same, message.get_seq(), sender, now_us)
        _keep_newest(self._newest, key, _MAX_ANSWERS)
        return False

    def _counting(self, sequence: int, frame: bytes, sender: Sender) -> bool:
        """Store a frame; return whether its sender counts its frames."""
        known = self._counts.get(sender.identity)
        counts = known is None or known.counts
        if known is not None and known.sequence == sequence and known.frame != frame:
            counts = False
        self._counts[sender.identity] = _Count(sequence, frame, counts)
        _keep_newest(self._counts, sender.identity, _MAX_SENDERS)
        return counts

    def store_answer(self, command: Command, sender: Sender, result: int, now_us: int) -> None:
        """Store the final answer to a command."""
        key = (sender.identity, comparable(command))
        self._answers[key] = _Answered(result, now_us)
        _keep_newest(self._answers, key, _MAX_ANSWERS)

    def answer(self, command: Command, sender: Sender, now_us: int) -> int | None:
        """The recent MAV_RESULT of the same command of the same sender, or None."""
        known = self._answers.get((sender.identity, comparable(command)))
        if known is None or now_us - known.time_us > ANSWER_LIFETIME_US:
            return None
        return known.result
