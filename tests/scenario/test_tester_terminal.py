"""A user at the tester's real terminal, and what broker and edge server see of it."""

from collections.abc import Iterator
from itertools import count
from typing import Any

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.app import App
from mavlink_broker.config import Config
from mavlink_broker.links.hub import open_links
from mavlink_broker.links.url import parse_links
from tests.support.broker_world import go_home, land, mission, takeoff, waypoint
from tests.support.fake_edge import FakeEdge
from tests.support.keyboard_world import Clock
from tests.support.terminal_user import TerminalUser, at_terminal, behind_pipe

pytestmark = pytest.mark.scenario

FINISHED, FAILED, ABORTED = Status.FINISHED, Status.FAILED, Status.ABORTED
MAIN = "Mission running 1. Set command as finished 2. Update position 3. Set alarm"
ACTION = "------ Enter the action number:"
TYPE = "------ Enter the selected type number:"
CODE = "------ Enter the selected code number:"
AGAIN = "------ Enter a correct number:"
LANDING = "Enter '0' to set the drone as landed after the mission abort/alarm:"


class Farm:
    """A broker with an edge server in memory."""

    def __init__(self) -> None:
        self.edge = FakeEdge()
        self.hub = open_links(parse_links("udpin://127.0.0.1:0"))
        self.port = self.hub.urls[0].port
        self._ulids = count(1)
        self._app = App(Config(), self.hub, self.edge, Clock(), self._ulid)

    def _ulid(self) -> str:
        return f"01{next(self._ulids):024d}"

    def go_on(self) -> None:
        self._app.step(0.01)

    def fly(self, *commands: dict[str, Any], mission_id: int = 1201) -> None:
        self.edge.plan(mission(*commands, mission_id=mission_id))

    def newest(self, path: str) -> dict[str, Any]:
        return self.edge.bodies(path)[-1] if self.edge.bodies(path) else {}


@pytest.fixture
def farm() -> Iterator[Farm]:
    farm = Farm()
    yield farm
    farm.hub.close()


@pytest.fixture
def user(farm: Farm) -> Iterator[TerminalUser]:
    with at_terminal(farm.port) as user:
        user.meanwhile = farm.go_on
        user.wait_for_texts("Waiting for a mission.")
        yield user


def ended(farm: Farm, user: TerminalUser, mission_id: int = 1201) -> list[int]:
    """Wait for a mission's end; gives the statuses of its commands."""
    user.wait_for(lambda: (farm.edge.status(mission_id) or 0) >= FINISHED, "the mission's end")
    return farm.edge.statuses(mission_id)


@pytest.mark.promise
def test_a_mission_is_shown_and_finished_command_by_command(farm: Farm, user: TerminalUser) -> None:
    farm.fly(takeoff(), waypoint(), go_home())
    user.wait_for_texts(
        "Mission received:", "1. take off to", "2. fly to", "3. return home and land"
    )
    for _ in range(3):
        user.wait_for_texts(MAIN, "4. Update battery level", "5. Update observation info")
        user.answer(ACTION, "1")
        user.wait_for_texts("Finished:")
    assert ended(farm, user) == [FINISHED] * 3
    assert user.shown.count("Mission running") == 3
    assert len(farm.edge.bodies("/pose/")) == 3


def test_position_and_battery_are_as_entered(farm: Farm, user: TerminalUser) -> None:
    farm.fly(takeoff(), go_home())
    for line in ("7", "no", "2"):
        user.answer(ACTION, line)
    for name, line in zip(
        ("latitude", "longitude", "altitude", "yaw", "pitch", "roll"),
        ("40.5", "-3.5", "12.5", "270", "", "x"),
        strict=True,
    ):
        user.answer(f"Enter the new {name} (if not an int it will be generated randomly):", line)
    user.wait_for_texts("The vehicle is at latitude 40.5")
    user.answer(ACTION, "4")
    user.wait_for_texts("Select the battery param to change: 1. Capacity 2. Percentage 3. Back")
    user.type("1")
    user.answer("Enter the new battery capacity (mAh):", "4100")
    user.answer(ACTION, "4")
    user.wait_for_texts("3. Back")
    user.type("2")
    for line in ("80", "101"):
        user.answer("Enter the new battery percentage (%):", line)
    user.wait_for_texts("Select the battery param to change:", "3. Back")
    user.type("2")
    user.answer("Enter the new battery percentage (%):", "55")
    user.wait_for(lambda: farm.newest("/state_vector/").get("latitude") == 40.5, "the place")
    user.answer(ACTION, "1")
    user.wait_for(lambda: farm.newest("/battery/"), "a battery")
    pose, battery = farm.newest("/pose/"), farm.newest("/battery/")
    assert [pose[part] for part in ("latitude", "longitude", "altitude")] == [40.5, -3.5, 12.5]
    assert pose["yaw"] == pytest.approx(270.0)
    assert all(0.0 <= pose[drawn] <= 100.0 for drawn in ("pitch", "roll"))
    assert battery["percentage"] == pytest.approx(0.55)
    assert battery["capacity"] == pytest.approx(4.1)


def test_the_observation_is_as_entered(farm: Farm, user: TerminalUser) -> None:
    farm.fly(takeoff(), waypoint(), go_home())
    user.answer(ACTION, "1")
    for number, prompt, line in (
        ("1", "Enter the new resource id(string):", "probe 7"),
        ("2", "Enter the new observed property(string):", "soil moisture"),
        ("3", "Enter the new result value(float):", "wet"),
        ("3", "Enter the new result value(float):", "12.5"),
        ("4", "Enter the new result uom(string):", "% vol"),
    ):
        user.answer(ACTION, "5")
        user.wait_for_texts("Select the observation param to change:", "5. Back")
        user.type(number)
        user.answer(prompt, line)
    user.answer(ACTION, "5")
    user.wait_for_texts("5. Back")
    user.type("5")
    for _ in range(2):
        user.answer(ACTION, "1")
    assert ended(farm, user) == [FINISHED] * 3
    observations = [
        one for body in farm.edge.bodies("/observation/") for one in body["observation_array"]
    ]
    assert all(one["result_time"] > 1.7e9 for one in observations)
    seen = {  # They arrive in either order
        (one["resource_id"], one["observed_property"], one["result_value"], one["result_uom"])
        for one in observations
    }
    assert ("temp", "temperature", 20.0, "C") in seen  # Sent before the user changes it
    assert ("probe 7", "soil moisture", 12.5, "% vol") in seen


def test_the_alarm_menus_lead_back_and_send_the_alarm(farm: Farm, user: TerminalUser) -> None:
    farm.fly(takeoff(), waypoint(), land())
    user.answer(ACTION, "1")
    user.answer(ACTION, "3")
    user.answer(TYPE, "x")
    user.answer(AGAIN, "4")
    user.answer(TYPE, "1")
    user.wait_for_texts("6. Equipment humidity sensor", "7. Back")
    user.answer(CODE, "")
    user.answer(AGAIN, "8")
    user.answer(CODE, "7")
    user.answer(TYPE, "2")
    user.wait_for_texts("4. Function humidity sensing", "5. Back")
    user.answer(CODE, "5")
    user.answer(TYPE, "3")
    user.wait_for_texts(MAIN)
    user.answer(ACTION, "3")
    user.answer(TYPE, "2")
    user.answer(CODE, "2")
    user.answer("first parameter of the alarm (float):", "a lot")
    user.answer("first parameter of the alarm (float):", "0.5")
    user.answer("second parameter of the alarm (float):", "1.5")
    user.answer(LANDING, "1")
    user.answer(LANDING, "0")
    assert ended(farm, user) == [FINISHED, FAILED, ABORTED]
    assert farm.edge.status(1201) == FAILED
    alarm = farm.newest("/alarm/")
    assert (alarm["alarm_type_id"], alarm["alarm_code_id"]) == (2, 51)
    assert alarm["param_array"] == [0.5, 1.5]
    user.wait_for_texts("The vehicle is down.")
    user.wait_for(lambda: farm.newest("/vehicles/1").get("armed") is False, "disarmed")
    user.wait_for(lambda: len(farm.edge.bodies("/pose/")) == 2, "the place of the landing")
    assert len(farm.edge.bodies("/alarm/")) == 1


def test_an_abort_leaves_only_the_landing_and_the_next_mission_flies(
    farm: Farm, user: TerminalUser
) -> None:
    farm.fly(takeoff(), waypoint(), go_home())
    user.answer(ACTION, "1")
    user.answer(ACTION, "5")
    user.wait_for(lambda: farm.edge.reports(1201)[1:], "the second command")
    farm.edge.event(EventType.ABORT_MISSION)
    user.wait_for_texts("The mission has been aborted.")
    user.answer(LANDING, "1")
    user.answer(LANDING, "0")
    user.wait_for_texts("The vehicle is down.")
    assert ended(farm, user) == [FINISHED, ABORTED, ABORTED]
    farm.fly(takeoff(), go_home(), mission_id=1202)
    for _ in range(2):
        user.answer(ACTION, "1")
    assert ended(farm, user, 1202) == [FINISHED] * 2


def test_a_geofence_is_shown_and_is_no_mission(farm: Farm, user: TerminalUser) -> None:
    south, west = 40.4434 - 6e-4, -3.7382 - 8e-4
    north, east = 40.4434 + 6e-4, -3.7382 + 8e-4
    ring = [[south, west], [south, east], [north, east], [north, west]]
    farm.edge.plan(mission(takeoff(), go_home()), geofence={"inclusion": [ring]})
    user.wait_for_texts("Received: geofence, 4 items", "Mission received:", "1. take off to")
    for _ in range(2):
        user.answer(ACTION, "1")
    assert ended(farm, user) == [FINISHED] * 2


def test_an_event_in_flight_is_shown_and_finished_by_1(farm: Farm, user: TerminalUser) -> None:
    place = {"latitude": 40.4434, "longitude": -3.7382}
    circle = {**place, "orbit_altitude": 8.0, "radius": 10.0, "start_point": 0}
    commands: list[tuple[int, dict[str, Any]]] = [
        (7, circle),
        (8, {**place, "altitude": 5.0, "heading": 1}),
        (9, {"corners": [[0.2, 0.3], [0.7, 0.6]]}),
    ]
    live = [
        {"command_id": n, "command_type_id": kind, "parameters": parameters}
        for n, (kind, parameters) in enumerate(commands, start=2)
    ]
    panorama = {"command_id": 6, "command_type_id": 10, "parameters": {"panorama_mode": 0}}
    farm.fly(takeoff(), *live, waypoint(5), panorama, go_home(7))
    for title in (
        "take off to",
        "circle with radius 10 m",
        "follow the target",
        "track the subject between 0.2, 0.3",
        "fly to",
        "take a panorama",
        "return home and land",
    ):
        user.wait_for_texts("Running:", title)
        user.answer(ACTION, "1")
        user.wait_for_texts("Finished:")
    assert ended(farm, user) == [FINISHED] * 7


@pytest.mark.parametrize("keys", ["\x03", "\x04"], ids=["Ctrl-C", "Ctrl-D"])
def test_ctrl_c_and_ctrl_d_end_it_cleanly(user: TerminalUser, keys: str) -> None:
    user.press(keys)
    assert user.wait_for_exit() == 0
    assert "Traceback" not in user.shown


def test_ctrl_c_in_the_middle_of_a_mission_ends_it_cleanly(farm: Farm, user: TerminalUser) -> None:
    farm.fly(takeoff(), go_home())
    user.answer(ACTION, "3")
    user.wait_for_texts(TYPE)
    user.press("\x03")
    assert user.wait_for_exit() == 0
    assert "Traceback" not in user.shown


def test_lines_from_a_pipe_are_kept_until_they_are_asked_for(farm: Farm) -> None:
    with behind_pipe(farm.port) as user:
        user.meanwhile = farm.go_on
        user.type("1", "2", "40.5", "-3.5", "9", "", "", "", "1", "1")
        user.wait_for_texts("Waiting for a mission.")
        farm.fly(takeoff(), waypoint(), go_home())
        user.close_input()
        assert ended(farm, user) == [FINISHED] * 3
        assert user.wait_for_exit() == 0
    assert farm.edge.bodies("/pose/")[1]["latitude"] == 40.5


def test_a_script_answers_the_prompts(farm: Farm, tmp_path: Any) -> None:
    script = tmp_path / "script"
    script.write_text("# up\n1\n@wait 0.1\n3\n1\n3\n0.5\n1.5\n0\n")
    with behind_pipe(farm.port, "--script", str(script)) as user:
        user.meanwhile = farm.go_on
        farm.fly(takeoff(), waypoint(), go_home())
        assert ended(farm, user) == [FINISHED, FAILED, ABORTED]
        assert user.wait_for_exit() == 0
    assert farm.newest("/alarm/")["alarm_code_id"] == 3


def test_without_an_input_it_ends_at_once(farm: Farm) -> None:
    with behind_pipe(farm.port) as user:
        user.close_input()
        assert user.wait_for_exit() == 0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [(("--system-id", "256"), "1 to 255"), (("--script", "/nothing"), "--script")],
)
def test_invalid_arguments_are_refused_with_one_sentence(
    arguments: tuple[str, ...], word: str
) -> None:
    with behind_pipe(9, *arguments) as user:
        assert user.wait_for_exit() == 2
        assert word in user.shown
        assert "Traceback" not in user.shown
