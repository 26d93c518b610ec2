"""Restricted keys: some of their role's routes only, and resources of some vehicles only.

OWASP API1 (broken object level authorization): each route that names a vehicle in its path, query
or body checks it here; a test covers all of them.
"""

from collections.abc import Callable, Iterable
from typing import Any, Final

from flask import g
from werkzeug.exceptions import Forbidden

from edge_server.services.context import Precondition
from edge_server.services.reports.listing import Listing
from edge_server.store.rows.keys import Scope, StoredKey

SAFE_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_REPORTING: Final = frozenset({"bulk.create", "vehicles.put"})
Page = Callable[[int | None], list[dict[str, Any]]]


def covers(scopes: frozenset[Scope], endpoint: str, method: str) -> bool:
    """Whether scopes allow a request; a key without scopes is not restricted by them."""
    return not scopes or any(_covers(scope, endpoint, method) for scope in scopes)


def _covers(scope: Scope, endpoint: str, method: str) -> bool:
    if scope is Scope.METRICS:
        return endpoint.startswith("metrics.")
    if scope is Scope.REPORT:
        return (
            endpoint in _REPORTING
            or endpoint.startswith("vehicle_logs.")
            or (endpoint.startswith("telemetry.") and endpoint.endswith("_create"))
        )
    return method in SAFE_METHODS


def is_restricted() -> bool:
    """Whether the caller's key has fewer permissions than its role."""
    return bool(_key().scopes) or _key().vehicle_ids is not None


def vehicles() -> frozenset[int] | None:
    """Give the vehicles that the caller's key is restricted to; None: all."""
    return _key().vehicle_ids


def permits(vehicle_ids: Iterable[int | None]) -> bool:
    """Whether the caller's key permits all of these vehicles; None means every vehicle."""
    known = vehicles()
    return known is None or all(vehicle_id in known for vehicle_id in vehicle_ids)


def check(*vehicle_ids: int | None) -> None:
    """Raise 403 unless the caller's key permits these vehicles; None means every vehicle."""
    if not permits(vehicle_ids):
        raise Forbidden(refusal(vehicle_ids))


def refusal(vehicle_ids: Iterable[int | None]) -> str:
    """Make the message that names a vehicle that the key does not permit."""
    known = vehicles() or frozenset()
    others = sorted({number for number in vehicle_ids if number is not None} - known)
    named = f"vehicle {others[0]}" if others else "every vehicle"
    return f"this key does not permit {named}"


def vehicles_of(shown: dict[str, Any]) -> list[int | None]:
    """Give the vehicles of a representation: a report, a vehicle, a plan."""
    if "missions" in shown:
        return [mission["vehicle_id"] for mission in shown["missions"]]
    return [shown.get("vehicle_id")]


def permitted(shown: dict[str, Any]) -> dict[str, Any]:
    """Return a representation if the caller's key permits its vehicles; raises 403."""
    check(*vehicles_of(shown))
    return shown


def check_resource(find: Callable[[], dict[str, Any]]) -> None:
    """Check a resource before a change, if the caller's key is restricted; raises 403."""
    if vehicles() is not None:
        permitted(find())


def with_vehicle_check(precondition: Precondition) -> Precondition:
    """Make a precondition that also checks the resource's vehicles; for restricted keys."""

    def check_both(shown: dict[str, Any]) -> None:
        if shown:
            permitted(shown)
        precondition(shown)

    return check_both


def own_missions(plan: dict[str, Any]) -> dict[str, Any]:
    """Leave the permitted missions of a plan; raises 403 if there is none."""
    if vehicles() is None:
        return plan
    own = [mission for mission in plan["missions"] if permits([mission["vehicle_id"]])]
    if not own:
        raise Forbidden(refusal(vehicles_of(plan)))
    return {**plan, "missions": own}


def pages(page: Page, wanted: int | None, limit: int) -> list[dict[str, Any]]:
    """List the resources of the wanted vehicle, or of all that the key permits.

    `page` lists those of one vehicle (None: all), ordered by id, at most `limit`. If a page is cut
    for its size, the answer ends where it ends, so that the client does not skip the rest of it.
    """
    known = vehicles()
    if wanted is not None or known is None:
        check(*([] if wanted is None else [wanted]))
        return page(wanted)
    parts = [page(vehicle_id) for vehicle_id in sorted(known)]
    ends = [part[-1]["id"] for part in parts if isinstance(part, Listing) and part.is_cut]
    found = {item["id"]: item for part in parts for item in part}
    shown = [identifier for identifier in sorted(found) if not ends or identifier <= min(ends)]
    return [found[identifier] for identifier in shown][:limit]


def _key() -> StoredKey:
    key: StoredKey = g.key
    return key
