"""Moves the setpoint along a route of waypoints, leg by leg.

A new route is joined from the present motion by a bend where that is possible and saves time, else
the setpoint first comes to rest. `reshape` keeps the present leg.
"""

import math
from collections.abc import Sequence

from uav_firmware.lib import speed_profile
from uav_firmware.lib.guide import Guide, GuideLimits
from uav_firmware.lib.motion import (
    Arc,
    MotionLimits,
    MotionState,
    Stretch,
    along,
    arcs,
    stop_on,
    stop_pieces,
    straight_pieces,
)
from uav_firmware.lib.smoothing import Leg, Waypoint, join, plan_leg
from uav_firmware.lib.vector import ZERO, add, dot, norm, scale, subtract
from uav_firmware.msg.vectors import Vector3

_LOOK_AHEAD = 8  # Waypoints that determine the speed of the present leg
_SLOWEST = 1e-3  # [m/s] below it a motion has no direction
_DOWN: Vector3 = (0.0, 0.0, 1.0)
_SAMPLED_SHARES = (0.0, 0.5, 1.0)  # Of each stretch of a stop
_SLOWER_M_S = 0.3  # [m/s] Less is noise of the estimate, or lag


def _moved(piece: Stretch, step: Vector3) -> Stretch:
    """A stretch moved by a step [m]."""
    if isinstance(piece, Arc):
        return piece._replace(centre=add(piece.centre, step))
    return piece._replace(position=add(piece.position, step))


def _slowed(state: MotionState, position: Vector3, velocity: Vector3, jerk: float) -> MotionState:
    """The state with the speeds of a slower vehicle, and not ahead of it there."""
    level = math.hypot(state.velocity[0], state.velocity[1])
    ahead = (
        (state.velocity[0] / level, state.velocity[1] / level, 0.0) if level > _SLOWEST else ZERO
    )
    for direction in (ahead, scale(_DOWN, math.copysign(1.0, state.velocity[2]))):
        speed = dot(state.velocity, direction)
        true = max(0.0, dot(velocity, direction))
        if true >= speed - _SLOWER_M_S:
            continue
        slope = dot(state.acceleration, direction)
        # A harder braking would outlast the speed that is left.
        softer = max(slope, -math.sqrt(2.0 * jerk * true))
        lead = max(0.0, dot(subtract(state.position, position), direction))
        state = MotionState(
            subtract(state.position, scale(direction, lead)),
            add(state.velocity, scale(direction, true - speed)),
            add(state.acceleration, scale(direction, softer - slope)),
        )
    return state


class PathFollower:
    """Motion of the setpoint; time advances only in `advance`."""

    def __init__(self) -> None:
        self.state = MotionState(ZERO, ZERO, ZERO)
        self.passed = 0  # Waypoints of the present route that the setpoint has passed
        self._route: tuple[Waypoint, ...] = ()
        self._leg_index = 0  # Waypoint that the present pieces lead to
        self._leg: Leg | None = None
        self._origin: Vector3 = ZERO  # Where the line of the present leg began
        self._pieces: list[Stretch] = []
        self._time = 0.0  # [s] Within the first piece
        self._joining = False  # The first piece bends to the line of the first leg
        self._tracked: tuple[Vector3, MotionLimits] | None = None  # Velocity to track [m/s]
        self._guide = Guide()
        self._stop_limits: MotionLimits | None = None  # Of a stop that is flown

    @property
    def stopping(self) -> bool:
        """Whether the setpoint comes to rest, before or without a route."""
        return self._stop_limits is not None

    @property
    def resting(self) -> bool:
        """Whether the setpoint is at rest and the route has ended."""
        return not self._pieces and self._leg_index >= len(self._route) and self._tracked is None

    @property
    def goal(self) -> Vector3 | None:
        """Waypoint [m] that is flown to; None without a route."""
        return self._route[self.passed].position if self.passed < len(self._route) else None

    @property
    def sinking(self) -> bool:
        """Whether the setpoint sinks at a constant speed without end."""
        piece = self._pieces[0] if self._pieces else None
        return piece is not None and math.isinf(piece.duration) and not isinstance(piece, Arc)

    @property
    def descending(self) -> bool:
        """Whether a descent is flown that ends in sinking without end."""
        piece = self._pieces[-1] if self._pieces else None
        return piece is not None and math.isinf(piece.duration) and not isinstance(piece, Arc)

    def rest_point(self, limits: MotionLimits) -> Vector3:
        """Where the setpoint would come to rest [m]."""
        stop = self._stop(limits)
        return stop[-1].end().position if stop else self.state.position

    def reset(self, position: Vector3, velocity: Vector3 = ZERO) -> None:
        """Begin again at the vehicle's own position and velocity."""
        self.state = MotionState(position, velocity, ZERO)
        self._follow((), [])

    def move(self, step: Vector3) -> None:
        """Move a descent that is flown, with its setpoint, by a step [m]."""
        self.state = self.state._replace(position=add(self.state.position, step))
        self._pieces = [_moved(piece, step) for piece in self._pieces]

    def shift(self, position: Vector3, velocity: Vector3, limits: MotionLimits) -> None:
        """Follow a reset of the estimate by a step of `position` [m] and `velocity` [m/s].

        The setpoint moves with the estimate, so that the motion of the vehicle does not change.
        The route stays fixed to the earth. A position that is held moves with the estimate, and
        so do a descent and a circle.
        """
        self.state = self.state._replace(
            position=add(self.state.position, position),
            velocity=add(self.state.velocity, velocity),
        )
        route, passed = self._route, self.passed
        if self._tracked is not None:
            return
        endless = bool(self._pieces) and math.isinf(self._pieces[-1].duration)
        if endless or any(isinstance(piece, Arc) for piece in self._pieces):
            self._pieces = [_moved(piece, position) for piece in self._pieces]
        else:
            self.fly(route[passed:], limits)
            self._route, self._leg_index, self.passed = route, passed, passed

    def stop(self, limits: MotionLimits) -> None:
        """Come to rest as soon as the limits allow; on a circle that is flown, along it."""
        self._follow((), self._stop(limits))
        self._stop_limits = limits if self._pieces else None

    def stop_points(self, limits: MotionLimits) -> tuple[Vector3, ...]:
        """Points [m] of the way to rest, the last of which is the rest."""
        return tuple(
            piece.at(share * piece.duration).position
            for piece in self._stop(limits)
            for share in _SAMPLED_SHARES
        ) or (self.state.position,)

    def shorten_stop(self, position: Vector3, velocity: Vector3) -> None:
        """Shorten a straight stop for a vehicle that has braked better than planned.

        A vehicle slower than the setpoint, by speed limits, wind or drag, would else be led on
        to a place where it need not go. The setpoint takes over its speed, and is put back to
        it where it is ahead; along the motion and vertically for itself.
        """
        limits = self._stop_limits
        if limits is None or not self._pieces or isinstance(self._pieces[0], Arc):
            return
        state = _slowed(self.state, position, velocity, limits.jerk)
        if state is not self.state:
            self.state = state
            self._pieces, self._time = list(stop_pieces(state, limits)), 0.0

    def _stop(self, limits: MotionLimits) -> list[Stretch]:
        piece = self._pieces[0] if self._pieces else None
        if isinstance(piece, Arc):
            return list(stop_on(piece, self._time, limits))
        return list(stop_pieces(self.state, limits))

    def fly(self, route: Sequence[Waypoint], limits: MotionLimits) -> None:
        """Fly a route, from the present motion; its last waypoint is a stop."""
        self.stop(limits)
        self._route = tuple(route)
        if not self._pieces or not route:
            return
        joined = join(self.state, self._ahead())
        if joined is not None:
            bend, leg = joined
            self._start_leg(leg)
            self._origin, self._joining = bend.end().position, True
            self._pieces.insert(0, bend)

    def extend(self, route: Sequence[Waypoint]) -> None:
        """Extend the route; to be called before its present end determines a leg."""
        self._route = (*self._route, *route)

    def circle(
        self,
        centre: Vector3,
        radius: float,
        angle: float,
        speed: speed_profile.Limits,
    ) -> None:
        """Fly a level circle from the point of it that the setpoint rests on.

        Args:
            centre: of the circle [m]; the setpoint's height is kept.
            radius: [m] positive clockwise seen from above.
            angle: to fly [rad]; infinite without end, else it ends at rest.
            speed: limits along the circle; its speed is the cruising speed.
        """
        north, east, down = self.state.position
        bearing = math.atan2(east - centre[1], north - centre[0])
        phases = speed_profile.cruise_for(angle * abs(radius), speed)
        level = (centre[0], centre[1], down)
        self._follow((), list(arcs(level, radius, bearing, phases)))

    def descend(self, distance: float, end_speed: float, limits: MotionLimits) -> None:
        """Go down `distance` [m] as the limits allow, then sink at `end_speed` without end.

        To be called at rest or while sinking.
        """
        start = self.state.velocity[2]
        axis = along(_DOWN, limits)
        axis = axis._replace(speed=max(axis.speed, start, end_speed))
        shortest = speed_profile.change_distance(start, end_speed, axis)
        phases = speed_profile.plan(max(distance, shortest), start, end_speed, axis) or []
        state = MotionState(self.state.position, scale(_DOWN, start), ZERO)
        endless = speed_profile.Phase(math.inf, 0.0)
        self._follow((), list(straight_pieces(state, _DOWN, [*phases, endless])))

    def track_velocity(self, velocity: Vector3, limits: MotionLimits) -> None:
        """Track a velocity [m/s] within acceleration and jerk until another command."""
        self._follow((), [])
        self._tracked = (velocity, limits)

    def relimit(self, limits: MotionLimits) -> None:
        """Fly the same route with other limits."""
        self.reshape([waypoint._replace(limits=limits) for waypoint in self._route])

    def reshape(self, route: Sequence[Waypoint]) -> None:
        """Fly the same points with other limits; a turn or stop already begun is kept."""
        self._route = tuple(route)
        leg, ahead = self._leg, self._ahead()
        if leg is None or not ahead or len(self._pieces) <= len(leg.turn):
            return
        if self._joining:
            self.fly(route, ahead[0].limits)
            return
        position, velocity, acceleration = self.state
        speed = norm(velocity)
        if speed < _SLOWEST:
            return
        slope = dot(acceleration, scale(velocity, 1.0 / speed))
        other = plan_leg(position, speed, ahead, acceleration=slope, origin=self._origin)
        if other is not None:
            self._start_leg(other)
            self._time = 0.0

    def advance(self, dt: float) -> MotionState:
        """Advance the setpoint by `dt` [s]."""
        if self._tracked is not None:
            return self._advance_velocity(*self._tracked, dt)
        self._time += dt
        while True:
            if not self._pieces and not self._begin_leg():
                self._time = 0.0
                self._stop_limits = None
                self.state = MotionState(self.state.position, ZERO, ZERO)
                return self.state
            if not self._pieces:
                continue
            piece = self._pieces[0]
            if self._time < piece.duration:
                self.state = piece.at(self._time)
                self._note_passing(piece)
                return self.state
            self._time -= piece.duration
            self.state = piece.end()
            self._pieces.pop(0)
            self._joining = False
            if not self._pieces and self._leg is not None:
                self._end_leg()

    def _advance_velocity(self, velocity: Vector3, limits: MotionLimits, dt: float) -> MotionState:
        guide = self._guide
        guide.position, guide.velocity, guide.acceleration = self.state
        slopes = GuideLimits(
            limits.acceleration_horizontal,
            limits.acceleration_up,
            limits.acceleration_down,
            limits.jerk,
            math.inf,
            math.inf,
        )
        if dt > 0.0:
            guide.advance(velocity, guide.position, slopes, dt)
        self.state = MotionState(guide.position, guide.velocity, guide.acceleration)
        return self.state

    def _follow(self, route: tuple[Waypoint, ...], pieces: list[Stretch]) -> None:
        self._route, self._pieces, self._leg, self._joining = route, pieces, None, False
        self._leg_index, self.passed, self._time = 0, 0, 0.0
        self._tracked = self._stop_limits = None

    def _ahead(self) -> tuple[Waypoint, ...]:
        return self._route[self._leg_index : self._leg_index + _LOOK_AHEAD]

    def _begin_leg(self) -> bool:
        """Plan the next leg of the route; False when there is none."""
        ahead = self._ahead()
        if not ahead:
            return False
        position, velocity, _ = self.state
        if self._leg is None or self._leg.exit_speed == 0.0:
            self._origin, velocity = position, ZERO
        else:
            self._origin = self._route[self._leg_index - 1].position
        leg = plan_leg(position, norm(velocity), ahead, origin=self._origin)
        if leg is None:
            # The rest of the leg is too short for lowered limits: stop first.
            stop = stop_pieces(MotionState(position, velocity, ZERO), ahead[0].limits)
            self._leg, self._pieces = None, list(stop)
        else:
            self._start_leg(leg)
            if not self._pieces:
                self._end_leg()
        return True

    def _start_leg(self, leg: Leg) -> None:
        self._stop_limits = None
        self._leg, self._pieces = leg, [*leg.straight, *leg.turn]

    def _end_leg(self) -> None:
        self._leg_index += 1
        self.passed = self._leg_index

    def _note_passing(self, piece: Stretch) -> None:
        """A waypoint is passed in the middle of its turn."""
        leg = self._leg
        if leg is None or not leg.turn or len(self._pieces) > len(leg.turn):
            return
        if self._time >= 0.5 * piece.duration:
            self.passed = self._leg_index + 1
