"""What must hold of records: each is stored once, and reaches the cloud once and in order."""

import json
from collections import Counter, defaultdict
from collections.abc import Iterator

from dst.actors.operator_person import Operator
from dst.world.world import World
from edge_server.outbox.queue import Stream
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post


class DeliveryLaws:
    """Watches what the edge server acknowledges to the broker, and what the cloud receives."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self._acknowledged: set[tuple[str, int]] = set()  # Kind and number of each record
        self._ids_of_key: dict[str, set[int]] = defaultdict(set)

    def taken(self, post: Post, answer: Answer) -> None:
        """Note a record that the edge server has acknowledged."""
        if post.method != "POST" or answer.status_code >= 300 or post.idempotency_key is None:
            return
        number = json.loads(answer.body).get("id")
        if number is not None:
            self._acknowledged.add((post.path.strip("/"), number))
            self._ids_of_key[post.idempotency_key].add(number)

    def stored_twice(self) -> Iterator[str]:
        """Give the requests that were repeated, and stored more than once."""
        for key, numbers in self._ids_of_key.items():
            if len(numbers) > 1:
                yield f"key {key} is stored as {sorted(numbers)}"
        if self._operator.double_ids:
            yield "; ".join(self._operator.double_ids)

    def missing(self) -> list[str]:
        """Give how many records of each kind the cloud still lacks."""
        received = self._world.cloud.received.values()
        missing = self._acknowledged - {(one.stream.kind, one.record_id) for one in received}
        kinds = Counter(kind for kind, _ in missing if kind != "state_vector")
        return [f"the cloud lacks {count} of {kind}" for kind, count in kinds.items()]

    def delivered_wrongly(self) -> Iterator[str]:
        """Give what the cloud has under two ids, and what came out of the order of the outbox."""
        ids: dict[tuple[str, str], set[str]] = defaultdict(set)
        for message_id, record in self._world.cloud.received.items():
            content = json.loads(record.payload)
            content.pop("message_id", None)
            ids[record.stream.kind, json.dumps(content, sort_keys=True)].add(message_id)
        for (kind, text), found in ids.items():
            if len(found) > 1:
                yield f"the cloud has one {kind} under {len(found)} ids: {text}"
        newest: dict[Stream, int] = {}
        for record in self._world.cloud.received.values():
            before = newest.get(record.stream, 0)
            if record.outbox_id < before:
                yield f"the cloud has {record.stream} {record.outbox_id} after {before}"
            newest[record.stream] = record.outbox_id
