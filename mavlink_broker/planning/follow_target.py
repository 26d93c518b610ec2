"""FOLLOW_TARGET(144): where a target is that a vehicle follows."""

from typing import Final, TypeAlias

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.planning.situation import Home, Spot

_KNOWN: Final = 3  # est_capabilities: position and velocity
Vector: TypeAlias = tuple[float, float, float]
STANDING: Final[Vector] = (0.0, 0.0, 0.0)


def target_message(
    spot: Spot, home: Home, now: float, *, velocity_ned_m_s: Vector = STANDING
) -> Message:
    """Tell a target's place and speed; its time is the broker's own clock.

    The altitude is the one that the follower is to keep, above mean sea level: some autopilots fly
    at it, others have been told a height of their own.
    """
    return mavlink.MAVLink_follow_target_message(
        int(now * 1e3),
        _KNOWN,
        round(spot.latitude_deg * 1e7),
        round(spot.longitude_deg * 1e7),
        home.altitude_amsl_m + spot.relative_altitude_m,
        velocity_ned_m_s,
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        0,
    )
