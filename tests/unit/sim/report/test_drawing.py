"""Sheet and page: whole, self-contained, and without a warning of the drawing library."""

import logging
import re
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from sim.report.figures import Flight, examine
from sim.report.maps import plan_view
from sim.report.page import page
from sim.report.panels import tracking
from sim.report.plan import COMMAND_NAMES
from sim.report.sheet import write_overview, write_sheet
from tests.unit.sim.report import synthetic

PNG = b"\x89PNG\r\n\x1a\n"


def flight(document: dict[str, Any] | None = None) -> Flight:
    return examine(1, synthetic.planned(document), synthetic.log(), synthetic.truth())


@pytest.mark.thorough
def test_the_sheet_is_a_picture(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        write_sheet(tmp_path / "sheet.png", "Title", "subtitle", flight())
    assert (tmp_path / "sheet.png").read_bytes().startswith(PNG)
    assert caplog.messages == []


@pytest.mark.first_case
@pytest.mark.parametrize(
    "document",
    [
        {"missions": []},
        {"missions": [{"mission_id": 1, "vehicle_id": 1, "command_array": []}]},
        synthetic.plan(
            command_type_id=7,
            parameters={**synthetic.place(5.0, 0.0), "radius": 8.0, "orbit_altitude": 5.0},
        ),
    ],
    ids=["no mission", "no command", "orbit"],
)
def test_an_odd_plan_is_drawn_too(document: dict[str, Any], tmp_path: Path) -> None:
    write_sheet(tmp_path / "sheet.png", "Title", "subtitle", flight(document))
    assert (tmp_path / "sheet.png").stat().st_size > 50_000


@pytest.mark.thorough
def test_the_page_needs_nothing_beside_itself() -> None:
    html = page("Title", "wind 0 m/s", [flight()])
    assert not re.findall(r'(?:src|href)="(?!data:)', html)
    assert "<script" not in html
    assert html.count("data:image/png;base64,") == 7


@pytest.mark.thorough
def test_the_page_tells_commands_points_and_events() -> None:
    html = page("Title", "wind 0 m/s", [flight()])
    assert "Vehicle 1: FINISHED" in html
    for text in ("NAV_TAKEOFF", "NAV_WAYPOINT", "NAV_LAND", "Battery low", "mode MISSION", "armed"):
        assert text in html
    assert '<td class="number">0.50</td>' in html


def test_what_others_wrote_is_no_markup() -> None:
    html = page("<b>Title</b>", "wind & weather", [])
    assert "<b>" not in html
    assert "wind &amp; weather" in html


def test_commands_are_named_as_the_vocabulary_names_them() -> None:
    from afarcloud.enumerations import CommandType  # noqa: PLC0415

    assert {kind.value: kind.name for kind in CommandType} == dict(COMMAND_NAMES)


def test_several_vehicles_share_one_overview(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_overview(tmp_path / "report.png", "Title", "subtitle", [flight(), flight()])
    assert (tmp_path / "report.png").read_bytes().startswith(PNG)
    assert caplog.messages == []


def fenced(half_m: float) -> dict[str, Any]:
    """The plan within a square fence."""
    ends = ((-half_m, -half_m), (-half_m, half_m), (half_m, half_m), (half_m, -half_m))
    corners = [tuple(synthetic.place(*end).values()) for end in ends]
    return synthetic.plan() | {"geofence": {"inclusion": [corners]}}


@pytest.mark.parametrize(("half_m", "label"), [(25.0, "fence"), (500.0, "fence, larger than")])
def test_a_fence_lies_in_the_frame_or_is_said_to_be_larger(half_m: float, label: str) -> None:
    axes = Figure(figsize=(6.0, 6.0)).add_subplot()
    plan_view(axes, flight(fenced(half_m)))
    whole = axes.get_xlim()[1] > half_m and axes.get_ylim()[0] < -half_m
    (shown,) = (patch for patch in axes.patches if str(patch.get_label()).startswith("fence"))
    assert str(shown.get_label()).startswith(label)
    assert bool(whole) is (label == "fence")


def test_the_largest_distance_from_the_setpoint_is_in_the_frame() -> None:
    flown = examine(
        1, synthetic.planned(), synthetic.log(setpoint_error=(0.0, 0.4, -0.2)), synthetic.truth()
    )
    flown.tracking.values[5] = (3.0, 0.0, 0.0)
    axes = Figure().add_subplot()
    tracking(axes, flown)
    assert axes.get_ylim()[1] > 3.0
