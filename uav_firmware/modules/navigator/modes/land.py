"""Landing: level to the target, then down in three speeds until the vehicle has landed.

    TRANSIT --over the point, or kept away from it--> DESCENT --MPC_LAND_ALT3--> TOUCHDOWN
    TOUCHDOWN --landed--> done

A vehicle that the wind keeps away from the point, and that has come no nearer for some seconds,
descends where it is: near the ground the wind is weaker. In the descent the setpoint stays near a
vehicle that is blown off it, so that it does not race back to the point low above the ground.

DESCENT slows to MPC_LAND_SPEED at MPC_LAND_ALT2 above the landing point and keeps sinking, so
that ground which lies lower only makes it longer. Where the range finder measures the ground
elsewhere than was believed, by home or by the target, DESCENT begins anew above that ground: a
home that was set in the air makes no landing slow, and higher ground none fast. Where the range
finder turns out to be stuck, the ground is again where it was believed, but never lower than it
was measured before the vehicle has sunk through that: a landing that is slow stays slow. While it
is stuck or silent nothing but a belief says where the ground is, and the landing is slow from
_UNSEEN_GROUND_M higher.

With a motor lost the vehicle spins as it descends, and TOUCHDOWN takes half the speed. For the
first seconds its body cones by up to 40 degrees and would tip over at the touch, so below
_CONING_BELOW_M the landing is interrupted until that has settled, unless the vehicle stands. The
ground is then the higher of the believed and the measured one, since a range finder that has just
got stuck shows one that is too low:

    DESCENT, TOUCHDOWN --motor lost less than _CONING_S ago--> CONING --settled--> DESCENT
"""

import math
from enum import Enum, auto

from uav_firmware.lib.ground_contact import does_not_sink
from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.modes.approach import NEAR_M, Approach
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.msg.mission import ModeTarget, NavigatorTarget
from uav_firmware.msg.status import Severity
from uav_firmware.msg.vectors import Vector3

_CRAWL_SHARE = 0.6  # of MPC_LAND_SPEED, for the last stretch
_SPINNING_CRAWL_SHARE = 0.3  # The friction of the first foot grows with the sink speed
_CONING_S = 12.0  # [s] Since a motor was lost; then the body cones by less than 4 degrees
_CONING_HEIGHT_M = 2.0  # [m] Above the ground; losing the motor costs up to 1 m
_CONING_BELOW_M = 3.0  # [m] Above the ground; higher it can descend meanwhile
_GROUND_DIFFERS_M = 1.5  # [m] More than the errors of height and range finder near the ground
_UNSEEN_GROUND_M = 10.0  # [m] By which a field may rise above home
_PATIENCE_S = 5.0  # [s] Longer than a gust
_DRIFTED_M = 5.0  # [m] From the point, in the descent: more than gusts do


class LandPhase(Enum):
    """Phase of a landing."""

    TRANSIT = auto()
    DESCENT = auto()
    CONING = auto()
    TOUCHDOWN = auto()


class Land:
    """Lands at a point whose down coordinate is that of the ground there, as far as is known."""

    def __init__(self, flight: Flight, target: Vector3, yaw_deg: float) -> None:
        self.phase = LandPhase.TRANSIT
        self._ground_down = self._believed_down = target[2]
        self._is_measured = False  # The ground, by the range finder
        self._is_blind = False  # The present descent, for want of a range finder that works
        here = flight.rest_point()
        self._over = (target[0], target[1], here[2])
        self._approach = Approach(_PATIENCE_S)
        self._has_reported = False  # That it lands elsewhere
        flight.face(yaw_deg)
        flight.fly(flight.stop_at(self._over))

    def follow_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Land at the present position after a reset of the estimate."""
        north, east, _ = step.position_ned
        self._over = (self._over[0] + north, self._over[1] + east, self._over[2])
        if self.phase is LandPhase.TRANSIT:
            flight.fly(flight.stop_at(self._over))

    def step(self, flight: Flight) -> bool:
        """Whether the vehicle has landed."""
        if self.phase is LandPhase.TRANSIT:
            self._travel(flight)
        else:
            self._sink(flight)
        return self.phase is not LandPhase.TRANSIT and flight.landed

    def _travel(self, flight: Flight) -> None:
        if self._over_the_point(flight):
            self._finds_other_ground(flight)
            self._descend(flight)
        elif self._approach.has_stalled(flight, self._over):
            self._report_once(flight, "Cannot reach the landing place: landing here")
            self.descend_here(flight)

    def _sink(self, flight: Flight) -> None:
        params = flight.params
        self._follow_drift(flight)
        height = self._ground_down - flight.position[2]
        if self._finds_other_ground(flight):
            self._begin_anew(flight)
        elif self.phase is LandPhase.DESCENT and self._is_blind is not flight.range_finder_blind:
            self._descend(flight)
        elif self.phase is LandPhase.CONING:
            if not _cones(flight) and flight.path.resting:
                self._descend(flight)
        elif _cones(flight) and self._may_be_low(flight) and not _stands(flight):
            self._wait_above_ground(flight)
        elif (
            self.phase is LandPhase.DESCENT
            and flight.path.sinking
            and height < params.land_crawl_height
        ):
            self.phase = LandPhase.TOUCHDOWN
            share = _SPINNING_CRAWL_SHARE if flight.motor_lost_us is not None else _CRAWL_SHARE
            flight.path.descend(0.0, share * params.land_speed, flight.limits())

    def descend_here(self, flight: Flight) -> None:
        """Give up the point, and descend where the vehicle is, on ground no lower than home."""
        self._has_reported = True
        self._ground_down = self._believed_down = min(self._ground_down, flight.home_down(0.0))
        flight.path.reset(flight.position)
        self._over = flight.position
        self._finds_other_ground(flight)
        self._descend(flight)

    def _follow_drift(self, flight: Flight) -> None:
        """Keep the setpoint near a vehicle that the wind blows away, and report it."""
        flight.stay_near()
        known = flight.estimate is not None and flight.estimate.position_valid
        if known and flight.error_to(self._over)[0] > _DRIFTED_M:
            self._report_once(flight, "Cannot keep to the landing place: landing here")

    def _report_once(self, flight: Flight, text: str) -> None:
        if not self._has_reported:
            flight.report(Severity.WARNING, text)
        self._has_reported = True

    def _begin_anew(self, flight: Flight) -> None:
        """Continue above ground that is elsewhere."""
        if self.phase is LandPhase.CONING:
            self._wait_above_ground(flight)
        else:
            self._descend(flight)

    def _wait_above_ground(self, flight: Flight) -> None:
        """Interrupt the landing, until the body cones no more."""
        self.phase = LandPhase.CONING
        north, east, _ = flight.path.state.position
        down = self._highest_ground_down(flight) - _CONING_HEIGHT_M
        flight.fly(flight.stop_at((north, east, down)))

    def _may_be_low(self, flight: Flight) -> bool:
        """Whether the vehicle is near the ground, wherever that is."""
        return self._highest_ground_down(flight) - flight.position[2] < _CONING_BELOW_M

    def _highest_ground_down(self, flight: Flight) -> float:
        """Down coordinate [m] of the ground, or of that believed if it may be there, above it."""
        refuted = flight.position[2] > self._believed_down + _GROUND_DIFFERS_M
        return self._ground_down if refuted else min(self._ground_down, self._believed_down)

    def _descend(self, flight: Flight) -> None:
        params = flight.params
        self.phase = LandPhase.DESCENT
        self._is_blind = flight.range_finder_blind
        setpoint_height = self._ground_down - flight.path.state.position[2]
        slow = params.land_slow_height + (_UNSEEN_GROUND_M if self._is_blind else 0.0)
        fast = max(0.0, setpoint_height - slow)
        flight.path.descend(fast, params.land_speed, flight.limits())

    def _finds_other_ground(self, flight: Flight) -> bool:
        """Take over the ground that is measured below, where it is not as was believed."""
        measured = self._believed_down if flight.range_finder_failed else flight.ground_down
        if math.isnan(measured) or abs(measured - self._ground_down) <= _GROUND_DIFFERS_M:
            return False
        is_lower = measured > self._ground_down
        if self._is_measured and is_lower and not self._is_under_the_ground(flight):
            return False
        self._ground_down, self._is_measured = measured, not flight.range_finder_failed
        return True

    def _is_under_the_ground(self, flight: Flight) -> bool:
        """Whether the vehicle has sunk through the ground that was measured: there is none."""
        return flight.position[2] > self._ground_down + _GROUND_DIFFERS_M

    def _over_the_point(self, flight: Flight) -> bool:
        if not flight.path.resting:
            return False
        horizontal, _ = flight.error_to(self._over)
        blind = flight.estimate is None or not flight.estimate.position_valid
        return blind or (flight.turned and horizontal < NEAR_M)


def _cones(flight: Flight) -> bool:
    """Whether a motor was lost so short a time ago that the body still cones."""
    lost_s = flight.motor_lost_s
    return lost_s is not None and lost_s < _CONING_S


def _stands(flight: Flight) -> bool:
    """Whether the ground carries the vehicle already: then it must not rise again."""
    estimate, commanded_m_s = flight.estimate, flight.path.state.velocity[2]
    return estimate is not None and does_not_sink(
        estimate.velocity_ned[2], commanded_m_s, estimate.sink_accuracy_m_s
    )


def land_here(flight: Flight, yaw_deg: float = math.nan) -> Land:
    """Land where the vehicle comes to rest, on ground as high as home."""
    flight.begin_where_it_is()
    here = flight.rest_point()
    return Land(flight, (here[0], here[1], flight.home_down(0.0)), yaw_deg)


class LandMode(NavigatorMode):
    """AUTO_LAND; lands at the target, or where it is.

    During the transit it lands where it comes to rest as soon as the position is no longer
    measured, also if a fix returns: the operator can command the target again.
    """

    def __init__(self) -> None:
        self._here = True
        self._land: Land | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the transit to the landing point."""
        self.finished = False
        self._here = not isinstance(target, NavigatorTarget)
        if not isinstance(target, NavigatorTarget):
            self._land = land_here(flight)
            return
        flight.begin_where_it_is()
        goal = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
        if math.isnan(target.altitude_amsl_m):
            goal = (goal[0], goal[1], flight.home_down(0.0))
        flight.abort_down = goal[2] - target.abort_height_m
        self._land = Land(flight, goal, math.degrees(target.yaw))

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Continue a landing without a target at the present position."""
        if self._land is not None and self._here:
            self._land.follow_reset(flight, step)

    def on_active(self, flight: Flight) -> None:
        """Run the landing; without a measured position the transit ends."""
        if self._land is None or self.finished:
            return
        travels = not self._here and self._land.phase is LandPhase.TRANSIT
        if travels and not flight.position_measured:
            self._here = True
            self._land = land_here(flight)
            flight.report(
                Severity.WARNING, "No GPS fix to reach the landing place by: landing here"
            )
        self.finished = self._land.step(flight)
