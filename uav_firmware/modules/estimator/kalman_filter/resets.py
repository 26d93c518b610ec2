"""Resets of the estimate, counted and summed: the only place from which the state is stepped.

A reset moves the estimate to a measurement, without the gain of the filter. The vehicle has not
moved: the owner of a setpoint shifts it by the same step (PX4 `ekf_helper.cpp`, the resets of
horizontal position, altitude, velocity and heading, and their counters).
"""

import math

from uav_firmware.lib.vector import add
from uav_firmware.modules.estimator.kalman_filter.state import NominalState
from uav_firmware.msg.estimate import EstimateResets


class ResetLog:
    """Moves the nominal state and keeps the account of it."""

    def __init__(self) -> None:
        self.resets = EstimateResets()

    def move_horizontally(self, state: NominalState, north_m: float, east_m: float) -> None:
        """Move the position by a horizontal step [m]."""
        log, step = self.resets, (north_m, east_m, 0.0)
        state.position_ned = add(state.position_ned, step)
        self.resets = log._replace(
            xy_count=log.xy_count + 1,
            position_delta_ned=(north_m, east_m, log.position_delta_ned[2]),
            position_total_ned=add(log.position_total_ned, step),
        )

    def move_vertically(self, state: NominalState, down_m: float) -> None:
        """Move the height by a step [m, positive down]."""
        log, step = self.resets, (0.0, 0.0, down_m)
        state.position_ned = add(state.position_ned, step)
        north_m, east_m, _ = log.position_delta_ned
        self.resets = log._replace(
            z_count=log.z_count + 1,
            position_delta_ned=(north_m, east_m, down_m),
            position_total_ned=add(log.position_total_ned, step),
        )

    def change_speed(self, state: NominalState, north_m_s: float, east_m_s: float) -> None:
        """Change the horizontal velocity by a step [m/s]."""
        log, step = self.resets, (north_m_s, east_m_s, 0.0)
        state.velocity_ned = add(state.velocity_ned, step)
        self.resets = log._replace(
            velocity_xy_count=log.velocity_xy_count + 1,
            velocity_delta_ned=(north_m_s, east_m_s, log.velocity_delta_ned[2]),
            velocity_total_ned=add(log.velocity_total_ned, step),
        )

    def change_sink(self, state: NominalState, down_m_s: float) -> None:
        """Change the vertical velocity by a step [m/s, positive down]."""
        log, step = self.resets, (0.0, 0.0, down_m_s)
        state.velocity_ned = add(state.velocity_ned, step)
        north_m_s, east_m_s, _ = log.velocity_delta_ned
        self.resets = log._replace(
            velocity_z_count=log.velocity_z_count + 1,
            velocity_delta_ned=(north_m_s, east_m_s, down_m_s),
            velocity_total_ned=add(log.velocity_total_ned, step),
        )

    def note_turn(self, angle: float) -> None:
        """Count a heading that was turned by an angle [rad]."""
        log = self.resets
        self.resets = log._replace(
            heading_count=log.heading_count + 1,
            heading_delta=angle,
            heading_total=math.remainder(log.heading_total + angle, math.tau),
        )
