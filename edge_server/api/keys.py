"""`/keys/`: the access keys, for admins. A secret is shown once, to who has asked for the key."""

from typing import Any, Final

from apiflask import APIBlueprint
from flask import current_app
from flask.typing import ResponseReturnValue

from edge_server.api import bodies, scopes, urls
from edge_server.api.auth import ADMIN, KeyRing, allow, audit, refusal
from edge_server.api.contract import Contract, describe
from edge_server.services import keys
from edge_server.services.keys import KeyRequest

WORDS: Final = ("keys", "key")
ITEM: Final = "string(length=8):prefix"
KEY_RING: Final = "edge_key_ring"
EXAMPLE: Final = {"name": "north-broker", "role": "broker", "vehicle_ids": [1, 2]}


def blueprint() -> APIBlueprint:
    """Make the routes."""
    routes = APIBlueprint("keys", __name__)
    urls.add(routes, WORDS, "page", page, "GET")
    urls.add(routes, WORDS, "create", create, "POST")
    urls.add(routes, WORDS, "get", get, "GET", item=ITEM)
    urls.add(routes, WORDS, "revoke", revoke, "DELETE", item=ITEM)
    return routes


@allow(ADMIN)
@describe(Contract({200: "AccessKey"}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List all keys, revoked ones too, without their secrets."""
    context = bodies.context()
    now = context.clock()
    return [keys.show(key, now) for key in keys.everything(context.database)]


@allow(ADMIN)
@describe(Contract({201: "NewAccessKey"}, body="KeyRequest", errors=(409,), example=EXAMPLE))
def create() -> ResponseReturnValue:
    """Make a key; the answer holds its secret, which is kept nowhere."""
    wanted = bodies.model(KeyRequest)
    _check_unnarrowed()
    context = bodies.context()
    now = context.clock()
    made, secret = keys.create(context.database, wanted, now)
    _ring().forget()
    audit(f"made key {made.prefix} ({made.name}, {made.role})")
    location = {"Location": f"/keys/{made.prefix}"}
    return {**keys.show(made, now), "key": secret}, 201, location


@allow(ADMIN)
@describe(Contract({200: "AccessKey"}))
def get(prefix: str) -> dict[str, Any]:
    """Give one key, without its secret."""
    context = bodies.context()
    return keys.show(keys.find(context.database, prefix), context.clock())


@allow(ADMIN)
@describe(Contract({204: None}, errors=(409,)))
def revoke(prefix: str) -> ResponseReturnValue:
    """Let a key open nothing any more, from now on in this process, within 1 s everywhere."""
    _check_unnarrowed()
    context = bodies.context()
    keys.revoke(context.database, prefix, context.clock())
    _ring().forget()
    audit(f"revoked key {prefix}")
    return "", 204


def _check_unnarrowed() -> None:
    """A narrowed key could make a wider one."""
    if scopes.is_narrowed():
        raise refusal("a narrowed key may not change keys")


def _ring() -> KeyRing:
    ring: KeyRing = current_app.extensions[KEY_RING]
    return ring
