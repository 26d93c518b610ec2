"""Collects what a vehicle says to its operator, long sentences put together from their parts.

A text of more than 50 bytes comes in numbered chunks under a common id. Chunks may be lost; what
has arrived is better than nothing, with three dots for what has not.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

KEPT: Final = 16
TOLD: Final = 3
"""Complaints that go into one report: the first is often the reason of the last."""
SENTENCE_WITHIN_S: Final = 10.0
"""After which the same id means another sentence."""
_GAP: Final = "..."


@dataclass(slots=True)
class _Sentence:
    time: float
    identifier: int  # 0: it came whole
    chunks: dict[int, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        parts = [self.chunks.get(number, _GAP) for number in range(max(self.chunks) + 1)]
        return " ".join("".join(parts).split())


class StatusTexts:
    """The latest complaints of one vehicle: STATUSTEXT of warning severity or worse."""

    def __init__(self) -> None:
        self._sentences: deque[_Sentence] = deque(maxlen=KEPT)

    def receive(self, message: Message, now: float) -> None:
        """Take a STATUSTEXT; everything else is ignored."""
        if message.get_type() != "STATUSTEXT" or message.severity > mavlink.MAV_SEVERITY_WARNING:
            return
        sentence = self._open(message.id, now)
        if sentence is None:
            sentence = _Sentence(now, message.id)
            self._sentences.append(sentence)
        sentence.chunks[message.chunk_seq] = message.text

    def since(self, time: float) -> list[str]:
        """Give the latest different complaints since a time, in their order."""
        texts = [sentence.text for sentence in self._sentences if sentence.time >= time]
        different = dict.fromkeys(text for text in texts if text)
        return list(different)[-TOLD:]

    def clear(self) -> None:
        """Forget everything."""
        self._sentences.clear()

    def _open(self, identifier: int, now: float) -> _Sentence | None:
        if identifier == 0:
            return None
        return next(
            (
                sentence
                for sentence in self._sentences
                if sentence.identifier == identifier and now - sentence.time < SENTENCE_WITHIN_S
            ),
            None,
        )
