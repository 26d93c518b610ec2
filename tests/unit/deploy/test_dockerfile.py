"""The images hold what their programs need, and nothing names a machine or an index."""

import ast
import re
import subprocess
import sys
from functools import cache
from importlib.metadata import packages_distributions
from importlib.util import find_spec
from pathlib import Path

import pytest

from deploy import health
from tests.unit.deploy.dockerfile import ROOT, TARGETS, stages
from tests.unit.deploy.settings import ANYWHERE, KNOWN

STAGES = stages()
BROUGHT_BY_OTHERS = {"werkzeug": "flask", "pydantic-core": "pydantic", "urllib3": "requests"}
BY_NAME_ONLY = {"psycopg", "mavsdk", "schemathesis"}
"""Loaded for a URL, or tools that a person starts."""
STARTED_BY = {"vehicle": ("sim.camera.__main__", "sim.camera.film.live_view")}
"""What a program starts as programs of their own."""
EDGE_FILES = STAGES["edge-server-files"]
programs = pytest.mark.parametrize("target", TARGETS)


@cache
def distribution_of() -> dict[str, str]:
    """Package that brings a module, as pip spells it."""
    return {
        module: names[0].lower().replace("_", "-")
        for module, names in packages_distributions().items()
    }


@cache
def imports_of(file: Path) -> set[str]:
    """What a file imports when it runs, not what only the type checker reads."""
    tree = ast.parse(file.read_text())
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
        for statement in node.body
        for inner in ast.walk(statement)
    }
    names: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@cache
def file_of(module: str) -> Path | None:
    place = ROOT / module.replace(".", "/")
    return next((p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file()), None)


@cache
def reached_from(*modules: str) -> tuple[set[Path], set[str]]:
    """Our files that a program may load, and the packages of others that they name."""
    files: set[Path] = set()
    others: set[str] = set()
    waiting = list(modules)
    while waiting:
        module = waiting.pop()
        if (file := file_of(module)) is None:
            top = module.split(".")[0]
            if not (ROOT / top).is_dir() and top not in sys.stdlib_module_names:
                others.add(top)
        elif file not in files:
            files.add(file)
            waiting += [*imports_of(file), *([module.rpartition(".")[0]] if "." in module else [])]
    return files, others


def started_in(target: str) -> list[str]:
    module = STAGES[target].module
    main = module if file_of(f"{module}.__main__") is None else f"{module}.__main__"
    return [main, *STARTED_BY.get(target, ())]


@programs
def test_the_module_of_every_image_exists(target: str) -> None:
    assert find_spec(STAGES[target].module) is not None


@pytest.mark.first_case
@programs
def test_every_image_has_the_files_that_its_program_loads(target: str) -> None:
    copied = STAGES[STAGES[target].files_from].copied
    files, _ = reached_from(*started_in(target), "deploy.health")
    names = {str(file.relative_to(ROOT)) for file in files}
    missing = {
        name for name in names if not any(name == c or name.startswith(f"{c}/") for c in copied)
    }
    assert missing == set()


@pytest.mark.first_case
@programs
def test_every_image_has_the_packages_that_its_program_loads_and_no_others(target: str) -> None:
    _, modules = reached_from(*started_in(target))
    if STAGES[target].files_from == "edge-server-files":
        modules |= {"alembic"}  # It loads the migrations by their path
    distributions = {distribution_of()[module] for module in modules}
    needed = {BROUGHT_BY_OTHERS.get(name, name) for name in distributions}
    listed = STAGES[STAGES[target].files_from].installed
    installed = {name.partition("[")[0] for name in listed}
    assert needed - installed == set()
    assert installed - needed - BY_NAME_ONLY == set()


@pytest.mark.parametrize("stage", ["broker-files", "vehicle-files"])
def test_the_one_dialect_that_is_kept_is_the_one_that_is_spoken(stage: str) -> None:
    module = {
        "broker-files": "mavlink_broker.mavlink.dialect",
        "vehicle-files": "uav_firmware.modules.mavlink.wire.dialect",
    }[stage]
    file = file_of(module)
    assert file is not None
    (spoken,) = re.findall(
        r"^from pymavlink\.dialects\.v20 import (\w+)", file.read_text(), re.MULTILINE
    )
    (line,) = (line for line in STAGES[stage].all("RUN") if "dialects" in line)
    assert re.findall(r"! -path '\*/v20/(\w+)\.py'", line) == [spoken]


@programs
def test_every_variable_of_an_image_is_a_setting_of_its_program(target: str) -> None:
    assert set(STAGES[target].environment) <= KNOWN[target] | ANYWHERE


@programs
def test_every_program_runs_as_nobody_special_and_ends_at_sigterm(target: str) -> None:
    user = STAGES[target].last("USER")
    assert all(int(number) >= 1000 for number in user.split(":"))
    assert STAGES[target].last("STOPSIGNAL") == "SIGTERM"


def test_every_program_that_stays_has_its_health_check() -> None:
    asked = {target: STAGES[target].health for target in TARGETS}
    assert asked.pop("tester") is None
    assert asked.pop("acceptance") is None
    assert asked == {target: target for target in health.PROGRAMS}


@pytest.mark.parametrize(
    ("target", "variable", "exposed"),
    [
        ("edge-server", "EDGE_PORT", "{}/tcp"),
        ("broker", "MAVLINK_PORT", "{}/udp"),
        ("cloud", "CLOUD_PORT", "{}/tcp"),
    ],
)
def test_a_program_listens_where_its_image_says(target: str, variable: str, exposed: str) -> None:
    stage = STAGES[target]
    assert stage.last("EXPOSE") == exposed.format(stage.environment[variable])


def test_a_vehicle_listens_where_its_image_says() -> None:
    stage = STAGES["vehicle"]
    own = int(stage.environment["VEHICLE_PORT_BASE"]) + int(stage.environment["SYSTEM_ID"])
    assert stage.last("EXPOSE") == f"{own}/udp"


def test_packages_come_from_the_lock_files_with_hashes_and_nothing_else() -> None:
    runs = [line for stage in STAGES.values() for line in stage.all("RUN") if "-m pip" in line]
    fetched = {line for line in runs if " download " in line or " wheel " in line}
    assert all("--require-hashes" in line and ".lock" in line for line in fetched)
    assert EDGE_FILES.environment["PIP_NO_INDEX"] == "1"
    assert all(line in fetched or " install " in line for line in runs)


@pytest.mark.parametrize(
    ("target", "extra"),
    [
        ("edge-server", "edge"),
        ("relay", "edge"),
        ("broker", "broker"),
        ("cloud", "edge"),
        ("vehicle", "vehicle"),
    ],
)
def test_every_image_is_built_from_the_lock_of_its_program_the_simulator_in_one(
    target: str, extra: str
) -> None:
    runs = " ".join(STAGES[STAGES[target].files_from].all("RUN"))
    assert set(re.findall(r"[\w-]+\.lock", runs)) == {f"requirements-{extra}.lock"}
    simulates = re.search(
        r"^jsbsim==", (ROOT / f"requirements-{extra}.lock").read_text(), re.MULTILINE
    )
    assert bool(simulates) is (target == "vehicle")


def test_only_the_vehicles_image_builds_the_simulator_where_it_has_no_wheel() -> None:
    names = {
        name
        for name, stage in STAGES.items()
        if any("from_source=--no-binary=jsbsim" in line for line in stage.all("RUN"))
    }
    assert names == {"vehicle-wheels", "vehicle-files"}


def test_the_simulator_is_left_out_of_the_lock_of_tester_and_acceptance() -> None:
    (line,) = (line for line in STAGES["more-wheels"].all("RUN") if "awk" in line)
    program = re.search(r"awk '([^']*)'", line)
    assert program is not None
    lock = ROOT / "requirements-dev.lock"
    kept = subprocess.run(
        ["awk", program[1], str(lock)], capture_output=True, text=True, check=True
    ).stdout
    every = re.findall(r"^([\w-]+)==", lock.read_text(), re.MULTILINE)
    assert re.findall(r"^([\w-]+)==", kept, re.MULTILINE) == [
        name for name in every if name != "jsbsim"
    ]


@pytest.mark.parametrize("lock", sorted(path.name for path in ROOT.glob("requirements*.lock")))
def test_every_line_of_a_lock_file_has_its_version_and_hash(lock: str) -> None:
    entries = re.split(r"\n(?=\S)", (ROOT / lock).read_text().strip())
    assert all(re.search(r"^[\w.\[\]-]+==\S+", e) and "--hash=sha256:" in e for e in entries)


@pytest.mark.parametrize(
    "file",
    [p for p in sorted((ROOT / "deploy").rglob("*")) if p.is_file() and p.suffix != ".pyc"],
    ids=lambda p: str(p.relative_to(ROOT)),
)
def test_no_file_names_a_registry_an_index_or_a_machine(file: Path) -> None:
    text = file.read_text()
    hosts = set(re.findall(r"https?://([a-z0-9.-]+\.[a-z]{2,})", text))
    assert hosts <= {"cloud.example"}
    assert not re.search(r"\b(?:docker|quay|ghcr|gcr|pypi|debian)\.(?:io|org|com)\b", text)
    assert not re.search(r"(?<![\w.\"])/(?:home|root|work|Users)/", text)


def test_the_base_image_is_an_argument_without_a_registry() -> None:
    text = (ROOT / "deploy/Dockerfile").read_text()
    (default,) = re.findall(r"^ARG BASE_IMAGE=(\S+)", text, re.MULTILINE)
    assert "/" not in default
    outside = {stage.parent for stage in STAGES.values()} - set(STAGES)
    assert outside == {"${BASE_IMAGE}", "${BUILD_IMAGE}"}


def test_what_the_images_take_reaches_the_builder() -> None:
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    let_through = {line[1:] for line in ignored if line.startswith("!")}
    taken = {name for stage in STAGES.values() for name in stage.copied}
    tops = {re.sub(r"^deploy/\w+\.py$", "deploy/*.py", name) for name in taken}
    tops = {name if name.startswith("deploy/") else name.split("/")[0] for name in tops}
    assert tops == let_through
    assert "*" in ignored
