"""Plans: validated, stored, their missions queued for the broker; one transaction each."""

from collections.abc import Sequence
from typing import Any, Final

from pydantic import ValidationError
from sqlalchemy import Connection

from afarcloud.enumerations import Status
from afarcloud.faults import Fault, InvalidError
from afarcloud.plan import Plan
from afarcloud.rules import FenceVerdict
from afarcloud.wire import Kind, write
from edge_server.services import audit, post_idempotency
from edge_server.services.context import Caller, Context, Precondition, unconditionally
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.services.fleet import broker_work
from edge_server.services.planning import fences, plan_checks
from edge_server.services.planning.plan_view import show
from edge_server.services.retries import retry_on_conflict
from edge_server.store.connection.database import to_json
from edge_server.store.connection.locks import WORK
from edge_server.store.rows import plans, vehicle_holds, vehicles, work, work_removal
from edge_server.store.rows.idempotency import Answered
from edge_server.store.rows.plans import StoredPlan

_SEVERAL = "plans"
SILENT_S: Final = 300.0
"""An operator may close an accepted mission once no broker has made a request about its vehicle for
so long; a live broker updates even a lost vehicle every 30 s."""


@retry_on_conflict
def create(context: Context, plan: Plan, caller: Caller) -> dict[str, Any]:
    """Store a plan and queue its missions; returns it as stored.

    Raises:
        InvalidError: if it breaks a rule.
        ConflictError: if a mission of the same number is unfinished or a vehicle's queue is full.
        KeyReusedError: if the idempotency key belongs to another request.
    """
    body_sha256 = post_idempotency.hash_body(write(plan))
    route = Kind.PLAN.value
    fence = fences.check(context, plan)
    with context.database.write(WORK) as connection:
        answered = post_idempotency.find_answer(connection, caller, route, body_sha256)
        if answered is None:
            now = context.clock()
            row = _create(connection, context, plan, fence, now)
            shown = _show(connection, _find(connection, row))
            answered = Answered(route, body_sha256, row, None, now, to_json(shown))
            post_idempotency.store_answer(connection, caller, answered)
        else:
            shown = post_idempotency.first_answer(
                answered, lambda: _show(connection, _find(connection, answered.object_id))
            )
    context.work_signal.notify()
    return shown


@retry_on_conflict
def create_all(
    context: Context,
    documents: Sequence[Plan],
    caller: Caller,
    source: dict[str, Any],
    warnings: Sequence[Fault] = (),
    *,
    numbered_here: bool = False,
    missing: Sequence[Fault] | None = None,
) -> list[dict[str, Any]]:
    """Store several plans in one transaction, in their order; returns them as stored.

    `source` is what they were made from and identifies a repeated request; the `warnings` of the
    conversion are stored with each plan. With `numbered_here` the request gives no mission_ids:
    the plans get the next ones that are free here. `missing` lists what drafts lack because of
    their source, None if they must be complete: a draft is stored with all that it lacks, and
    dispatched once it is complete.

    Raises:
        as `create`; then none of them is stored.
    """
    body_sha256 = post_idempotency.hash_body(source)
    verdicts = [fences.check(context, plan) for plan in documents]  # Independent of mission_ids
    with context.database.write(WORK) as connection:
        answered = post_idempotency.find_answer(connection, caller, _SEVERAL, body_sha256)
        if answered is None:
            now = context.clock()
            if numbered_here:
                documents = plan_checks.with_free_ids(connection, documents)
            rows = [
                _create(connection, context, plan, fence, now, warnings, missing)
                for plan, fence in zip(documents, verdicts, strict=True)
            ]
            shown = [_show(connection, _find(connection, row)) for row in rows]
            answered = Answered(_SEVERAL, body_sha256, rows[0], None, now, to_json(shown))
            post_idempotency.store_answer(connection, caller, answered)
        else:
            first, count = answered.object_id, len(documents)
            shown = post_idempotency.first_answer(
                answered,
                lambda: [_show(connection, _find(connection, first + n)) for n in range(count)],
            )
    context.work_signal.notify()
    return shown


def _create(
    connection: Connection,
    context: Context,
    plan: Plan,
    fence: FenceVerdict,
    now: float,
    warnings: Sequence[Fault] = (),
    missing: Sequence[Fault] | None = None,
) -> int:
    broker_work.expire(context, connection, now)
    stored = plan_checks.checked(connection, context, plan, fence, now, missing)
    stored.warnings.extend({"path": one.path, "message": one.message} for one in warnings)
    if plans.find(connection, stored.plan_id) is not None:
        raise ConflictError(
            "another plan has this plan_id; leave it out, or replace that plan with PUT",
            (Fault("plan_id", "is already taken"),),
        )
    row = plans.add(connection, stored)
    audit.about(f"plans/{row}")
    _queue(connection, context, plan, stored._replace(id=row), now)
    return row


@retry_on_conflict
def replace(
    context: Context,
    reference: int | str,
    plan: Plan,
    precondition: Precondition = unconditionally,
) -> dict[str, Any]:
    """Replace a plan of which the broker has no mission; its id and plan_id stay.

    Raises:
        NotFoundError: if there is none.
        ChangedError: if the precondition fails.
        InvalidError: if the new one breaks a rule.
        ConflictError: if the broker has a mission of it, or as for `create`.
    """
    fence = fences.check(context, plan)
    with context.database.write(WORK) as connection:
        now = context.clock()
        broker_work.expire(context, connection, now)
        old = _find(connection, reference)
        with audit.naming_last_change(connection, f"plans/{old.id}", f"plans/{old.plan_id}"):
            precondition(_show(connection, old))
        if any(item.state != work.QUEUED for item in work.of_plan(connection, old.id)):
            raise ConflictError(
                f"plan {old.id} cannot be replaced: a mission of it was accepted or has ended"
            )
        if plan.plan_id not in {None, old.plan_id}:
            raise ConflictError(
                f"the plan_id of plan {old.id} cannot be changed; leave it out",
                (Fault("plan_id", "cannot be changed"),),
            )
        work_removal.remove_of_plan(connection, old.id, now)
        new = plan_checks.checked(connection, context, plan, fence, now)._replace(
            id=old.id, plan_id=old.plan_id, received_at=old.received_at
        )
        plans.replace(connection, new)
        _queue(connection, context, plan, new, now)
        shown = _show(connection, new)
    context.work_signal.notify()
    return shown


@retry_on_conflict
def dispatch(
    context: Context, reference: int | str, precondition: Precondition = unconditionally
) -> dict[str, Any]:
    """Queue the missions of a held plan; a plan that is not held stays as it is.

    Raises:
        NotFoundError: if there is none.
        ChangedError: if it is held and the precondition fails.
        InvalidError: if it breaks a rule now: a vehicle was deleted, or its limits have changed.
        ConflictError: if it has expired or is changed at the same time, or as for `create`.
    """
    with context.database.read() as connection:
        stored = _find(connection, reference)
        missions = work.of_plan(connection, stored.id)
    waits = any(item.held for item in missions)
    checked = _dispatched(stored, missions) if waits else None
    fence = None if checked is None else fences.check(context, checked)
    with context.database.write(WORK) as connection:
        now = context.clock()
        broker_work.expire(context, connection, now)
        stored = _find(connection, reference)
        missions = work.of_plan(connection, stored.id)
        if any(item.held for item in missions):
            with audit.naming_last_change(
                connection, f"plans/{stored.id}", f"plans/{stored.plan_id}"
            ):
                precondition(_show(connection, stored))
            _check_whole(stored)
            if any(item.state == work.CLOSED for item in missions):
                raise ConflictError(f"plan {stored.id} has ended: {missions[0].message}")
            plan = _dispatched(stored, missions)
            if plan != checked or fence is None:
                raise ConflictError(f"plan {stored.id} was changed meanwhile; read it again")
            stored = _queue_dispatched(connection, context, stored, plan, fence, now)
        shown = _show(connection, stored)
    context.work_signal.notify()
    return shown


def _check_whole(stored: StoredPlan) -> None:
    """Check that a draft is complete; raises InvalidError with what it lacks."""
    lacks = [
        one for one in stored.warnings if one["message"].startswith(f"{plan_checks.MISSING}: ")
    ]
    if lacks:
        raise InvalidError(tuple(Fault(one["path"], one["message"]) for one in lacks))


def _dispatched(stored: StoredPlan, missions: Sequence[work.Work]) -> Plan:
    """Return a stored plan as it is when it is dispatched.

    Raises:
        InvalidError: if the model has become stricter since the plan was stored.
    """
    bodies = [item.body for item in missions]
    try:
        return Plan.model_validate({**stored.body, "dispatch": True, "missions": bodies})
    except ValidationError as error:
        faults = error.errors(include_url=False, include_input=False)
        raise InvalidError(
            tuple(Fault(".".join(map(str, one["loc"])), one["msg"]) for one in faults)
        ) from None


def _queue_dispatched(
    connection: Connection,
    context: Context,
    stored: StoredPlan,
    plan: Plan,
    fence: FenceVerdict,
    now: float,
) -> StoredPlan:
    """Queue a held plan's missions as new work: the broker's cursor is past their old ids.

    The lifetime of a plan that names no time begins anew.
    """
    work_removal.remove_of_plan(connection, stored.id, now)
    checked = plan_checks.checked(connection, context, plan, fence, now)
    dispatched = stored._replace(
        body=checked.body, warnings=checked.warnings, expires_at=checked.expires_at
    )
    plans.replace(connection, dispatched)
    _queue(connection, context, plan, dispatched, now)
    return dispatched


def find(context: Context, reference: int | str) -> dict[str, Any]:
    """Return a plan with its live status; raises NotFoundError."""
    broker_work.expire_if_due(context)
    with context.database.read() as connection:
        return _show(connection, _find(connection, reference))


def page(
    context: Context,
    *,
    after_id: int,
    limit: int,
    since_s: float = 0.0,
    vehicle_id: int | None = None,
) -> list[dict[str, Any]]:
    """List plans with their live status, oldest first; `since_s` bounds their receipt."""
    broker_work.expire_if_due(context)
    with context.database.read() as connection:
        return [
            _show(connection, stored)
            for stored in plans.page(
                connection,
                after_id=after_id,
                limit=limit,
                since_s=since_s,
                vehicle_id=vehicle_id,
            )
        ]


@retry_on_conflict
def remove(
    context: Context,
    reference: int | str,
    precondition: Precondition = unconditionally,
) -> None:
    """Delete a plan; its queued missions are cancelled.

    Raises:
        NotFoundError: if there is none.
        ChangedError: if the precondition fails.
        ConflictError: if the broker has accepted a mission of it.
    """
    with context.database.write(WORK) as connection:
        stored = _find(connection, reference)
        with audit.naming_last_change(connection, f"plans/{stored.id}", f"plans/{stored.plan_id}"):
            precondition(_show(connection, stored))
        if any(item.state == work.ACCEPTED for item in work.of_plan(connection, stored.id)):
            raise ConflictError(
                f"plan {stored.id} cannot be deleted: the broker has accepted a mission of it; "
                "abort it first"
            )
        work_removal.remove_of_plan(connection, stored.id, context.clock())
        plans.remove(connection, stored.id)


@retry_on_conflict
def close(
    context: Context, reference: int | str, reason: str, vehicle_id: int | None = None
) -> dict[str, Any]:
    """End accepted missions of a broker that has failed, or has lost them.

    `vehicle_id` selects the missions of one vehicle; without it all that are accepted are ended.
    Ended and queued missions stay as they are.

    Raises:
        NotFoundError: if there is no such plan.
        ConflictError: if a broker has made a request about a vehicle recently, unless it has
            answered an abort of the mission and the mission goes on here.
    """
    with context.database.write(WORK) as connection:
        now = context.clock()
        stored = _find(connection, reference)
        missions = [
            item
            for item in work.of_plan(connection, stored.id)
            if item.state == work.ACCEPTED and vehicle_id in {None, item.vehicle_id}
        ]
        for item in missions:
            if not _is_lost(connection, item):
                _check_silent(connection, item, now)
            text = f"closed by an operator: {reason}"
            broker_work.end(connection, item, Status.ABORTED, text, now)
        if missions:
            audit.about(f"plans/{stored.id}: {reason}")
        else:
            audit.changes_nothing()
        shown = _show(connection, stored)
    context.wake_relay()
    return shown


def _is_lost(connection: Connection, item: work.Work) -> bool:
    """Whether the broker of an accepted mission has shown that it does not fly it.

    It has answered an abort, which would have ended the mission, and does not name the mission in
    its state of the vehicle. Its state alone proves nothing: a mission that waits for its vehicle
    is not named there either.
    """
    vehicle_id = item.vehicle_id or 0
    known = vehicles.get(connection, vehicle_id)
    if known is not None and known.state.get("mission_id") == item.mission_id:
        return False
    return work.has_answered_abort(connection, item)


def _check_silent(connection: Connection, item: work.Work, now: float) -> None:
    """Check that no broker has made a request about a mission's vehicle for `SILENT_S`.

    A time in the future comes from a clock that was wrong: a live broker would have made a request
    since.

    Raises:
        ConflictError: if one has.
    """
    vehicle_id = item.vehicle_id or 0
    known = vehicles.get(connection, vehicle_id)
    last = vehicles.contact(connection, vehicle_id)
    times = [last.at if last else None, known.updated_at if known else None]
    ages = [abs(now - time_s) for time_s in times if time_s is not None]
    age_s = min(ages, default=SILENT_S)
    if age_s >= SILENT_S:
        return
    raise ConflictError(
        f"the broker of vehicle {vehicle_id} is connected: its last request was {age_s:.0f} s ago;"
        f" abort the mission by an event: it can be closed once the broker has answered that, or"
        f" {SILENT_S:.0f} s after the last request",
        (Fault("vehicle_id", "has a broker that is connected"),),
    )


def _queue(
    connection: Connection, context: Context, plan: Plan, stored: StoredPlan, now: float
) -> None:
    for index, mission in enumerate(plan.missions):
        if plan.dispatch:
            plan_checks.check_queue(connection, context, mission, f"missions.{index}")
        work.add_mission(
            connection,
            plan_row=stored.id,
            body=write(mission),
            now=now,
            expires_at=stored.expires_at,
            held=not plan.dispatch,
            place=index,
        )


def _find(connection: Connection, reference: int | str) -> StoredPlan:
    stored = plans.find(connection, reference)
    if stored is None:
        raise NotFoundError(f"there is no plan {reference}")
    return stored


def _show(connection: Connection, stored: StoredPlan) -> dict[str, Any]:
    missions = work.of_plan(connection, stored.id)
    progress = {item.id: work.commands(connection, item.id) for item in missions}
    return show(stored, missions, progress, vehicle_holds.everyone(connection))
