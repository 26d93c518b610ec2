"""MkDocs hook: files outside `docs/` that a page links to become pages of the site.

In the repository a link such as `../../sim/config.py` opens the file. The site holds `docs/` alone,
so the hook adds a page `source/sim/config.py` with the highlighted file and points the link there.
A linked Markdown file (a package's README) becomes a page with its own links followed likewise.
A picture is copied. A link to a folder leads to the README in it.
"""

import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT: Final = Path(__file__).parents[2]
SOURCE: Final = "source"
LINK: Final = re.compile(r"(\]\()(?!https?:|#)([^)#\s]+)((?:#[^)\s]*)?\))")
PICTURES: Final = frozenset({".jpg", ".png"})


def on_files(files: Files, /, *, config: MkDocsConfig) -> Files:
    """Add a page for each file of the repository that a page links to, directly or not."""
    waiting = [
        f"docs/{file.src_uri}" for file in files.documentation_pages() if file.src_uri[:1] != "/"
    ]
    seen: set[str] = set()
    while waiting:
        here = waiting.pop()
        for target in _targets(here, (ROOT / here).read_text(encoding="utf-8")):
            if target in seen or target.startswith("docs/") or not (ROOT / target).is_file():
                continue
            seen.add(target)
            files.append(_as_page(target, config))
            if target.endswith(".md"):
                waiting.append(target)
    return files


def on_page_markdown(markdown: str, /, *, page: Any, **_: object) -> str:
    """Point links that leave `docs/` to the pages that `on_files` has added."""
    uri: str = page.file.src_uri
    if uri.startswith(f"{SOURCE}/"):
        if not uri.endswith("README.md"):
            return markdown
        here = uri.removeprefix(f"{SOURCE}/")
    else:
        here = f"docs/{uri}"

    def redirected(link: re.Match[str]) -> str:
        target = _page_of(_resolved(here, link[2]))
        return f"{link[1]}{posixpath.relpath(target, posixpath.dirname(uri) or '.')}{link[3]}"

    return LINK.sub(redirected, markdown)


def _targets(here: str, text: str) -> Iterator[str]:
    for _, target, _ in LINK.findall(text):
        yield _resolved(here, target)


def _resolved(here: str, target: str) -> str:
    """Path from the root of the repository; a folder means the README in it."""
    path = posixpath.normpath(posixpath.join(posixpath.dirname(here), target))
    return f"{path}/README.md" if (ROOT / path).is_dir() else path


def _page_of(path: str) -> str:
    """Path within the site's sources of a path within the repository."""
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    kept = path.endswith(".md") or Path(path).suffix in PICTURES
    return f"{SOURCE}/{path}" if kept else f"{SOURCE}/{path}.md"


def _as_page(path: str, config: MkDocsConfig) -> File:
    name = _page_of(path)
    if Path(path).suffix in PICTURES:
        return File.generated(config, name, abs_src_path=str(ROOT / path))
    text = (ROOT / path).read_text(encoding="utf-8")
    if not path.endswith(".md"):
        language = {".py": "python", ".json": "json"}.get(Path(path).suffix, "text")
        text = f"# `{path}`\n\n````{language}\n{text}````\n"
    return File.generated(config, name, content=text)
