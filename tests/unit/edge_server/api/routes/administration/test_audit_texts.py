"""The console has a text for each row that a person, a shell or the program can put in the log."""

import json
import re
from pathlib import Path

import pytest

from edge_server.api.access.scopes import SAFE_METHODS
from edge_server.cli import users
from tests.unit.edge_server.conftest import Edge

ROOT = Path(__file__).parents[6]
RECORD = re.compile(r"telemetry\.\w+_(?P<verb>\w+)")
OF_BROKERS = {"bulk.create"}
FROM_SHELL = {
    "keys.create",
    "keys.rotate",
    "keys.revoke",
    "dead_letters.retry",
    "dead_letters.retry-all",
    "dead_letters.discard",
    "retention.plans",
    "retention.audit",
}


def actions(edge: Edge) -> set[str]:
    """The endpoints that write, and what is done without a request."""
    rules = edge.client.application.url_map.iter_rules()
    endpoints = {rule.endpoint for rule in rules if (rule.methods or set()) - SAFE_METHODS}
    of_users = {f"users.{name}" for name in users.COMMANDS if name != "list"}
    return endpoints | FROM_SHELL | of_users


@pytest.mark.parametrize("language", ["en", "es"])
def test_each_action_of_the_audit_log_has_a_text(edge: Edge, language: str) -> None:
    texts = json.loads((ROOT / f"console/src/i18n/{language}.json").read_text())["audit"]
    wordless = []
    for action in sorted(actions(edge) - OF_BROKERS):
        record = RECORD.fullmatch(action)
        group, verb = ("record", record["verb"]) if record else action.split(".")
        if verb not in texts.get(group, {}):
            wordless.append(action)
    assert not wordless
