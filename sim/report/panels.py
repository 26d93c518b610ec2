"""The panels of a report: each draws one picture of a flight onto axes it is given."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from sim.report.arrays import Array, euler, largest
from sim.report.figures import Flight, Series

TRUE: Final = "#1b4f8f"
ESTIMATED: Final = "#e07a1f"
SETPOINT: Final = "#3a9a4b"
PLANNED: Final = "#6b6b6b"
FORBIDDEN: Final = "#c23b3b"
AXES: Final = ("#1b4f8f", "#e07a1f", "#3a9a4b", "#8b4fb0")
MODE_COLOURS: Final = ("#eef3fa", "#fdf3e7", "#edf7ee", "#f6eef9", "#f9eeee")
_FENCE_MARGIN: Final = 0.35  # of the track's size, up to which a fence widens the view


def plan_view(axes: Axes, flight: Flight) -> None:
    """The track from above, against the plan and its fence."""
    planned, true, estimated = flight.planned, flight.true.values, flight.estimated.values
    for number, corners in enumerate(planned.inclusions):
        label = "fence" if number == 0 else None
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
    axes.plot(estimated[:, 1], estimated[:, 0], color=ESTIMATED, lw=1.0, label="estimated")
    axes.plot(true[:, 1], true[:, 0], color=TRUE, lw=1.8, label="true", zorder=3)
    _points(axes, flight)
    axes.plot(*true[0, 1::-1], marker="s", ms=7, color=TRUE, ls="", label="start", zorder=4)
    axes.plot(
        *true[-1, 1::-1], marker="x", ms=8, mew=2, color=FORBIDDEN, ls="", label="end", zorder=5
    )
    _frame(axes, flight)
    axes.grid(visible=True, color="#e6eaee", lw=0.6)
    axes.set_axisbelow(True)
    axes.set(title="Plan view", xlabel="east [m]", ylabel="north [m]")
    _legend(axes)


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
            color="#256b33",
            weight="bold",
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
            zorder=6,
        )


def _frame(axes: Axes, flight: Flight) -> None:
    """Show track and points; of a fence as much as does not make them small."""
    seen = np.concatenate((flight.true.values[:, :2], _route(flight)))
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = max(float(np.max(high - low)), 6.0)
    corners = flight.planned.inclusions
    if corners:
        fence = np.concatenate(corners)
        low = np.maximum(np.minimum(low, fence.min(axis=0)), low - _FENCE_MARGIN * size)
        high = np.minimum(np.maximum(high, fence.max(axis=0)), high + _FENCE_MARGIN * size)
    _equal_scales(axes, low - 0.08 * size, high + 0.08 * size)


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
    for point in flight.planned.points:
        north, east, up = point.position
        axes.plot([east, east], [north, north], [floor, up], color=SETPOINT, lw=0.8, ls=":")
        axes.scatter(east, north, up, color=SETPOINT, s=18, depthshade=False)
        axes.text(east, north, up, f"  {point.label}", fontsize=8, color="#256b33")
    spans = np.ptp(true, axis=0)
    level = max(float(spans[0]), float(spans[1]), 1.0)
    axes.set_box_aspect(
        (max(spans[1], 0.3 * level), max(spans[0], 0.3 * level), max(spans[2], 0.45 * level))
    )
    axes.view_init(elev=24, azim=-60)
    axes.tick_params(labelsize=7)
    axes.set(xlabel="east [m]", ylabel="north [m]", zlabel="height [m]")
    axes.set_title("In space", loc="left")
    axes.legend(loc="upper right", fontsize=8, frameon=False)


def height(axes: Axes, flight: Flight) -> None:
    """Height above the start, with what was asked for."""
    _time_axis(axes, flight, names=True)
    axes.plot(
        flight.setpoint.time_s,
        flight.setpoint.values[:, 2],
        color=SETPOINT,
        lw=1.2,
        label="set-point",
    )
    axes.plot(
        flight.estimated.time_s,
        flight.estimated.values[:, 2],
        color=ESTIMATED,
        lw=1.0,
        label="estimated",
    )
    axes.plot(flight.true.time_s, flight.true.values[:, 2], color=TRUE, lw=1.6, label="true")
    for passage in flight.passages:
        axes.plot(
            passage.time_s, passage.point.position[2], marker="o", ms=4, color=SETPOINT, zorder=5
        )
        axes.annotate(
            passage.point.label,
            (passage.time_s, passage.point.position[2]),
            xytext=(3, 5),
            textcoords="offset points",
            fontsize=8,
            color="#256b33",
        )
    top = float(np.max(flight.true.values[:, 2]))
    axes.set_ylim(-0.08 * top - 0.2, 1.25 * top + 0.5)
    axes.set(title="Height above the start", ylabel="height [m]")
    _legend(axes)


def speed(axes: Axes, flight: Flight) -> None:
    """Level and vertical speed."""
    _time_axis(axes, flight)
    velocity, time_s = flight.true_velocity.values, flight.true_velocity.time_s
    topic = "vehicle_local_position_setpoint"
    wanted_s = flight.log.time_s(topic) - flight.armed_at_s
    wanted = flight.log.columns(topic, "vx", "vy", "vz")
    axes.plot(
        wanted_s,
        np.hypot(wanted[:, 0], wanted[:, 1]),
        color="#9db8dd",
        lw=1.4,
        label="level, set-point",
    )
    axes.plot(wanted_s, -wanted[:, 2], color="#f1c39c", lw=1.4, label="up, set-point")
    axes.plot(
        time_s, np.hypot(velocity[:, 0], velocity[:, 1]), color=TRUE, lw=1.3, label="level, true"
    )
    axes.plot(time_s, -velocity[:, 2], color=ESTIMATED, lw=1.3, label="up, true")
    axes.set(title="Speed", ylabel="speed [m/s]")
    _legend(axes)


def angle(axes: Axes, flight: Flight, index: int) -> None:
    """Roll (0), pitch (1) or yaw (2), believed and asked for."""
    _time_axis(axes, flight)
    name = ("Roll", "Pitch", "Yaw")[index]
    for topic, field, colour, label in (
        ("vehicle_attitude_setpoint", "q_d", SETPOINT, "set-point"),
        ("vehicle_attitude", "q", TRUE, "estimated"),
    ):
        time_s = flight.log.time_s(topic) - flight.armed_at_s
        degrees = np.degrees(euler(flight.log.array(topic, field, 4))[index])
        if index == 2:
            degrees = _broken_at_wraps(degrees)
        axes.plot(time_s, degrees, color=colour, lw=1.1, label=label)
    axes.set(title=name, ylabel=f"{name.lower()} [deg]")
    _legend(axes)


def _broken_at_wraps(degrees: Array) -> Array:
    """The same angles with a gap where they jump from 180 to -180."""
    broken = degrees.copy()
    broken[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    return broken


def position_error(axes: Axes, flight: Flight) -> None:
    """Estimated minus true position, with the accuracy that the estimator claims."""
    _time_axis(axes, flight)
    topic = "vehicle_global_position"
    time_s = flight.log.time_s(topic) - flight.armed_at_s
    claimed = flight.log.column(topic, "eph")
    axes.fill_between(
        time_s,
        -claimed,
        claimed,
        color="#9aa5b1",
        alpha=0.25,
        lw=0,
        label="claimed, level (1 sigma)",
    )
    _components(axes, flight.errors.position, ("north", "east", "up"))
    axes.set(title="Estimate minus truth: position", ylabel="error [m]")
    _legend(axes)


def velocity_error(axes: Axes, flight: Flight) -> None:
    """Estimated minus true velocity."""
    _time_axis(axes, flight)
    _components(axes, flight.errors.velocity, ("north", "east", "down"))
    axes.set(title="Estimate minus truth: velocity", ylabel="error [m/s]")
    _legend(axes)


def attitude_error(axes: Axes, flight: Flight) -> None:
    """Error of tilt and of heading."""
    _time_axis(axes, flight)
    heading, tilt = flight.errors.heading, flight.errors.tilt
    axes.plot(heading.time_s, np.degrees(heading.values), color=ESTIMATED, lw=1.1, label="heading")
    axes.plot(tilt.time_s, np.degrees(tilt.values), color=TRUE, lw=1.1, label="tilt (amount)")
    axes.set(title="Estimate minus truth: attitude", ylabel="error [deg]")
    _legend(axes)


def tracking(axes: Axes, flight: Flight) -> None:
    """True distance from the set-point: what estimator and controller leave together."""
    _time_axis(axes, flight)
    error = flight.tracking
    axes.plot(
        error.time_s,
        np.hypot(error.values[:, 0], error.values[:, 1]),
        color=TRUE,
        lw=1.2,
        label="level",
    )
    axes.plot(error.time_s, error.values[:, 2], color=ESTIMATED, lw=1.2, label="height")
    known = np.abs(error.values[np.isfinite(error.values)])
    limit = max(2.5 * float(np.quantile(known, 0.9)), 0.2) if known.size else 1.0
    axes.set_ylim(max(-limit, axes.get_ylim()[0]), min(limit, axes.get_ylim()[1]))
    axes.set(
        title=f"Truth minus set-point, up to {largest(error.values):.2f} m", ylabel="distance [m]"
    )
    _legend(axes)


def battery(axes: Axes, flight: Flight) -> None:
    """Voltage, and current on the right."""
    _time_axis(axes, flight)
    topic = "battery_status"
    time_s = flight.log.time_s(topic) - flight.armed_at_s
    right = axes.twinx()
    right.plot(time_s, flight.log.column(topic, "current_a"), color=ESTIMATED, lw=1.0, alpha=0.9)
    right.spines["right"].set_visible(True)
    right.set_ylabel("current [A]", color=ESTIMATED)
    right.set_ylim(bottom=0.0)
    axes.plot(time_s, flight.log.column(topic, "voltage_v"), color=TRUE, lw=1.4)
    axes.set(title="Battery", ylabel="voltage [V]")
    axes.yaxis.label.set_color(TRUE)


def motors(axes: Axes, flight: Flight) -> None:
    """Commands to the four motors."""
    _time_axis(axes, flight)
    time_s = flight.log.time_s("actuator_motors") - flight.armed_at_s
    outputs = flight.log.array("actuator_motors", "control", 4)
    names = ("1 front right", "2 rear left", "3 front left", "4 rear right")
    for output, name, colour in zip(outputs.T, names, AXES, strict=True):
        axes.plot(time_s, output, color=colour, lw=0.8, label=name)
    axes.set(title="Motor commands", ylabel="command [-]", ylim=(-0.02, 1.02))
    _legend(axes)


def _legend(axes: Axes) -> None:
    """A legend beside the title, where it hides nothing."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        fontsize=8,
        ncols=7,
        frameon=False,
        borderpad=0.1,
        columnspacing=1.2,
        handlelength=1.6,
    )


def _components(axes: Axes, series: Series, names: Sequence[str]) -> None:
    for values, name, colour in zip(series.values.T, names, AXES, strict=False):
        axes.plot(series.time_s, values, color=colour, lw=1.1, label=name)


def _time_axis(axes: Axes, flight: Flight, *, names: bool = False) -> None:
    """Common time axis, modes as background; with `names`, the modes are named on top."""
    start_s, end_s = float(flight.true.time_s[0]), float(flight.true.time_s[-1])
    axes.set_xlim(start_s, end_s)
    axes.set_xlabel("time since arming [s]", fontsize=8)
    axes.grid(visible=True, color="#d8dde3", lw=0.6)
    axes.set_axisbelow(True)
    colours: dict[str, str] = {}
    for span in flight.modes:
        colour = colours.setdefault(span.mode, MODE_COLOURS[len(colours) % len(MODE_COLOURS)])
        left, right = max(span.start_s, start_s), min(span.end_s, end_s)
        if right <= left:
            continue
        axes.axvspan(left, right, color=colour, lw=0, zorder=0)
        if names and right - left > 0.08 * (end_s - start_s):
            axes.text(
                0.5 * (left + right),
                0.97,
                span.mode,
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="top",
                fontsize=8,
                color="#4a5560",
            )
