"""What a narrowed key may do: some of its role's routes, and things of some vehicles only.

OWASP API1: whoever may use a route may not therefore use it on every object. Each route that names
a vehicle, in its address, its query or its body, asks here; a test goes through all of them.
"""

from collections.abc import Callable, Iterable
from typing import Any, Final

from flask import g
from werkzeug.exceptions import Forbidden

from edge_server.services.context import Precondition
from edge_server.services.listing import Listing
from edge_server.store.keys import Scope, StoredKey

SAFE_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_REPORTING: Final = frozenset({"bulk.create", "vehicles.put"})
Page = Callable[[int | None], list[dict[str, Any]]]


def covers(scopes: frozenset[Scope], endpoint: str, method: str) -> bool:
    """Whether scopes let a request through; none at all narrow nothing."""
    return not scopes or any(_covers(scope, endpoint, method) for scope in scopes)


def _covers(scope: Scope, endpoint: str, method: str) -> bool:
    if scope is Scope.METRICS:
        return endpoint.startswith("metrics.")
    if scope is Scope.REPORT:
        return endpoint in _REPORTING or (
            endpoint.startswith("telemetry.") and endpoint.endswith("_create")
        )
    return method in SAFE_METHODS


def is_narrowed() -> bool:
    """Whether the caller's key may less than its role."""
    return bool(_key().scopes) or _key().vehicle_ids is not None


def vehicles() -> frozenset[int] | None:
    """Give the vehicles that the caller's key is good for, None for all."""
    return _key().vehicle_ids


def permits(vehicle_ids: Iterable[int | None]) -> bool:
    """Whether the caller's key is good for all of these vehicles; None stands for every vehicle."""
    known = vehicles()
    return known is None or all(vehicle_id in known for vehicle_id in vehicle_ids)


def check(*vehicle_ids: int | None) -> None:
    """Let a request pass that concerns these vehicles, None being all there are; raises 403."""
    if not permits(vehicle_ids):
        raise Forbidden(refusal(vehicle_ids))


def refusal(vehicle_ids: Iterable[int | None]) -> str:
    """Say which vehicle this key is not good for."""
    known = vehicles() or frozenset()
    others = sorted({number for number in vehicle_ids if number is not None} - known)
    named = f"vehicle {others[0]}" if others else "every vehicle"
    return f"this key is not good for {named}"


def concerned(shown: dict[str, Any]) -> list[int | None]:
    """Give the vehicles of a thing as the API shows it: a report, a vehicle, a plan."""
    if "missions" in shown:
        return [mission["vehicle_id"] for mission in shown["missions"]]
    return [shown.get("vehicle_id")]


def checked(shown: dict[str, Any]) -> dict[str, Any]:
    """Pass a thing on that the caller's key may see; raises 403."""
    check(*concerned(shown))
    return shown


def check_found(find: Callable[[], dict[str, Any]]) -> None:
    """Look at a thing before it is changed, if the caller's key is narrowed; raises 403."""
    if vehicles() is not None:
        checked(find())


def guarding(precondition: Precondition) -> Precondition:
    """Make a precondition that also holds what is there against the caller's key."""

    def check_both(shown: dict[str, Any]) -> None:
        if shown:
            checked(shown)
        precondition(shown)

    return check_both


def own_missions(plan: dict[str, Any]) -> dict[str, Any]:
    """Show of a plan what concerns the caller's vehicles; raises 403 when nothing does."""
    if vehicles() is None:
        return plan
    own = [mission for mission in plan["missions"] if permits([mission["vehicle_id"]])]
    if not own:
        raise Forbidden(refusal(concerned(plan)))
    return {**plan, "missions": own}


def pages(page: Page, wanted: int | None, limit: int) -> list[dict[str, Any]]:
    """List things of the vehicle that is asked for, or of all that the key is good for.

    `page` lists those of one vehicle (None: of all), ordered by id and at most `limit`. Where one
    of several pages is cut for its size, nothing behind its end is shown: it would be passed over.
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
