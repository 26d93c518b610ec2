"""The OpenAPI document describes what the server does."""

import html
import re
from base64 import b64encode
from typing import Any

import pytest

from afarcloud import wire
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import plan, telemetry

METHODS = {"GET", "POST", "PUT", "PATCH", "DELETE"}


@pytest.fixture
def document(edge: Edge) -> dict[str, Any]:
    found: dict[str, Any] = edge.get("/openapi.json")
    return found


def references(value: Any) -> set[str]:
    """Every schema that is referred to."""
    if isinstance(value, dict):
        own = {value["$ref"]} if isinstance(value.get("$ref"), str) else set()
        return own.union(*(references(one) for one in value.values()))
    if isinstance(value, list):
        return set().union(*(references(one) for one in value))
    return set()


def test_every_route_that_answers_data_is_described(edge: Edge, document: dict[str, Any]) -> None:
    described = {
        (operation["operationId"], method.upper())
        for operations in document["paths"].values()
        for method, operation in operations.items()
    }
    routes = {
        (rule.endpoint.replace(".", "_") + f"_{method.lower()}", method)
        for rule in edge.client.application.url_map.iter_rules()
        for method in set(rule.methods or ()) & METHODS
        if rule.endpoint not in {"documentation.docs", "documentation.script", "console.file"}
    }
    assert described == routes


def test_every_schema_that_is_named_is_there(document: dict[str, Any]) -> None:
    there = {f"#/components/schemas/{name}" for name in document["components"]["schemas"]}
    assert references(document) <= there


@pytest.mark.thorough
def test_the_document_names_the_roles(document: dict[str, Any]) -> None:
    assert document["paths"]["/pose/"]["post"]["description"] == "Roles: broker."
    assert "security" not in document["paths"]["/healthz/"]["get"]


@pytest.mark.thorough
def test_the_example_of_a_plan_is_taken(edge: Edge, document: dict[str, Any]) -> None:
    content = document["paths"]["/plans/"]["post"]["requestBody"]["content"]
    assert edge.post_plan(content["application/json"]["example"]).status_code == 201


@pytest.mark.first_case
@pytest.mark.parametrize("kind", [kind.value for kind in wire.TELEMETRY])
def test_an_answer_has_what_the_schema_requires(
    edge: Edge, document: dict[str, Any], kind: str
) -> None:
    stored = edge.report(kind, telemetry(kind)).json or {}
    name = wire.MODELS[wire.Kind(kind)].__name__
    schema = document["components"]["schemas"][f"Stored{name}"]
    assert set(schema["required"]) <= set(stored) <= set(schema["properties"])


def test_a_plans_answer_has_what_the_schema_requires(edge: Edge, document: dict[str, Any]) -> None:
    stored = edge.post_plan(plan()).json or {}
    schema = document["components"]["schemas"]["StoredPlan"]
    assert set(schema["required"]) <= set(stored) <= set(schema["properties"])


def test_the_page_needs_nothing_but_a_browser_and_a_key(edge: Edge) -> None:
    without_key = edge.ask("GET", "/docs", None)
    assert without_key.status_code == 401
    assert without_key.headers["WWW-Authenticate"].lower().startswith("basic")
    login = b64encode(f"me:{edge.key('operator')}".encode()).decode()
    page = edge.ask("GET", "/docs", None, headers={"Authorization": f"Basic {login}"})
    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["Content-Security-Policy"]
    for path in edge.get("/openapi.json")["paths"]:
        assert f"<code>{html.escape(path)}</code>" in page.text
    assert "http://" not in page.text
    assert "https://" not in page.text


def test_every_request_can_be_tried_out_but_the_stream(
    edge: Edge, document: dict[str, Any]
) -> None:
    page = edge.ask("GET", "/docs", "operator").text
    offered = set(re.findall(r'<form data-method="([A-Z]+)" data-path="([^"]+)">', page))
    described = {
        (method.upper(), html.escape(path))
        for path, operations in document["paths"].items()
        for method in operations
    }
    assert offered == described - {("GET", "/live/")}
    plan_form = page.split('<form data-method="POST" data-path="/plans/">')[1].split("</form>")[0]
    assert "command_array" in plan_form.split("<textarea")[1]


def test_the_page_runs_its_own_script_and_no_other(edge: Edge) -> None:
    page = edge.ask("GET", "/docs", "operator")
    assert re.findall(r"<script[^>]*>", page.text) == ["<script defer src=/docs/try.js>"]
    assert "script-src 'self'; connect-src 'self'" in page.headers["Content-Security-Policy"]
    assert "onclick" not in page.text
    script = edge.ask("GET", "/docs/try.js", "operator")
    assert script.mimetype == "text/javascript"
    assert "csrf_token" in script.text
    assert edge.ask("GET", "/docs/try.js", None).status_code == 401


def test_authorization_takes_precedence_over_x_api_key(edge: Edge) -> None:
    for wrong in ("Bearer nonsense", "Digest n=\xff", "Basic bm9uZTpub25l", "Basic \xff==", ""):
        headers = {"Authorization": wrong, "X-API-Key": edge.key("operator")}
        assert edge.ask("GET", "/plans/", None, headers=headers).status_code == 401


BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}


def test_a_browser_at_the_root_finds_the_documentation(edge: Edge) -> None:
    page = edge.ask("GET", "/", None, headers=BROWSER)
    assert page.status_code == 200
    assert page.mimetype == "text/html"
    assert "href=/docs" in page.text
    assert "default-src 'none'" in page.headers["Content-Security-Policy"]


@pytest.mark.first_case
@pytest.mark.parametrize("accept", [{}, {"Accept": "*/*"}, {"Accept": "application/json"}])
def test_the_root_is_nothing_to_other_clients(edge: Edge, accept: dict[str, str]) -> None:
    assert edge.ask("GET", "/", None, headers=accept).status_code == 401
    assert edge.ask("GET", "/", "operator", headers=accept).status_code == 404
    assert edge.ask("POST", "/", None, headers=accept | BROWSER).status_code == 401
