"""Posts as the broker leaves them, numbered so that order shows."""

from typing import Any

from mavlink_broker.edge.outbox import Post, Urgency


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
