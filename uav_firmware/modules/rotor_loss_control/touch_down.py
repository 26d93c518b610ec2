"""Tells that a spinning vehicle has met the ground: it sinks no more, and something brakes it.

The feet of a vehicle that spins under power on the ground walk, until it tips over; so the
thrust has to go within tenths of a second, long before a land detector that waits for rest
reacts. Neither sign is enough alone: a gust stops the sinking for a moment, and the spin
changes with the thrust, but over seconds. Both together are the ground. The sign is not kept:
should it err in the air, the vehicle falls, the sign is gone and the thrust is back.
"""

_LEAST_WANTED_SINK_M_S = 0.1
_SINK_SHARE = 0.4  # Of the wanted sink speed
_SPIN_SHARE = 0.97  # Of what it was
_SPIN_TIME_S = 10.0  # In which a former spin is forgotten; the ground may brake it slowly
_LEAST_SPIN_RAD_S = 3.0
_FALL_M_S = 1.0  # A tenth of a second of free fall
_TIME_S = 0.02


class TouchDownSign:
    """The sign, from step to step."""

    def __init__(self) -> None:
        self._spin = 0.0  # [rad/s] The greatest of late
        self._held_s = 0.0

    def update(self, wanted_sink: float, sink: float, yaw_rate: float, dt: float) -> bool:
        """Whether the ground is met, for speeds [m/s, down] and the yaw rate [rad/s]."""
        spin = abs(yaw_rate)
        self._spin = max(spin, self._spin * (1.0 - dt / (dt + _SPIN_TIME_S)))
        if self._held_s >= _TIME_S:
            # Feet that settle jerk; only a fall, or an order to rise, takes the ground away
            stays = wanted_sink > _LEAST_WANTED_SINK_M_S and sink < _FALL_M_S
        else:
            braked = self._spin > _LEAST_SPIN_RAD_S and spin < _SPIN_SHARE * self._spin
            stopped = abs(sink) < _SINK_SHARE * wanted_sink
            stays = braked and stopped and wanted_sink > _LEAST_WANTED_SINK_M_S
        self._held_s = self._held_s + dt if stays else 0.0
        return self._held_s >= _TIME_S
