"""Who may call: a key has a role, a route names its roles, everything else is refused.

The role of the caller is known before the route is looked at, so nothing but health answers a
stranger, not even a 404.
"""

import hmac
import logging
import re
import threading
import time
from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from flask import current_app, g, request
from werkzeug.datastructures import WWWAuthenticate
from werkzeug.exceptions import Forbidden, HTTPException, Unauthorized

from edge_server.api.errors import RequestError
from edge_server.services.context import Caller
from edge_server.store import keys
from edge_server.store.database import Database
from edge_server.store.keys import Role, StoredKey

AUDIT = logging.getLogger("edge_server.audit")
KEYS_STAY_FRESH_S: Final = 1.0


PEOPLE: Final = frozenset({Role.FARMER, Role.OPERATOR, Role.ADMIN, Role.CLOUD})
"""Those who look: everybody but the broker."""
READERS: Final = PEOPLE | {Role.BROKER}
PLANNERS: Final = frozenset({Role.OPERATOR, Role.ADMIN})
BROKER: Final = frozenset({Role.BROKER})
ADMIN: Final = frozenset({Role.ADMIN})
PUBLIC: Final[frozenset[Role]] = frozenset()

PAGES: Final = frozenset({"/docs", "/openapi.json"})
"""What people open in a browser, which asks for a name and a key: any name will do."""
KEY_RULE: Final = "must be 1 to 64 visible ASCII characters"
_KEY_SHAPE: Final = re.compile(r"[!-~]{1,64}")
_ATTRIBUTE: Final = "edge_roles"
_View = TypeVar("_View", bound=Callable[..., object])


def roles_of(view: object) -> frozenset[Role] | None:
    """Give the roles that may use a view; None when it has no mark."""
    found: frozenset[Role] | None = getattr(view, _ATTRIBUTE, None)
    return found


def allow(roles: frozenset[Role]) -> Callable[[_View], _View]:
    """Say who may call a view; PUBLIC means anybody, and no mark means nobody."""

    def mark(view: _View) -> _View:
        setattr(view, _ATTRIBUTE, roles)
        return view

    return mark


class KeyRing:
    """The active keys, read again when they are older than a second."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = threading.Lock()
        self._keys: Mapping[str, StoredKey] = {}
        self._read_at = float("-inf")

    def role_of(self, key: str) -> Role | None:
        """Give the role of a key, None for one that opens nothing."""
        prefix = keys.prefix_of(key)
        if prefix is None:
            return None
        known = self._fresh().get(prefix)
        offered = keys.digest(key)
        if known is None or not hmac.compare_digest(known.sha256, offered):
            return None
        return Role(known.role)

    def _fresh(self) -> Mapping[str, StoredKey]:
        with self._lock:
            if time.monotonic() - self._read_at > KEYS_STAY_FRESH_S:
                with self._database.read() as connection:
                    self._keys = {key.prefix: key for key in keys.active(connection)}
                self._read_at = time.monotonic()
            return self._keys


def check_caller(ring: KeyRing) -> None:
    """Let a request pass or raise 401 or 403; runs before every view."""
    view = current_app.view_functions.get(request.endpoint or "")
    allowed = roles_of(view)
    if allowed == PUBLIC and allowed is not None:
        return
    role = ring.role_of(_offered_key())
    if role is None:
        scheme = "basic" if request.path.rstrip("/") in PAGES else "bearer"
        raise Unauthorized(
            "an access key is needed: Authorization: Bearer <key>",
            www_authenticate=WWWAuthenticate(scheme, {"realm": "edge server"}),
        )
    g.role = role
    if isinstance(request.routing_exception, HTTPException):
        return  # 404 or 405, which the dispatcher raises next
    if allowed is None or role not in allowed:
        AUDIT.warning("refused %s %s %s", role, request.method, request.path)
        raise Forbidden(f"the role {role} may not do this")


def caller() -> Caller:
    """Give who asks, and under which idempotency key; raises 422 for one that is no key."""
    key = request.headers.get("Idempotency-Key")
    if key is not None and not is_idempotency_key(key):
        raise RequestError(422, f"Idempotency-Key {KEY_RULE}")
    return Caller(g.role, key)


def is_idempotency_key(key: object) -> bool:
    """Whether a text may be an idempotency key."""
    return isinstance(key, str) and _KEY_SHAPE.fullmatch(key) is not None


def audit(action: str) -> None:
    """Note a write by a person or the cloud."""
    AUDIT.info("%s %s from %s", g.role, action, request.remote_addr)


def _offered_key() -> str:
    """The key that is shown; where there is an Authorization, it alone counts."""
    shown = request.headers.get("Authorization")
    if shown is not None:
        scheme, _, token = shown.partition(" ")
        if scheme.lower() == "bearer":
            return token.strip()
        basic = request.authorization
        return (basic.password or "") if basic is not None and basic.type == "basic" else ""
    return request.headers.get("X-API-Key", "").strip()
