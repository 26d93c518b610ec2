"""A person at the tester's real terminal, and what broker and edge server see of it."""

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
from tests.support.person import Person, at_terminal, behind_pipe

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
def person(farm: Farm) -> Iterator[Person]:
    with at_terminal(farm.port) as person:
        person.meanwhile = farm.go_on
        person.reads("Waiting for a mission.")
        yield person


def ended(farm: Farm, person: Person, mission_id: int = 1201) -> list[int]:
    """Wait for a mission's end; gives the statuses of its commands."""
    person.wait_for(lambda: (farm.edge.status(mission_id) or 0) >= FINISHED, "the mission's end")
    return farm.edge.statuses(mission_id)


def test_a_mission_is_shown_and_finished_command_by_command(farm: Farm, person: Person) -> None:
    farm.fly(takeoff(), waypoint(), go_home())
    person.reads("Mission received:", "1. take off to", "2. fly to", "3. return home and land")
    for _ in range(3):
        person.reads(MAIN, "4. Update battery level", "5. Update observation info")
        person.answers(ACTION, "1")
        person.reads("Finished:")
    assert ended(farm, person) == [FINISHED] * 3
    assert person.shown.count("Mission running") == 3
    assert len(farm.edge.bodies("/pose/")) == 3


def test_position_and_battery_are_what_the_person_says(farm: Farm, person: Person) -> None:
    farm.fly(takeoff(), go_home())
    for line in ("7", "no", "2"):
        person.answers(ACTION, line)
    for name, line in zip(
        ("latitude", "longitude", "altitude", "yaw", "pitch", "roll"),
        ("40.5", "-3.5", "12.5", "270", "", "x"),
        strict=True,
    ):
        person.answers(f"Enter the new {name} (if not an int it will be generated randomly):", line)
    person.reads("The vehicle is at latitude 40.5")
    person.answers(ACTION, "4")
    person.reads("Select the battery param to change: 1. Capacity 2. Percentage 3. Back")
    person.type("1")
    person.answers("Enter the new battery capacity (mAh):", "4100")
    person.answers(ACTION, "4")
    person.reads("3. Back")
    person.type("2")
    for line in ("80", "101"):
        person.answers("Enter the new battery percentage (%):", line)
    person.reads("Select the battery param to change:", "3. Back")
    person.type("2")
    person.answers("Enter the new battery percentage (%):", "55")
    person.wait_for(lambda: farm.newest("/state_vector/").get("latitude") == 40.5, "the place")
    person.answers(ACTION, "1")
    person.wait_for(lambda: farm.newest("/battery/"), "a battery")
    pose, battery = farm.newest("/pose/"), farm.newest("/battery/")
    assert [pose[part] for part in ("latitude", "longitude", "altitude")] == [40.5, -3.5, 12.5]
    assert pose["yaw"] == pytest.approx(270.0)
    assert all(0.0 <= pose[drawn] <= 100.0 for drawn in ("pitch", "roll"))
    assert battery["percentage"] == pytest.approx(0.55)
    assert battery["capacity"] == pytest.approx(4.1)


def test_the_observation_is_what_the_person_says(farm: Farm, person: Person) -> None:
    farm.fly(takeoff(), waypoint(), go_home())
    person.answers(ACTION, "1")
    for number, prompt, line in (
        ("1", "Enter the new resource id(string):", "probe 7"),
        ("2", "Enter the new observed property(string):", "soil moisture"),
        ("3", "Enter the new result value(float):", "wet"),
        ("3", "Enter the new result value(float):", "12.5"),
        ("4", "Enter the new result uom(string):", "% vol"),
    ):
        person.answers(ACTION, "5")
        person.reads("Select the observation param to change:", "5. Back")
        person.type(number)
        person.answers(prompt, line)
    person.answers(ACTION, "5")
    person.reads("5. Back")
    person.type("5")
    for _ in range(2):
        person.answers(ACTION, "1")
    assert ended(farm, person) == [FINISHED] * 3
    observations = [
        one for body in farm.edge.bodies("/observation/") for one in body["observation_array"]
    ]
    assert all(one["result_time"] > 1.7e9 for one in observations)
    seen = {  # They arrive in either order
        (one["resource_id"], one["observed_property"], one["result_value"], one["result_uom"])
        for one in observations
    }
    assert ("temp", "temperature", 20.0, "C") in seen  # What is said before the person's change
    assert ("probe 7", "soil moisture", 12.5, "% vol") in seen


def test_the_way_through_the_alarms_and_back_and_the_alarm_itself(
    farm: Farm, person: Person
) -> None:
    farm.fly(takeoff(), waypoint(), land())
    person.answers(ACTION, "1")
    person.answers(ACTION, "3")
    person.answers(TYPE, "x")
    person.answers(AGAIN, "4")
    person.answers(TYPE, "1")
    person.reads("6. Equipment humidity sensor", "7. Back")
    person.answers(CODE, "")
    person.answers(AGAIN, "8")
    person.answers(CODE, "7")
    person.answers(TYPE, "2")
    person.reads("4. Function humidity sensing", "5. Back")
    person.answers(CODE, "5")
    person.answers(TYPE, "3")
    person.reads(MAIN)
    person.answers(ACTION, "3")
    person.answers(TYPE, "2")
    person.answers(CODE, "2")
    person.answers("first parameter of the alarm (float):", "a lot")
    person.answers("first parameter of the alarm (float):", "0.5")
    person.answers("second parameter of the alarm (float):", "1.5")
    person.answers(LANDING, "1")
    person.answers(LANDING, "0")
    assert ended(farm, person) == [FINISHED, FAILED, ABORTED]
    assert farm.edge.status(1201) == FAILED
    alarm = farm.newest("/alarm/")
    assert (alarm["alarm_type_id"], alarm["alarm_code_id"]) == (2, 51)
    assert alarm["param_array"] == [0.5, 1.5]
    person.reads("The vehicle is down.")
    person.wait_for(lambda: farm.newest("/vehicles/1").get("armed") is False, "disarmed")
    person.wait_for(lambda: len(farm.edge.bodies("/pose/")) == 2, "the place of the landing")
    assert len(farm.edge.bodies("/alarm/")) == 1


def test_an_abort_leaves_only_the_landing_and_the_next_mission_flies(
    farm: Farm, person: Person
) -> None:
    farm.fly(takeoff(), waypoint(), go_home())
    person.answers(ACTION, "1")
    person.answers(ACTION, "5")
    person.wait_for(lambda: farm.edge.reports(1201)[1:], "the second command")
    farm.edge.event(EventType.ABORT_MISSION)
    person.reads("The mission has been aborted.")
    person.answers(LANDING, "1")
    person.answers(LANDING, "0")
    person.reads("The vehicle is down.")
    assert ended(farm, person) == [FINISHED, ABORTED, ABORTED]
    farm.fly(takeoff(), go_home(), mission_id=1202)
    for _ in range(2):
        person.answers(ACTION, "1")
    assert ended(farm, person, 1202) == [FINISHED] * 2


def test_a_geofence_is_shown_and_is_no_mission(farm: Farm, person: Person) -> None:
    south, west = 40.4434 - 6e-4, -3.7382 - 8e-4
    north, east = 40.4434 + 6e-4, -3.7382 + 8e-4
    ring = [[south, west], [south, east], [north, east], [north, west]]
    farm.edge.plan(mission(takeoff(), go_home()), geofence={"inclusion": [ring]})
    person.reads("Received: geofence, 4 items", "Mission received:", "1. take off to")
    for _ in range(2):
        person.answers(ACTION, "1")
    assert ended(farm, person) == [FINISHED] * 2


def test_what_comes_in_flight_is_shown_and_finished_by_1(farm: Farm, person: Person) -> None:
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
        person.reads("Running:", title)
        person.answers(ACTION, "1")
        person.reads("Finished:")
    assert ended(farm, person) == [FINISHED] * 7


@pytest.mark.parametrize("keys", ["\x03", "\x04"], ids=["Ctrl-C", "Ctrl-D"])
def test_ctrl_c_and_ctrl_d_end_it_cleanly(person: Person, keys: str) -> None:
    person.press(keys)
    assert person.leaves() == 0
    assert "Traceback" not in person.shown


def test_ctrl_c_in_the_middle_of_a_mission_ends_it_cleanly(farm: Farm, person: Person) -> None:
    farm.fly(takeoff(), go_home())
    person.answers(ACTION, "3")
    person.reads(TYPE)
    person.press("\x03")
    assert person.leaves() == 0
    assert "Traceback" not in person.shown


def test_lines_from_a_pipe_are_kept_until_they_are_asked_for(farm: Farm) -> None:
    with behind_pipe(farm.port) as person:
        person.meanwhile = farm.go_on
        person.type("1", "2", "40.5", "-3.5", "9", "", "", "", "1", "1")
        person.reads("Waiting for a mission.")
        farm.fly(takeoff(), waypoint(), go_home())
        person.hang_up()
        assert ended(farm, person) == [FINISHED] * 3
        assert person.leaves() == 0
    assert farm.edge.bodies("/pose/")[1]["latitude"] == 40.5


def test_a_script_types_in_the_persons_stead(farm: Farm, tmp_path: Any) -> None:
    script = tmp_path / "script"
    script.write_text("# up\n1\n@wait 0.1\n3\n1\n3\n0.5\n1.5\n0\n")
    with behind_pipe(farm.port, "--script", str(script)) as person:
        person.meanwhile = farm.go_on
        farm.fly(takeoff(), waypoint(), go_home())
        assert ended(farm, person) == [FINISHED, FAILED, ABORTED]
        assert person.leaves() == 0
    assert farm.newest("/alarm/")["alarm_code_id"] == 3


def test_without_an_input_it_ends_at_once(farm: Farm) -> None:
    with behind_pipe(farm.port) as person:
        person.hang_up()
        assert person.leaves() == 0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [(("--system-id", "256"), "1 to 255"), (("--script", "/nothing"), "--script")],
)
def test_what_cannot_be_is_said_in_a_sentence(arguments: tuple[str, ...], word: str) -> None:
    with behind_pipe(9, *arguments) as person:
        assert person.leaves() == 2
        assert word in person.shown
        assert "Traceback" not in person.shown
