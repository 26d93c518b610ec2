"""Any plan, both profiles, all families: translated or refused with a reason, and read back."""

import json
import math
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from afarcloud import rules, wire
from afarcloud.annex import in_seconds
from afarcloud.commands import Command
from afarcloud.enumerations import CommandType, PanoramaMode, PrecisionLandMode, Profile
from afarcloud.flyable import VehicleLimits
from afarcloud.plan import Mission, Plan
from mavlink_broker.autopilots.families import ARDUPILOT, GENERIC, OWN, PX4, Family
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.mission.exchanges import difference
from mavlink_broker.planning.mission import FlightPlan, Itinerary, LiveCommand, Segment, translate
from mavlink_broker.planning.situation import (
    Circled,
    RefusedError,
    SendCommand,
    Series,
    TurnInPlace,
)
from tests.support.mission_reader import LIVE_KINDS, MissionReader, ReadCommand
from tests.support.plan_strategies import missions, plans
from tests.support.stored_items import as_ardupilot_keeps, as_px4_keeps
from tests.support.translated_missions import HOME

NOW = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
ROUTE = Route(254, 191, 1, 1)
FAMILIES = [PX4, OWN, ARDUPILOT, GENERIC]
PROFILES = [Profile.FIELD, Profile.ANNEX]
STORES = {"px4": as_px4_keeps, "ardupilot": as_ardupilot_keeps}
UNKNOWN_AS_ITEMS = {
    "px4": {18, 82, 115, 34, 32, 33, 192, 193, 207, 2004, 2005, 2800},
    "ardupilot": {34, 32, 192, 193, 2004, 2005, 2800},
}
"""What these autopilots take in no mission (reference of their mission managers)."""
YAW_MAY_BE_OPEN = {16, 17, 21, 22}

families = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
profiles = pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.value)
any_data = settings(
    max_examples=12,
    suppress_health_check=[HealthCheck.too_slow],
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink],
)


def read(document: dict[str, Any]) -> Plan:
    """Read a plan as the edge server would, which lets it pass."""
    plan = wire.read_plan(json.dumps(document).encode())
    limits = {mission.vehicle_id: VehicleLimits() for mission in plan.missions}
    assert rules.check(plan, limits, NOW).faults == ()
    return plan


def flown(document: dict[str, Any], profile: Profile) -> Mission:
    (mission,) = read({"profile": profile.value, "missions": [document]}).missions
    return in_seconds(mission) if profile is Profile.ANNEX else mission


def stretches(segments: tuple[Segment, ...]) -> list[FlightPlan]:
    return [segment for segment in segments if isinstance(segment, FlightPlan)]


def stored(plan: FlightPlan, family: Family) -> list[Message]:
    """The items as the vehicle gives them back."""
    encoder, decoder = Encoder(1, 1), Decoder()
    frames = [encoder.encode(message) for message in plan.messages(1, 1)]
    messages = [message for frame in frames for message in decoder.decode(frame)]
    if family.name not in STORES:
        return messages
    kept = [STORES[family.name](message) for message in messages]
    refused = [one for one in kept if isinstance(one, int)]
    assert not refused
    return [one for one in kept if not isinstance(one, int)]


@pytest.mark.first_case
@families
@profiles
@any_data
@given(data=st.data())
def test_any_plan_in_any_order_is_translated_or_refused_with_a_reason(
    family: Family, profile: Profile, data: st.DataObject
) -> None:
    document = data.draw(plans(profile, in_any_order=profile is Profile.ANNEX))
    for mission in wire.read_plan(json.dumps(document).encode()).missions:
        result = translated(mission, family)
        if isinstance(result, RefusedError):
            check_refusal(mission, result)
            continue
        done = [index for segment in result.segments for index in segment.commands]
        assert done == list(range(len(mission.command_array)))
        assert len(result.notes) == len(mission.command_array)


def translated(mission: Mission, family: Family) -> Itinerary | RefusedError:
    try:
        return translate(mission, family, HOME)
    except RefusedError as error:
        return error


def check_refusal(mission: Mission, error: RefusedError) -> None:
    """It names the command, one of its fields, and a reason."""
    command = mission.command_array[error.command_index]
    assert error.command_id == command.command_id
    assert str(error).startswith(f"command {command.command_id}: {error.refusal.parameter}: ")
    names = {"command_type_id", *type(command.parameters).model_fields}
    assert error.refusal.parameter in names
    assert len(error.refusal.why) > 10


@pytest.mark.first_case
@families
@profiles
@any_data
@given(data=st.data())
def test_what_takes_off_before_it_flies_is_flown_by_everybody(
    family: Family, profile: Profile, data: st.DataObject
) -> None:
    mission = flown(data.draw(missions(profile)), profile)
    assert translate(mission, family, HOME).segments


@pytest.mark.first_case
@families
@profiles
@any_data
@given(data=st.data())
def test_what_the_vehicle_gives_back_means_the_commands_that_were_sent(
    family: Family, profile: Profile, data: st.DataObject
) -> None:
    mission = flown(data.draw(missions(profile)), profile)
    for segment in translate(mission, family, HOME).segments:
        if isinstance(segment, LiveCommand):
            check_live(mission.command_array[segment.command], segment)
            continue
        messages = stored(segment, family)
        assert difference(segment, messages, family) is None
        reader = MissionReader(
            messages, HOME[:2], segment.first_item, has_yaws=not family.yaw_by_condition
        )
        commands = reader.read()
        assert len(commands) == len(segment.commands)
        assert reader.holds is not segment.ends_on_ground
        for index, command in zip(segment.commands, commands, strict=True):
            check_items(mission.command_array[index], command, family)
            assert {segment.command_of_item[i] for i in command.items} == {index}
            done = segment.done_item[index - segment.first_command]
            assert done in command.items


def check_items(sent: Command, command: ReadCommand, family: Family) -> None:
    assert command.kind is sent.command_type_id
    planned = sent.parameters.model_dump() | dropped(sent, family)
    for name, value in command.values.items():
        if name in planned:
            assert_same(name, planned[name], value, family)


def dropped(sent: Command, family: Family) -> dict[str, Any]:
    """What a family does not honour is read back as nothing; a note names it."""
    rest: dict[str, Any] = {}
    if sent.command_type_id is CommandType.NAV_TAKEOFF and family.name in STORES:
        rest = {"minimum_pitch": None}
    if sent.command_type_id is CommandType.NAV_LAND:
        if not family.honours_abort_altitude:
            rest["minimum_target_altitude"] = 0.0
        if not family.honours_precision_landing:
            rest["precision_land_mode"] = PrecisionLandMode.DISABLED
    if not family.honours_acceptance_radius:
        rest["acceptance_radius"] = None
    if family.name == "ardupilot":
        rest |= {"freq": None}
    return rest


def assert_same(name: str, planned: Any, read: Any, family: Family) -> None:
    if planned is None and name.endswith("yaw_angle"):
        assert read is None
    elif planned is None:
        return
    elif name.endswith("yaw_angle"):
        assert abs(math.remainder(read - planned, 360.0)) < 0.02
    elif name in {"latitude", "longitude"}:
        assert abs(read - planned) <= 0.6e-7
    elif "altitude" in name and family.name == "ardupilot":
        assert abs(read - planned) <= (1.0 if name == "minimum_target_altitude" else 0.011)
    else:
        cut = {"hold_time": 1.0, "radius": 10.0 if planned > 255.0 else 1.0, "pitch_angle": 1.0}
        whole = cut.get(name, 0.0) if family.name == "ardupilot" else 0.0
        assert math.isclose(read, planned, rel_tol=1e-6, abs_tol=max(whole, 1e-5))


def check_live(sent: Command, live: LiveCommand) -> None:
    """The orders of a live command mean the command, and where it is to be."""
    is_panorama = sent.command_type_id is CommandType.CAMERA_PANORAMA
    first = live.action.begin[0][-1 if is_panorama else 0].message(ROUTE, 0)  # It holds before
    if isinstance(live.action.end, Series):
        assert sent.command_type_id is CommandType.CAMERA_PANORAMA
        faces = [step for step in live.action.end.steps if isinstance(step, TurnInPlace)]
        shots = [step for step in live.action.end.steps if isinstance(step, SendCommand)]
        full = sent.parameters.panorama_mode is PanoramaMode.FULL_CIRCLE
        assert len(shots) == (8 if full else 5)
        turned = faces[-2].turn_deg - faces[0].turn_deg
        assert (turned, faces[-1].turn_deg) == (315.0 if full else 180.0, 0.0)
        return
    p: Any = sent.parameters
    if isinstance(live.action.end, Circled):
        turn = live.action.end.turn
        assert sent.command_type_id is CommandType.NAV_HOTPOINT
        assert (turn.latitude_deg, turn.longitude_deg) == (p.latitude, p.longitude)
        assert (turn.radius_m, turn.is_clockwise) == (p.radius, p.is_clockwise)
        assert (live.action.end.height_m, live.action.end.heading) == (
            p.orbit_altitude,
            p.orbit_type,
        )
        return
    assert LIVE_KINDS[first.command] is sent.command_type_id
    match sent.command_type_id:
        case CommandType.NAV_HOTPOINT:
            assert abs(first.x / 1e7 - p.latitude) <= 0.6e-7
            assert abs(first.y / 1e7 - p.longitude) <= 0.6e-7
            assert first.z == pytest.approx(HOME.altitude_amsl_m + p.orbit_altitude)
            assert first.param1 == (p.radius if p.is_clockwise else -p.radius)
        case CommandType.NAV_TRACK_SUBJECT:
            corners = (first.param1, first.param2), (first.param3, first.param4)
            assert corners == p.corners
        case CommandType.NAV_FOLLOW_TARGET:
            assert live.action.follow is not None
            assert live.action.follow[:2] == (p.latitude, p.longitude)
            assert live.action.follow[2] >= p.altitude


@pytest.mark.first_case
@families
@any_data
@given(data=st.data())
def test_the_encoding_is_one_that_strict_autopilots_take(
    family: Family, data: st.DataObject
) -> None:
    """Section "encoding" of the reference, for every item of every family."""
    mission = flown(data.draw(missions()), Profile.FIELD)
    for plan in stretches(translate(mission, family, HOME).segments):
        messages = plan.messages(7, 1)
        assert [message.seq for message in messages] == list(range(len(messages)))
        current = [message.seq for message in messages if message.current]
        assert current == [plan.first_item] == [1 if family is ARDUPILOT else 0]
        for message in messages:
            assert message.autocontinue == 1
            assert message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION
            assert (message.target_system, message.target_component) == (7, 1)
            assert message.command not in UNKNOWN_AS_ITEMS.get(family.name, set())
            check_frame(message, is_home=message.seq < plan.first_item)
            check_numbers(message, family)


def check_frame(message: Message, *, is_home: bool) -> None:
    if is_home:
        assert (message.command, message.frame) == (16, mavlink.MAV_FRAME_GLOBAL)
        assert message.z == HOME.altitude_amsl_m
    elif message.frame == mavlink.MAV_FRAME_MISSION:
        assert message.command not in {16, 17, 18, 21, 22, 195}
        assert message.y == 0
    else:
        assert message.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        assert message.command in {16, 17, 18, 21, 22, 195}


def check_numbers(message: Message, family: Family) -> None:
    rates = {3, 4} if message.command == 1000 and family is not ARDUPILOT else set()
    yaw = {4} if message.command in YAW_MAY_BE_OPEN else set()
    for number in range(1, 5):
        value = getattr(message, f"param{number}")
        assert not math.isinf(value)
        assert not math.isnan(value) or number in yaw | rates
    assert math.isfinite(message.z)
    if message.command in {16, 22} and family is PX4:  # Masks: set and not honoured is refused
        assert message.param3 == 0.0
        assert message.command == 16 or message.param2 == 0.0
