"""Documents are held to the tree: paths exist, targets exist, examples run."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TOP_LEVEL = {
    "afarcloud",
    "edge_server",
    "mavlink_broker",
    "uav_firmware",
    "sim",
    "tests",
    "examples",
    "deploy",
}
DOCUMENTS = sorted(
    path
    for path in ROOT.rglob("*.md")
    if path.relative_to(ROOT).parts[0] in TOP_LEVEL or path.parent == ROOT
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


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_path_named_in_a_document_exists(document: Path) -> None:
    missing = [path for path in named_paths(document) if not (ROOT / path).exists()]
    assert missing == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_link_of_a_document_leads_somewhere(document: Path) -> None:
    missing = [
        link for link in LINK.findall(document.read_text()) if not (document.parent / link).exists()
    ]
    assert missing == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_make_target_named_in_a_document_exists(document: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    text = document.read_text()
    named = re.findall(r"`(?:[A-Z_]+=\S+ )*make ([a-z-]+)", text)
    named += re.findall(r"^(?:[A-Z_]+=\S+ )*make ([a-z-]+)", text, re.MULTILINE)
    assert set(named) <= targets


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_python_example_runs(document: Path) -> None:
    for example in fences(document, "python"):
        run = subprocess.run(
            [sys.executable, "-c", example],
            check=False,
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert run.returncode == 0, f"{example}\n{run.stderr}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_json_example_is_json(document: Path) -> None:
    for example in fences(document, "json"):
        json.loads(example)


def test_the_data_path_of_the_readme_is_complete() -> None:
    readme = (ROOT / "README.md").read_text()
    rows = re.findall(r"^\| (\d+) \| (.+?) \| (.+?) \|", readme, re.MULTILINE)
    assert [int(number) for number, _, _ in rows] == list(range(1, len(rows) + 1))
    for _, stage, files in rows:
        assert CODE_SPAN.findall(files), stage


def test_every_dependency_has_its_reason_in_the_readme() -> None:
    project = (ROOT / "pyproject.toml").read_text()
    declared = re.findall(r'^    "([a-z0-9-]+)>=', project, re.MULTILINE)
    reasons = (ROOT / "README.md").read_text().split("## Dependencies")[1]
    unexplained = [name for name in declared if not re.search(rf"\b{name}\b", reasons)]
    assert unexplained == []
    assert len(declared) > 15
