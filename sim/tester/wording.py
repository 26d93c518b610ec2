"""How vehicle and alarm are told to people."""

from collections.abc import Sequence

from sim.tester.actions import Pose
from sim.tester.alarms import Alarm
from sim.tester.steps import Step

_STATUSTEXT: int = 50


def mission_text(steps: Sequence[Step]) -> str:
    """Show a mission that was received."""
    titles = (f"  {n}. {step.title}" for n, step in enumerate(steps, start=1))
    return "\n".join(("Mission received:", *titles))


def pose_text(pose: Pose) -> str:
    """Say where the vehicle is."""
    return (
        f"latitude {pose.latitude_deg:.7f}, longitude {pose.longitude_deg:.7f}, "
        f"altitude {pose.relative_altitude_m:g} m, yaw {pose.yaw_deg:g}, "
        f"pitch {pose.pitch_deg:g}, roll {pose.roll_deg:g}"
    )


def alarm_text(alarm: Alarm, parameters: tuple[float, float]) -> str:
    """Say what has failed, in the length of a STATUSTEXT."""
    return f"{alarm.label}: {parameters[0]:g}, {parameters[1]:g}"[:_STATUSTEXT]
