"""`/users/` and `/sessions/`: accounts of people and their sessions, for admins."""

from typing import Any, Final

from flask import Blueprint
from flask.typing import ResponseReturnValue

from edge_server.api import bodies, schemas, urls
from edge_server.api.access.auth import ADMIN, allow, audit, key_ring, refuse_restricted
from edge_server.api.contract import Contract, describe
from edge_server.services.administration import accounts
from edge_server.services.administration.accounts import AccountChange, AccountRequest

NAMES: Final = ("users", "user")
NAME: Final = "string(maxlength=64):name"
PREFIX: Final = "string(length=8):prefix"
EXAMPLE: Final = {"name": "maria", "role": "operator", "password": "nine words are better than one"}


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("users", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "create", create, "POST")
    urls.add(routes, NAMES, "get", get, "GET", item=NAME)
    urls.add(routes, NAMES, "change", change, "PATCH", item=NAME)
    urls.add(routes, NAMES, "delete", delete, "DELETE", item=NAME)
    urls.add(routes, NAMES, "link", link, "POST", item=NAME, action="link")
    urls.add(routes, ("sessions",), "sessions", sessions, "GET")
    urls.add(routes, ("sessions",), "end_session", end_session, "DELETE", item=PREFIX)
    return routes


@allow(ADMIN)
@describe(Contract({200: schemas.Account}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List all accounts, without their passwords."""
    return [accounts.show(person) for person in accounts.everyone(bodies.context().database)]


@allow(ADMIN)
@describe(Contract({201: schemas.Account}, body=AccountRequest, errors=(409,), example=EXAMPLE))
def create() -> ResponseReturnValue:
    """Create an account."""
    wanted = bodies.model(AccountRequest)
    refuse_restricted("accounts")
    context = bodies.context()
    made = accounts.create(context.database, wanted, context.clock())
    audit(f"created account {made.name} ({made.role})")
    return accounts.show(made), 201, {"Location": f"/users/{made.name}"}


@allow(ADMIN)
@describe(Contract({200: schemas.Account}))
def get(name: str) -> dict[str, Any]:
    """Give one account, without its password."""
    return accounts.show(accounts.find(bodies.context().database, name))


@allow(ADMIN)
@describe(Contract({200: schemas.Account}, body=AccountChange, example={"disabled": True}))
def change(name: str) -> dict[str, Any]:
    """Change role, password or `disabled`; the last two end the person's sessions."""
    wanted = bodies.model(AccountChange)
    refuse_restricted("accounts")
    changed = accounts.change(bodies.context().database, name, wanted)
    key_ring().invalidate()
    audit(f"changed account {name}")
    return accounts.show(changed)


@allow(ADMIN)
@describe(Contract({204: None}))
def delete(name: str) -> ResponseReturnValue:
    """Delete an account and end its sessions."""
    refuse_restricted("accounts")
    accounts.delete(bodies.context().database, name)
    key_ring().invalidate()
    audit(f"deleted account {name}")
    return "", 204


@allow(ADMIN)
@describe(Contract({201: schemas.SignInLink}))
def link(name: str) -> ResponseReturnValue:
    """Make a link that signs the person in once within 10 minutes, for a forgotten password."""
    refuse_restricted("accounts")
    context = bodies.context()
    token = accounts.make_link(context.database, name, context.clock())
    audit(f"made a link for {name}")
    return {"link": token, "path": f"/console/#link={token}"}, 201


@allow(ADMIN)
@describe(Contract({200: schemas.Session}, is_list=True))
def sessions() -> list[dict[str, Any]]:
    """List the sessions of all people, oldest first."""
    context = bodies.context()
    found = accounts.sessions(context.database, context.clock())
    return [accounts.show_session(session) for session in found]


@allow(ADMIN)
@describe(Contract({204: None}))
def end_session(prefix: str) -> ResponseReturnValue:
    """End a session: at once in this process, within 1 s in every other one."""
    refuse_restricted("accounts")
    accounts.end_session(bodies.context().database, prefix)
    key_ring().invalidate()
    audit(f"ended session {prefix}")
    return "", 204
