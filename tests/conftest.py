"""Settings of all tests."""

import gc
import importlib
import os

# Tests judge the source, and look inside; FARM_PURE=0 runs them on what `make compile` has made.
os.environ.setdefault("FARM_PURE", "1")

import uav_firmware  # noqa: F401, I001 - first: it loads what is compiled, and the simulation with it
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

from edge_server.store import migrate
from tests.support import statements, url_rules
from tests.support.databases import ENGINES, PostgresServer, empty_sqlite, running_server
from tests.support.descriptors import closed_afterwards
from uav_firmware.drivers.file_tree import TreeFile

gc.disable()  # Until the tests are collected: little of what that makes is garbage
url_rules.compile_once()
statements.compile_once()

# The programs that tests start shall use the databases of the tests
os.environ.pop("DATABASE_URL", None)


_HERE = Path(__file__).parent
_THOROUGH_FOLDERS = tuple(f"{_HERE / name}/" for name in ("scenario", "conformance"))
"""Of their tests `make test` runs those that are marked as promises."""
_FIRST_CASE_FOLDERS = tuple(
    f"{_HERE / 'unit' / 'mavlink_broker' / name}/" for name in ("events", "restarts", "takeovers")
)
"""Each test flies a mission through the whole broker; `make test` runs the first case of each."""
_NOT_THOROUGH = "not thorough"
"""The expression with which `make test` chooses."""
_WHOLE_FARMS = f"{_HERE / 'unit' / 'dst'}/"


def pytest_configure(config: pytest.Config) -> None:
    """Choose the examples of property tests.

    No example is judged by the wall clock: these machines are shared. Where CI is set, the same
    examples are drawn at every run, so that a change and not chance decides; elsewhere new ones.
    `make test` draws half as many as hypothesis does by itself, `make test-thorough` twice as many.
    """
    expression = config.getoption("markexpr")
    examples = {_NOT_THOROUGH: 50, "thorough or hypothesis": 200}.get(expression, 100)
    is_ci = bool(os.environ.get("CI"))
    settings.register_profile("ours", deadline=None, derandomize=is_ci, max_examples=examples)
    settings.load_profile("ours")


def pytest_collection(session: pytest.Session) -> None:
    """Let each worker compile a part of the test modules that are not compiled yet.

    Every worker collects every module, all in the same order: without compiled files, as after a
    clone, each would compile each. Where a worker has imported the modules from a place of its
    own in that order, the others load what it has compiled.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None or session.config.args != session.config.getini("testpaths"):
        return
    modules = [m for m in sorted(_HERE.rglob("test_*.py")) if not _is_left_out(m, session.config)]
    begin = len(modules) * int(worker.removeprefix("gw")) // _workers()
    for module in modules[begin:] + modules[:begin]:
        parts = module.relative_to(_HERE.parent).with_suffix("").parts
        with suppress(Exception):  # What it is, the collection finds out and reports
            importlib.import_module(".".join(parts))


def _workers() -> int:
    return int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import for `make test` none of the scenarios and conformance sequences that it leaves out."""
    return True if _is_left_out(collection_path, config) else None


def _is_left_out(path: Path, config: pytest.Config) -> bool:
    is_module = path.name.startswith("test_") and path.suffix == ".py"
    if not is_module or not str(path).startswith(_THOROUGH_FOLDERS):
        return False
    chosen = config.getoption("markexpr") == _NOT_THOROUGH
    return chosen and "pytest.mark.promise" not in path.read_text(encoding="utf-8")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what only `make test-all` runs.

    These are the scenarios and conformance sequences beyond one per promise, and every case but the
    first of a test that is marked `first_case` or flies a mission through the whole broker.
    """
    begun: set[str] = set()
    for item in items:
        path = str(item.path)
        if path.startswith(_THOROUGH_FOLDERS) and item.get_closest_marker("promise") is None:
            item.add_marker(pytest.mark.thorough)
        is_flown = path.startswith(_FIRST_CASE_FOLDERS)
        if is_flown or item.get_closest_marker("first_case") is not None:
            function = item.nodeid.partition("[")[0]
            if function in begun:
                item.add_marker(pytest.mark.thorough)
            begun.add(function)
    _move_whole_farms(items)


def _move_whole_farms(items: list[pytest.Item]) -> None:
    """Let the second worker begin with the tests that simulate whole farms.

    Each takes seconds of one processor. At their place in the alphabet one worker would be left
    with all of them when the others have finished.
    """
    whole_farms = [item for item in items if str(item.path).startswith(_WHOLE_FARMS)]
    others = [item for item in items if not str(item.path).startswith(_WHOLE_FARMS)]
    second = len(items) // _workers()
    items[:] = others[:second] + whole_farms + others[second:]


def pytest_collection_finish() -> None:
    """Let the garbage collector leave the modules of all tests alone, and collect less often.

    Most tests make an application or a vehicle of their own; with the usual thresholds a third
    of the processor's time of such tests is spent on searching a quarter of a million objects.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 50)
    gc.enable()


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """A real PostgreSQL server for all tests of this process."""
    with running_server() as server:
        yield server


@pytest.fixture(scope="session")
def empty_on_postgres(postgres: PostgresServer) -> str:
    """Name of a database with our tables, to be renewed."""
    name = postgres.create(name="empty")
    migrate.prepare(postgres.url(name))
    postgres.keep(name)
    return name


@pytest.fixture(params=ENGINES)
def engine_name(request: pytest.FixtureRequest) -> str:
    """The kind of database: whoever asks for it runs on each."""
    return str(request.param)


@pytest.fixture
def database_url(engine_name: str, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """URL of an empty database of this test alone, with our tables."""
    if engine_name == "sqlite":
        yield empty_sqlite(tmp_path / "edge" / "edge.sqlite3")
        return
    server: PostgresServer = request.getfixturevalue("postgres")
    name = request.getfixturevalue("empty_on_postgres")
    server.renew(name)
    yield server.url(name)


@pytest.fixture
def no_open_files() -> Iterator[None]:
    """Close the files that a vehicle's server keeps open until its clients are idle for long."""
    with closed_afterwards(TreeFile):
        yield
