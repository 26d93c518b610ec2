"""Posts as the broker leaves them, numbered so that order shows, and the spool with them."""

from pathlib import Path
from typing import Any

from mavlink_broker.database import Database, read_rows
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.edge.spool import Spool


def post(lane: str = "mission_report", number: int = 0, **changed: Any) -> Post:
    """A report of vehicle 1 that needs no registration."""
    fields: dict[str, Any] = {
        "method": "POST",
        "path": f"/{lane}/",
        "body": {"sequence_number": number, "vehicle_id": changed.get("vehicle_id", 1)},
        "vehicle_id": 1,
        "lane": lane,
        "urgency": Urgency.REPORT,
        "idempotency_key": f"{lane}-{number}",
        "needs_registration": False,
    }
    return Post(**(fields | changed))


def picture(number: int = 0, size_bytes: int = 1000, **changed: Any) -> Post:
    """A picture of so many bytes."""
    body = {"sequence_number": number, "frame": "A" * size_bytes}
    return post("image", number, body=body, urgency=Urgency.PICTURE, **changed)


def state_vector(number: int = 0) -> Post:
    """What may be lost."""
    return post("state_vector", number, urgency=Urgency.TELEMETRY, may_be_dropped=True)


def numbers(posts: list[Post]) -> list[int]:
    """Which posts these are."""
    return [one.body["sequence_number"] for one in posts]


def spool_in(folder: Path, max_bytes: int = 1 << 20) -> Spool:
    """Open the spool of a state folder."""
    return Spool(Database(folder), max_bytes=max_bytes)


def posts_on_disk(folder: Path) -> list[bytes]:
    """The posts of a state folder as they are stored, in order, also beside a running broker."""
    return [data for (data,) in read_rows(folder, "SELECT data FROM posts ORDER BY number")]
