"""Typed topics by which modules exchange messages. Single-threaded, no copies, no callbacks."""

from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Topic(Generic[T]):
    """The newest message of one type, and how many have been published.

    A reader keeps the last `count` it acted on and compares: a new value has a new count.
    """

    __slots__ = ("count", "value")

    def __init__(self) -> None:
        self.value: T | None = None
        self.count: int = 0

    def publish(self, value: T) -> None:
        """Replace the value."""
        self.value = value
        self.count += 1


class Queue(Generic[T]):
    """Messages of which one reader receives each: commands, acknowledgements, texts.

    Bounded: when full, the oldest is dropped and counted, so that a reader that has stopped
    does not fill the memory.
    """

    __slots__ = ("_items", "dropped")

    def __init__(self, limit: int = 256) -> None:
        self._items: deque[T] = deque(maxlen=limit)
        self.dropped: int = 0

    def publish(self, item: T) -> None:
        """Append an item."""
        if len(self._items) == self._items.maxlen:
            self.dropped += 1
        self._items.append(item)

    def __len__(self) -> int:
        """How many items wait."""
        return len(self._items)

    def pop(self) -> T | None:
        """Remove the oldest item and return it; None when nothing waits."""
        return self._items.popleft() if self._items else None

    def drain(self) -> list[T]:
        """Remove all waiting items and return them, oldest first."""
        if not self._items:  # Mostly: queues are read far more often than written
            return []
        items = list(self._items)
        self._items.clear()
        return items


class Fork(Queue[T]):
    """A queue whose items also reach a second and a third reader."""

    __slots__ = ("second", "third")

    def __init__(self, limit: int = 256) -> None:
        super().__init__(limit)
        self.second: Queue[T] = Queue(limit)
        self.third: Queue[T] = Queue(limit)

    def publish(self, item: T) -> None:
        """Append an item for each reader."""
        super().publish(item)
        self.second.publish(item)
        self.third.publish(item)
