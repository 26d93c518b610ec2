"""A document under conversion to the canonical form, and the sent path of each of its parts."""

from dataclasses import dataclass, field
from typing import Any

from afarcloud.faults import Fault


@dataclass(slots=True)
class Imported:
    """A document in canonical names, its faults, and the names in which it was sent."""

    document: Any
    faults: list[Fault] = field(default_factory=list)
    _sent: dict[str, str] = field(default_factory=dict)
    _unread: list[str] = field(default_factory=list)

    def refuse(self, sent_path: str, message: str, unread: str | None = None) -> None:
        """Note a fault at a place of the document as it was sent.

        `unread` is the canonical path that could not be filled for it; that it is missing is
        then no fault of its own.
        """
        self.faults.append(Fault(sent_path, message))
        if unread is not None:
            self._unread.append(unread)

    def is_unread(self, path: str) -> bool:
        """Whether a canonical path is missing because of a fault that is reported already."""
        return path in self._unread

    def rename(self, path: str, sent_path: str) -> None:
        """Note that the value at `path` was sent at `sent_path`."""
        self._sent[path] = self.sent_path(sent_path)

    def sent_path(self, path: str) -> str:
        """Return the path at which a part of the canonical document was sent."""
        head, tail = path, ""
        while head:
            if head in self._sent:
                return self._sent[head] + tail
            head, dot, last = head.rpartition(".")
            tail = f"{dot}{last}{tail}"
        return path
