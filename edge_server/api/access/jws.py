"""Verification of a detached JWS (RFC 7515 appendix F, RFC 7797) over the bytes of a body. Pure.

`<protected header>..<signature>`, and the protected header has `alg`, `aud` (our EDGE_ID), `exp`
[epoch seconds] and `jti`, which may be used once; without a body also `htu`, the path of the
request. The key determines the algorithm: a header that names another one, or `none`, or contains a
key, is refused.

SignatureKeyError  the key file holds no key that can verify a signature
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
from edge_server.api.access.signatures import invalid_signature
from edge_server.api.errors import RequestError
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
    """The key file holds no key that can verify a signature."""


class _Registry(JWSRegistry):
    """Accepts the algorithm of the key; does not warn of deprecated names."""

    max_header_length = _LONGEST_HEADER
    max_payload_length = _LONGEST_BODY

    def get_alg(self, name: str) -> Any:
        """Give an algorithm by its name."""
        return self.algorithms[name]


_REGISTRY: Final = _Registry(strict_check_header=False)


class Signatures:
    """The cloud's keys; verifies its signatures."""

    def __init__(self, keys: Mapping[str | None, _Key], edge_id: str) -> None:
        """Accept signatures by these keys, by their `kid`, that name this audience."""
        self._keys = keys
        self._edge_id = edge_id

    def check(self, signature: str, body: bytes, path: str, now: float) -> Token:
        """Verify the signature of a body; returns its token, which may be used once.

        Raises:
            Unauthorized: if it is malformed, or not by the cloud.
            Forbidden: if its audience is another server, or it is not valid now.
            RequestError: if a claim is missing or malformed.
        """
        protected = _protected(signature)
        key = self._key(protected)
        algorithms = _algorithms(key)
        if protected.get("alg") not in algorithms:
            raise invalid_signature(f"the algorithm must be {' or '.join(algorithms)}")
        try:
            jws.deserialize_compact(signature, key, registry=_REGISTRY, payload=body)
        except (JoseError, ValueError):
            raise invalid_signature("the signature does not fit the body and the key") from None
        return self._claims(protected, path, now, needs_path=not body)

    def _key(self, protected: Mapping[str, Any]) -> _Key:
        kid = protected.get("kid")
        if kid is None and len(self._keys) == 1:
            return next(iter(self._keys.values()))
        if isinstance(kid, str) and kid in self._keys:
            return self._keys[kid]
        if None in self._keys and isinstance(kid, str):
            return self._keys[None]  # A key without a kid verifies any kid
        raise invalid_signature("kid names no key of the cloud")

    def _claims(
        self, protected: Mapping[str, Any], path: str, now: float, *, needs_path: bool
    ) -> Token:
        audience, expires_at, jti = (protected.get(name) for name in ("aud", "exp", "jti"))
        if not isinstance(jti, str) or _JTI.fullmatch(jti) is None:
            raise _invalid_claim("jti", "must be 1 to 128 visible ASCII characters")
        if expires_at is None or not _is_time(expires_at):
            raise _invalid_claim("exp", "must be epoch seconds")
        audiences = audience if isinstance(audience, list) else [audience]
        if not all(isinstance(one, str) for one in audiences) or not audiences:
            raise _invalid_claim("aud", "must name the edge servers that it is for")
        if self._edge_id not in audiences:
            raise Forbidden("the signature is for another edge server (aud)")
        if now >= expires_at:
            raise Forbidden("the signature has expired (exp)")
        if expires_at > now + LONGEST_LIFE_S:
            raise Forbidden("the signature is valid for too long: 7 days at most (exp)")
        if "nbf" in protected and not (_is_time(protected["nbf"]) and protected["nbf"] <= now):
            raise Forbidden("the signature is not valid yet (nbf)")
        if protected.get("htu") not in {path, path + "/"} and (needs_path or "htu" in protected):
            raise Forbidden("the signature must be for this path (htu)")
        return Token(jti, float(expires_at))


def load(path: Path, edge_id: str) -> Signatures:
    """Read the cloud's keys: a JWK, a JWK set, or a public key in PEM.

    Raises:
        SignatureKeyError: if there is no Ed25519 key, and no secret of 32 bytes or more.
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


def _protected(signature: str) -> dict[str, Any]:
    """Read the protected header, which is not verified yet."""
    parts = signature.split(".")
    if len(signature) > _LONGEST_HEADER or len(parts) != 3 or parts[1] or not all(parts[::2]):
        raise invalid_signature("the signature must be a detached JWS: header..signature")
    try:
        protected = json.loads(
            urlsafe_b64decode(parts[0].encode()), object_pairs_hook=unique_members
        )
    except (ValueError, Base64Error, RecursionError):
        raise invalid_signature("the signature's header is not JSON in base64url") from None
    if not isinstance(protected, dict) or not isinstance(protected.get("alg"), str):
        raise invalid_signature("the signature's header must be an object with alg")
    if not _FOREIGN_KEYS.isdisjoint(protected):
        raise invalid_signature("a signature that contains a key is not accepted")
    if not set(_strings(protected.get("crit", []))) <= {"b64"}:
        raise invalid_signature("the signature's header has an unsupported crit")
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


def _invalid_claim(claim: str, reason: str) -> RequestError:
    return RequestError(422, f"the signature's {claim} {reason}")
