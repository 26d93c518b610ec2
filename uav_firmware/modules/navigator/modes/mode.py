"""What every mode of the navigator offers: hooks, and whether its work is done."""

from abc import ABC, abstractmethod

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.mission import ModeTarget


class NavigatorMode(ABC):
    """One navigation state; lives as long as the vehicle."""

    finished: bool = False

    @abstractmethod
    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """The mode begins, with the target that came with it."""

    @abstractmethod
    def on_active(self, flight: Flight) -> None:
        """A step in the mode; sets `finished` when its work is done."""

    def on_inactivation(self, flight: Flight) -> None:
        """The mode ends."""
        del flight
        self.finished = False

    def on_speeds(self, flight: Flight) -> None:
        """The commanded speeds have changed."""
        flight.path.relimit(flight.limits())

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """The estimate was reset by a step, and the path with it: move places that go along."""
        del flight, step

    def sits(self, flight: Flight) -> bool:
        """Whether a vehicle on the ground shall stay there in this mode."""
        return flight.landed
