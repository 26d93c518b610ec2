"""The person's way through the seed's menus, every path of it."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.tester.terminal.menu import Menu
from sim.tester.terminal.screens import (
    ALARM_PROMPTS,
    CORRECT_NUMBER,
    LANDING_PROMPT,
    PERCENTAGE_PROMPT,
    QUESTIONS,
    SCREENS,
    Place,
)
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

MAIN = (
    "Mission running\n1. Set command as finished\n2. Update position\n3. Set alarm\n"
    "4. Update battery level\n5. Update observation info\n------ Enter the action number: "
)
EQUIPMENT = {
    "1": Alarm.SONAR,
    "2": Alarm.PROPELLERS,
    "3": Alarm.IMU,
    "4": Alarm.CAMERA,
    "5": Alarm.GPS,
    "6": Alarm.HUMIDITY_SENSOR,
}
FUNCTIONS = {
    "1": Alarm.LOCALIZATION,
    "2": Alarm.PROPULSION,
    "3": Alarm.NAVIGATION,
    "4": Alarm.HUMIDITY_SENSING,
}


def fixed(value: float = 42.0) -> Menu:
    return Menu(lambda _low, _high: value, percentage=80)


def running(*lines: str, drawn: float = 42.0) -> Menu:
    """A menu in a mission, after some lines."""
    menu = fixed(drawn)
    menu.mission_runs()
    for line in lines:
        assert menu.answer(line) is None
    return menu


def test_nothing_is_asked_without_a_mission() -> None:
    menu = fixed()
    assert not menu.is_asking
    assert menu.answer("1") is None


def test_the_main_menu_is_shown_when_a_mission_runs_and_no_more_when_it_has_ended() -> None:
    menu = running()
    assert menu.prompt == MAIN
    menu.mission_ended()
    assert not menu.is_asking
    assert menu.prompt == ""


@pytest.mark.parametrize("line", ["0", "6", "-1", "1.0", "", "one", " ", "11111111111", "²", "\0"])
def test_whatever_is_not_1_to_5_shows_the_main_menu_again(line: str) -> None:
    menu = running(line)
    assert (menu.place, menu.prompt) == (Place.MAIN, MAIN)


@pytest.mark.parametrize("line", ["1", " 1 ", "01", "1\r"])
def test_1_finishes_the_command_and_the_main_menu_stays(line: str) -> None:
    menu = running()
    assert menu.answer(line) == FinishCommand()
    assert menu.prompt == MAIN


def test_2_asks_for_six_values_and_then_moves() -> None:
    menu = running("2")
    asked = []
    for line in ("40.5", "-3.5", "12.5", "270", "-5"):
        asked.append(menu.prompt)
        assert menu.answer(line) is None
    asked.append(menu.prompt)
    assert menu.answer("2.5") == SetPose(Pose(40.5, -3.5, 12.5, 270.0, -5.0, 2.5))
    names = ("latitude", "longitude", "altitude", "yaw", "pitch", "roll")
    assert asked == [
        f" - Enter the new {name} (if not an int it will be generated\nrandomly): "
        for name in names
    ]
    assert menu.prompt == MAIN


@pytest.mark.parametrize("bad", ["", "north", "nan", "inf", "-inf", "1,5", "0x10", "12 m"])
def test_what_is_no_number_is_drawn(bad: str) -> None:
    menu = running("2", bad, bad, bad, bad, bad, drawn=17.5)
    assert menu.answer(bad) == SetPose(Pose(17.5, 17.5, 17.5, 17.5, 17.5, 17.5))


@given(st.lists(st.text(st.characters(exclude_categories=["N"])), min_size=6, max_size=6))
def test_what_is_drawn_is_from_0_to_100_and_on_the_globe(bad: list[str]) -> None:
    menu = Menu(random.Random(1).uniform, percentage=80)
    menu.mission_runs()
    menu.answer("2")
    *_, action = [menu.answer(line) for line in bad]
    assert isinstance(action, SetPose)
    assert all(0.0 <= value <= 100.0 for value in action.pose)
    assert action.pose.latitude_deg <= 90.0


@pytest.mark.parametrize(("part", "value"), [(0, "90.1"), (0, "-91"), (1, "180.5"), (2, "1e9")])
def test_a_place_that_does_not_exist_is_drawn_too(part: int, value: str) -> None:
    lines = ["1", "2", "3", "4", "5", "6"]
    lines[part] = value
    menu = running("2", *lines[:5], drawn=33.0)
    action = menu.answer(lines[5])
    assert isinstance(action, SetPose)
    assert action.pose[part] == 33.0


def test_3_shows_the_types_and_back_leads_to_the_main_menu() -> None:
    menu = running("3")
    assert menu.prompt == (
        "Select the alarm type\n1. Equipment failure\n2. Function unavailable\n3. Back\n"
        "------ Enter the selected type number: "
    )
    menu.answer("3")
    assert menu.prompt == MAIN


@pytest.mark.parametrize("way", [("3",), ("3", "1"), ("3", "2")])
def test_no_integer_is_asked_for_again_and_another_number_shows_the_menu(
    way: tuple[str, ...],
) -> None:
    menu = running(*way)
    shown = menu.prompt
    for line in ("x", "", "1.5"):
        menu.answer(line)
        assert menu.prompt == CORRECT_NUMBER
    for line in ("0", "8", "-3"):
        menu.answer(line)
        assert menu.prompt == shown


@pytest.mark.parametrize(
    ("kind", "shown", "back"),
    [
        (
            "1",
            (
                "Select the alarm code\n1. Equipment sonar\n2. Equipment propellers\n"
                "3. Equipment IMU\n4. Equipment camera\n5. Equipment GPS\n"
                "6. Equipment humidity sensor\n7. Back\n------ Enter the selected code number: "
            ),
            "7",
        ),
        (
            "2",
            (
                "Select the alarm code\n1. Function localization\n2. Function propulsion\n"
                "3. Function navigation\n4. Function humidity sensing\n5. Back\n"
                "------ Enter the selected code number: "
            ),
            "5",
        ),
    ],
)
def test_the_codes_of_a_type_are_shown_and_back_leads_to_the_types(
    kind: str, shown: str, back: str
) -> None:
    menu = running("3", kind)
    assert menu.prompt == shown
    menu.answer(back)
    assert menu.place is Place.ALARM_TYPE


@pytest.mark.parametrize(
    ("kind", "code", "alarm"),
    [
        *(("1", code, alarm) for code, alarm in EQUIPMENT.items()),
        *(("2", code, alarm) for code, alarm in FUNCTIONS.items()),
    ],
)
def test_an_alarm_takes_two_numbers_and_leaves_only_the_landing(
    kind: str, code: str, alarm: Alarm
) -> None:
    menu = running("3", kind, code)
    assert menu.prompt == ALARM_PROMPTS[0]
    menu.answer("much")
    assert menu.prompt == ALARM_PROMPTS[0]
    menu.answer("0.5")
    assert menu.prompt == ALARM_PROMPTS[1]
    menu.answer("")
    assert menu.prompt == ALARM_PROMPTS[1]
    assert menu.answer("-2") == SetAlarm(alarm, (0.5, -2.0))
    assert (menu.place, menu.prompt) == (Place.LANDING, LANDING_PROMPT)


def test_every_alarm_can_be_set() -> None:
    assert {*EQUIPMENT.values(), *FUNCTIONS.values()} == set(Alarm)


def test_4_shows_what_of_the_battery_can_be_changed() -> None:
    menu = running("4")
    assert menu.prompt.startswith(
        "Select the battery param to change:\n1. Capacity\n2. Percentage\n3. Back\n"
    )
    menu.answer("3")
    assert menu.prompt == MAIN


def test_a_capacity_is_taken_and_a_bad_one_changes_nothing() -> None:
    menu = running("4", "1")
    assert menu.prompt == "------ Enter the new battery capacity (mAh): "
    assert menu.answer("4500.5") == SetBatteryCapacity(4500.5)
    for bad in ("", "0", "-1", "nan", "100001", "big"):
        assert running("4", "1", bad).prompt == MAIN


@pytest.mark.parametrize("line", ["0", "100", "79", " 5 "])
def test_a_percentage_is_taken(line: str) -> None:
    menu = running("4", "2")
    assert menu.prompt == PERCENTAGE_PROMPT
    assert menu.answer(line) == SetBatteryPercentage(int(line))
    assert menu.prompt == MAIN


@pytest.mark.parametrize("bad", ["80", "101", "-1", "50.5", "", "half"])
def test_a_percentage_has_two_tries(bad: str) -> None:
    menu = running("4", "2", bad)
    assert menu.prompt == PERCENTAGE_PROMPT
    menu.answer(bad)
    assert menu.place is Place.BATTERY
    assert running("4", "2", bad).answer("50") == SetBatteryPercentage(50)


def test_a_percentage_must_differ_from_the_one_before() -> None:
    menu = running("4", "2")
    menu.answer("60")
    for line in ("4", "2", "60"):
        assert menu.answer(line) is None
    assert menu.place is Place.PERCENTAGE
    assert menu.answer("80") == SetBatteryPercentage(80)


@pytest.mark.parametrize(
    ("number", "prompt", "line", "part", "value"),
    [
        ("1", "resource id(string)", "probe 7", ObservationPart.RESOURCE_ID, "probe 7"),
        ("2", "observed property(string)", "soil", ObservationPart.OBSERVED_PROPERTY, "soil"),
        ("3", "result value(float)", "-1.5", ObservationPart.RESULT_VALUE, -1.5),
        ("4", "result uom(string)", "%", ObservationPart.RESULT_UOM, "%"),
    ],
)
def test_5_changes_one_part_of_the_observation(
    number: str, prompt: str, line: str, part: ObservationPart, value: str | float
) -> None:
    menu = running("5", number)
    assert menu.prompt == f"------ Enter the new {prompt}: "
    assert menu.answer(line) == SetObservation(part, value)
    assert menu.prompt == MAIN


@pytest.mark.parametrize(
    ("number", "bad"),
    [("1", ""), ("2", " "), ("3", "warm"), ("3", "nan"), ("4", "a" * 31), ("1", "é" * 16)],
)
def test_a_bad_part_of_the_observation_changes_nothing(number: str, bad: str) -> None:
    assert running("5", number, bad).prompt == MAIN


def test_5_and_then_5_is_back() -> None:
    menu = running("5")
    assert menu.prompt.startswith(
        "Select the observation param to change:\n1. Resource id\n2. Observed property\n"
        "3. Result value\n4. Result uom\n5. Back\n"
    )
    menu.answer("5")
    assert menu.prompt == MAIN


@pytest.mark.parametrize("where", [(), ("3",), ("3", "1", "2", "0.5"), ("4", "2"), ("2", "1")])
def test_an_interrupted_mission_leaves_only_the_landing_wherever_the_person_was(
    where: tuple[str, ...],
) -> None:
    menu = running(*where)
    menu.mission_interrupted()
    assert menu.prompt == ("Enter '0' to set the drone as landed after the mission\nabort/alarm: ")
    for line in ("1", "", "00", "land"):
        assert menu.answer(line) is None
        assert menu.prompt == LANDING_PROMPT
    assert menu.answer("0") == Land()
    assert not menu.is_asking


def test_a_mission_that_begins_leaves_a_person_in_a_menu_there() -> None:
    menu = running("2", "1")
    menu.mission_runs()
    assert menu.place is Place.POSITION


def test_a_mission_that_begins_in_the_air_ends_the_wait_for_the_landing() -> None:
    menu = running()
    menu.mission_interrupted()
    menu.mission_runs()
    assert menu.prompt == MAIN


@given(st.lists(st.one_of(st.sampled_from("0123456789"), st.text(max_size=5)), max_size=40))
def test_no_line_leads_out_of_the_menus(lines: list[str]) -> None:
    menu = Menu(random.Random(1).uniform, percentage=80)
    menu.mission_runs()
    for line in lines:
        menu.answer(line)
        assert menu.is_asking == bool(menu.prompt)
        if not menu.is_asking:
            menu.mission_runs()


def test_every_place_is_a_menu_a_question_or_handled_apart() -> None:
    apart = {Place.IDLE, Place.POSITION, Place.ALARM_PARAMETERS, Place.PERCENTAGE, Place.LANDING}
    assert set(SCREENS) | set(QUESTIONS) | apart == set(Place)
