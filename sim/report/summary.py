"""The summary table of a flight."""

import numpy as np

from sim.report.arrays import Array, largest, resample, rms
from sim.report.figures import ON_GROUND_M, Flight, Series


def in_the_air(flight: Flight, series: Series) -> Array:
    """Values of the time in which the vehicle was truly off the ground."""
    height = resample(flight.true.time_s, flight.true.values[:, 2], series.time_s)
    return series.values[height > ON_GROUND_M]


def summary(flight: Flight) -> list[tuple[str, str]]:
    """The figures as text, in the order of the table."""
    errors, landing, velocity = flight.errors, flight.landing, flight.true_velocity.values
    position = in_the_air(flight, errors.position)
    tilt, heading = in_the_air(flight, errors.tilt), in_the_air(flight, errors.heading)
    motion = in_the_air(flight, errors.velocity)
    track = flight.tracking.values
    level, down = np.hypot(velocity[:, 0], velocity[:, 1]), velocity[:, 2]
    return [
        ("Armed; in the air", f"{flight.armed_for_s:.1f} s; {flight.airborne_s:.1f} s"),
        (
            "3-D distance flown; greatest height",
            f"{flight.distance_flown_m:.1f} m; {_top(flight.true):.2f} m",
        ),
        (
            "Fastest: level; up; down",
            "; ".join(f"{float(np.max(speed)):.2f}" for speed in (level, -down, down)) + " m/s",
        ),
        ("Distance from setpoint, level", _pair(track[:, :2], "m")),
        ("Distance from setpoint, height", _pair(track[:, 2], "m")),
        ("Estimate error, level", _pair(position[:, :2], "m")),
        ("Estimate error, height", _pair(position[:, 2], "m")),
        ("Estimate error, velocity", _pair(motion, "m/s")),
        ("Estimate error, tilt", _pair(np.degrees(tilt), "deg")),
        ("Estimate error, heading", _pair(np.degrees(heading), "deg")),
        (
            "Landing point error",
            "no landing planned" if landing.error_m is None else f"{landing.error_m:.2f} m",
        ),
        ("Touch-down", f"{landing.touch_down_m_s:.2f} m/s"),
        *_battery(flight),
    ]


def _top(true: Series) -> float:
    return float(np.max(true.values[:, 2]))


def _pair(values: Array, unit: str) -> str:
    return f"{rms(values):.3f} {unit} RMS; {largest(values):.3f} {unit} at most"


def _battery(flight: Flight) -> list[tuple[str, str]]:
    log, topic = flight.log, "battery_status"
    if topic not in log.topics:
        return []
    time_s, voltage = log.time_s(topic), log.column(topic, "voltage_v")
    current, used = log.column(topic, "current_a"), log.column(topic, "discharged_mah")
    energy_wh = float(np.sum((voltage * current)[:-1] * np.diff(time_s))) / 3600.0
    left = log.column(topic, "remaining")[-1]
    return [
        (
            "Battery used",
            f"{used[-1] - used[0]:.0f} mAh, {energy_wh:.1f} Wh; {left:.0%} left",
        ),
        (
            "Battery, least voltage; greatest current",
            f"{float(np.min(voltage)):.2f} V; {float(np.max(current)):.1f} A",
        ),
    ]
