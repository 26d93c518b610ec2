"""Collects STATUSTEXTs of a vehicle and joins the chunks of long ones.

A text of more than 50 bytes is sent in numbered chunks with a common id. Three dots stand for lost
chunks.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

KEPT: Final = 16
MAX_REPORTED: Final = 3
"""Texts in one report: the first is often the cause of the last."""
CHUNK_TIMEOUT_S: Final = 10.0
"""After this time the same id means another text."""
_GAP: Final = "..."


@dataclass(slots=True)
class _Text:
    time: float
    identifier: int  # 0: sent in one chunk
    chunks: dict[int, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        parts = [self.chunks.get(number, _GAP) for number in range(max(self.chunks) + 1)]
        return " ".join("".join(parts).split())


class StatusTexts:
    """The latest STATUSTEXTs of one vehicle with severity WARNING or worse."""

    def __init__(self) -> None:
        self._texts: deque[_Text] = deque(maxlen=KEPT)

    def receive(self, message: Message, now: float) -> None:
        """Handle a STATUSTEXT; other messages are ignored."""
        if message.get_type() != "STATUSTEXT" or message.severity > mavlink.MAV_SEVERITY_WARNING:
            return
        entry = self._open(message.id, now)
        if entry is None:
            entry = _Text(now, message.id)
            self._texts.append(entry)
        entry.chunks[message.chunk_seq] = message.text

    def since(self, time: float) -> list[str]:
        """Return the latest different texts since a time, in their order."""
        texts = [entry.text for entry in self._texts if entry.time >= time]
        different = dict.fromkeys(text for text in texts if text)
        return list(different)[-MAX_REPORTED:]

    def clear(self) -> None:
        """Forget everything."""
        self._texts.clear()

    def _open(self, identifier: int, now: float) -> _Text | None:
        if identifier == 0:
            return None
        return next(
            (
                entry
                for entry in self._texts
                if entry.identifier == identifier and now - entry.time < CHUNK_TIMEOUT_S
            ),
            None,
        )
