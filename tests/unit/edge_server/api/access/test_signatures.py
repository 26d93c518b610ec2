"""A signature of the cloud is accepted once; any other is refused."""

import hashlib
import hmac
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given
from hypothesis import strategies as st
from joserfc.jwk import OctKey
from werkzeug.exceptions import HTTPException
from werkzeug.test import TestResponse

from edge_server.api.access import jws
from edge_server.api.errors import RequestError
from edge_server.services.fleet.events import EVENT_LIMIT
from tests.unit.edge_server.conftest import NOON, Edge
from tests.unit.edge_server.documents import mission, plan
from tests.unit.edge_server.signing import SECRET, SECRET_JWK, claims, encode, sign

BODY = json.dumps(plan(dispatch=False)).encode()
ABORT = json.dumps({"sequence_number": 1, "vehicle_id": 1, "event_type_id": 2}).encode()


def post(
    edge: Edge, signature: str | None, body: bytes = BODY, role: str = "cloud", key: str = ""
) -> TestResponse:
    headers: dict[str, Any] = {"X-JWS-Signature": signature}
    if key:
        headers["Idempotency-Key"] = key
    if signature is None and role != "cloud":
        del headers["X-JWS-Signature"]
    return edge.ask(
        "POST", "/plans/", role, data=body, headers=headers, content_type="application/json"
    )


def test_a_signed_plan_is_kept_and_held(edge: Edge) -> None:
    body = json.dumps(plan()).encode()
    answer = post(edge, sign(body, claims(NOON)), body)
    assert answer.status_code == 201
    assert (answer.json or {})["missions"][0]["dispatch_state"] == "held"


def test_a_plan_that_wants_to_start_by_itself_is_refused(edge: Edge) -> None:
    body = json.dumps(plan(dispatch=True)).encode()
    assert post(edge, sign(body, claims(NOON)), body).status_code == 403
    assert edge.count("plan") == 0


def test_the_body_may_be_signed_without_base64(edge: Edge) -> None:
    header = claims(NOON, b64=False, crit=["b64"])
    assert post(edge, sign(BODY, header)).status_code == 201


HOSTILE: list[tuple[int, str | None]] = [
    (401, None),
    (401, ""),
    (401, "nonsense"),
    (401, "a.b.c.d"),
    (401, sign(BODY, claims(NOON)).replace("..", f".{encode(BODY)}.")),  # Not detached
    (401, sign(BODY, claims(NOON))[:-4] + "AAAA"),
    (401, sign(BODY + b" ", claims(NOON))),
    (401, sign(BODY, claims(NOON), lambda _: b"")),
    (401, sign(BODY, claims(NOON, alg="none"), lambda _: b"")),
    (401, sign(BODY, claims(NOON, alg="none"), lambda _: b"x")),
    (401, sign(BODY, claims(NOON, alg="None"))),
    (401, sign(BODY, claims(NOON, alg="HS512"))),
    (401, sign(BODY, claims(NOON, alg="RS256"))),
    (401, sign(BODY, claims(NOON, alg="EdDSA"))),
    (401, sign(BODY, claims(NOON, alg=["HS256"]))),
    (401, sign(BODY, claims(NOON, alg=None))),
    (401, sign(BODY, claims(NOON, jwk=SECRET_JWK))),
    (401, sign(BODY, claims(NOON, jku="https://example.org/keys"))),
    (401, sign(BODY, claims(NOON, crit=["exp"]))),
    (401, sign(BODY, claims(NOON, crit="b64"))),
    (401, sign(BODY, claims(NOON, b64=False))),  # Without crit a verifier may ignore b64
    (401, encode(b"[1]") + "..AAAA"),
    (401, encode(b"\xff") + "..AAAA"),
    (401, encode(b"[" * 3000) + "..AAAA"),
    (401, "A" * 5000 + "..AAAA"),
    (403, sign(BODY, claims(NOON, aud="another"))),
    (403, sign(BODY, claims(NOON, aud=["a", "b"]))),
    (403, sign(BODY, claims(NOON, exp=int(NOON)))),
    (403, sign(BODY, claims(NOON, exp=0))),
    (403, sign(BODY, claims(NOON, exp=int(NOON) + 10**9))),
    (403, sign(BODY, claims(NOON, nbf=int(NOON) + 60))),
    (403, sign(BODY, claims(NOON, htu="/events"))),
    (422, sign(BODY, claims(NOON, exp=None))),
    (422, sign(BODY, claims(NOON, exp="soon"))),
    (422, sign(BODY, claims(NOON, exp=True))),
    (422, sign(BODY, claims(NOON, exp=float("inf")))),
    (422, sign(BODY, claims(NOON, exp=10**400))),
    (422, sign(BODY, claims(NOON, exp=-(10**400)))),
    (403, sign(BODY, claims(NOON, nbf=10**400))),
    (422, sign(BODY, claims(NOON, jti=None))),
    (422, sign(BODY, claims(NOON, jti=""))),
    (422, sign(BODY, claims(NOON, jti=7))),
    (422, sign(BODY, claims(NOON, jti="x" * 129))),
    (422, sign(BODY, claims(NOON, aud=None))),
    (422, sign(BODY, claims(NOON, aud=[]))),
    (422, sign(BODY, claims(NOON, aud={"edge": 1}))),
]


def test_a_hostile_token_leaves_no_trace(edge: Edge) -> None:
    for status, signature in HOSTILE:
        answer = post(edge, signature)
        assert answer.status_code == status, (signature, answer.json)
        assert (answer.json or {})["message"]
    assert edge.count("plan") == edge.count("spent_token") == 0


@pytest.mark.thorough
def test_a_signature_is_used_once(edge: Edge) -> None:
    signature = sign(BODY, claims(NOON))
    assert post(edge, signature).status_code == 201
    answer = post(edge, signature)
    assert answer.status_code == 403
    assert "jti" in (answer.json or {})["message"]
    assert edge.count("plan") == edge.count("spent_token") == 1


def test_a_lost_answer_is_repeated(edge: Edge) -> None:
    signature = sign(BODY, claims(NOON))
    first = post(edge, signature, key="once").json
    again = post(edge, signature, key="once")
    assert again.status_code == 201
    assert again.json == first
    assert edge.count("plan") == edge.count("audit") == 1


def test_a_refused_plan_uses_up_its_signature(edge: Edge) -> None:
    unknown = json.dumps(plan(dispatch=False)).replace('"vehicle_id": 1', '"vehicle_id": 9')
    signature = sign(unknown.encode(), claims(NOON))
    assert post(edge, signature, unknown.encode()).status_code == 422
    edge.register(9)
    assert post(edge, signature, unknown.encode()).status_code == 403
    assert edge.count("plan") == 0


@pytest.mark.first_case
@pytest.mark.parametrize(("vehicle_id", "status"), [(1, 409), (77, 404)])
def test_a_refused_abort_cannot_be_repeated_when_there_is_something_to_abort(
    edge: Edge, vehicle_id: int, status: int
) -> None:
    order = {"sequence_number": 1, "vehicle_id": vehicle_id, "event_type_id": 2}
    body = json.dumps(order).encode()
    headers = {"X-JWS-Signature": sign(body, claims(NOON, htu="/events"))}

    def abort() -> int:
        json_type = "application/json"
        asked = edge.ask(
            "POST", "/events/", "cloud", data=body, headers=headers, content_type=json_type
        )
        return asked.status_code

    assert abort() == status
    edge.register(vehicle_id)
    edge.post_plan(plan(mission(5, vehicle_id)))
    assert abort() == 403
    assert len(edge.work()) == 1


@pytest.mark.thorough
def test_a_temporary_refusal_leaves_the_signature_valid(edge: Edge) -> None:
    edge.post_plan(plan())
    for number in range(EVENT_LIMIT):
        body = {"sequence_number": number, "vehicle_id": 1, "event_type_id": 3, "maximum_speed": 2}
        assert edge.post("/events/", body, "operator").status_code == 201
    headers = {"X-JWS-Signature": sign(ABORT, claims(NOON, htu="/events"))}
    options: dict[str, Any] = {"data": ABORT, "content_type": "application/json"}
    full = edge.ask("POST", "/events/", "cloud", headers=headers, **options)
    assert full.status_code == 429
    for item in edge.work()[:EVENT_LIMIT]:
        edge.acknowledge(item["id"], "done")
    assert edge.ask("POST", "/events/", "cloud", headers=headers, **options).status_code == 201


def test_others_need_no_signature_but_a_bad_one_is_refused(edge: Edge) -> None:
    assert post(edge, sign(BODY, claims(NOON, aud="x")), role="operator").status_code == 403
    assert post(edge, None, role="operator").status_code == 201


def test_events_of_the_cloud_are_signed_too(edge: Edge) -> None:
    def send(signature: str | None) -> int:
        headers = {"X-JWS-Signature": signature}
        options = {"data": ABORT, "content_type": "application/json", "headers": headers}
        return edge.ask("POST", "/events/", "cloud", **options).status_code

    assert send(None) == 401
    assert send(sign(BODY, claims(NOON))) == 401
    assert send(sign(ABORT, claims(NOON))) not in {401, 403}


@pytest.mark.thorough
def test_where_there_is_no_body_the_path_is_signed(edge: Edge) -> None:
    signatures = jws.Signatures({None: _secret()}, "edge")
    path = "/plans/5/dispatch"
    bare, bound = sign(b"", claims(NOON)), sign(b"", claims(NOON, htu=path))
    with pytest.raises(HTTPException, match="htu"):
        signatures.check(bare, b"", path, NOON)
    with pytest.raises(HTTPException, match="htu"):
        signatures.check(bound, b"", "/plans/6/dispatch", NOON)
    assert signatures.check(bound, b"", path, NOON).expires_at == NOON + 60
    assert edge.ask("POST", path, "cloud").status_code == 403  # No unattended start


def _secret() -> Any:
    return OctKey.import_key(dict(SECRET_JWK))


def _key_file(tmp_path: Path, content: object) -> Path:
    path = tmp_path / "key.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="ascii")
    return path


@pytest.fixture(scope="module")
def private() -> Ed25519PrivateKey:
    """The cloud's own key."""
    return Ed25519PrivateKey.generate()


@pytest.fixture(scope="module")
def pem(private: Ed25519PrivateKey) -> str:
    """Its public part."""
    form = serialization.PublicFormat.SubjectPublicKeyInfo
    return private.public_key().public_bytes(serialization.Encoding.PEM, form).decode()


@pytest.mark.parametrize("alg", ["EdDSA", "Ed25519"])
def test_an_ed25519_key_in_pem_or_as_a_jwk(
    tmp_path: Path, private: Ed25519PrivateKey, pem: str, alg: str
) -> None:
    jwk = {"kty": "OKP", "crv": "Ed25519", "x": encode(private.public_key().public_bytes_raw())}
    for content in (pem, jwk, {"keys": [jwk | {"kid": "a"}]}):
        signatures = jws.load(_key_file(tmp_path, content), "edge")
        token = sign(BODY, claims(NOON, alg=alg), private.sign)
        assert signatures.check(token, BODY, "/plans", NOON).jti.startswith("jti-")


def test_a_public_key_is_no_secret(tmp_path: Path, pem: str) -> None:
    """Algorithm confusion: HS256 with the bytes of the public key as the secret."""
    signatures = jws.load(_key_file(tmp_path, pem), "edge")
    for secret in (pem.encode(), pem.strip().encode(), SECRET):
        forger = partial(hmac.digest, secret, digest=hashlib.sha256)
        forged = sign(BODY, claims(NOON), forger)
        with pytest.raises(HTTPException):
            signatures.check(forged, BODY, "/plans", NOON)


def test_the_key_is_chosen_by_its_name(tmp_path: Path, private: Ed25519PrivateKey) -> None:
    other = {"kty": "oct", "k": encode(b"o" * 32), "kid": "b"}
    keys = [SECRET_JWK | {"kid": "a"}, other]
    signatures = jws.load(_key_file(tmp_path, {"keys": keys}), "edge")
    assert signatures.check(sign(BODY, claims(NOON, kid="a")), BODY, "/plans", NOON)
    for kid in ("b", "c", None, 7):
        with pytest.raises(HTTPException):
            signatures.check(sign(BODY, claims(NOON, kid=kid)), BODY, "/plans", NOON)
    with pytest.raises(HTTPException):
        signatures.check(sign(BODY, claims(NOON, kid="a"), private.sign), BODY, "/plans", NOON)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "nonsense",
        "{}",
        "[]",
        {"keys": []},
        {"kty": "oct", "k": encode(b"x" * 31)},
        {"kty": "OKP", "crv": "X25519", "x": encode(b"x" * 32)},
        {"kty": "EC", "crv": "P-256", "x": encode(b"x" * 32), "y": encode(b"x" * 32)},
        {"keys": [SECRET_JWK, SECRET_JWK]},
    ],
)
def test_a_file_without_a_key_of_ours_is_refused(tmp_path: Path, content: object) -> None:
    with pytest.raises(jws.SignatureKeyError):
        jws.load(_key_file(tmp_path, content), "edge")


@pytest.mark.thorough
@given(shown=st.text(max_size=60) | st.from_regex(r"[A-Za-z0-9_-]{0,40}\.\.[A-Za-z0-9_-]{0,40}"))
def test_malformed_signatures_are_refused(shown: str) -> None:
    with pytest.raises((HTTPException, RequestError)):
        jws.Signatures({None: _secret()}, "edge").check(shown, BODY, "/plans", NOON)
