"""Who may call: a key has a role, a route names its roles, everything else is refused.

The caller is known before the route is looked at, so nothing but health answers a stranger, not
even a 404. A key may be narrowed by scopes (edge_server.api.scopes), never widened.
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

from edge_server.api import scopes, trails
from edge_server.api.errors import RequestError
from edge_server.api.limits import Limits
from edge_server.services.context import Caller, Context
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
_NO_DIGEST: Final = b"\0" * 32
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

    def __init__(self, database: Database, clock: Callable[[], float] = time.time) -> None:
        self._database = database
        self._clock = clock
        self._lock = threading.Lock()
        self._keys: Mapping[str, StoredKey] = {}
        self._read_at = float("-inf")

    def find(self, key: str) -> StoredKey | None:
        """Find what is known of a key, None for one that opens nothing."""
        prefix = keys.prefix_of(key)
        if prefix is None:
            return None
        known = self._fresh().get(prefix)
        expected = _NO_DIGEST if known is None else known.sha256
        if not hmac.compare_digest(expected, keys.digest(key)) or known is None:
            return None
        return known if known.opens(self._clock()) else None

    def is_known(self, key: str) -> bool:
        """Whether a key was active when the keys were read last; waits for nothing.

        Before they have been read every key is known.
        """
        known = self._keys.get(keys.prefix_of(key) or "")
        return not self._keys or (
            known is not None and hmac.compare_digest(known.sha256, keys.digest(key))
        )

    def forget(self) -> None:
        """Read the keys again at the next request: they have been changed."""
        with self._lock:
            self._read_at = float("-inf")

    def _fresh(self) -> Mapping[str, StoredKey]:
        with self._lock:
            if time.monotonic() - self._read_at > KEYS_STAY_FRESH_S:
                with self._database.read() as connection:
                    self._keys = {key.prefix: key for key in keys.active(connection)}
                self._read_at = time.monotonic()
            return self._keys


def check_caller(ring: KeyRing, limits: Limits, context: Context) -> None:
    """Let a request pass or raise 401, 403 or 429; runs before every view."""
    view = current_app.view_functions.get(request.endpoint or "")
    allowed = roles_of(view)
    if allowed == PUBLIC and allowed is not None:
        return
    key = _identify(ring, limits)
    role = Role(key.role)
    g.key, g.role = key, role
    limits.count(key)
    trails.begin(context, key)
    if isinstance(request.routing_exception, HTTPException):
        return  # 404 or 405, which the dispatcher raises next
    if allowed is None or role not in allowed:
        raise refusal(f"the role {role} may not do this")
    if not scopes.covers(key.scopes, request.endpoint or "", request.method):
        raise refusal("this key is narrowed to other things: " + ", ".join(sorted(key.scopes)))


def _identify(ring: KeyRing, limits: Limits) -> StoredKey:
    """Find the key that is shown; raises 401, or 429 to who shows wrong ones again and again."""
    shown = _offered_key()
    key = ring.find(shown)
    if key is not None:
        return key
    if shown:
        # A key that opens is never shut out by others who fail at the same address.
        limits.count_failure(request.remote_addr)
    scheme = "basic" if request.path.rstrip("/") in PAGES else "bearer"
    wrong = "this access key opens nothing: it is unknown, has expired or was revoked"
    raise Unauthorized(
        wrong if shown else "an access key is needed: Authorization: Bearer <key>",
        www_authenticate=WWWAuthenticate(scheme, {"realm": "edge server"}),
    )


def refusal(reason: str) -> Forbidden:
    """Make the 403 for a key that may not do what is asked, and note it in the log."""
    AUDIT.warning("refused %s %s %s: %s", g.key.name, request.method, request.path, reason)
    return Forbidden(reason)


def caller() -> Caller:
    """Give who asks, and under which idempotency key; raises 422 for one that is no key."""
    key = request.headers.get("Idempotency-Key")
    if key is not None and not is_idempotency_key(key):
        raise RequestError(422, f"Idempotency-Key {KEY_RULE}")
    return Caller(g.role, key, g.key.name)


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
        # The parser raises ValueError for what is not ASCII
        is_basic = scheme.lower() == "basic" and token.isascii()
        basic = request.authorization if is_basic else None
        return (basic.password or "") if basic is not None else ""
    return request.headers.get("X-API-Key", "").strip()
