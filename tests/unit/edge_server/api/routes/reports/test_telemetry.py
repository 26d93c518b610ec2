"""Reports over HTTP: stored once, shown, corrected, deleted."""

import base64

import pytest
from sqlalchemy import text

from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import TELEMETRY, telemetry

KINDS = list(TELEMETRY)
PLURALS = {"battery": "batteries"}


@pytest.mark.first_case
@pytest.mark.parametrize("kind", KINDS)
def test_a_report_is_kept_and_due(edge: Edge, kind: str) -> None:
    answer = edge.report(kind, {kind: telemetry(kind)})
    assert answer.status_code == 201
    stored = answer.json or {}
    assert answer.headers["Location"] == f"/{kind}/{stored['id']}/"
    assert edge.get(answer.headers["Location"]) == stored
    sent = telemetry(kind)
    assert {name: stored[name] for name in sent} == sent
    assert edge.count("outbox") == 1


@pytest.mark.first_case
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("slash", ["", "/"])
def test_singular_and_plural_with_and_without_slash(edge: Edge, kind: str, slash: str) -> None:
    for word in (kind, PLURALS.get(kind, f"{kind}s")):
        answer = edge.post(f"/{word}{slash}", telemetry(kind), "broker")
        assert answer.status_code == 201
        identifier = (answer.json or {})["id"]
        path = f"/{word}/{identifier}{slash}"
        assert edge.get(path)["id"] == identifier
        assert edge.ask("PUT", path, "admin", json=telemetry(kind, 9)).status_code == 200
        assert edge.ask("DELETE", path, "admin").status_code == 204
        assert edge.get(f"/{word}{slash}") == []


def test_a_record_of_one_kind_is_not_found_under_another(edge: Edge) -> None:
    identifier = (edge.report("pose", telemetry("pose")).json or {})["id"]
    assert edge.ask("GET", f"/battery/{identifier}", "operator").status_code == 404


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_repeated_report_under_its_key_is_stored_once(edge: Edge) -> None:
    first = edge.report("pose", telemetry("pose"), key="01K9Z4T1W8F6Q2M3N5P7R9S0VX")
    again = edge.report("pose", {"pose": telemetry("pose")}, key="01K9Z4T1W8F6Q2M3N5P7R9S0VX")
    assert (again.status_code, again.json) == (201, first.json)
    assert (edge.count("telemetry"), edge.count("outbox")) == (1, 1)


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_repeated_report_is_known_after_its_delivery(edge: Edge) -> None:
    first = edge.report("pose", telemetry("pose"), key="one")
    with edge.context.database.write() as connection:
        connection.execute(text("DELETE FROM telemetry"))
    again = edge.report("pose", telemetry("pose"), key="one")
    assert (again.status_code, again.json) == (201, first.json)
    assert edge.count("telemetry") == 0


@pytest.mark.first_case
@pytest.mark.parametrize("kind", ["pose", "battery"])
def test_a_key_used_for_something_else_is_refused(edge: Edge, kind: str) -> None:
    edge.report("pose", telemetry("pose"), key="one")
    answer = edge.report(kind, telemetry(kind, sequence_number=1), key="one")
    assert answer.status_code == 422
    assert edge.count("telemetry") == 1


@pytest.mark.first_case
@pytest.mark.parametrize("key", ["x" * 65, "with space", "\xe9"])
def test_a_key_of_another_shape_is_refused(edge: Edge, key: str) -> None:
    assert edge.report("pose", telemetry("pose"), key=key).status_code == 422
    assert edge.count("telemetry") == 0


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_list_is_cut_into_pages_in_order(edge: Edge) -> None:
    for number in range(5):
        edge.report("pose", telemetry("pose", number, vehicle_id=1 + number % 2))
    first = edge.get("/pose/?limit=2")
    rest = edge.get(f"/pose/?after={first[-1]['id']}")
    assert [item["sequence_number"] for item in first + rest] == [0, 1, 2, 3, 4]
    assert [item["sequence_number"] for item in edge.get("/pose/?vehicle_id=2")] == [1, 3]


@pytest.mark.first_case
@pytest.mark.parametrize(
    "query", ["limit=0", "limit=1001", "limit=x", "limit=1e2", "after=-1", "vehicle_id=0"]
)
def test_a_bad_query_is_refused_by_name(edge: Edge, query: str) -> None:
    answer = edge.ask("GET", f"/pose/?{query}", "operator")
    assert answer.status_code == 422
    assert query.partition("=")[0] in (answer.json or {})["detail"]["query"]


def test_lists_of_images_leave_the_pictures_out(edge: Edge) -> None:
    identifier = (edge.report("image", telemetry("image")).json or {})["id"]
    assert "frame" not in edge.get("/image/")[0]
    assert "frame" in edge.get(f"/image/{identifier}")


def test_a_picture_of_a_mebibyte_fits_and_a_bigger_body_does_not(edge: Edge) -> None:
    picture = b"\xff\xd8\xff" + bytes(1_048_576 - 3)
    body = telemetry("image") | {
        "frame": base64.b64encode(picture).decode(),
        "image_size": len(picture),
    }
    assert edge.report("image", body).status_code == 201
    assert edge.report("pose", telemetry("pose") | {"x": "y" * 1_100_000}).status_code == 413
    assert edge.report("image", body | {"x": "y" * 300_000}).status_code == 413


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_corrected_report_is_a_new_message_to_the_cloud(edge: Edge) -> None:
    stored = edge.report("pose", telemetry("pose")).json or {}
    answer = edge.ask("PUT", f"/pose/{stored['id']}", "admin", json=telemetry("pose", 7))
    corrected = answer.json or {}
    assert corrected["sequence_number"] == 7
    assert corrected["message_id"] != stored["message_id"]
    assert edge.count("outbox") == 1


def test_a_report_cannot_change_its_vehicle(edge: Edge) -> None:
    stored = edge.report("pose", telemetry("pose")).json or {}
    path = f"/pose/{stored['id']}"
    answer = edge.ask("PUT", path, "admin", json=telemetry("pose", vehicle_id=2))
    assert answer.status_code == 409
    assert edge.get(path) == stored


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_deleted_report_is_not_due_any_more(edge: Edge) -> None:
    stored = edge.report("pose", telemetry("pose")).json or {}
    edge.ask("DELETE", f"/pose/{stored['id']}", "admin")
    assert (edge.count("telemetry"), edge.count("outbox")) == (0, 0)
    assert edge.ask("DELETE", f"/pose/{stored['id']}", "admin").status_code == 404


@pytest.mark.first_case
@BOTH_ENGINES
def test_ids_are_never_used_again(edge: Edge) -> None:
    first = (edge.report("pose", telemetry("pose")).json or {})["id"]
    edge.ask("DELETE", f"/pose/{first}", "admin")
    assert (edge.report("pose", telemetry("pose")).json or {})["id"] > first


@pytest.mark.first_case
@pytest.mark.parametrize("kind", KINDS)
def test_a_bad_report_is_refused_and_nothing_is_stored(edge: Edge, kind: str) -> None:
    answer = edge.report(kind, telemetry(kind) | {"vehicle_id": 0, "surprise": 1})
    assert answer.status_code == 422
    assert {"vehicle_id", "surprise"} <= (answer.json or {})["detail"]["json"].keys()
    assert (edge.count("telemetry"), edge.count("outbox")) == (0, 0)
