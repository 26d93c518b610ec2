"""The reference pages of the endpoints list what the server's OpenAPI document describes."""

import re

from tests.support import pages
from tests.unit.edge_server.conftest import Edge

KINDS = "battery|image|observation|state_vector|mission_report|alarm"


def normalised(path: str) -> str:
    """The same path for every parameter name, kind of report, and final slash."""
    path = re.sub(r"[<{][^>}]*[>}]", "<>", path.split("?", maxsplit=1)[0])
    return re.sub(rf"^/({KINDS})\b", "/pose", path).rstrip("/")


def test_the_pages_list_every_endpoint(edge: Edge) -> None:
    names = ("http-endpoints", "flight-endpoints", "access")
    text = "".join(pages.text(f"reference/{name}.md") for name in names)
    listed = {
        (method, normalised(path))
        for method, path in re.findall(r"`(GET|POST|PUT|PATCH|DELETE) (/[^`]*)`", text)
    }
    listed.add(("GET", "/pose"))  # "`GET` the same"
    for_people = ("/docs", "/docs/try.js", "/console", "/console/<>")
    listed -= {("GET", path) for path in for_people}
    described = {
        (method.upper(), normalised(path))
        for path, operations in edge.get("/openapi.json")["paths"].items()
        for method in operations
    }
    assert listed == described
