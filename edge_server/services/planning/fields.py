"""Fields: their boundaries, stored under a number that plans and surveys may name."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection

from afarcloud.faults import InvalidError
from afarcloud.plan import Polygon
from afarcloud.rules import name_faults
from afarcloud.wire import write
from edge_server.geodata.field import Field, area_m2
from edge_server.services import audit, post_idempotency
from edge_server.services.context import (
    Caller,
    Context,
    Precondition,
    show_time,
    unconditionally,
)
from edge_server.services.errors import NotFoundError
from edge_server.services.retries import retry_on_conflict
from edge_server.store.connection.database import to_json
from edge_server.store.rows import fields
from edge_server.store.rows.fields import StoredField
from edge_server.store.rows.idempotency import Answered

_ROUTE: Final = "field"


class NoFlyArea(NamedTuple):
    """One ring of a field; the areas of a field are numbered from 1, as the console does."""

    field: int
    number: int
    ring: Polygon


@retry_on_conflict
def create_all(
    context: Context, documents: Sequence[Field], caller: Caller
) -> list[dict[str, Any]]:
    """Store the fields of one request, all or none; returns them as stored.

    Raises:
        InvalidError: if a name cannot be shown.
        KeyReusedError: if the idempotency key belongs to another request.
    """
    _check_names(documents)
    bodies = [write(document) for document in documents]
    body_sha256 = post_idempotency.hash_body({"fields": bodies})
    with context.database.write() as connection:
        answered = post_idempotency.find_answer(connection, caller, _ROUTE, body_sha256)
        if answered is None:
            now = context.clock()
            first, *_ = [fields.add(connection, body, now) for body in bodies]
            shown = _of_moment(connection, first, now, len(bodies))
            answered = Answered(_ROUTE, body_sha256, first, None, now, to_json(shown))
            post_idempotency.store_answer(connection, caller, answered)
            return shown
        first, now = answered.object_id, answered.created_at
        return post_idempotency.first_answer(
            answered, lambda: _of_moment(connection, first, now, len(bodies))
        )


def _check_names(documents: Sequence[Field]) -> None:
    for index, document in enumerate(documents):
        path = "name" if len(documents) == 1 else f"{index}.name"
        if faults := tuple(name_faults(document.name, path)):
            raise InvalidError(faults)


def _of_moment(
    connection: Connection, first: int, received_at: float, count: int
) -> list[dict[str, Any]]:
    """Return the fields of one request."""
    return [show(stored) for stored in fields.of_moment(connection, first, received_at, count)]


def find(context: Context, identifier: int) -> dict[str, Any]:
    """Return a field; raises NotFoundError."""
    with context.database.read() as connection:
        return show(_known(fields.get(connection, identifier), identifier))


def outline(context: Context, identifier: int) -> Field | None:
    """Return a field as a document, None if there is none."""
    with context.database.read() as connection:
        stored = fields.get(connection, identifier)
    return None if stored is None else Field.model_validate(stored.body)


def have_no_fly_areas(context: Context) -> bool:
    """Whether any field has a no-fly area."""
    with context.database.read() as connection:
        return fields.has_no_fly_area(connection)


def no_fly_areas(context: Context) -> list[NoFlyArea]:
    """List the no-fly areas of all fields."""
    with context.database.read() as connection:
        found = fields.with_no_fly_areas(connection)
    return [
        NoFlyArea(one.id, number, tuple((latitude, longitude) for latitude, longitude in ring))
        for one in found
        for number, ring in enumerate(one.body["exclusions"], 1)
    ]


def page(
    context: Context, *, after_id: int, limit: int, since_s: float = 0.0
) -> list[dict[str, Any]]:
    """List fields, oldest first; `since_s` bounds their receipt."""
    with context.database.read() as connection:
        found = fields.page(connection, after_id=after_id, limit=limit, since_s=since_s)
    return [show(stored) for stored in found]


@retry_on_conflict
def replace(
    context: Context,
    identifier: int,
    document: Field,
    precondition: Precondition = unconditionally,
) -> dict[str, Any]:
    """Replace a field's boundary.

    Raises:
        NotFoundError: if there is no such field.
        ChangedError: by the precondition.
        InvalidError: if its name cannot be shown.
    """
    _check_names([document])
    with context.database.write() as connection:
        old = _known(fields.get(connection, identifier), identifier)
        with audit.naming_last_change(connection, f"fields/{identifier}"):
            precondition(show(old))
        fields.replace(connection, identifier, write(document), context.clock())
        return show(_known(fields.get(connection, identifier), identifier))


@retry_on_conflict
def remove(context: Context, identifier: int, precondition: Precondition = unconditionally) -> None:
    """Delete a field; plans that name it stay as they are.

    Raises NotFoundError, or ChangedError by the precondition.
    """
    with context.database.write() as connection:
        known = _known(fields.get(connection, identifier), identifier)
        with audit.naming_last_change(connection, f"fields/{identifier}"):
            precondition(show(known))
        fields.remove(connection, identifier)


def show(stored: StoredField) -> dict[str, Any]:
    """Return a field as the API shows it."""
    return {
        "id": stored.id,
        **stored.body,
        "area_m2": round(area_m2(Field.model_validate(stored.body)), 1),
        "received_at": show_time(stored.received_at),
        "updated_at": show_time(stored.updated_at),
    }


def _known(stored: StoredField | None, identifier: int) -> StoredField:
    if stored is None:
        raise NotFoundError(f"there is no field {identifier}")
    return stored
