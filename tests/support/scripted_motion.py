"""How a scripted vehicle flies to a place, and round one."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from tests.support.geodesy import LocalGround


@dataclass
class Circle:
    """A circle that is being flown, from its northernmost point."""

    centre: tuple[float, float]
    radius_m: float  # Negative: counter-clockwise
    speed_m_s: float
    angle_rad: float  # To fly; infinite: until another order
    flown_rad: float = 0.0

    def after(self, seconds: float) -> tuple[float, float]:
        """Fly on; gives the new place."""
        self.flown_rad += self.speed_m_s / abs(self.radius_m) * seconds
        bearing = math.copysign(self.flown_rad, self.radius_m)
        radius_m = abs(self.radius_m)
        ground = LocalGround(*self.centre)
        return ground.place(radius_m * math.cos(bearing), radius_m * math.sin(bearing))

    @property
    def is_complete(self) -> bool:
        return self.flown_rad >= self.angle_rad


class Movement(NamedTuple):
    """Where a vehicle is, and how it moves."""

    place: tuple[float, float]
    """Latitude and longitude [deg]."""
    height_m: float
    velocity_ned: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Target:
    """The place that a DO_REPOSITION names."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float
    ground_speed_m_s: float

    def approach(self, from_: Movement, elapsed_s: float, climb_rate_m_s: float) -> Movement:
        """Fly straight towards it for a time, at most at its ground speed."""
        ground = LocalGround(*from_.place)
        north_m, east_m = ground.north_east_m(self.latitude_deg, self.longitude_deg)
        left_m, climb_m = math.hypot(north_m, east_m), self.relative_altitude_m - from_.height_m
        flown_m = min(left_m, self.ground_speed_m_s * elapsed_s)
        climbed_m = math.copysign(min(abs(climb_m), climb_rate_m_s * elapsed_s), climb_m)
        share = flown_m / left_m if left_m else 0.0
        velocity = share * north_m / elapsed_s, share * east_m / elapsed_s, -climbed_m / elapsed_s
        place = ground.place(share * north_m, share * east_m)
        return Movement(place, from_.height_m + climbed_m, velocity)
