"""The built console is served to everybody, and nothing else of the machine is."""

import gzip
from pathlib import Path

import pytest

from tests.unit.edge_server.conftest import Edge

BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}
PAGE = "<!doctype html><title>Farm console</title>"
SCRIPT = "console.log('farm')"


@pytest.fixture
def built(edge: Edge) -> Path:
    """The folder of a built console."""
    folder = edge.config.console_dir
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text(PAGE, encoding="utf-8")
    (folder / "assets" / "index-4f2a.js").write_text(SCRIPT, encoding="utf-8")
    (folder / "favicon.svg").write_text("<svg/>", encoding="utf-8")
    return folder


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("path", ["/console/", "/console", "/console/fleet", "/console/plans/5"])
def test_an_address_of_the_console_answers_its_page(edge: Edge, path: str) -> None:
    page = edge.ask("GET", path, None, headers=BROWSER)
    assert (page.status_code, page.text, page.mimetype) == (200, PAGE, "text/html")
    assert page.headers["Cache-Control"] == "no-cache"


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("path", ["/console/", "/console/assets/index-4f2a.js"])
def test_the_browser_may_run_nothing_but_files_of_this_server(edge: Edge, path: str) -> None:
    answer = edge.ask("GET", path, None)
    policy = dict(
        part.strip().split(" ", 1) for part in answer.headers["Content-Security-Policy"].split(";")
    )
    assert policy["default-src"] == policy["connect-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["base-uri"] == policy["object-src"] == "'none'"
    assert "unsafe" not in answer.headers["Content-Security-Policy"]
    assert answer.headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.usefixtures("built")
def test_a_file_with_a_hash_in_its_name_is_cached_for_ever(edge: Edge) -> None:
    script = edge.ask("GET", "/console/assets/index-4f2a.js", None)
    assert (script.text, script.mimetype) == (SCRIPT, "text/javascript")
    assert script.headers["Cache-Control"] == "public, max-age=31536000, immutable"
    icon = edge.ask("GET", "/console/favicon.svg", None)
    assert (icon.mimetype, icon.headers["Cache-Control"]) == ("image/svg+xml", "no-cache")


def test_a_compressed_file_is_sent_to_a_browser_that_accepts_it(edge: Edge, built: Path) -> None:
    path = built / "assets" / "index-4f2a.js"
    path.with_suffix(".js.gz").write_bytes(gzip.compress(SCRIPT.encode()))
    place = "/console/assets/index-4f2a.js"
    packed = edge.ask("GET", place, None, headers={"Accept-Encoding": "gzip, br"})
    assert (packed.headers["Content-Encoding"], packed.mimetype) == ("gzip", "text/javascript")
    assert gzip.decompress(packed.data).decode() == SCRIPT
    plain = edge.ask("GET", place, None)
    assert ("Content-Encoding" in plain.headers, plain.text) == (False, SCRIPT)
    assert plain.headers["Vary"] == packed.headers["Vary"] == "Accept-Encoding"
    assert plain.headers["ETag"] != packed.headers["ETag"]
    part = {"Accept-Encoding": "gzip", "Range": "bytes=0-6"}
    assert edge.ask("GET", place, None, headers=part).text == SCRIPT[:7]


def test_a_page_is_sent_again_only_after_it_has_changed(edge: Edge, built: Path) -> None:
    tag = edge.ask("GET", "/console/", None).headers["ETag"]
    again = edge.ask("GET", "/console/", None, headers={"If-None-Match": tag})
    assert (again.status_code, again.text) == (304, "")
    (built / "index.html").write_text("newer", encoding="utf-8")
    newer = edge.ask("GET", "/console/", None, headers={"If-None-Match": tag})
    assert (newer.status_code, newer.text) == (200, "newer")


@pytest.mark.usefixtures("built")
def test_a_part_of_a_file_can_be_requested(edge: Edge) -> None:
    path = "/console/assets/index-4f2a.js"
    part = edge.ask("GET", path, None, headers={"Range": "bytes=0-6"})
    assert (part.status_code, part.text) == (206, "console")
    beyond = edge.ask("GET", path, None, headers={"Range": "bytes=1000-"})
    assert beyond.status_code == 416


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize(
    "name", ["assets/index-0000.js", "assets/none", "assets/", "missing.png", "style.css"]
)
def test_a_missing_file_is_not_answered_with_the_page(edge: Edge, name: str) -> None:
    assert edge.ask("GET", f"/console/{name}", None).status_code == 404


@pytest.mark.parametrize(
    "name",
    [
        "../secret.txt",
        "..%2Fsecret.txt",
        "assets/../../secret.txt",
        "%2e%2e/secret.txt",
        "..%5Csecret.txt",
        "%2Fetc%2Fpasswd",
        "/etc/passwd",
        "index.html%00.js",
        "assets/link.txt",
        "x" * 5000 + ".js",
    ],
)
def test_a_file_outside_the_folder_is_never_answered(edge: Edge, built: Path, name: str) -> None:
    secret = built.parent / "secret.txt"
    secret.write_text("s3cret", encoding="utf-8")
    (built / "assets" / "link.txt").symlink_to(secret)
    answer = edge.ask("GET", f"/console/{name}", None)
    assert answer.status_code in {200, 401, 404}  # 401: no route has such a path
    assert "s3cret" not in answer.text
    assert "root:" not in answer.text


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_the_console_cannot_be_written(edge: Edge, method: str) -> None:
    assert edge.ask(method, "/console/", None).status_code == 401
    assert edge.ask(method, "/console/", "admin").status_code == 405


@pytest.mark.usefixtures("built")
def test_a_browser_at_the_root_is_redirected_to_the_console(edge: Edge) -> None:
    answer = edge.ask("GET", "/", None, headers=BROWSER)
    assert (answer.status_code, answer.headers["Location"]) == (302, "/console/")
    assert edge.ask("GET", "/", None).status_code == 401
    assert edge.ask("GET", "/", "operator").status_code == 404


def test_a_console_that_is_not_built_says_so(edge: Edge) -> None:
    answer = edge.ask("GET", "/console/", None, headers=BROWSER)
    assert (answer.status_code, answer.mimetype) == (404, "text/html")
    assert "EDGE_CONSOLE_DIR" in answer.text
    assert str(edge.config.console_dir) not in answer.text
    assert edge.ask("GET", "/", None, headers=BROWSER).status_code == 200
