"""Any mission of the flown kinds, for property tests, and its translation to mission items."""

from typing import Any

from hypothesis import strategies as st

from afarcloud.enumerations import CommandType
from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.planning.mission import FlightPlan, translate
from mavlink_broker.planning.situation import Home

HOME = Home(40.4434, -3.7382, 650.0)
yaws = st.none() | st.floats(-180, 359.99)


def _place() -> dict[str, st.SearchStrategy[Any]]:
    return {"latitude": st.floats(-90, 90), "longitude": st.floats(-180, 180)}


PARAMETERS: dict[int, st.SearchStrategy[dict[str, Any]]] = {
    CommandType.NAV_TAKEOFF: st.fixed_dictionaries(
        {**_place(), "altitude": st.floats(0.5, 120), "yaw_angle": yaws},
        optional={"minimum_pitch": st.floats(0, 45)},
    ),
    CommandType.NAV_LAND: st.fixed_dictionaries(
        {**_place(), "desired_yaw_angle": yaws, "landing_altitude": st.floats(-50, 120)},
        optional={
            "minimum_target_altitude": st.floats(0, 120),
            "precision_land_mode": st.integers(0, 2),
        },
    ),
    CommandType.NAV_WAYPOINT: st.fixed_dictionaries(
        {**_place(), "altitude": st.floats(0, 120), "desired_yaw_angle": yaws},
        optional={
            "hold_time": st.floats(0, 3600),
            "acceptance_radius": st.floats(0.1, 50),
            "trajectory_control": st.floats(-50, 50),
        },
    ),
    CommandType.CAMERA_IMAGE: st.fixed_dictionaries(
        {"pitch_angle": st.floats(-90, 90), "time_interval": st.integers(1, 9)},
        optional={"yaw_angle": yaws, "photo_count": st.integers(1, 9)},
    ),
    CommandType.VIDEO_START_CAPTURE: st.fixed_dictionaries(
        {"video_stream_id": st.integers(0, 9), "freq": st.floats(0, 5)}
    ),
    CommandType.VIDEO_STOP_CAPTURE: st.fixed_dictionaries({"video_stream_id": st.integers(0, 9)}),
    CommandType.NAV_HOTPOINT: st.fixed_dictionaries(
        {**_place(), "orbit_altitude": st.floats(2, 120), "radius": st.floats(5, 500)},
        optional={
            "angular_velocity": st.floats(1, 60),
            "is_clockwise": st.booleans(),
            "start_point": st.integers(0, 4),
            "orbit_type": st.integers(0, 5),
        },
    ),
    CommandType.NAV_FOLLOW_TARGET: st.fixed_dictionaries(
        {**_place(), "altitude": st.floats(0, 120), "heading": st.integers(0, 1)}
    ),
    CommandType.NAV_TRACK_SUBJECT: st.just({"corners": [[0.2, 0.3], [0.7, 0.6]]}),
    CommandType.CAMERA_PANORAMA: st.fixed_dictionaries({"panorama_mode": st.integers(0, 1)}),
    CommandType.NAV_HOME: st.fixed_dictionaries({"landing": st.booleans()}),
}
"""The parameters of each command."""
ON_THE_GROUND = [
    CommandType.NAV_TAKEOFF,
    CommandType.VIDEO_START_CAPTURE,
    CommandType.VIDEO_STOP_CAPTURE,
]
"""Commands that need no take-off before them."""


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Any mission that takes off before it flies, again behind each landing."""
    commands: list[dict[str, Any]] = []
    on_ground, turns_possible = True, False
    for _ in range(draw(st.integers(1, 12))):
        kinds = ON_THE_GROUND if on_ground and commands else sorted(PARAMETERS)
        kind = draw(st.sampled_from(kinds)) if commands else CommandType.NAV_TAKEOFF
        if kind is CommandType.CAMERA_PANORAMA and not turns_possible:
            kind = CommandType.CAMERA_IMAGE
        parameters = draw(PARAMETERS[kind])
        commands.append(
            {"command_id": len(commands), "command_type_id": int(kind), "parameters": parameters}
        )
        lands = kind == CommandType.NAV_LAND or parameters.get("landing", False)
        on_ground = lands or (on_ground and kind != CommandType.NAV_TAKEOFF)
        gives_place = kind in {CommandType.NAV_TAKEOFF, CommandType.NAV_WAYPOINT}
        keeps_place = kind in {CommandType.CAMERA_IMAGE, CommandType.VIDEO_START_CAPTURE}
        turns_possible = gives_place or (turns_possible and keeps_place)
    return Mission.model_validate(
        {
            "mission_id": 1,
            "vehicle_id": 1,
            "maximum_speed": draw(st.floats(0.1, 100)),
            "command_array": commands,
        }
    )


def stretches_of(mission: Mission, family: Family) -> list[FlightPlan]:
    """The stretches of a mission that are flown as items, not live."""
    segments = translate(mission, family, HOME).segments
    return [segment for segment in segments if isinstance(segment, FlightPlan)]


def over_the_wire(plan: FlightPlan) -> list[Any]:
    """The messages that upload a stretch, as the vehicle decodes them."""
    encoder, decoder = Encoder(1, 1), Decoder()
    frames = [encoder.encode(message) for message in plan.messages(1, 1)]
    return [message for frame in frames for message in decoder.decode(frame)]
