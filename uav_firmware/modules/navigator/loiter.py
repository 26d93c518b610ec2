"""Hold: stop and stay, or fly to a commanded point and stay there."""

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.mode import NavigatorMode
from uav_firmware.modules.navigator.reposition import climb_back, reposition
from uav_firmware.msg.mission import NavigatorTarget


class LoiterMode(NavigatorMode):
    """AUTO_LOITER; finished when it stands still."""

    def on_activation(self, flight: Flight, target: NavigatorTarget | None) -> None:
        """Stop, or begin the way to the target."""
        self.finished = False
        flight.yaw_target = flight.yaw.yaw
        if target is not None:
            reposition(flight, target)
        else:
            flight.hold()
            climb_back(flight)

    def on_active(self, flight: Flight) -> None:
        """Nothing to decide: the path leads to rest."""
        self.finished = flight.path.resting
