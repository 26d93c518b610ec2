"""Hold: stop and stay, or fly to a commanded point and stay there."""

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.modes.mode import NavigatorMode
from uav_firmware.modules.navigator.modes.reposition import climb_back, reposition
from uav_firmware.msg.mission import ModeTarget, NavigatorTarget


class LoiterMode(NavigatorMode):
    """AUTO_LOITER; finished when it stands still."""

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Stop, or begin the way to the target."""
        self.finished = False
        flight.yaw_target = flight.yaw.yaw
        if isinstance(target, NavigatorTarget):
            reposition(flight, target)
        else:
            flight.hold()
            climb_back(flight)

    def on_active(self, flight: Flight) -> None:
        """Nothing to decide: the path leads to rest."""
        self.finished = flight.path.resting
