"""Authentication and authorization: a key has a role, and a route names its roles.

The key is checked before the route, so that a client without one receives 401, even for a path
that does not exist; only health checks, the console's files and signing in need no key. Scopes
restrict a key further (edge_server.api.access.scopes).

A browser in which a person is signed in sends a session's secret as a cookie instead of a key. The
browser sends the cookie for every site, so a write needs the header X-CSRF-Token too, whose value
only this server's own pages can read (OWASP, "Cross-Site Request Forgery Prevention").
"""

import hashlib
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

from afarcloud.faults import Fault
from edge_server.api.access import audit_trail, scopes
from edge_server.api.access.limits import Limits
from edge_server.api.errors import RequestError
from edge_server.services.context import Caller, Context
from edge_server.store.connection.database import Database
from edge_server.store.rows import accounts, keys
from edge_server.store.rows.keys import Role, StoredKey

AUDIT = logging.getLogger("edge_server.audit")
KEYS_CACHED_S: Final = 1.0
"""A revoked key is refused after so long at most, in every process."""
PEOPLE: Final = frozenset({Role.FARMER, Role.OPERATOR, Role.ADMIN, Role.CLOUD})
"""Every role but the broker."""
READERS: Final = PEOPLE | {Role.BROKER}
PLANNERS: Final = frozenset({Role.OPERATOR, Role.ADMIN})
BROKER: Final = frozenset({Role.BROKER})
ADMIN: Final = frozenset({Role.ADMIN})
PUBLIC: Final[frozenset[Role]] = frozenset()

BROWSER_PAGES: Final = frozenset({"/docs", "/openapi.json"})
"""Paths that a browser opens: it asks for a user name, which may be any, and the key."""
KEY_RULE: Final = "must be 1 to 64 visible ASCII characters"
_KEY_SHAPE: Final = re.compile(r"[!-~]{1,64}")
KEY_RING: Final = "edge_key_ring"
"""Name of the extension of the app that holds the `KeyRing`."""
COOKIE: Final = "session"
CSRF_HEADER: Final = "X-CSRF-Token"
INSTANCE_HEADER: Final = "Broker-Instance"
"""Distinguishes brokers with one access key."""
_INSTANCE_SHAPE: Final = re.compile(r"[A-Za-z0-9]{1,32}")
_ATTRIBUTE: Final = "edge_roles"
_NO_DIGEST: Final = b"\0" * 32
_NO_KEY: Final = "an access key is needed: send Authorization: Bearer <key> or X-API-Key: <key>"
_UNKNOWN_KEY: Final = (
    "unknown key: it was never issued, has expired or was revoked; "
    "ask an administrator of this edge server for a new one"
)
_ENDED: Final = "the session has ended: sign in again"
_NO_CSRF: Final = f"{CSRF_HEADER} must be the csrf_token of this session (GET /session/)"
_FOUND_BY: Final = len("fm_") + 8
"""Length of what a secret begins with: its kind and prefix."""
_View = TypeVar("_View", bound=Callable[..., object])


def roles_of(view: object) -> frozenset[Role] | None:
    """Give the roles that may use a view; None for a view without `allow`."""
    found: frozenset[Role] | None = getattr(view, _ATTRIBUTE, None)
    return found


def allow(roles: frozenset[Role]) -> Callable[[_View], _View]:
    """Set the roles of a view: PUBLIC needs no key; a view without this decorator refuses all."""

    def mark(view: _View) -> _View:
        setattr(view, _ATTRIBUTE, roles)
        return view

    return mark


class KeyRing:
    """Cache of the active keys and sessions, read again after `KEYS_CACHED_S`."""

    def __init__(
        self,
        database: Database,
        clock: Callable[[], float] = time.time,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._database = database
        self._clock = clock
        self._monotonic = monotonic
        self._lock = threading.Lock()
        self._keys: Mapping[str, StoredKey] = {}
        self._digests: frozenset[bytes] = frozenset()
        self._read_at = float("-inf")

    def find(self, secret: str) -> StoredKey | None:
        """Find an active key or session by its secret; None if there is none."""
        if keys.prefix_of(secret) is None and accounts.prefix_of(secret) is None:
            return None
        known = self._cached().get(secret[:_FOUND_BY])
        expected = _NO_DIGEST if known is None else known.sha256
        if not hmac.compare_digest(expected, keys.digest(secret)) or known is None:
            return None
        return known if known.is_valid(self._clock()) else None

    def is_known(self, secret: str) -> bool:
        """Whether a key or session was active when they were last read; never blocks.

        Every one is known before the first read.
        """
        known = self._keys.get(secret[:_FOUND_BY])
        return not self._keys or (
            known is not None and hmac.compare_digest(known.sha256, keys.digest(secret))
        )

    def is_active(self, key: StoredKey, clock: Callable[[], float]) -> bool:
        """Whether a key or session was active when they were last read; never blocks."""
        return key.sha256 in self._digests and key.is_valid(clock())

    def refresh(self) -> None:
        """Read them again if that is due."""
        self._cached()

    def invalidate(self) -> None:
        """Read them again at the next request."""
        with self._lock:
            self._read_at = float("-inf")

    def _cached(self) -> Mapping[str, StoredKey]:
        with self._lock:
            if self._monotonic() - self._read_at > KEYS_CACHED_S:
                with self._database.read() as connection:
                    found = {f"fm_{key.prefix}": key for key in keys.active(connection)}
                    sessions = accounts.session_keys(connection)
                self._keys = found | {f"fs_{key.prefix}": key for key in sessions}
                self._digests = frozenset(key.sha256 for key in self._keys.values())
                self._read_at = self._monotonic()
            return self._keys


def authorize(ring: KeyRing, limits: Limits, context: Context) -> None:
    """Raise 401, 403 or 429 unless the caller may use the view; runs before every view."""
    view = current_app.view_functions.get(request.endpoint or "")
    allowed = roles_of(view)
    if allowed == PUBLIC and allowed is not None:
        return
    key = _identify(ring, limits)
    role = Role(key.role)
    g.key, g.role = key, role
    limits.count(key)
    audit_trail.begin(context, key)
    if is_session() and request.method not in scopes.SAFE_METHODS and not _has_csrf_token():
        raise refusal(_NO_CSRF)
    if isinstance(request.routing_exception, HTTPException):
        return  # 404 or 405, which the dispatcher raises next
    if allowed is None or role not in allowed:
        raise refusal(f"the role {role} may not use this endpoint")
    if not scopes.covers(key.scopes, request.endpoint or "", request.method):
        raise refusal("the scopes of this key do not allow this: " + ", ".join(sorted(key.scopes)))


def _identify(ring: KeyRing, limits: Limits) -> StoredKey:
    """Find the key of the request; raises 401, or 429 for an address with many unknown keys."""
    secret = _secret_of_request()
    is_key = keys.prefix_of(secret) is not None
    key = ring.find(secret) if is_key else None
    if key is not None:
        return key
    cookie = "" if _has_key() else request.cookies.get(COOKIE, "")
    if accounts.prefix_of(cookie) is not None and (session := ring.find(cookie)) is not None:
        g.session_secret = cookie
        return session
    if secret:
        # Counted after the look-up: unknown keys of an address do not block its valid keys
        limits.count_failure(request.remote_addr)
    scheme = "basic" if request.path.rstrip("/") in BROWSER_PAGES else "bearer"
    missing = _ENDED if cookie else _NO_KEY
    raise Unauthorized(
        _UNKNOWN_KEY if secret else missing,
        www_authenticate=WWWAuthenticate(scheme, {"realm": "edge server"}),
    )


def key_ring() -> KeyRing:
    """Give the keys and sessions of this app."""
    ring: KeyRing = current_app.extensions[KEY_RING]
    return ring


def refuse_restricted(what: str) -> None:
    """Raise 403 for a restricted key that would change what gives access."""
    if scopes.is_restricted():
        raise refusal(f"a restricted key may not change {what}: it could gain permissions")


def is_session() -> bool:
    """Whether the caller is a person in a browser, not the owner of a key."""
    return "session_secret" in g


def csrf_token() -> str | None:
    """Give the token that writes of the caller's session need; None for a key."""
    if not is_session():
        return None
    secret: str = g.session_secret
    return token_of_session(secret)


def token_of_session(secret: str) -> str:
    """Derive the CSRF token of a session: it reveals nothing of the secret."""
    return hmac.new(secret.encode(), b"csrf", hashlib.sha256).hexdigest()


def _has_csrf_token() -> bool:
    given = request.headers.get(CSRF_HEADER, "").encode()
    return hmac.compare_digest(given, (csrf_token() or "").encode())


def refusal(reason: str) -> Forbidden:
    """Make the 403 for a key without the permission, and log it."""
    AUDIT.warning("refused %s %s %s: %s", g.key.name, request.method, request.path, reason)
    return Forbidden(reason)


def caller() -> Caller:
    """Give the caller and its idempotency key; raises 422 for a malformed one."""
    key = request.headers.get("Idempotency-Key")
    if key is not None and not is_idempotency_key(key):
        raise _wrong_header("Idempotency-Key", KEY_RULE)
    return Caller(g.role, key, g.key.name, _instance())


def broker() -> str:
    """Return the identity of the broker that makes this request; raises 422 for a malformed one."""
    return Caller(g.role, None, g.key.name, _instance()).broker


def _instance() -> str:
    instance = request.headers.get(INSTANCE_HEADER, "")
    if instance and _INSTANCE_SHAPE.fullmatch(instance) is None:
        raise _wrong_header(INSTANCE_HEADER, "must be 1 to 32 letters and digits")
    return instance


def _wrong_header(name: str, rule: str) -> RequestError:
    """Make the 422 for a header field that breaks its rule."""
    return RequestError(422, f"{name} {rule}", (Fault(name, rule),), where="header")


def is_idempotency_key(key: object) -> bool:
    """Whether a value is a well-formed idempotency key."""
    return isinstance(key, str) and _KEY_SHAPE.fullmatch(key) is not None


def audit(action: str) -> None:
    """Log a write by a person or the cloud; one that repeats an earlier answer says so."""
    trail = audit_trail.current()
    again = "again (nothing is done twice) " if trail is not None and trail.repeats_answer else ""
    AUDIT.info("%s %s%s from %s", g.role, again, action, request.remote_addr)


def _has_key() -> bool:
    """Whether the request names a key, which takes precedence over a session."""
    return "Authorization" in request.headers or "X-API-Key" in request.headers


def _secret_of_request() -> str:
    """The access key of a request, "" without one; Authorization takes precedence if present."""
    header = request.headers.get("Authorization")
    if header is not None:
        scheme, _, token = header.partition(" ")
        if scheme.lower() == "bearer":
            return token.strip()
        # The parser raises ValueError for what is not ASCII
        is_basic = scheme.lower() == "basic" and token.isascii()
        basic = request.authorization if is_basic else None
        return (basic.password or "") if basic is not None else ""
    return request.headers.get("X-API-Key", "").strip()
