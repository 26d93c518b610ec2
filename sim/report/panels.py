"""Panels over time: each draws one picture of a flight onto axes it is given."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from sim.report.arrays import Array, euler, largest
from sim.report.figures import Flight, Series
from sim.report.style import AXES, ESTIMATED, GRID, LABELS, MODE_COLOURS, SETPOINT, TRUE, legend


def height(axes: Axes, flight: Flight) -> None:
    """Height above the start, with what was asked for."""
    _time_axis(axes, flight, names=True)
    axes.plot(
        flight.setpoint.time_s,
        flight.setpoint.values[:, 2],
        color=SETPOINT,
        lw=1.2,
        label="setpoint",
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
            color=LABELS,
        )
    top = float(np.max(flight.true.values[:, 2]))
    axes.set_ylim(-0.08 * top - 0.2, 1.25 * top + 0.5)
    axes.set(title="Height above the start", ylabel="height [m]")
    legend(axes)


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
        label="level, setpoint",
    )
    axes.plot(wanted_s, -wanted[:, 2], color="#f1c39c", lw=1.4, label="up, setpoint")
    axes.plot(
        time_s, np.hypot(velocity[:, 0], velocity[:, 1]), color=TRUE, lw=1.3, label="level, true"
    )
    axes.plot(time_s, -velocity[:, 2], color=ESTIMATED, lw=1.3, label="up, true")
    axes.set(title="Speed", ylabel="speed [m/s]")
    legend(axes)


def angle(axes: Axes, flight: Flight, index: int) -> None:
    """Roll (0), pitch (1) or yaw (2), estimated and commanded."""
    _time_axis(axes, flight)
    name = ("Roll", "Pitch", "Yaw")[index]
    for topic, field, colour, label in (
        ("vehicle_attitude_setpoint", "q_d", SETPOINT, "setpoint"),
        ("vehicle_attitude", "q", TRUE, "estimated"),
    ):
        time_s = flight.log.time_s(topic) - flight.armed_at_s
        degrees = np.degrees(euler(flight.log.array(topic, field, 4))[index])
        if index == 2:
            degrees = _broken_at_wraps(degrees)
        axes.plot(time_s, degrees, color=colour, lw=1.1, label=label)
    axes.set(title=name, ylabel=f"{name.lower()} [deg]")
    legend(axes)


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
    legend(axes)


def velocity_error(axes: Axes, flight: Flight) -> None:
    """Estimated minus true velocity."""
    _time_axis(axes, flight)
    _components(axes, flight.errors.velocity, ("north", "east", "down"))
    axes.set(title="Estimate minus truth: velocity", ylabel="error [m/s]")
    legend(axes)


def attitude_error(axes: Axes, flight: Flight) -> None:
    """Error of tilt and of heading."""
    _time_axis(axes, flight)
    heading, tilt = flight.errors.heading, flight.errors.tilt
    axes.plot(heading.time_s, np.degrees(heading.values), color=ESTIMATED, lw=1.1, label="heading")
    axes.plot(tilt.time_s, np.degrees(tilt.values), color=TRUE, lw=1.1, label="tilt (amount)")
    axes.set(title="Estimate minus truth: attitude", ylabel="error [deg]")
    legend(axes)


def tracking(axes: Axes, flight: Flight) -> None:
    """True distance from the setpoint: what estimator and controller leave together."""
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
    axes.set(
        title=f"Truth minus setpoint, up to {largest(error.values):.2f} m", ylabel="distance [m]"
    )
    legend(axes)


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
    legend(axes)


def _components(axes: Axes, series: Series, names: Sequence[str]) -> None:
    for values, name, colour in zip(series.values.T, names, AXES, strict=False):
        axes.plot(series.time_s, values, color=colour, lw=1.1, label=name)


def _time_axis(axes: Axes, flight: Flight, *, names: bool = False) -> None:
    """Common time axis, modes as background; with `names`, the modes are named on top."""
    start_s, end_s = float(flight.true.time_s[0]), float(flight.true.time_s[-1])
    axes.set_xlim(start_s, end_s)
    axes.set_xlabel("time since arming [s]", fontsize=8)
    axes.grid(visible=True, color=GRID, lw=0.6)
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
