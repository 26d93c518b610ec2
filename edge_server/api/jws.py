"""Checks a detached JWS (RFC 7515 appendix F, RFC 7797) over the bytes of a body. Pure.

`<protected header>..<signature>`, and the protected header bears `alg`, `aud` (our EDGE_ID), `exp`
[epoch seconds] and `jti`, which is worth one effect; where there is no body, also `htu`, the path
that is meant. The algorithm is the key's, whatever the header says: a header that names another,
or `none`, or brings a key of its own, is refused.

SignatureKeyError  the key file holds nothing that can check a signature
"""

import json
import re
from binascii import Error as Base64Error
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from joserfc import jws
from joserfc.errors import JoseError
from joserfc.jwk import JWKRegistry, KeySet, OctKey, OKPKey
from joserfc.jws import JWSRegistry
from joserfc.util import urlsafe_b64decode
from werkzeug.exceptions import Forbidden

from afarcloud.wire import unique_members
from edge_server.api.errors import RequestError
from edge_server.api.signatures import unsigned
from edge_server.services.audit import Token

LONGEST_LIFE_S: Final = 7 * 86_400.0
_SHORTEST_SECRET_BYTES: Final = 32
_LONGEST_HEADER: Final = 4096
_LONGEST_BODY: Final = 2 * 1024 * 1024
_LATEST_S: Final = 1e12  # Epoch seconds; far beyond any calendar
_JTI: Final = re.compile(r"[!-~]{1,128}")
_FOREIGN_KEYS: Final = frozenset({"jwk", "jku", "x5u", "x5c", "x5t", "x5t#S256"})
_Key = OKPKey | OctKey


class SignatureKeyError(Exception):
    """The key file holds nothing that can check a signature."""


class _Registry(JWSRegistry):
    """Takes the algorithm that was held against the key; a name's age is no reason to warn."""

    max_header_length = _LONGEST_HEADER
    max_payload_length = _LONGEST_BODY

    def get_alg(self, name: str) -> Any:
        """Give an algorithm by its name."""
        return self.algorithms[name]


_REGISTRY: Final = _Registry(strict_check_header=False)


class Signatures:
    """The cloud's keys; checks what bears its signature."""

    def __init__(self, keys: Mapping[str | None, _Key], edge_id: str) -> None:
        """Take keys by their `kid`, and our own name."""
        self._keys = keys
        self._edge_id = edge_id

    def check(self, shown: str, body: bytes, path: str, now: float) -> Token:
        """Check a signature of a body; returns what it uses up.

        Raises:
            Unauthorized: if it is none, or not by the cloud.
            Forbidden: if it is for somebody else, or not for now.
            RequestError: if its claims are missing or make no sense.
        """
        protected = _protected(shown)
        key = self._key(protected)
        algorithms = _algorithms(key)
        if protected.get("alg") not in algorithms:
            raise unsigned(f"the algorithm must be {' or '.join(algorithms)}")
        try:
            jws.deserialize_compact(shown, key, registry=_REGISTRY, payload=body)
        except (JoseError, ValueError):
            raise unsigned("the signature does not fit the body and the key") from None
        return self._claims(protected, path, now, needs_path=not body)

    def _key(self, protected: Mapping[str, Any]) -> _Key:
        kid = protected.get("kid")
        if kid is None and len(self._keys) == 1:
            return next(iter(self._keys.values()))
        if isinstance(kid, str) and kid in self._keys:
            return self._keys[kid]
        if None in self._keys and isinstance(kid, str):
            return self._keys[None]  # One key without a name answers to any
        raise unsigned("kid names no key of the cloud")

    def _claims(
        self, protected: Mapping[str, Any], path: str, now: float, *, needs_path: bool
    ) -> Token:
        audience, expires_at, jti = (protected.get(name) for name in ("aud", "exp", "jti"))
        if not isinstance(jti, str) or _JTI.fullmatch(jti) is None:
            raise _senseless("jti", "must be 1 to 128 visible ASCII characters")
        if expires_at is None or not _is_time(expires_at):
            raise _senseless("exp", "must be epoch seconds")
        meant = audience if isinstance(audience, list) else [audience]
        if not all(isinstance(one, str) for one in meant) or not meant:
            raise _senseless("aud", "must name the edge servers that are meant")
        if self._edge_id not in meant:
            raise Forbidden("the signature is meant for another edge server (aud)")
        if now >= expires_at:
            raise Forbidden("the signature has expired (exp)")
        if expires_at > now + LONGEST_LIFE_S:
            raise Forbidden("the signature is good for too long: 7 days at most (exp)")
        if "nbf" in protected and not (_is_time(protected["nbf"]) and protected["nbf"] <= now):
            raise Forbidden("the signature is not good yet (nbf)")
        if protected.get("htu") not in {path, path + "/"} and (needs_path or "htu" in protected):
            raise Forbidden("the signature must be for this path (htu)")
        return Token(jti, float(expires_at))


def load(path: Path, edge_id: str) -> Signatures:
    """Read the cloud's keys: a JWK, a JWK set, or a public key in PEM.

    Raises:
        SignatureKeyError: if there is none that we use: Ed25519, or a secret of 32 bytes or more.
    """
    try:
        raw = path.read_text(encoding="utf-8")
        found = [OKPKey.import_key(raw)] if raw.lstrip().startswith("-----") else _jwks(raw)
    except (OSError, ValueError, TypeError, KeyError, JoseError) as error:
        raise SignatureKeyError(f"{path} holds no key that can be used: {error}") from None
    keys: dict[str | None, _Key] = {}
    for key in found:
        _check_key(path, key)
        if not isinstance(key, (OKPKey, OctKey)) or key.kid in keys:
            raise SignatureKeyError(f"{path} holds several keys of one kid, or of another kind")
        keys[key.kid] = key
    if not keys:
        raise SignatureKeyError(f"{path} holds no key")
    return Signatures(keys, edge_id)


def _jwks(raw: str) -> list[Any]:
    document = json.loads(raw)
    if isinstance(document, dict) and "keys" in document:
        return list(KeySet.import_key_set({"keys": document["keys"]}).keys)
    return [JWKRegistry.import_key(document)]


def _check_key(path: Path, key: object) -> None:
    if isinstance(key, OctKey) and len(key.raw_value) >= _SHORTEST_SECRET_BYTES:
        return
    if isinstance(key, OKPKey) and key.curve_name == "Ed25519":
        return
    named = "a shorter secret" if isinstance(key, OctKey) else "a key of another kind"
    raise SignatureKeyError(
        f"{path} holds {named}; it must be Ed25519, or a secret of 32 bytes or more"
    )


def _protected(shown: str) -> dict[str, Any]:
    """Read the protected header, which nobody has vouched for yet."""
    parts = shown.split(".")
    if len(shown) > _LONGEST_HEADER or len(parts) != 3 or parts[1] or not all(parts[::2]):
        raise unsigned("the signature must be a detached JWS: header..signature")
    try:
        protected = json.loads(
            urlsafe_b64decode(parts[0].encode()), object_pairs_hook=unique_members
        )
    except (ValueError, Base64Error, RecursionError):
        raise unsigned("the signature's header is not JSON in base64url") from None
    if not isinstance(protected, dict) or not isinstance(protected.get("alg"), str):
        raise unsigned("the signature's header must be an object with alg")
    if not _FOREIGN_KEYS.isdisjoint(protected):
        raise unsigned("a signature that brings a key of its own is not taken")
    if not set(_strings(protected.get("crit", []))) <= {"b64"}:
        raise unsigned("the signature's header has a crit that is not known")
    return protected


def _strings(value: object) -> list[str]:
    whole = isinstance(value, list) and all(isinstance(one, str) for one in value)
    return list(value) if isinstance(value, list) and whole else ["?"]


def _algorithms(key: _Key) -> tuple[str, ...]:
    return ("HS256",) if isinstance(key, OctKey) else ("EdDSA", "Ed25519")


def _is_time(value: object) -> bool:
    """Whether it is a number of seconds; an integer of JSON may be too large for any float."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return -_LATEST_S <= value <= _LATEST_S  # Neither NaN nor infinity


def _senseless(claim: str, reason: str) -> RequestError:
    return RequestError(422, f"the signature's {claim} {reason}")
