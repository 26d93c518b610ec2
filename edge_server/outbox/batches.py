"""Many records in one request: NDJSON out, a result per record back; pure.

    {"kind": "pose", "record": {"sequence_number": 7, ..., "message_id": "01K9..."}}
    {"kind": "alarm", "record": {...}}

    {"results": [{"message_id": "01K9...", "status": 200}, {"message_id": ..., "status": 422}]}

A result is what the record alone would have been answered, `retry_after_s` and `outcome` included.
The cloud takes the records of one stream in their order: after one that it wants again, it answers
the later ones of that stream in the batch with 424.
"""

import json
from collections.abc import Sequence
from typing import Any, Final

from edge_server.outbox.answers import Answer, Meaning, Reply, judge
from edge_server.outbox.queue import Parcel

MEDIA_TYPE: Final = "application/x-ndjson"
JSON: Final = "application/json"


def write(parcels: Sequence[Parcel]) -> bytes:
    """Write the body of a batch."""
    lines = [f'{{"kind":"{p.stream.kind}","record":{p.payload}}}\n' for p in parcels]
    return "".join(lines).encode()


def read(reply: Reply, parcels: Sequence[Parcel]) -> list[Reply] | None:
    """Give each record its reply; None when a good answer does not fit what was sent.

    An answer that is no confirmation speaks for all of them.
    """
    if not isinstance(reply, Answer) or judge(reply).meaning is not Meaning.CONFIRMED:
        return [reply] * len(parcels)
    results = _results(reply.body)
    if results is None or len(results) != len(parcels):
        return None
    replies = [_reply(result, parcel) for result, parcel in zip(results, parcels, strict=True)]
    found = [one for one in replies if one is not None]
    return found if len(found) == len(parcels) else None


def _results(body: bytes) -> list[Any] | None:
    document = json.loads(body) if body.strip() else None
    results = document.get("results") if isinstance(document, dict) else None
    return results if isinstance(results, list) else None


def _reply(result: Any, parcel: Parcel) -> Reply | None:
    if not isinstance(result, dict) or result.get("message_id") != parcel.message_id:
        return None
    status = result.get("status")
    if isinstance(status, bool) or not isinstance(status, int) or not 200 <= status <= 599:
        return None
    body = json.dumps({"outcome": result.get("outcome")}).encode()
    return Answer(status, JSON, body, _seconds(result.get("retry_after_s")))


def _seconds(wish: object) -> float | None:
    """A wait that can be used; NaN fails the comparison."""
    if isinstance(wish, bool) or not isinstance(wish, int | float) or not 0 <= wish <= 1e9:
        return None
    return float(wish)
