"""`QGC WPL 110` files."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.faults import InvalidError
from afarcloud.plan import Mission
from edge_server.exchange import from_commands, to_commands, waypoint_list
from edge_server.exchange.mission_item import Home, MissionFile

ARDUPILOT = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t40.443400\t-3.738200\t650.000000\t1
1\t0\t3\t22\t0.000\t0.000\t0.000\t0.000\t0.000\t0.000\t10.000\t1
2\t0\t3\t16\t0.000\t0.000\t0.000\t0.000\t40.443500\t-3.738200\t10.000\t1
3\t0\t0\t16\t0.000\t0.000\t0.000\t0.000\t40.443600\t-3.738200\t662.000\t1
4\t0\t3\t20\t0.000\t0.000\t0.000\t0.000\t0.000\t0.000\t0.000\t1
"""
PX4 = """QGC WPL 110
0\t1\t3\t22\t0\t0\t0\tnan\t40.4434\t-3.7382\t10\t1
1\t0\t3\t16\t2\t0\t0\t90\t40.4435\t-3.7382\t10\t1
2\t0\t2\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""


def kinds(text: str) -> list[int]:
    file = waypoint_list.read(text.encode())
    found = to_commands.translate(file.items, file.home, zero_yaw_is_unset=file.zero_yaw_is_unset)
    return [one["command_type_id"] for one in found.commands]


def mission_of(file: MissionFile) -> Mission:
    found = to_commands.translate(file.items, file.home, zero_yaw_is_unset=True)
    return Mission.model_validate(
        {
            "mission_id": 1,
            "vehicle_id": 1,
            "maximum_speed": found.maximum_speed_m_s or 6.5,
            "command_array": found.commands,
        }
    )


def faults(raw: bytes) -> dict[str, str]:
    with pytest.raises(InvalidError) as refused:
        waypoint_list.read(raw)
    return {fault.path: fault.message for fault in refused.value.faults}


def row(*columns: object, number: int = 0) -> bytes:
    """A file of one row, in which some columns are others."""
    filled = [number, 0, 3, 16, 0, 0, 0, 0, 40.4, -3.7, 10, 1]
    filled[: len(columns)] = columns  # type: ignore[assignment]  # anything may stand there
    return ("QGC WPL 110\n" + "\t".join(map(str, filled))).encode()


def test_ardupilots_first_row_is_home() -> None:
    file = waypoint_list.read(ARDUPILOT.encode())
    assert file.home == Home(40.4434, -3.7382, 650.0)
    assert [item.number for item in file.items] == [1, 2, 3, 4]
    found = to_commands.translate(file.items, file.home, zero_yaw_is_unset=True)
    takeoff, near, far, back = (one["parameters"] for one in found.commands)
    assert (takeoff["latitude"], takeoff["longitude"]) == (40.4434, -3.7382)
    assert near["desired_yaw_angle"] is None
    assert far["altitude"] == 12.0
    assert back == {"landing": True}


def test_a_waypoint_before_the_takeoff_is_home_in_any_frame() -> None:
    low = PX4.replace("QGC WPL 110\n", "").replace("\n2\t", "\n3\t").replace("\n1\t", "\n2\t")
    low = "QGC WPL 110\n0\t1\t3\t16\t0\t0\t0\t0\t40.4434\t-3.7382\t0\t0\n1" + low[1:]
    file = waypoint_list.read(low.encode())
    assert file.home == Home(40.4434, -3.7382, None)
    assert kinds(low) == [1, 3, 11]


def test_px4s_first_row_is_the_first_item() -> None:
    assert kinds(PX4) == [1, 3, 11]
    file = waypoint_list.read(PX4.encode())
    assert file.home is None
    assert file.items[0].parameters[3] is None
    assert file.items[1].parameters[3] == 90


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\t", "   "),
        lambda text: text.replace("\t", " \t", 3).replace("\t0.000\t", "   0.000\t "),
        lambda text: text.replace("\t16\t", "  16 ").replace("\t1\n", " 1\t\n"),
        lambda text: text.replace("650.000000\t1", "650.000000\t0"),
        lambda text: text.replace("\n", "\n\n") + "# by hand\n",
        lambda text: text.replace("QGC WPL 110", "QGC\tWPL 110  "),
    ],
)
def test_how_lines_are_written_does_not_matter(change: object) -> None:
    assert callable(change)
    assert kinds(change(ARDUPILOT)) == [1, 3, 3, 11]


@pytest.mark.parametrize(
    ("raw", "path"),
    [
        (b"", "line.1"),
        (b"QGC WPL 120\n", "line.1"),
        (b"QGC WPL\n", "line.1"),
        (b"QGC WPL 110\n\xff", ""),
        (row() + b"\t5", "line.2"),
        (row(number=1), "line.2"),
        (row(0, 0, "x"), "line.2"),
        (row(0, 0, 3, 16.5), "line.2"),
        (row(0, 0, 3, -16), "line.2"),
        (row(0, 0, 3, 16, "1e400"), "line.2"),
        (row(0, 0, 3, 16, "inf"), "line.2"),
        (row(0, 0, 3, 16, "0x10"), "line.2"),
        (row(0, 0, 3, 16, "1_0"), "line.2"),
        (row(0, 0, 3, 16, 0, 0, 0, 0, "40,4"), "line.2"),
    ],
)
def test_a_line_that_is_none_is_refused_by_its_number(raw: bytes, path: str) -> None:
    assert path in faults(raw)


def test_all_bad_lines_are_told_at_once() -> None:
    text = ARDUPILOT.replace("\t22\t", "\tx\t").replace("\t20\t", "\ty\t")
    assert {"line.3", "line.6"} <= set(faults(text.encode()))


@given(st.binary(max_size=80) | st.text("0123456789\t.-naQGCWPL \n", max_size=200).map(str.encode))
def test_anything_is_read_or_refused(raw: bytes) -> None:
    for one in (raw, b"QGC WPL 110\n" + raw):
        with contextlib.suppress(InvalidError):
            waypoint_list.read(one)


def test_what_is_written_is_read_as_the_same_mission() -> None:
    file = waypoint_list.read(ARDUPILOT.encode())
    mission = mission_of(file)
    home = from_commands.home_of(mission)
    text = waypoint_list.write(from_commands.items_of(mission, home), home)
    again = waypoint_list.read(text.encode())
    assert again.home == Home(40.4434, -3.7382, 0.0)
    assert mission_of(again) == mission


def test_each_row_has_its_number_and_twelve_columns() -> None:
    file = waypoint_list.read(PX4.encode())
    header, *rows = waypoint_list.write(file.items, Home(40.4434, -3.7382, None)).splitlines()
    assert header == "QGC WPL 110"
    assert [(line.split("\t")[0], len(line.split("\t"))) for line in rows] == [
        (str(number), waypoint_list.COLUMNS) for number in range(4)
    ]
