"""The hooks of a mode, as PX4's `navigator_mode.h`."""

from abc import ABC, abstractmethod

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.mission import ModeTarget


class NavigatorMode(ABC):
    """One navigation state; the object exists as long as the navigator."""

    finished: bool = False

    @abstractmethod
    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the mode, with the target that was commanded for it."""

    @abstractmethod
    def on_active(self, flight: Flight) -> None:
        """Run a step of the mode; set `finished` when the mode has reached its end."""

    def on_inactivation(self, flight: Flight) -> None:
        """End the mode."""
        del flight
        self.finished = False

    def on_speeds(self, flight: Flight) -> None:
        """Apply a change of the commanded speeds."""
        flight.path.relimit(flight.limits())

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Apply a reset of the estimate to places that move with the vehicle."""
        del flight, step

    def stays_on_ground(self, flight: Flight) -> bool:
        """Whether a vehicle on the ground stays there in this mode."""
        return flight.landed
