"""Collects what a vehicle says to its operator, long sentences put together from their parts.

A text of more than 50 bytes comes in numbered chunks under a common id. Chunks may be lost; what
has arrived is better than nothing.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.dialect import Message, mavlink

KEPT: Final = 8


@dataclass(slots=True)
class _Sentence:
    time: float
    identifier: int  # 0: it came whole
    chunks: dict[int, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        return "".join(self.chunks[number] for number in sorted(self.chunks)).strip()


class StatusTexts:
    """The latest complaints of one vehicle: STATUSTEXT of warning severity or worse."""

    def __init__(self) -> None:
        self._sentences: deque[_Sentence] = deque(maxlen=KEPT)

    def receive(self, message: Message, now: float) -> None:
        """Take a STATUSTEXT; everything else is ignored."""
        if message.get_type() != "STATUSTEXT" or message.severity > mavlink.MAV_SEVERITY_WARNING:
            return
        sentence = self._open(message.id)
        if sentence is None:
            sentence = _Sentence(now, message.id)
            self._sentences.append(sentence)
        sentence.chunks[message.chunk_seq] = message.text

    def latest_since(self, time: float) -> str | None:
        """Give the latest complaint since a time, or None."""
        texts = (s.text for s in reversed(self._sentences) if s.time >= time)
        return next((text for text in texts if text), None)

    def clear(self) -> None:
        """Forget everything."""
        self._sentences.clear()

    def _open(self, identifier: int) -> _Sentence | None:
        if identifier == 0:
            return None
        return next((s for s in self._sentences if s.identifier == identifier), None)
