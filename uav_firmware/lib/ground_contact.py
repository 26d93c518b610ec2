"""Ground contact: a vehicle that is commanded to descend does not sink. Pure.

The land detector and the position controller both conclude from it, with a thrust below the
weight, that the ground carries the vehicle (PX4, MulticopterLandDetector). The land detector takes
the commanded descent from the setpoint; so it has to know when the position controller descends
by itself instead, and how fast.

A vertical velocity with a large deviation does not show zero when the vehicle stands: what is
within three deviations counts as none, up to 1 m/s. Without enough thrust a vehicle in the air
is faster than that within half a second.
"""

import math
from typing import Final

STALE_SETPOINT_US: Final = 500_000
"""[us] The position controller flies by no older trajectory setpoint, and descends."""
BLIND_DESCENT_M_S: Final = 0.5
"""[m/s] Speed, down, at which it descends without a setpoint; at least, without a height."""

GROUND_SINK_SPEED_M_S: Final = 0.7
"""[m/s] Setpoint, down, of a vehicle that stays on the ground: it keeps the thrust low."""

_DESCENT_MIN_M_S: Final = 0.1  # Slower is no descent
_FOLLOWED_SHARE: Final = 0.5  # Of the commanded speed: a vehicle that sinks faster follows it
_STILL_SIGMAS: Final = 3.0
_LARGEST_STILL_M_S: Final = 1.0


def does_not_sink(
    vertical_speed_m_s: float,
    commanded_m_s: float,
    accuracy_m_s: float,
    *,
    still_max_m_s: float = math.inf,
) -> bool:
    """Whether a vehicle neither sinks nor rises although it is commanded to descend.

    Args:
        vertical_speed_m_s: Estimated vertical speed, down positive.
        commanded_m_s: Commanded vertical speed, down positive; NaN is no descent, infinite
            where nothing controls the height.
        accuracy_m_s: Deviation (one sigma) of the estimated speed.
        still_max_m_s: Largest speed that counts as none when the speed is known well.
    """
    still_m_s = max(
        min(still_max_m_s, _FOLLOWED_SHARE * commanded_m_s),
        min(_STILL_SIGMAS * accuracy_m_s, _LARGEST_STILL_M_S),
    )
    return commanded_m_s > _DESCENT_MIN_M_S and abs(vertical_speed_m_s) < still_m_s
