"""Panels in space: each draws tracks onto axes it is given."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from sim.report.arrays import Array
from sim.report.figures import Flight
from sim.report.style import (
    AXES,
    ESTIMATED,
    FORBIDDEN,
    GRID,
    LABELS,
    PLANNED,
    SETPOINT,
    TRUE,
    legend,
)

_LARGEST_FENCE: Final = 6.0  # Of the track's size, up to which a fence is shown whole


def plan_view(axes: Axes, flight: Flight) -> None:
    """The track from above, against the plan and its fence."""
    planned, true, estimated = flight.planned, flight.true.values, flight.estimated.values
    for number, corners in enumerate(planned.inclusions):
        label = _fence_label(flight) if number == 0 else None
        axes.add_patch(
            Polygon(corners[:, ::-1], fill=False, ec="#7a9a7a", ls=(0, (6, 3)), lw=1.2, label=label)
        )
    for number, corners in enumerate(planned.exclusions):
        label = "keep out" if number == 0 else None
        axes.add_patch(
            Polygon(corners[:, ::-1], fc=FORBIDDEN, alpha=0.15, ec=FORBIDDEN, lw=1.0, label=label)
        )
    route = _route(flight)
    axes.plot(route[:, 1], route[:, 0], color=PLANNED, ls="--", lw=1.2, label="planned")
    axes.plot(
        estimated[:, 1], estimated[:, 0], color=ESTIMATED, lw=0.9, label="estimated", zorder=3.5
    )
    axes.plot(true[:, 1], true[:, 0], color=TRUE, lw=1.8, label="true", zorder=3)
    _points(axes, flight)
    axes.plot(*true[0, 1::-1], marker="s", ms=7, color=TRUE, ls="", label="start", zorder=4)
    axes.plot(
        *true[-1, 1::-1], marker="x", ms=8, mew=2, color=FORBIDDEN, ls="", label="end", zorder=5
    )
    _frame(axes, flight)
    axes.grid(visible=True, color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    axes.set(title="Plan view", xlabel="east [m]", ylabel="north [m]")
    legend(axes)


def _route(flight: Flight) -> Array:
    """Points of the plan in order, home last if it ends there."""
    places = [np.zeros(2), *(p.position[:2] for p in flight.planned.points)]
    last = flight.planned.commands[-1].name if flight.planned.commands else ""
    if flight.planned.landing is not None and last.endswith("HOME"):
        places.append(flight.planned.landing)
    return np.array(places)


def _points(axes: Axes, flight: Flight) -> None:
    labelled: dict[tuple[float, float], list[str]] = {}
    for point in flight.planned.points:
        north, east, _ = point.position
        radius = point.orbit_radius_m or point.acceptance_m
        if radius is not None:
            axes.add_patch(Circle((east, north), radius, fill=False, ec=SETPOINT, lw=1.1, zorder=2))
        axes.plot(east, north, marker="o", ms=3.5, color=SETPOINT, ls="", zorder=4)
        labelled.setdefault((round(east, 1), round(north, 1)), []).append(point.label)
    for (east, north), labels in labelled.items():
        axes.annotate(
            ", ".join(labels),
            (east, north),
            xytext=(7, 7),
            textcoords="offset points",
            fontsize=9,
            color=LABELS,
            weight="bold",
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
            zorder=6,
        )


def _frame(axes: Axes, flight: Flight) -> None:
    """Show track and points, and the whole fence unless it would make them very small."""
    seen = np.concatenate((flight.true.values[:, :2], _route(flight)))
    if _is_fence_shown_whole(flight):
        seen = np.concatenate((seen, *flight.planned.inclusions, *flight.planned.exclusions))
    low, high = seen.min(axis=0), seen.max(axis=0)
    border = 0.08 * max(float(np.max(high - low)), 6.0)
    _equal_scales(axes, low - border, high + border)


def _fence_label(flight: Flight) -> str:
    return "fence" if _is_fence_shown_whole(flight) else "fence, larger than this view"


def _is_fence_shown_whole(flight: Flight) -> bool:
    corners = [*flight.planned.inclusions, *flight.planned.exclusions]
    if not corners:
        return True
    track = np.concatenate((flight.true.values[:, :2], _route(flight)))
    size = max(float(np.max(np.ptp(track, axis=0))), 6.0)
    return bool(np.max(np.ptp(np.concatenate((track, *corners)), axis=0)) <= _LARGEST_FENCE * size)


def _equal_scales(axes: Axes, low: Array, high: Array) -> None:
    """Limits (north, east) that hold the given ones and make a metre the same both ways."""
    extent = axes.get_window_extent()
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    metres_per_pixel = max(2.0 * half[0] / extent.height, 2.0 * half[1] / extent.width)
    north, east = 0.5 * metres_per_pixel * extent.height, 0.5 * metres_per_pixel * extent.width
    axes.set_xlim(middle[1] - east, middle[1] + east)
    axes.set_ylim(middle[0] - north, middle[0] + north)
    axes.set_aspect("equal", adjustable="box")


def space_view(axes: Any, flight: Flight) -> None:
    """The track in space, with its shadow on the ground."""
    true, floor = flight.true.values, 0.0
    axes.plot(true[:, 1], true[:, 0], floor, color="#b8c4d6", lw=1.2, label="on the ground")
    axes.plot(true[:, 1], true[:, 0], true[:, 2], color=TRUE, lw=1.8, label="true")
    planned = flight.planned.points
    if planned:
        north, east, up = np.array([point.position for point in planned]).T
        axes.plot(east, north, up, color=PLANNED, lw=1.0, ls="--", label="planned")
    for point in planned:
        north, east, up = point.position
        axes.plot([east, east], [north, north], [floor, up], color=SETPOINT, lw=0.8, ls=":")
        axes.scatter(east, north, up, color=SETPOINT, s=18, depthshade=False)
        axes.text(east, north, up, f"  {point.label}", fontsize=8, color=LABELS)
    spans = np.ptp(true, axis=0)
    level = max(float(spans[0]), float(spans[1]), 1.0)
    axes.set_box_aspect(
        (max(spans[1], 0.3 * level), max(spans[0], 0.3 * level), max(spans[2], 0.45 * level)),
        zoom=1.1,
    )
    axes.view_init(elev=24, azim=-60)
    axes.tick_params(labelsize=7)
    axes.set(xlabel="east [m]", ylabel="north [m]", zlabel="height [m]")
    axes.set_title("In space", loc="left")
    axes.legend(loc="upper right", fontsize=8, frameon=False)


def all_tracks(axes: Axes, flights: Sequence[Flight]) -> None:
    """The true tracks of several vehicles from above, about where the first one stood."""
    origin, seen = flights[0].plane, []
    for number, flight in enumerate(flights):
        start = origin.place(
            np.array(flight.plane.latitude_deg), np.array(flight.plane.longitude_deg)
        )
        track = flight.true.values[:, :2] + start
        seen.append(track)
        colour = AXES[number % len(AXES)]
        axes.plot(track[:, 1], track[:, 0], color=colour, lw=1.5, label=f"{flight.vehicle_id}")
        axes.plot(start[1], start[0], marker="s", ms=6, color=colour, ls="")
    places = np.concatenate(seen)
    low, high = places.min(axis=0), places.max(axis=0)
    border = 0.08 * max(float(np.max(high - low)), 6.0)
    _equal_scales(axes, low - border, high + border)
    axes.grid(visible=True, color=GRID, lw=0.6)
    axes.set(title="True tracks", xlabel="east [m]", ylabel="north [m]")
    legend(axes)


def all_heights(axes: Axes, flights: Sequence[Flight]) -> None:
    """The true heights of several vehicles, each since its own arming."""
    for number, flight in enumerate(flights):
        axes.plot(
            flight.true.time_s,
            flight.true.values[:, 2],
            color=AXES[number % len(AXES)],
            lw=1.4,
            label=f"{flight.vehicle_id}",
        )
    axes.grid(visible=True, color=GRID, lw=0.6)
    axes.set(title="Heights", xlabel="time since each arming [s]", ylabel="height [m]")
    legend(axes)
