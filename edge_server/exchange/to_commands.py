"""Mission items to AFarCloud commands, the inverse of `from_commands`. Pure.

An item becomes a command, belongs to one (a gimbal's angle to the picture behind it), is left out
with a warning where that changes nothing, or is refused by number and reason. None is dropped.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

from afarcloud.faults import Fault, InvalidError
from afarcloud.plan import DEFAULT_SPEED_M_S
from edge_server.exchange import circle_items, flight_items, payload_items
from edge_server.exchange.mission_item import Cmd, Home, Item
from edge_server.exchange.translation import Refusal, Translation


class Translated(NamedTuple):
    """Commands as documents, and for each the place of its item in the file."""

    commands: list[dict[str, Any]]
    paths: list[str]
    maximum_speed_m_s: float
    warnings: list[Fault]


Handler: TypeAlias = Callable[[Translation, Item], None]


def translate(
    items: Sequence[Item],
    home: Home | None,
    *,
    speed_m_s: float | None = None,
    zero_yaw_is_unset: bool = False,
) -> Translated:
    """Translate a mission; `speed_m_s` applies where no item has one.

    Raises:
        InvalidError: with every item that cannot be translated.
    """
    state = Translation(home, zero_yaw_is_unset, speed_m_s)
    faults = []
    for item in items:
        try:
            _take(state, item)
        except Refusal as refusal:
            faults.append(Fault(item.path, f"{item.title} {refusal}"))
    faults += [Fault(item.path, f"{item.title} {why}") for item, why in _left_over(state)]
    if not items:
        faults.append(Fault("", "has no items"))
    if faults:
        raise InvalidError(tuple(faults))
    return Translated(
        state.commands, state.paths, state.speed_m_s or DEFAULT_SPEED_M_S, state.warnings
    )


def _take(state: Translation, item: Item) -> None:
    if not item.auto_continue:
        raise Refusal("waits for a pilot before it goes on, which no command does")
    if item.command in HARMLESS:
        state.warn(item, f"is left out: {HARMLESS[Cmd(item.command)]}")
        return
    if state.hold is not None:
        raise Refusal(f"is never reached: item {state.hold.number} holds without end")
    handler = HANDLERS.get(item.command)
    if handler is None:
        raise Refusal("has no counterpart among the commands of a plan")
    handler(state, item)


def _left_over(state: Translation) -> list[tuple[Item, str]]:
    """Return the settings that no following command uses, each with the reason."""
    found = []
    if state.heading is not None:
        found.append((state.heading[0], "turns the vehicle at no place that follows"))
    if state.gimbal is not None and not state.gimbal_is_used:
        found.append((state.gimbal[0], "turns the camera for no picture that follows"))
    return found


HARMLESS: Final[Mapping[int, str]] = {
    Cmd.DO_LAND_START: "it only marks a place in the list",
    Cmd.SET_CAMERA_MODE: "the mode follows from the command",
    Cmd.IMAGE_STOP_CAPTURE: "a series of pictures ends by itself",
    Cmd.DO_GIMBAL_MANAGER_CONFIGURE: "the broker that flies the plan controls the gimbal",
}


HANDLERS: Final[Mapping[int, Handler]] = {
    Cmd.NAV_WAYPOINT: flight_items.waypoint,
    Cmd.NAV_LOITER_UNLIM: flight_items.loiter_for_ever,
    Cmd.NAV_LOITER_TURNS: circle_items.loiter_turns,
    Cmd.NAV_LOITER_TIME: flight_items.loiter_time,
    Cmd.NAV_RETURN_TO_LAUNCH: flight_items.return_home,
    Cmd.NAV_LAND: flight_items.land,
    Cmd.NAV_TAKEOFF: flight_items.takeoff,
    Cmd.DO_FOLLOW: circle_items.follow,
    Cmd.DO_ORBIT: circle_items.orbit,
    Cmd.NAV_DELAY: flight_items.delay,
    Cmd.CONDITION_YAW: flight_items.turn,
    Cmd.DO_CHANGE_SPEED: flight_items.speed,
    Cmd.DO_MOUNT_CONTROL: payload_items.mount,
    Cmd.DO_SET_CAM_TRIGG_DIST: payload_items.pictures_by_distance,
    Cmd.DO_GIMBAL_MANAGER_PITCHYAW: payload_items.gimbal,
    Cmd.IMAGE_START_CAPTURE: payload_items.pictures,
    Cmd.CAMERA_TRACK_RECTANGLE: payload_items.track,
    Cmd.VIDEO_START_CAPTURE: payload_items.video_start,
    Cmd.VIDEO_STOP_CAPTURE: payload_items.video_stop,
    Cmd.PANORAMA_CREATE: payload_items.panorama,
    Cmd.CONDITION_GATE: flight_items.gate,
}
"""The commands that are translated; any other is refused."""
