"""Whether plans may be stored, and their missions be queued: what a POST and its preview check."""

from collections import Counter
from collections.abc import Sequence
from typing import Final

from sqlalchemy import Connection
from ulid import ULID

from afarcloud import rules
from afarcloud.faults import Fault, InvalidError
from afarcloud.numbers import INT32_MAX
from afarcloud.plan import Mission, Plan
from afarcloud.rules import FenceVerdict
from afarcloud.wire import write
from edge_server.services.context import Context, moment
from edge_server.services.errors import ConflictError
from edge_server.services.fleet import broker_work
from edge_server.services.planning import fences
from edge_server.store.rows import vehicles, work
from edge_server.store.rows.plans import StoredPlan

MISSING: Final = "missing"
"""Prefix of a warning that prevents the dispatch of a draft; a PUT completes the draft."""


def check_all(context: Context, documents: Sequence[Plan], *, numbered_here: bool = False) -> None:
    """Check new plans as `plans.create_all` does, and store none of them.

    Raises:
        as `plans.create_all`, as far as it does not concern an idempotency key.
    """
    broker_work.expire_if_due(context)
    verdicts = [fences.check(context, plan) for plan in documents]
    ahead: Counter[int] = Counter()
    with context.database.read() as connection:
        now = context.clock()
        if numbered_here:
            documents = with_free_ids(connection, documents)
        for plan, fence in zip(documents, verdicts, strict=True):
            checked(connection, context, plan, fence, now)
            for index, mission in enumerate(plan.missions if plan.dispatch else ()):
                path, vehicle_id = f"missions.{index}", mission.vehicle_id
                check_queue(connection, context, mission, path, ahead[vehicle_id])
                ahead[vehicle_id] += 1


def with_free_ids(connection: Connection, documents: Sequence[Plan]) -> list[Plan]:
    """Move consecutive mission_ids up until no mission here has one of them."""
    ids = [mission.mission_id for plan in documents for mission in plan.missions]
    first, count = min(ids), max(ids) - min(ids) + 1
    taken = work.taken_mission_ids(connection, first, INT32_MAX)
    free = first
    while collisions := taken.intersection(range(free, free + count)):
        free = max(collisions) + 1
    if free + count - 1 > INT32_MAX:
        raise ConflictError(f"no {count} mission_ids from {first} up are free")
    return [_moved(plan, free - first) for plan in documents]


def _moved(plan: Plan, by: int) -> Plan:
    missions = tuple(
        mission.model_copy(update={"mission_id": mission.mission_id + by})
        for mission in plan.missions
    )
    return plan.model_copy(update={"missions": missions})


def checked(
    connection: Connection,
    context: Context,
    plan: Plan,
    fence: FenceVerdict,
    now: float,
    missing: Sequence[Fault] | None = None,
) -> StoredPlan:
    """Check a plan against the rules; raises InvalidError with every fault.

    A draft (`missing` is given) may lack more, such as a take-off; all of it becomes warnings.
    """
    registered = vehicles.known(connection, {item.vehicle_id for item in plan.missions})
    limits = dict.fromkeys(registered, context.vehicle_limits)
    checked = rules.check(plan, limits, moment(now), fence)
    lacks = () if missing is None else (*missing, *checked.missing)
    faults = tuple(fault for fault in checked.faults if fault not in lacks)
    if faults or (lacks and plan.dispatch):
        raise InvalidError(faults or lacks)
    config = context.config
    lifetime_s = config.plan_lifetime_s if plan.dispatch else config.held_plan_lifetime_s
    expires_at = plan.expires_at.timestamp() if plan.expires_at else now + lifetime_s
    body = write(plan)
    del body["missions"]
    return StoredPlan(
        id=0,
        plan_id=plan.plan_id or str(ULID()),
        body=body,
        received_at=now,
        expires_at=expires_at,
        warnings=[
            *({"path": one.path, "message": f"{MISSING}: {one.message}"} for one in lacks),
            *({"path": one.path, "message": one.message} for one in checked.warnings),
        ],
    )


def check_queue(
    connection: Connection, context: Context, mission: Mission, path: str, ahead: int = 0
) -> None:
    """Check that a vehicle's queue takes a mission; `ahead` of it are others that are not stored.

    Raises:
        ConflictError: if a mission of the same number is unfinished or the queue is full.
    """
    waiting = [
        item
        for item in work.unfinished(connection, vehicle_id=mission.vehicle_id)
        if item.kind == work.MISSION
    ]
    if any(item.mission_id == mission.mission_id for item in waiting):
        raise ConflictError(
            f"mission {mission.mission_id} of vehicle {mission.vehicle_id} is unfinished; "
            "post the plan again when it has ended, or with another mission_id",
            (Fault(f"{path}.mission_id", "is the id of an unfinished mission of this vehicle"),),
        )
    unfinished = len(waiting) + ahead
    if unfinished >= context.config.queue_limit:
        raise ConflictError(
            f"vehicle {mission.vehicle_id} has {unfinished} unfinished missions, the maximum; "
            "post the plan again when one has ended",
            (Fault(f"{path}.vehicle_id", "has a full queue"),),
        )
