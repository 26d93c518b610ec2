"""A camera on a relay or a servo of an ArduPilot vehicle (`AP_Camera_Backend.cpp`).

Each trigger counts in `img_idx`. Without a feedback pin CAMERA_FEEDBACK follows at once, with the
GPS's time of day and `completed_captures` 0; with one when the camera confirms the picture, with
the time since boot in 32 bits. The message is sent once.
"""

from dataclasses import dataclass
from typing import Final

from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import HOME
from tests.support.vehicle_wire import mavlink

NOON_US: Final = 1_790_000_000_000_000


@dataclass
class TriggeredCamera:
    """One camera; `has_pin` if CAM_FEEDBACK_PIN is connected to its hot shoe."""

    vehicle: ScriptedVehicle
    has_pin: bool = False
    instance: int = 0
    triggered: int = 0
    confirmed: int = 0

    def shoot(self, now: float, *, arrives: bool = True, confirms: bool = True) -> None:
        """Trigger it; `arrives` if the message does, `confirms` if the camera takes the picture."""
        self.triggered = (self.triggered + 1) % 65536
        if self.has_pin and not confirms:
            return
        self.confirmed += self.has_pin
        if arrives:
            self.report(now)

    def report(self, now: float) -> None:
        """Send the feedback of the newest picture."""
        boot_us = round((now - self.vehicle.booted_at) * 1e6)
        height_m = self.vehicle.height_m
        self.vehicle.send(
            mavlink.MAVLink_camera_feedback_message(
                boot_us % (1 << 32) if self.has_pin else NOON_US + boot_us,
                0,
                self.instance,
                self.triggered,
                round(self.vehicle.place[0] * 1e7),
                round(self.vehicle.place[1] * 1e7),
                HOME[2] + height_m,
                height_m,
                *(0.0, 0.0, 0.0, 0.0),
                mavlink.CAMERA_FEEDBACK_PHOTO,
                self.confirmed,
            )
        )
