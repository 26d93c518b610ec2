"""The cloud's answer to a record over MQTT; pure.

The correlation data is the record's message_id; the payload is a JSON object with the status that
HTTP would have given, and perhaps the seconds after which to try again. A batch is answered with a
status for the whole, and the results of `edge_server/outbox/batches.py`:

    {"message_id": "01K9Z4T1W8F6Q2M3N5P7R9S0VX", "status": 503, "retry_after_s": 30}
    {"status": 200, "results": [{"message_id": "01K9...", "status": 200}, ...]}
"""

import json
from typing import Final

from edge_server.outbox.answers import Answer, Reply, Unreachable
from edge_server.outbox.batches import JSON

MAXIMUM_ANSWER_BYTES: Final = 65_536
_UNREADABLE: Final = Unreachable("an answer that is not one")


def read_answer(key: str, payload: bytes) -> Reply:
    """Read an answer; one that cannot be read, or is about another record, confirms nothing."""
    if len(payload) > MAXIMUM_ANSWER_BYTES:
        return Unreachable("an answer that is too long")
    try:
        answer = json.loads(payload)
    except (ValueError, RecursionError):
        return _UNREADABLE
    if not isinstance(answer, dict) or answer.get("message_id", key) != key:
        return _UNREADABLE
    status = answer.get("status")
    if isinstance(status, bool) or not isinstance(status, int) or not 100 <= status <= 599:
        return _UNREADABLE
    return Answer(status, JSON, payload, _seconds(answer.get("retry_after_s")))


def _seconds(value: object) -> float | None:
    """A wait that can be used; NaN fails the comparison."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
        return None
    return float(min(value, 1e9))
