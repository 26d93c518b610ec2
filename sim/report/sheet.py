"""Lays the panels out: one sheet as PNG, or one picture per panel for the page."""

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sim.report import maps, panels
from sim.report.figures import Flight, Passage
from sim.report.summary import summary

_DPI: Final = 110
_STYLE: Final[dict[Any, Any]] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#8a949e",
    "figure.facecolor": "white",
}
_TIME_PANELS: Final[tuple[Callable[[Any, Flight], None], ...]] = (
    panels.height,
    panels.speed,
    lambda axes, flight: panels.angle(axes, flight, 0),
    lambda axes, flight: panels.angle(axes, flight, 1),
    lambda axes, flight: panels.angle(axes, flight, 2),
    panels.motors,
    panels.tracking,
    panels.battery,
    panels.position_error,
    panels.velocity_error,
    panels.attitude_error,
)
_LAST_EVENTS: Final = 26


def write_sheet(path: Path, title: str, subtitle: str, flight: Flight) -> None:
    """Write the whole report of one flight as one picture."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(16, 25), dpi=_DPI)
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(
            8,
            2,
            height_ratios=(2.6, 1, 1, 1, 1, 1, 1, 1.9),
            hspace=0.42,
            wspace=0.14,
            left=0.05,
            right=0.955,
            top=0.955,
            bottom=0.02,
        )
        figure.text(0.05, 0.985, title, fontsize=15, weight="bold", va="top")
        figure.text(0.05, 0.974, subtitle, fontsize=10, color="#4a5560", va="top")
        maps.plan_view(figure.add_subplot(grid[0, 0]), flight)
        maps.space_view(figure.add_subplot(grid[0, 1], projection="3d"), flight)
        for number, panel in enumerate(_TIME_PANELS):
            panel(figure.add_subplot(grid[1 + number // 2, number % 2]), flight)
        _table(figure.add_subplot(grid[6, 1]), "", _passage_rows(flight))
        _lines(figure.add_subplot(grid[7, 0]), "Summary", _summary_lines(flight))
        _lines(figure.add_subplot(grid[7, 1]), "Events", _event_lines(flight))
        figure.savefig(path, dpi=_DPI)


def write_overview(path: Path, title: str, subtitle: str, flights: Sequence[Flight]) -> None:
    """Write the tracks and heights of several vehicles as one picture."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(16, 8), dpi=_DPI)
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(1, 2, left=0.05, right=0.975, top=0.87, bottom=0.08, wspace=0.12)
        figure.text(0.05, 0.97, title, fontsize=15, weight="bold", va="top")
        figure.text(0.05, 0.935, subtitle, fontsize=10, color="#4a5560", va="top")
        maps.all_tracks(figure.add_subplot(grid[0, 0]), flights)
        maps.all_heights(figure.add_subplot(grid[0, 1]), flights)
        figure.savefig(path, dpi=_DPI)


def pictures(flight: Flight) -> list[bytes]:
    """PNG pictures of the panels for a page: the two views first, then pairs of time panels."""
    with mpl.rc_context(_STYLE):
        views = Figure(figsize=(15, 6.5), dpi=_DPI)
        maps.plan_view(views.add_subplot(1, 2, 1), flight)
        maps.space_view(views.add_subplot(1, 2, 2, projection="3d"), flight)
        found = [_png(views)]
        for first in range(0, len(_TIME_PANELS), 2):
            pair = Figure(figsize=(15, 3.1), dpi=_DPI)
            for place, panel in enumerate(_TIME_PANELS[first : first + 2]):
                panel(pair.add_subplot(1, 2, 1 + place), flight)
            found.append(_png(pair))
    return found


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    figure.set_layout_engine("tight")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI)
    return stream.getvalue()


def passage_mark(passage: Passage) -> str:
    """Whether the circle was entered, as text."""
    if passage.accepted is None:
        return "-"
    return "yes" if passage.accepted else "NO"


def _passage_rows(flight: Flight) -> list[list[str]]:
    return [
        ["point", "time [s]", "distance [m]", "level [m]", "height [m]", "inside"],
        *(
            [
                passage.point.label,
                f"{passage.time_s:.1f}",
                f"{passage.distance_m:.2f}",
                f"{passage.horizontal_m:.2f}",
                f"{passage.vertical_m:+.2f}",
                passage_mark(passage),
            ]
            for passage in flight.passages
        ),
    ]


def _summary_lines(flight: Flight) -> list[tuple[str, str]]:
    commands = [
        (f"Command {command.command_id}: {command.name}", f"{command.status}  ({command.summary})")
        if command.summary
        else (f"Command {command.command_id}: {command.name}", command.status)
        for command in flight.planned.commands
    ]
    return [*summary(flight), *commands]


def _event_lines(flight: Flight) -> list[tuple[str, str]]:
    return [(f"{event.time_s:8.2f} s", event.text) for event in flight.events[:_LAST_EVENTS]]


def _table(axes: Any, title: str, rows: list[list[str]]) -> None:
    axes.axis("off")
    axes.set_title(title or "Points of the plan: closest approach of the true track")
    if len(rows) == 1:
        axes.text(0.0, 0.8, "no points planned")
        return
    table = axes.table(cellText=rows[1:], colLabels=rows[0], bbox=(0, 0, 1, 1), cellLoc="center")
    table.auto_set_font_size(False)  # noqa: FBT003  # matplotlib names it "value"
    table.set_fontsize(9)
    for (row, _), cell in table.get_celld().items():
        cell.set_edgecolor("#d8dde3")
        cell.set_facecolor("#eef3fa" if row == 0 else "white")


def _lines(axes: Any, title: str, lines: list[tuple[str, str]]) -> None:
    axes.axis("off")
    axes.set_title(title)
    step = 1.0 / max(len(lines), 22)
    for number, (left, right) in enumerate(lines):
        y = 0.98 - number * step
        axes.text(0.0, y, left, va="top", fontsize=9, color="#4a5560")
        axes.text(0.43 if title == "Summary" else 0.13, y, right, va="top", fontsize=9)
