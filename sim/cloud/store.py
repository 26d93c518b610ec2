"""What the cloud holds: a journal on disk, an index in memory.

A record is kept under its message id (the sender's Idempotency-Key). The same message again is
recognised and changes nothing; the same id with another body is a conflict. The journal is one
JSON line per record, so a cloud that was killed comes back with all it had confirmed.
"""

import hashlib
import json
import threading
from collections.abc import Iterator, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

KINDS = (
    "pose",
    "battery",
    "image",
    "observation",
    "state_vector",
    "mission_report",
    "alarm",
    "gap",
)
"""What a farm sends; a gap names records that it could not keep."""


class Outcome(Enum):
    """Result of a message."""

    STORED = "stored"
    DUPLICATE = "duplicate"
    CONFLICT = "conflict"


class Message(NamedTuple):
    """One record as a farm sends it."""

    kind: str
    message_id: str
    body: dict[str, Any]


class Record(NamedTuple):
    """One message as it arrived."""

    number: int  # [-] Order of arrival, from 1
    kind: str
    message_id: str
    received_at: float  # [s] Since 1970
    body: dict[str, Any]

    def as_json(self) -> dict[str, Any]:
        """Give the record as the API shows it."""
        return self._asdict()


def _digest(kind: str, body: dict[str, Any]) -> str:
    text = json.dumps([kind, body], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """All records, in order of arrival; safe to call from several threads."""

    def __init__(self, journal: Path | None) -> None:
        self._lock = threading.Lock()
        self._records: list[Record] = []
        self._digests: dict[str, str] = {}
        self._journal = journal
        if journal is not None:
            journal.parent.mkdir(parents=True, exist_ok=True)
            for record in _read_journal(journal):
                self._remember(record)

    def add(self, kind: str, message_id: str, body: dict[str, Any], now: float) -> Outcome:
        """Keep a message, unless it is already here.

        Raises:
            OSError: if the journal cannot be written; the message is then not kept.
        """
        return self.add_all([Message(kind, message_id, body)], now)[0]

    def add_all(self, messages: Sequence[Message], now: float) -> list[Outcome]:
        """Keep messages in their order, those that are not here yet; all of them or none.

        Raises:
            OSError: if the journal cannot be written; none of them is then kept.
        """
        with self._lock:
            outcomes: list[Outcome] = []
            new: list[Record] = []
            digests: dict[str, str] = {}
            for kind, message_id, body in messages:
                digest = _digest(kind, body)
                known = self._digests.get(message_id) or digests.get(message_id)
                if known is not None:
                    outcomes.append(Outcome.DUPLICATE if known == digest else Outcome.CONFLICT)
                    continue
                digests[message_id] = digest
                number = len(self._records) + len(new) + 1
                new.append(Record(number, kind, message_id, now, body))
                outcomes.append(Outcome.STORED)
            self._append(new)
            self._records += new
            self._digests |= digests
            return outcomes

    def records(self, kind: str | None = None, after: int = 0) -> list[Record]:
        """Give the records after number `after`, of one kind or of all."""
        with self._lock:
            return [r for r in self._records[after:] if kind is None or r.kind == kind]

    def counts(self) -> dict[str, int]:
        """Give the number of records of each kind."""
        with self._lock:
            return {kind: sum(r.kind == kind for r in self._records) for kind in KINDS}

    def _append(self, records: Sequence[Record]) -> None:
        if self._journal is None or not records:
            return
        lines = [json.dumps(record.as_json(), separators=(",", ":")) for record in records]
        with self._journal.open("a", encoding="utf-8") as journal:
            journal.write("\n".join(lines) + "\n")

    def _remember(self, record: Record) -> None:
        self._records.append(record)
        self._digests[record.message_id] = _digest(record.kind, record.body)


def _read_journal(journal: Path) -> Iterator[Record]:
    """Read the journal; a last line cut off by a kill was never confirmed and is removed."""
    if not journal.exists():
        return
    kept = 0
    with journal.open("rb") as lines:
        for line in lines:
            try:
                record = Record(**json.loads(line))
            except (ValueError, TypeError):
                break
            if not line.endswith(b"\n"):
                break
            kept += len(line)
            yield record
    with journal.open("rb+") as lines:
        lines.truncate(kept)
