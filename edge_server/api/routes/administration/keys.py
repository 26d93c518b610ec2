"""`/keys/`: access keys, for admins. A secret is in the answer that creates its key, only there."""

from typing import Any, Final

from flask import Blueprint
from flask.typing import ResponseReturnValue

from edge_server.api import bodies, schemas, urls
from edge_server.api.access.auth import ADMIN, allow, audit, key_ring, refuse_restricted
from edge_server.api.contract import Contract, describe
from edge_server.services.administration import keys
from edge_server.services.administration.keys import KeyRequest

NAMES: Final = ("keys", "key")
ITEM: Final = "string(length=8):prefix"
EXAMPLE: Final = {"name": "north-broker", "role": "broker", "vehicle_ids": [1, 2]}


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("keys", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "create", create, "POST")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM)
    urls.add(routes, NAMES, "revoke", revoke, "DELETE", item=ITEM)
    return routes


@allow(ADMIN)
@describe(Contract({200: schemas.AccessKey}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List all keys, revoked ones too, without their secrets."""
    context = bodies.context()
    now = context.clock()
    return [keys.show(key, now) for key in keys.everything(context.database)]


@allow(ADMIN)
@describe(Contract({201: schemas.NewAccessKey}, body=KeyRequest, errors=(409,), example=EXAMPLE))
def create() -> ResponseReturnValue:
    """Create a key; the answer holds its secret, which is stored nowhere."""
    wanted = bodies.model(KeyRequest)
    refuse_restricted("keys")
    context = bodies.context()
    now = context.clock()
    made, secret = keys.create(context.database, wanted, now)
    key_ring().invalidate()
    audit(f"created key {made.prefix} ({made.name}, {made.role})")
    location = {"Location": f"/keys/{made.prefix}"}
    return {**keys.show(made, now), "key": secret}, 201, location


@allow(ADMIN)
@describe(Contract({200: schemas.AccessKey}))
def get(prefix: str) -> dict[str, Any]:
    """Give one key, without its secret."""
    context = bodies.context()
    return keys.show(keys.find(context.database, prefix), context.clock())


@allow(ADMIN)
@describe(Contract({204: None}, errors=(409,)))
def revoke(prefix: str) -> ResponseReturnValue:
    """Revoke a key: at once in this process, within 1 s in every other one."""
    refuse_restricted("keys")
    context = bodies.context()
    keys.revoke(context.database, prefix, context.clock())
    key_ring().invalidate()
    audit(f"revoked key {prefix}")
    return "", 204
