"""Home position: set when the position is first known, at arming, and by command."""

import math

from uav_firmware.bus import Topic
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.status import HomePosition


def _frame(estimate: VehicleLocalPosition) -> LocalFrame | None:
    origin = estimate.origin
    return LocalFrame(*origin) if all(map(math.isfinite, origin)) else None


def home_here(now_us: int, estimate: VehicleLocalPosition) -> HomePosition | None:
    """Home at the estimated position; None while the local origin is unknown."""
    frame = _frame(estimate)
    if frame is None:
        return None
    place = frame.to_geodetic(estimate.position_ned)
    return HomePosition(now_us, *place, estimate.position_ned, estimate.heading)


def home_at(
    now_us: int,
    estimate: VehicleLocalPosition,
    place: tuple[float, float, float],
    yaw: float,
) -> HomePosition | None:
    """Home at latitude, longitude [deg] and altitude [m]; yaw NaN means the present heading."""
    frame = _frame(estimate)
    if frame is None:
        return None
    heading = estimate.heading if math.isnan(yaw) else math.remainder(yaw, math.tau)
    return HomePosition(now_us, *place, frame.to_ned(*place), heading)


class HomePositionUpdater:
    """Publishes the home position.

    A home set by command is kept until the vehicle is disarmed. When the local origin moves,
    home keeps its geodetic coordinates and gets new local ones.
    """

    def __init__(self, topic: Topic[HomePosition]) -> None:
        self._topic = topic
        self._by_command = False
        self._origin: tuple[float, float, float] | None = None

    def update(self, now_us: int, estimate: VehicleLocalPosition) -> None:
        """Set home if there is none; convert it when the local origin has moved."""
        origin = estimate.origin
        home = self._topic.value
        if home is None:
            self._publish(home_here(now_us, estimate))
        elif self._origin is not None and origin != self._origin:
            self._publish(home_at(now_us, estimate, home[1:4], home.yaw))
        self._origin = origin

    def on_arming(self, now_us: int, estimate: VehicleLocalPosition) -> None:
        """Set home to the present position, unless a command has set it."""
        if not self._by_command:
            self._publish(home_here(now_us, estimate))

    def on_disarming(self) -> None:
        """Let the next arming set home again."""
        self._by_command = False

    def set(
        self,
        now_us: int,
        estimate: VehicleLocalPosition,
        place: tuple[float, float, float] | None,
        yaw: float,
    ) -> None:
        """Set home to a place, or to the present position, by command."""
        self._by_command = True
        if place is None:
            self._publish(home_here(now_us, estimate))
        else:
            self._publish(home_at(now_us, estimate, place, yaw))

    def _publish(self, home: HomePosition | None) -> None:
        if home is not None:
            self._topic.publish(home)
