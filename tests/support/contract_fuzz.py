"""Holds the edge server to its OpenAPI document: requests that fit it and requests that do not.

Everything happens in this process. Each operation is asked with the key of a role that may use
it; `schemathesis.toml` says which checks do not apply where, and why.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import schemathesis
from flask import Flask
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import Case, GenerationMode
from schemathesis.config import SchemathesisConfig
from schemathesis.core.result import Ok

from edge_server.app import context_of, create_app
from edge_server.config import Config
from edge_server.process import key_files
from edge_server.process.preparation import prepare
from edge_server.store.rows.keys import Role

_NO_LIMIT: Final = 1_000_000
SETTINGS: Final = Path(__file__).parent.parent.parent / "schemathesis.toml"
_ROLES: Final = re.compile(r"Roles: ([a-z, ]+)")
MODES: Final = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)


@contextmanager
def served(state_dir: Path) -> Iterator[tuple[Flask, dict[str, str]]]:
    """Give an edge server without limits on how often it is asked, and the keys of all roles."""
    config = Config(
        state_dir=state_dir,
        requests_per_minute=_NO_LIMIT,
        broker_requests_per_minute=_NO_LIMIT,
        failures_per_minute=_NO_LIMIT,
    )
    prepare(config)
    app = create_app(config)
    files = {role.value: key_files.path_of(config.keys_dir, role) for role in Role}
    yield app, {role: key_files.read(path) or "" for role, path in files.items()}
    context_of(app).database.close()


def failures(
    app: Flask, keys: Mapping[str, str], mode: GenerationMode, examples: int, number: int
) -> Iterator[str]:
    """Give what is wrong with each operation that fails; `number` seeds the requests."""
    schema = schemathesis.openapi.from_wsgi(
        "/openapi.json",
        app,
        headers={"X-API-Key": keys["admin"]},
        config=SchemathesisConfig.from_path(SETTINGS),
    )
    for found in schema.get_all_operations():
        if not isinstance(found, Ok):
            yield str(found.err())
            continue
        operation = found.ok()
        role = _role(operation.definition.raw.get("description", ""))
        headers = {"X-API-Key": keys[role]} if role else {}
        check = _bounded(operation.as_strategy(generation_mode=mode), headers, examples, number)
        try:
            check()
        except Unsatisfiable:
            continue  # Nothing about it can be wrong: no parameter, no body
        except AssertionError as error:
            yield f"{operation.label}, {mode.value}: {error}"
        except BaseExceptionGroup as errors:
            yield f"{operation.label}, {mode.value}: {errors}"


def _role(description: str) -> str | None:
    """Somebody who may ask; the admin where the admin may."""
    named = _ROLES.search(description)
    if named is None:
        return None
    roles = named[1].split(", ")
    return "admin" if "admin" in roles else roles[0]


def _bounded(
    requests: Any, headers: dict[str, str], examples: int, number: int
) -> Callable[[], None]:
    @seed(number)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate],
    )
    @given(case=requests)
    def check(case: Case[Any]) -> None:
        case.call_and_validate(headers=headers)

    run: Callable[[], None] = check
    return run
