"""The figures of one flight: plan, log and truth in, numbers out. Times are since arming."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from sim.report.arrays import (
    Array,
    ReportError,
    closest_in_order,
    euler,
    resample,
    resample_attitude,
    tilt_between,
    wrapped,
)
from sim.report.events import Event, Span, armed_times, events, mode_spans
from sim.report.flight_log import FlightLog
from sim.report.plan import Planned, Point
from sim.report.truth_track import Plane, TruthTrack

ON_GROUND_M: Final = 0.25  # [m] centre of gravity of a vehicle that stands, and a little
_MARGIN_S: Final = 2.0  # shown before arming and after disarming


class Series(NamedTuple):
    """Values over time, a row per instant."""

    time_s: Array  # since arming
    values: Array


class Passage(NamedTuple):
    """How a point of the plan was passed."""

    point: Point
    time_s: float  # of the closest approach, since arming
    distance_m: float  # in space
    horizontal_m: float
    vertical_m: float  # positive: too high
    position: Array  # [m] where the vehicle was then

    @property
    def accepted(self) -> bool | None:
        """Whether the true track came into the circle; None for a point without one."""
        radius = self.point.acceptance_m
        return None if radius is None else self.distance_m <= radius


class Landing(NamedTuple):
    """Where and how it came down."""

    error_m: float | None  # horizontal, from the planned place; None: no place was planned
    from_home_m: float  # horizontal, from where it stood first
    touch_down_m_s: float  # fastest descent in the last quarter metre of height


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Estimate minus truth."""

    position: Series  # [m] north, east, up
    velocity: Series  # [m/s] north, east, down
    tilt: Series  # [rad]
    heading: Series  # [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """All that a report shows of one vehicle."""

    vehicle_id: int
    plane: Plane
    planned: Planned
    log: FlightLog
    armed_at_s: float  # since boot
    armed_for_s: float  # from the first arming to the last disarming
    airborne_s: float
    true: Series  # [m] north, east, up
    true_velocity: Series  # [m/s] north, east, down
    estimated: Series  # [m] north, east, up
    setpoint: Series  # [m] north, east, up
    errors: Errors
    tracking: Series  # [m] true place minus setpoint, in the air
    passages: list[Passage]
    landing: Landing
    distance_flown_m: float
    events: list[Event]  # times since arming
    modes: list[Span]  # times since arming


def examine(vehicle_id: int, planned: Planned, log: FlightLog, truth: TruthTrack) -> Flight:
    """Work out the figures of a flight.

    Raises:
        ReportError: if the vehicle never armed, or the log lacks what is needed.
    """
    armed = armed_times(log)
    if not armed:
        raise ReportError("the vehicle never armed")
    begin_s, end_s = armed[0][0], armed[-1][1]
    within = (truth.time_s >= begin_s - _MARGIN_S) & (truth.time_s <= end_s + _MARGIN_S)
    time_s, position, velocity = (
        truth.time_s[within] - begin_s,
        truth.position[within],
        truth.velocity_ned[within],
    )
    setpoint = _setpoint(log, truth, begin_s)
    true = Series(time_s, position)
    return Flight(
        vehicle_id=vehicle_id,
        plane=truth.plane,
        planned=planned,
        log=log,
        armed_at_s=begin_s,
        armed_for_s=end_s - begin_s,
        airborne_s=_time_above(true, ON_GROUND_M),
        true=true,
        true_velocity=Series(time_s, velocity),
        estimated=_estimate(log, truth, begin_s),
        setpoint=setpoint,
        errors=_errors(log, truth, begin_s),
        tracking=_tracking(setpoint, true),
        passages=_passages(planned.points, true),
        landing=_landing(planned, true, velocity),
        distance_flown_m=float(np.sum(np.linalg.norm(np.diff(position, axis=0), axis=1))),
        events=[event._replace(time_s=event.time_s - begin_s) for event in events(log)],
        modes=[
            Span(span.start_s - begin_s, span.end_s - begin_s, span.mode)
            for span in mode_spans(log)
        ],
    )


def _estimate(log: FlightLog, truth: TruthTrack, begin_s: float) -> Series:
    """Estimated position of the vehicle."""
    topic, plane = "vehicle_global_position", truth.plane
    ground = plane.place(log.column(topic, "lat"), log.column(topic, "lon"))
    up = log.column(topic, "alt") - plane.altitude_amsl_m
    return Series(log.time_s(topic) - begin_s, np.column_stack((ground, up)))


def _setpoint(log: FlightLog, truth: TruthTrack, begin_s: float) -> Series:
    """Where it was to be; setpoints are about the estimator's origin."""
    topic, plane = "vehicle_local_position_setpoint", truth.plane
    origin = "vehicle_local_position"
    middle = plane.place(log.column(origin, "ref_lat")[-1:], log.column(origin, "ref_lon")[-1:])[0]
    ground = log.columns(topic, "x", "y") + middle
    up = log.column(origin, "ref_alt")[-1] - plane.altitude_amsl_m - log.column(topic, "z")
    return Series(log.time_s(topic) - begin_s, np.column_stack((ground, up)))


def _errors(log: FlightLog, truth: TruthTrack, begin_s: float) -> Errors:
    estimate = _estimate(log, truth, begin_s)
    true_position = resample(truth.time_s - begin_s, truth.position, estimate.time_s)
    local_s = log.time_s("vehicle_local_position")
    velocity = log.columns("vehicle_local_position", "vx", "vy", "vz")
    attitude_s = log.time_s("vehicle_attitude")
    q = log.array("vehicle_attitude", "q", 4)
    true_q = resample_attitude(truth.time_s, truth.q_ned_frd, attitude_s)
    return Errors(
        position=Series(estimate.time_s, estimate.values - true_position),
        velocity=Series(
            local_s - begin_s, velocity - resample(truth.time_s, truth.velocity_ned, local_s)
        ),
        tilt=Series(attitude_s - begin_s, tilt_between(q, true_q)),
        heading=Series(attitude_s - begin_s, wrapped(euler(q)[2] - euler(true_q)[2])),
    )


def _tracking(setpoint: Series, true: Series) -> Series:
    there = resample(true.time_s, true.values, setpoint.time_s)
    airborne = there[:, 2] > ON_GROUND_M
    return Series(setpoint.time_s[airborne], (there - setpoint.values)[airborne])


def _passages(points: list[Point], true: Series) -> list[Passage]:
    passed = [point for point in points if point.orbit_radius_m is None]
    rows = closest_in_order(true.values, [point.position for point in passed])
    found = []
    for point, row in zip(passed, rows, strict=True):
        miss = true.values[row] - point.position
        found.append(
            Passage(
                point=point,
                time_s=float(true.time_s[row]),
                distance_m=float(np.linalg.norm(miss)),
                horizontal_m=float(np.hypot(miss[0], miss[1])),
                vertical_m=float(miss[2]),
                position=true.values[row],
            )
        )
    return found


def _landing(planned: Planned, true: Series, velocity: Array) -> Landing:
    last = true.values[-1, :2]
    high = np.flatnonzero(true.values[:, 2] > 2.0 * ON_GROUND_M)
    final = velocity[high[-1] :, 2] if high.size else velocity[-1:, 2]
    return Landing(
        error_m=None if planned.landing is None else float(np.hypot(*(last - planned.landing))),
        from_home_m=float(np.hypot(*last)),
        touch_down_m_s=float(np.max(final)),
    )


def _time_above(true: Series, height_m: float) -> float:
    above = true.values[:-1, 2] > height_m
    return float(np.sum(np.diff(true.time_s)[above]))
