"""Prometheus and Grafana ask for what the edge server serves; the alerts fire when they must."""

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]  # it has no types

from tests.unit.deploy.dockerfile import ROOT
from tests.unit.edge_server.conftest import Edge, config, edge, engine_name, prepared

__all__ = ["config", "edge", "engine_name", "prepared"]

FOLDER = ROOT / "deploy/monitoring"
ALERTS: list[dict[str, Any]] = [
    rule
    for group in yaml.safe_load((FOLDER / "alerts.yml").read_text())["groups"]
    for rule in group["rules"]
]
DASHBOARD: dict[str, Any] = json.loads((FOLDER / "grafana-dashboard.json").read_text())
EXPRESSIONS = {
    **{f"alert {rule['alert']}": rule["expr"] for rule in ALERTS},
    **{
        f"panel {panel['title']}, {target['refId']}": target["expr"]
        for panel in DASHBOARD["panels"]
        for target in panel["targets"]
    },
}
OF_PROMETHEUS = {"up"}


def promtool(*arguments: str, folder: Path = FOLDER) -> "subprocess.CompletedProcess[str]":
    tool = shutil.which("promtool")
    if tool is None:
        pytest.skip("without promtool: apt-get install prometheus")
    return subprocess.run(
        [tool, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


def metrics_in(expression: str) -> set[str]:
    plain = re.sub(r"\{[^}]*\}|\"[^\"]*\"|by \([^)]*\)|on \([^)]*\)", "", expression)
    return set(re.findall(r"\b(?:fm_\w+|process_\w+|up)\b", plain))


def test_every_metric_that_is_asked_for_is_served(edge: Edge) -> None:
    page = edge.ask("GET", "/metrics", "operator").text
    served = set(re.findall(r"^# TYPE (\w+) ", page, re.MULTILINE))
    asked = {name: metrics_in(expression) for name, expression in EXPRESSIONS.items()}
    assert all(asked.values())
    base = {name: {re.sub(r"_bucket$", "", m) for m in found} for name, found in asked.items()}
    assert {
        n: m - served - OF_PROMETHEUS for n, m in base.items() if m - served - OF_PROMETHEUS
    } == {}


@pytest.mark.parametrize("rule", ALERTS, ids=lambda rule: str(rule["alert"]))
def test_every_alert_has_a_severity_and_what_to_do(rule: dict[str, Any]) -> None:
    assert rule["labels"]["severity"] in {"warning", "critical"}
    assert rule["annotations"]["summary"]
    assert rule["annotations"]["action"]


def test_the_panels_of_the_dashboard_lie_side_by_side_on_one_data_source() -> None:
    panels = DASHBOARD["panels"]
    places = [(p["gridPos"]["x"], p["gridPos"]["y"]) for p in panels]
    assert len(set(places)) == len({p["id"] for p in panels}) == len(panels)
    assert all(p["gridPos"]["x"] + p["gridPos"]["w"] <= 24 for p in panels)
    assert {p["datasource"]["uid"] for p in panels} == {"${datasource}"}


def test_prometheus_takes_its_configuration_and_the_alerts(tmp_path: Path) -> None:
    for file in FOLDER.glob("*.yml"):
        shutil.copy(file, tmp_path)
    (tmp_path / "metrics.key").write_text("key")
    checked = promtool("check", "config", "prometheus.yml", folder=tmp_path)
    assert checked.returncode == 0, checked.stderr


def test_the_alerts_fire_when_they_must() -> None:
    tested = promtool("test", "rules", "alerts_test.yml")
    assert tested.returncode == 0, tested.stderr + tested.stdout
