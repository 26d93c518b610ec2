"""AFarCloud's eleven commands to mission items or live actions: one table of pure functions."""

from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

from afarcloud.commands import Command
from afarcloud.enumerations import CommandType
from mavlink_broker.planning import camera_commands, flight_commands, target_commands
from mavlink_broker.planning.hotpoint import hotpoint
from mavlink_broker.planning.live_actions import LiveAction
from mavlink_broker.planning.situation import Items, Refusal, RefusedError, Situation

Translator: TypeAlias = Callable[[Any, Situation], Items | LiveAction | Refusal]

TRANSLATORS: Final[Mapping[CommandType, Translator]] = {
    CommandType.NAV_TAKEOFF: flight_commands.takeoff,
    CommandType.NAV_LAND: flight_commands.land,
    CommandType.NAV_WAYPOINT: flight_commands.waypoint,
    CommandType.CAMERA_IMAGE: camera_commands.image,
    CommandType.VIDEO_START_CAPTURE: camera_commands.video_start,
    CommandType.VIDEO_STOP_CAPTURE: camera_commands.video_stop,
    CommandType.NAV_HOTPOINT: hotpoint,
    CommandType.NAV_FOLLOW_TARGET: target_commands.follow,
    CommandType.NAV_TRACK_SUBJECT: target_commands.track,
    CommandType.CAMERA_PANORAMA: camera_commands.panorama,
    CommandType.NAV_HOME: flight_commands.home,
}


def translate_command(index: int, command: Command, situation: Situation) -> Items | LiveAction:
    """Translate the command at `index` of a mission.

    Raises:
        RefusedError: if it cannot be flown where it stands.
    """
    translated = TRANSLATORS[command.command_type_id](command, situation)
    if isinstance(translated, Refusal):
        raise RefusedError(index, command, translated)
    return translated
