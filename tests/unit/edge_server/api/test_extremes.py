"""Values at the edge of what a database can hold: on no engine are they an error of ours."""

from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, mission_report, plan, telemetry

LARGEST = 2**63 - 1
NUL = "left\x00right"


@BOTH_ENGINES
def test_a_number_that_nothing_has_finds_nothing(edge: Edge) -> None:
    for thing in ("plans", "pose", "events", "fields", "vehicles", "dead_letters"):
        assert edge.ask("GET", f"/{thing}/{LARGEST}", "admin").status_code == 404, thing
    assert edge.ask("DELETE", f"/vehicles/{LARGEST}", "admin").status_code == 404
    assert edge.acknowledge(LARGEST, "accepted").status_code == 404


@BOTH_ENGINES
def test_a_list_after_the_largest_number_is_empty(edge: Edge) -> None:
    for thing in ("plans", "pose", "events", "fields", "audit", "dead_letters"):
        answer = edge.ask("GET", f"/{thing}/?after={LARGEST}", "admin")
        assert (answer.status_code, answer.data.strip() or b"[]") == (
            200,
            b"[]",
        )  # Or no line at all


@BOTH_ENGINES
def test_a_nul_in_a_text_is_a_letter_like_others_on_its_way_to_the_cloud(edge: Edge) -> None:
    assert edge.post_plan(plan(mission(), name=NUL)).status_code == 201
    edge.accept()
    kept = edge.report("mission_report", mission_report(2) | {"message": NUL})
    assert kept.status_code == 201
    assert kept.json is not None
    assert edge.get(f"/mission_report/{kept.json['id']}")["message"] == NUL
    (shown,) = edge.get("/plans/")
    assert shown["name"] == NUL
    assert shown["missions"][0]["message"].startswith("left")
    assert edge.report("alarm", telemetry("alarm") | {"message": NUL}).status_code == 201


@BOTH_ENGINES
def test_a_nul_in_an_address_finds_nothing(edge: Edge) -> None:
    assert edge.ask("GET", f"/plans/{'%00' * 26}", "operator").status_code == 404
