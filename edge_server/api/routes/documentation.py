"""`/openapi.json` and `/docs`: the API for programs and for people, readable without a network.

Both need a key like everything else; a browser asks for it (any name, the key as the password).
`/` answers a browser with a link to it. On the page every request can be tried out.
"""

import html
import json
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

from flask import Blueprint, Flask, Response, current_app
from flask.typing import ResponseReturnValue

from edge_server.api import openapi, schemas, urls
from edge_server.api.access.auth import READERS, allow, roles_of
from edge_server.api.contract import Contract, contract_of, describe
from edge_server.api.routes.console import opens_start_page

_METHODS: Final = ("GET", "POST", "PUT", "PATCH", "DELETE")
_STYLE: Final = """
body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
h2{margin-top:2.5rem;border-bottom:1px solid #ccc}code,pre{font:14px/1.4 ui-monospace,monospace}
pre{background:#f4f4f2;padding:1rem;overflow:auto}table{border-collapse:collapse}
td,th{padding:.2rem 1rem .2rem 0;text-align:left;vertical-align:top}
form{margin:1rem 0}label{display:block}textarea{width:100%;height:10rem}
output{display:block;white-space:pre-wrap;font:14px/1.4 ui-monospace,monospace}
summary{cursor:pointer}.method{display:inline-block;min-width:4.5rem;font-weight:600}
"""
_SCRIPT: Final = Path(__file__).with_name("try_out.js")
_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"
_POLICY_WITH_SCRIPT: Final = f"{_POLICY}; script-src 'self'; connect-src 'self'"
_STREAM: Final = "/live/"
"""An answer that never ends; it cannot be tried out."""
_START_PAGE: Final = (
    f"<!doctype html><html lang=en><meta charset=utf-8><title>Edge server</title>"
    f"<style>{_STYLE}</style><h1>Edge server</h1>"
    "<p>This server takes flight plans by REST and forwards what vehicles report to the cloud.</p>"
    "<p><a href=/docs>API documentation</a> (any user name; the password is an access key)</p>"
)


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("documentation", __name__)
    urls.add(routes, ("openapi.json",), "openapi", show_document, "GET")
    urls.add(routes, ("docs",), "docs", show_page, "GET")
    urls.add(routes, ("docs",), "script", show_script, "GET", action="try.js")
    return routes


@allow(READERS)
@describe(Contract({200: schemas.OpenApi}))
def show_document() -> ResponseReturnValue:
    """Give the OpenAPI 3.1 document."""
    return _document(_app())


@allow(READERS)
def show_page() -> ResponseReturnValue:
    """Show the document as a page."""
    return _html("".join(_page(_document(_app()))), _POLICY_WITH_SCRIPT)


@allow(READERS)
def show_script() -> ResponseReturnValue:
    """Give the script that sends requests from the page."""
    return Response(_SCRIPT.read_bytes(), content_type="text/javascript; charset=utf-8")


def link_browser_to_docs() -> Response | None:
    """Answer a browser that opens `/` with a page that links to `/docs`; None for all others.

    Call it before the caller is identified: the page needs no key and shows no data.
    """
    return _html(_START_PAGE) if opens_start_page() else None


def _html(text: str, policy: str = _POLICY) -> Response:
    page = Response(text, content_type="text/html; charset=utf-8")
    page.headers["Content-Security-Policy"] = policy
    return page


def _app() -> Flask:
    app: Flask = current_app._get_current_object()  # type: ignore[attr-defined]  # noqa: SLF001  # the app behind the proxy
    return app


@cache
def _document(app: Flask) -> dict[str, Any]:
    return openapi.document(_routes(app))


def _routes(app: Flask) -> Iterator[openapi.Route]:
    """One route for each endpoint and converter: the first name, with the slash at the end."""
    seen: set[tuple[str, str]] = set()
    for rule in app.url_map.iter_rules():
        view = app.view_functions[rule.endpoint]
        contract = contract_of(view)
        shape = openapi.CONVERTER.search(rule.rule)
        key = (rule.endpoint, shape[0] if shape else "")
        if contract is None or key in seen:
            continue
        seen.add(key)
        roles = tuple(sorted(role.value for role in roles_of(view) or ()))
        summary = (view.__doc__ or "").strip().splitlines()[0]
        for method in sorted(set(rule.methods or ()) & set(_METHODS)):
            yield openapi.Route(
                urls.canonical(rule), method, rule.endpoint, summary, roles, contract
            )


def _page(document: dict[str, Any]) -> Iterable[str]:
    info = document["info"]
    yield (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{_text(info['title'])}</title>"
        f"<style>{_STYLE}</style><script defer src=/docs/try.js></script>"
        f"<h1>{_text(info['title'])} {_text(info['version'])}</h1>"
        f"<p>{_text(info['description'])} For programs: "
        "<a href=openapi.json>openapi.json</a>.</p>"
    )
    for path, operations in document["paths"].items():
        yield f"<h2><code>{_text(path)}</code></h2>"
        for method, operation in operations.items():
            yield from _operation(path, method, operation)
    yield "<h1>Schemas</h1>"
    for name, schema in document["components"]["schemas"].items():
        yield (
            f'<details id="{_text(name)}"><summary><code>{_text(name)}</code> '
            f"{_text(schema.get('description', ''))}</summary>{_code(schema)}</details>"
        )


def _operation(path: str, method: str, operation: dict[str, Any]) -> Iterable[str]:
    yield (
        f"<details><summary><span class=method>{method.upper()}</span> "
        f"{_text(operation['summary'])} {_text(operation.get('description', ''))}</summary><table>"
    )
    for parameter in operation.get("parameters", []):
        yield _row(f"{parameter['name']} ({parameter['in']})", parameter.get("description", ""))
    for status, answer in operation["responses"].items():
        yield _row(status, answer["description"], answer)
    yield "</table>"
    body = operation.get("requestBody", {}).get("content", {}).get("application/json")
    if body:
        yield f"<p>Body: {_link(body['schema'])}</p>"
        if "example" in body:
            yield _code(body["example"])
    if path != _STREAM:
        yield from _form(path, method, operation)
    yield "</details>"


def _form(path: str, method: str, operation: dict[str, Any]) -> Iterable[str]:
    """A form that sends the request; the script fills its output."""
    yield f'<form data-method="{method.upper()}" data-path="{_text(path)}">'
    for parameter in operation.get("parameters", []):
        name, place = _text(parameter["name"]), _text(parameter["in"])
        required = " required" if place == "path" else ""
        yield f'<label>{name} <input name="{name}" data-in="{place}"{required}></label>'
    content = operation.get("requestBody", {}).get("content", {})
    if body := content.get("application/json"):
        example = _text(json.dumps(body["example"], indent=2)) if "example" in body else ""
        yield f"<label>Body <textarea spellcheck=false>{example}</textarea></label>"
    yield "<button>Try it out</button><output></output></form>"


def _row(name: str, text: str, answer: dict[str, Any] | None = None) -> str:
    schema = (answer or {}).get("content", {}).get("application/json", {}).get("schema", {})
    return f"<tr><th>{_text(name)}<td>{_text(text)}<td>{_link(schema)}"


def _link(schema: dict[str, Any]) -> str:
    reference = schema.get("$ref") or schema.get("items", {}).get("$ref", "")
    name = _text(reference.rpartition("/")[2])
    return f'<a href="#{name}"><code>{name}</code></a>' if name else ""


def _code(value: Any) -> str:
    return f"<pre>{_text(json.dumps(value, indent=2))}</pre>"


def _text(value: str) -> str:
    return html.escape(value)
