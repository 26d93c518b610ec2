"""`/console/`: the built files of the browser console, for everybody: they hold no data.

The console's own addresses below `/console/` are not files: they answer its `index.html`, so that
a page can be opened again. A missing file below `assets/` or with a suffix is 404 instead, because
a browser would take the page for a script. The build puts `<file>.gz` beside what is large; a
client that accepts gzip receives that.
"""

from pathlib import Path, PurePosixPath
from typing import Final

from flask import Blueprint, Response, redirect, request
from werkzeug.exceptions import NotFound
from werkzeug.security import safe_join

from edge_server.api import bodies
from edge_server.api.access.auth import PUBLIC, allow

PATH: Final = "/console/"
INDEX: Final = "index.html"
GZIP: Final = ".gz"
ASSETS: Final = "assets/"
"""Folder of the files whose names contain a hash of their content."""
CONTENT_SECURITY_POLICY: Final = (
    "default-src 'self'; img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self'; "
    "object-src 'none'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'"
)
IMMUTABLE: Final = "public, max-age=31536000, immutable"
REVALIDATED: Final = "no-cache"
NOT_BUILT: Final = (
    "<!doctype html><html lang=en><meta charset=utf-8><title>Edge server</title>"
    "<h1>The console is not built</h1>"
    "<p>There is no index.html in the folder of the setting EDGE_CONSOLE_DIR; "
    "<code>make console</code> builds one.</p>"
    "<p><a href=/docs>API documentation</a></p>"
)
TYPES: Final = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".jpg": "image/jpeg",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".mjs": "text/javascript; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".ttf": "font/ttf",
    ".wasm": "application/wasm",
    ".webmanifest": "application/manifest+json",
    ".webp": "image/webp",
    ".woff2": "font/woff2",
}
"""Content types by suffix; the table of the host's `mimetypes` differs between machines."""


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("console", __name__)
    for rule in (PATH, PATH.rstrip("/"), f"{PATH}<path:name>"):
        routes.add_url_rule(rule, "file", show_file, methods=["GET"])
    return routes


@allow(PUBLIC)
def show_file(name: str = "") -> Response:
    """Give a built file, or `index.html` for an address of the console; raises NotFound."""
    folder = bodies.context().config.console_dir
    if not is_built(folder):
        return _answer(NOT_BUILT.encode(), INDEX, 404)
    content = _read(folder, name)
    if content is not None:
        accepts_gzip = (
            request.accept_encodings.quality("gzip") > 0 and "Range" not in request.headers
        )
        compressed = _read(folder, name + GZIP) if accepts_gzip else None
        if compressed is not None:
            return _answer(compressed, name, is_gzip=True)
        return _answer(content, name)
    if name.startswith(ASSETS) or PurePosixPath(name).suffix:
        raise NotFound("the console has no such file")
    return _answer((folder / INDEX).read_bytes(), INDEX)


def lead_browser_to_console() -> Response | None:
    """Redirect a browser that opens `/` to the console if it is built; None for all others.

    Call it before the caller is identified: the console needs no key.
    """
    if not (opens_start_page() and is_built(bodies.context().config.console_dir)):
        return None
    answer = redirect(PATH)
    assert isinstance(answer, Response)  # noqa: S101  # Flask's own response class
    return answer


def opens_start_page() -> bool:
    """Whether a browser, not a program, opens `/`."""
    if request.path != "/" or request.method not in {"GET", "HEAD"}:
        return False
    best = request.accept_mimetypes.best_match(["application/json", "text/html"])
    return best == "text/html"


def is_built(folder: Path) -> bool:
    """Whether a folder has the built console."""
    return (folder / INDEX).is_file()


def _read(folder: Path, name: str) -> bytes | None:
    """Read a file below the folder; None if there is none."""
    if not name or "\0" in name:
        return None
    place = safe_join(str(folder), name)
    if place is None:
        return None
    path = Path(place)
    try:
        # A link must not lead out of the folder
        if not path.is_file() or not path.resolve().is_relative_to(folder.resolve()):
            return None
        return path.read_bytes()
    except OSError:  # A name that is too long for the file system, or an unreadable file
        return None


def _answer(content: bytes, name: str, status: int = 200, *, is_gzip: bool = False) -> Response:
    suffix = PurePosixPath(name).suffix.lower()
    answer = Response(content, status, content_type=TYPES.get(suffix, "application/octet-stream"))
    answer.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY
    answer.headers["Cache-Control"] = IMMUTABLE if name.startswith(ASSETS) else REVALIDATED
    answer.headers["Vary"] = "Accept-Encoding"
    if is_gzip:
        answer.headers["Content-Encoding"] = "gzip"
    if status == 200:
        answer.add_etag()
        answer.make_conditional(request, accept_ranges=not is_gzip, complete_length=len(content))
    return answer
