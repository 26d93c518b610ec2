"""The vehicle as the person plays it."""

import math
from itertools import pairwise

import pytest

from sim.tester.vehicle.actions import (
    FinishCommand,
    Land,
    ObservationPart,
    Pose,
    SetAlarm,
    SetBatteryCapacity,
    SetBatteryPercentage,
    SetObservation,
    SetPose,
)
from sim.tester.vehicle.alarms import Alarm
from sim.tester.vehicle.events import (
    Acknowledge,
    AreaReceived,
    Armed,
    Command,
    CompleteItems,
    ItemMadeCurrent,
    MissionChange,
    MissionCleared,
    MissionReceived,
    Observe,
    Order,
    Publish,
    Result,
    ShowArming,
    ShowText,
    Warn,
)
from sim.tester.vehicle.mission import MissionState
from sim.tester.vehicle.mission_steps import Item
from sim.tester.vehicle.stand_in import ORDER_WITHIN_S, StandIn
from sim.tester.vehicle.telemetry import Home

HOME = Home(40.4434, -3.7382, 650.0)
FLIGHT = tuple(Item(command=c, x=1, y=1, z=5.0) for c in (22, 16, 1000, 2000, 93, 20))
HOVER = tuple(Item(command=c, x=1, y=1, z=5.0) for c in (178, 22, 16, 17))
ORBIT, FOLLOW, TRACK, PICTURES = 34, 32, 2005, 2000


def command(number: int, *parameters: float, frame: int = 0, component: int = 1) -> Command:
    one, two, three, four, five, six, seven = (*parameters, *[0.0] * (7 - len(parameters)))
    return Command(
        number=number,
        parameters=(one, two, three, four, five, six, seven),
        frame=frame,
        component=component,
    )


def flying(items: tuple[Item, ...] = FLIGHT) -> StandIn:
    """A vehicle in its first step."""
    vehicle = StandIn(HOME, 0.0)
    vehicle.receive(MissionReceived(items), 1.0)
    vehicle.receive(Armed(armed=True), 1.0)
    vehicle.receive(command(300), 1.0)
    return vehicle


def holding() -> StandIn:
    """A vehicle that holds behind a stretch."""
    vehicle = flying(HOVER)
    vehicle.act(FinishCommand(), 2.0)
    return vehicle


def answer(orders: list[Order]) -> Result:
    (found,) = [order.result for order in orders if isinstance(order, Acknowledge)]
    return found


def test_a_mission_that_is_received_is_shown() -> None:
    (shown,) = StandIn(HOME, 0.0).receive(MissionReceived(FLIGHT), 1.0)
    assert shown == ShowText(
        "Mission received:\n  1. take off to 0.0000001, 0.0000001, 5 m\n"
        "  2. take pictures\n  3. return home and land"
    )


def test_it_sets_out_only_with_motors_and_a_mission() -> None:
    vehicle = StandIn(HOME, 0.0)
    assert answer(vehicle.receive(command(300), 1.0)) is Result.DENIED
    vehicle.receive(MissionReceived(FLIGHT), 1.0)
    assert answer(vehicle.receive(command(300), 1.0)) is Result.DENIED
    assert vehicle.receive(Armed(armed=True), 1.0) == [ShowArming(armed=True)]
    orders = vehicle.receive(command(300), 1.0)
    assert answer(orders) is Result.ACCEPTED
    assert MissionChange.RUNS in orders
    assert (vehicle.is_down, vehicle.mission.state) == (False, MissionState.ACTIVE)


def test_a_repeated_order_begins_nothing_anew() -> None:
    vehicle = flying()
    vehicle.act(FinishCommand(), 2.0)
    assert vehicle.receive(command(300), 3.0) == [Acknowledge(command(300), Result.ACCEPTED)]
    assert vehicle.mission.current == 2
    assert vehicle.receive(Armed(armed=True), 3.0) == []


def test_each_finish_ends_one_command_and_tells_its_results_first() -> None:
    vehicle = flying()
    orders = vehicle.act(FinishCommand(), 2.0)
    assert orders[:3] == [Publish(vehicle.pose), Observe(), CompleteItems(2)]
    assert vehicle.act(FinishCommand(), 3.0)[2] == CompleteItems(3)


def test_the_last_landing_ends_on_the_ground() -> None:
    vehicle = flying()
    for _ in range(3):
        orders = vehicle.act(FinishCommand(), 2.0)
    assert CompleteItems(1) in orders
    assert ShowArming(armed=False) in orders
    assert orders[-1] is MissionChange.ENDED
    assert (vehicle.is_down, vehicle.armed) == (True, False)
    assert vehicle.mission.state is MissionState.COMPLETE
    assert vehicle.act(FinishCommand(), 3.0) == []


def test_a_mission_without_landing_ends_in_the_air_at_its_hold() -> None:
    vehicle = flying(HOVER)
    orders = vehicle.act(FinishCommand(), 2.0)
    assert CompleteItems(3) in orders
    assert orders[-1] is MissionChange.ENDED
    assert (vehicle.is_down, vehicle.armed, vehicle.mission.current) == (False, True, 3)


def test_the_mission_begins_at_the_item_that_was_made_current() -> None:
    vehicle = StandIn(HOME, 0.0)
    vehicle.receive(MissionReceived(FLIGHT), 1.0)
    vehicle.receive(ItemMadeCurrent(2), 1.0)
    vehicle.receive(Armed(armed=True), 1.0)
    vehicle.receive(command(300), 1.0)
    vehicle.receive(ItemMadeCurrent(0), 1.0)  # MAVSDK also reports its own steps, later
    assert vehicle.act(FinishCommand(), 2.0)[2] == CompleteItems(3)


def test_a_mission_that_was_taken_away_is_gone() -> None:
    vehicle = StandIn(HOME, 0.0)
    vehicle.receive(MissionReceived(FLIGHT), 1.0)
    vehicle.receive(MissionCleared(), 1.0)
    assert (vehicle.mission.items, vehicle.mission.state) == ((), MissionState.NO_MISSION)


def test_a_geofence_leaves_the_mission_as_it_is() -> None:
    vehicle = StandIn(HOME, 0.0)
    vehicle.receive(MissionReceived(FLIGHT), 1.0)
    (shown,) = vehicle.receive(AreaReceived("geofence", 4), 2.0)
    assert shown == ShowText("Received: geofence, 4 items")
    assert vehicle.mission.items == FLIGHT


def test_a_mission_can_be_paused_and_go_on() -> None:
    vehicle = flying()
    states = []
    for goes_on in (0.0, 1.0):
        vehicle.receive(command(193, goes_on), 2.0)
        states.append(vehicle.mission.state)
    assert states == [MissionState.PAUSED, MissionState.ACTIVE]


@pytest.mark.parametrize("number", [20, 21])
def test_an_order_to_come_down_interrupts_and_0_lands_at_once(number: int) -> None:
    vehicle = flying()
    orders = vehicle.receive(command(number), 2.0)
    assert answer(orders) is Result.ACCEPTED
    assert orders[-1] is MissionChange.INTERRUPTED
    assert vehicle.receive(command(number), 2.5) == [Acknowledge(command(number), Result.ACCEPTED)]
    assert vehicle.tick(100.0) == []
    vehicle.act(Land(), 101.0)
    assert ShowArming(armed=False) in vehicle.tick(101.0)
    assert vehicle.is_down
    assert vehicle.tick(200.0) == []


def test_after_an_alarm_0_waits_for_the_broker_to_believe_it() -> None:
    vehicle = flying()
    assert vehicle.act(SetAlarm(Alarm.GPS, (0.5, 2.0)), 2.0) == [
        Warn("Equipment GPS: 0.5, 2", (0.5, 2.0))
    ]
    vehicle.act(Land(), 2.1)
    assert vehicle.tick(3.0) == []
    assert MissionChange.INTERRUPTED not in vehicle.receive(command(20), 4.0)
    assert ShowArming(armed=False) in vehicle.tick(4.0)
    assert vehicle.alarms == set()


def test_0_does_not_wait_for_ever() -> None:
    vehicle = flying()
    vehicle.act(Land(), 2.0)
    assert vehicle.tick(1.9 + ORDER_WITHIN_S) == []
    assert vehicle.tick(2.0 + ORDER_WITHIN_S) != []


def test_a_place_is_told_and_kept() -> None:
    vehicle = flying()
    pose = Pose(41.0, -4.0, 12.0, 90.0, 1.0, 2.0)
    orders = vehicle.act(SetPose(pose), 2.0)
    assert orders[0] == Publish(pose)
    assert vehicle.act(FinishCommand(), 3.0)[0] == Publish(pose)


def test_battery_and_observation_are_kept_until_they_are_told() -> None:
    vehicle = flying()
    vehicle.act(SetBatteryCapacity(4000.0), 2.0)
    vehicle.act(SetBatteryPercentage(55), 2.0)
    vehicle.act(SetObservation(ObservationPart.RESULT_VALUE, 3.5), 2.0)
    vehicle.act(SetObservation(ObservationPart.RESOURCE_ID, "probe"), 2.0)
    assert (vehicle.capacity_mah, vehicle.percentage) == (4000.0, 55)
    assert (vehicle.observation.resource_id, vehicle.observation.result_value) == ("probe", 3.5)


def test_a_place_in_the_middle_of_a_mission_is_an_aborts() -> None:
    vehicle = flying()
    go = command(192, -1.0, 1.0, 0.0, math.nan, 404400000.0, -37000000.0, 660.0)
    assert vehicle.receive(go, 2.0)[-1] is MissionChange.INTERRUPTED
    assert vehicle.pose == Pose(40.44, -3.7, 10.0)


def test_a_place_behind_a_mission_is_gone_to() -> None:
    vehicle = holding()
    go = command(192, -1.0, 1.0, 0.0, math.nan, math.nan, math.nan, 12.0, frame=6)
    assert MissionChange.INTERRUPTED not in vehicle.receive(go, 3.0)
    assert vehicle.pose == Pose(HOME.latitude_deg, HOME.longitude_deg, 12.0)


@pytest.mark.parametrize("radius_m", [10.0, -10.0])
def test_whoever_finishes_a_circle_flies_it(radius_m: float) -> None:
    vehicle = holding()
    orbit = command(ORBIT, radius_m, 2.0, 3.0, math.nan, 404434000.0, -37382000.0, 655.0)
    assert vehicle.receive(orbit, 3.0)[-1] is MissionChange.RUNS
    orders = vehicle.act(FinishCommand(), 4.0)
    places = [order.pose for order in orders if isinstance(order, Publish)]
    bearings = [
        math.atan2(
            (p.longitude_deg + 3.7382) * math.cos(math.radians(40.4434)), p.latitude_deg - 40.4434
        )
        for p in places
    ]
    turns = [math.remainder(b - a, 2.0 * math.pi) for a, b in pairwise(bearings)]
    assert sum(turns) * math.copysign(1.0, radius_m) > 2.0 * math.pi
    assert all(p.relative_altitude_m == pytest.approx(5.0) for p in places)
    assert vehicle.pose == places[-1]
    assert orders[-1] is MissionChange.ENDED


@pytest.mark.parametrize(
    ("order", "at_least_s"),
    [
        (command(FOLLOW, 254.0), 60.0),
        (command(TRACK, 0.1, 0.1, 0.2, 0.2, component=100), 60.0),
        (command(PICTURES, 0.0, 2.0, 5.0, component=100), 9.0),
    ],
)
def test_whoever_finishes_what_lasts_lets_the_time_pass(order: Command, at_least_s: float) -> None:
    vehicle = holding()
    assert answer(vehicle.receive(order, 3.0)) is Result.ACCEPTED
    assert vehicle.receive(order, 3.5) == [Acknowledge(order, Result.ACCEPTED)]
    before_ms = vehicle.time_ms(4.0)
    assert vehicle.act(FinishCommand(), 4.0)[-1] is MissionChange.ENDED
    assert vehicle.time_ms(4.0) - before_ms + 1000 >= at_least_s * 1e3
    later_ms = vehicle.time_ms(5.0)
    assert later_ms - vehicle.time_ms(4.0) == 1000


@pytest.mark.parametrize("stop", [command(193, 0.0), command(2010, component=100)])
def test_the_broker_may_end_a_live_command(stop: Command) -> None:
    vehicle = holding()
    vehicle.receive(command(FOLLOW, 254.0), 3.0)
    assert vehicle.receive(stop, 4.0) == [Acknowledge(stop, Result.ACCEPTED), MissionChange.ENDED]
    assert vehicle.live is None


def test_a_live_command_can_be_interrupted() -> None:
    vehicle = holding()
    vehicle.receive(command(FOLLOW, 254.0), 3.0)
    assert vehicle.receive(command(21), 4.0)[-1] is MissionChange.INTERRUPTED


def test_a_failed_camera_is_silent() -> None:
    vehicle = holding()
    vehicle.act(SetAlarm(Alarm.CAMERA, (0.0, 0.0)), 2.0)
    assert vehicle.receive(command(TRACK, component=100), 3.0) == []


def test_what_is_not_known_is_not_supported() -> None:
    assert answer(flying().receive(command(31000), 2.0)) is Result.UNSUPPORTED
    assert answer(flying().receive(command(224, 0.0), 2.0)) is Result.UNSUPPORTED


def test_a_mission_that_is_taken_up_while_it_waits_to_land_is_flown() -> None:
    vehicle = flying()
    go = command(192, -1.0, 1.0, 0.0, math.nan, 404400000.0, -37000000.0, 660.0)
    vehicle.receive(go, 2.0)
    vehicle.receive(MissionReceived(FLIGHT), 3.0)
    assert MissionChange.RUNS in vehicle.receive(command(300), 3.0)
    assert vehicle.tick(100.0) == []
