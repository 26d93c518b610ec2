"""Which environment variables each program listens to."""

import re
from pathlib import Path

from edge_server.config import SETTINGS
from mavlink_broker.config import settings_parser
from tests.unit.deploy.dockerfile import ROOT

_ASKED = re.compile(r'(?:\bget\(|environment\[|environment\.get\(\s*)"([A-Z][A-Z_]+)"')


def _asked_in(*files: str) -> set[str]:
    return {name for file in files for name in _ASKED.findall(Path(ROOT / file).read_text())}


def _broker() -> set[str]:
    actions = settings_parser({})._actions
    return {name for a in actions for name in re.findall(r"environment: ([A-Z_]+)", a.help or "")}


_EDGE = {setting.variable for setting in SETTINGS}
KNOWN = {
    "edge-server": _EDGE,
    "relay": _EDGE,
    "broker": _broker(),
    "vehicle": _asked_in("uav_firmware/config.py"),
    "cloud": _asked_in("sim/cloud/__main__.py"),
    "tester": _asked_in("sim/tester/__main__.py"),
    "acceptance": _asked_in("deploy/acceptance_flight.py") | {"REQUESTS_CA_BUNDLE"},
}
"""By target; `requests` listens to the one that no file of ours asks for."""
ANYWHERE = {"PATH", "PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED", "STATE_DIR"}
