"""Commands that take one picture each, in a direction."""

from typing import Any

from mavlink_broker.mavlink.dialect import mavlink

SHOOT = mavlink.MAV_CMD_IMAGE_START_CAPTURE
Aim = tuple[float, float | None]
"""Pitch and yaw [deg]."""


def image(number: int, aim: Aim) -> dict[str, Any]:
    """A command that takes one picture there."""
    parameters = {"pitch_angle": aim[0], "yaw_angle": aim[1], "photo_count": 1, "time_interval": 0}
    return {"command_id": number, "command_type_id": 4, "parameters": parameters}
