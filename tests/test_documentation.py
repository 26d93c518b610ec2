"""Documents agree with the tree: paths and links exist, examples run, the site builds."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs.tools import reference

ROOT = Path(__file__).parent.parent
TOP_LEVEL = {
    "afarcloud",
    "console",
    "edge_server",
    "mavlink_broker",
    "uav_firmware",
    "sim",
    "tests",
    "examples",
    "deploy",
    "docs",
}
DOCUMENTS = sorted(
    path
    for path in ROOT.rglob("*.md")
    if path.relative_to(ROOT).parts[0] in TOP_LEVEL or path.parent == ROOT
    if "node_modules" not in path.parts
)
CODE_SPAN = re.compile(r"`([^`\n]+)`")
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")


def name_of(document: Path) -> str:
    return str(document.relative_to(ROOT))


def fences(document: Path, language: str) -> list[str]:
    return [body for found, body in FENCE.findall(document.read_text()) if found == language]


def named_paths(document: Path) -> list[str]:
    """Code spans that name a file or folder of the tree, pattern characters left out."""
    prose = FENCE.sub("", document.read_text())
    spans = [span.split(":")[0] for span in CODE_SPAN.findall(prose)]
    return [
        span
        for span in spans
        if "/" in span and span.split("/")[0] in TOP_LEVEL and not re.search(r"[*<>{} ]", span)
    ]


def test_every_program_and_the_vocabulary_have_a_readme() -> None:
    for package in ("afarcloud", "edge_server", "mavlink_broker", "uav_firmware", "sim"):
        assert (ROOT / package / "README.md").is_file()


def test_every_path_named_in_a_document_exists() -> None:
    missing = [
        f"{name_of(document)}: {path}"
        for document in DOCUMENTS
        for path in named_paths(document)
        if not (ROOT / path).exists()
    ]
    assert missing == []


def test_every_link_of_a_document_leads_somewhere() -> None:
    missing = [
        f"{name_of(document)}: {link}"
        for document in DOCUMENTS
        for link in LINK.findall(document.read_text())
        if not (document.parent / link).exists()
    ]
    assert missing == []


def test_every_make_target_named_in_a_document_exists() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for document in DOCUMENTS:
        text = document.read_text()
        named = re.findall(r"`(?:[A-Z_]+=\S+ )*make ([a-z-]+)", text)
        named += re.findall(r"^(?:[A-Z_]+=\S+ )*make ([a-z-]+)", text, re.MULTILINE)
        assert set(named) <= targets, name_of(document)


def test_every_python_example_runs() -> None:
    for document in DOCUMENTS:
        for example in fences(document, "python"):
            run = subprocess.run(
                [sys.executable, "-c", example],
                check=False,
                cwd=ROOT,
                capture_output=True,
                text=True,
                timeout=120,
            )
            assert run.returncode == 0, f"{name_of(document)}:\n{example}\n{run.stderr}"
            assert " object at 0x" not in run.stdout, f"{name_of(document)}:\n{run.stdout}"


def test_every_json_example_is_json() -> None:
    for document in DOCUMENTS:
        for example in fences(document, "json"):
            try:
                json.loads(example)
            except ValueError as fault:
                pytest.fail(f"{name_of(document)}: {fault}:\n{example}")


def test_the_data_path_of_the_readme_is_complete() -> None:
    readme = (ROOT / "README.md").read_text()
    readme = readme.split("## The way of the data")[1]
    rows = re.findall(r"^\| (\d+) \| (.+?) \| (.+?) \|", readme, re.MULTILINE)
    assert [int(number) for number, _, _ in rows] == list(range(1, len(rows) + 1))
    for _, stage, files in rows:
        assert CODE_SPAN.findall(files), stage


def test_every_dependency_has_its_reason() -> None:
    project = (ROOT / "pyproject.toml").read_text()
    declared = set(re.findall(r'"([a-z0-9-]+)(?:\[[a-z]+\])?>=', project)) - {"setuptools"}
    reasons = (ROOT / "docs/reference/dependencies.md").read_text()
    unexplained = [name for name in declared if not re.search(rf"\b{name}\b", reasons)]
    assert unexplained == []
    assert len(declared) > 15


PAGES = [document for document in DOCUMENTS if document.is_relative_to(ROOT / "docs")]
READMES = [document for document in DOCUMENTS if document.name == "README.md"]
MOST_WORDS = 1600


def anchors(document: Path) -> set[str]:
    """Fragments of a document's headings, as GitHub and MkDocs make them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", document.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\s-]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_to_a_heading_finds_it() -> None:
    heading = re.compile(r"\]\((?!https?:)([^)#\s]*)#([^)\s]+)\)")
    missing = [
        f"{name_of(document)}: {target}#{fragment}"
        for document in DOCUMENTS
        for target, fragment in heading.findall(document.read_text())
        if fragment not in anchors(document.parent / target if target else document)
    ]
    assert missing == []


def test_a_page_is_short() -> None:
    for document in PAGES:
        if str(document.relative_to(ROOT / "docs")) not in reference.PAGES:
            assert len(document.read_text().split()) <= MOST_WORDS, name_of(document)


def test_a_block_of_code_has_lines_of_its_own() -> None:
    for document in (*PAGES, *READMES):
        for line in document.read_text().splitlines():
            assert "```" not in line or re.fullmatch(r"\s*```\w*", line), (name_of(document), line)


def test_a_package_readme_is_short() -> None:
    for document in READMES:
        if document.parent != ROOT:
            assert len(document.read_text().split()) <= 500, name_of(document)


@pytest.mark.first_case
@pytest.mark.parametrize("page", reference.PAGES)
def test_a_generated_page_is_what_the_code_says(page: str) -> None:
    assert (ROOT / "docs" / page).read_text() == reference.PAGES[page](), "run make reference"


def links_of(document: Path) -> set[Path]:
    """Documents and other files that a document links to."""
    targets = {
        (document.parent / target).resolve() for target in LINK.findall(document.read_text())
    }
    return {target / "README.md" if target.is_dir() else target for target in targets}


def test_every_page_is_two_clicks_from_the_readme() -> None:
    first = links_of(ROOT / "README.md")
    second = set().union(*(links_of(page) for page in first if page.suffix == ".md"))
    assert set(PAGES) - first - second == set()


def test_the_code_that_decides_an_abort_is_within_four_clicks() -> None:
    page = ROOT / "docs/explanation/abort.md"
    assert page in links_of(ROOT / "README.md")
    assert ROOT / "mavlink_broker/mission/abort_executor.py" in links_of(page)
    steps = re.findall(
        r"^\| \d \| \[`(.+?)`\].+? \| (?:`(\w+)`)? *\|", page.read_text(), re.MULTILINE
    )
    assert len(steps) == 7
    for file, function in steps:
        assert not function or f"def {function}(" in (ROOT / file).read_text(), function


@pytest.mark.thorough
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", tmp_path],
        check=False,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert (tmp_path / "explanation/abort.html").is_file()
    assert (tmp_path / "source/mavlink_broker/mission/abort_executor.py.html").is_file()
