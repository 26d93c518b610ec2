"""A scripted MAVProxy session, which knows nothing of this project, drives the autopilot process.

The items of a plan go up and come down as waypoint files, the flight goes by typed commands. No
line is typed that MAVProxy 1.8.75 cannot do with any PX4: its `mode` command fails there.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.conformance.ground_station import vehicle_process
from tests.conformance.mavproxy_session import MavProxy
from tests.support.parameter_table import autopilot
from tests.support.system import free_ports, wait_for
from uav_firmware.modules.mavlink.commands.vehicle_facts import vehicle_facts

pytestmark = pytest.mark.scenario

SYSTEM = 6
SPEED = 5
READ_ONLY = {fact.name for fact in vehicle_facts(SYSTEM, compasses=1)}
HOME = (40.4434, -3.7382)
E7_DEG = 1.01e-6
"""MAVProxy saves six decimals of a degree."""

Row = tuple[float, ...]
"""seq, current, frame, command, p1..p4, x, y, z, autocontinue of a waypoint file."""


class Session(NamedTuple):
    """MAVProxy, connected, and what belongs to it and to the vehicle."""

    proxy: MavProxy
    state: Path
    folder: Path


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    own, broker, ground = free_ports(3)
    state, folder = tmp_path_factory.mktemp("vehicle"), tmp_path_factory.mktemp("mavproxy")
    with (
        vehicle_process(SYSTEM, SPEED, (own, broker, ground), state),
        MavProxy(ground, folder) as proxy,
    ):
        proxy.until(f"Detected vehicle {SYSTEM}:1")
        proxy.until(r"Received \d+ parameters \(ftp\)")
        proxy.until(r"Saved \d+ defaults")
        yield Session(proxy, state, folder)


def waypoint_file(path: Path, *rows: Row) -> Path:
    """Write the text format that ground stations exchange."""
    lines = ["\t".join(f"{value:.7f}".rstrip("0").rstrip(".") for value in row) for row in rows]
    path.write_text("\n".join(["QGC WPL 110", *lines, ""]))
    return path


def rows_of(path: Path) -> list[Row]:
    head, *lines = path.read_text().splitlines()
    assert head == "QGC WPL 110"
    return [tuple(map(float, line.split("\t"))) for line in lines]


def same(came: list[Row], went: tuple[Row, ...]) -> None:
    """Compare item by item and field by field; NaN equals NaN."""
    assert len(came) == len(went)
    for found, wanted in zip(came, went, strict=True):
        assert found[:4] == wanted[:4]
        assert found[4:8] == pytest.approx(wanted[4:8], nan_ok=True)
        assert found[8:10] == pytest.approx(wanted[8:10], abs=E7_DEG)
        assert found[10:] == wanted[10:]


def exchanged(session: Session, kind: str, *rows: Row) -> None:
    """Load a file of a kind of plan into the vehicle, save the vehicle's plan, compare."""
    proxy, folder = session.proxy, session.folder
    plan = waypoint_file(folder / f"{kind}_up.txt", *rows)
    proxy.type(f"{kind} load {plan}")
    proxy.until(r"Sent all \d+ ")
    proxy.until(r"Got MISSION_ACK: TYPE_\w+: ACCEPTED")
    came = folder / f"{kind}_down.txt"
    proxy.ask(f"{kind} save {came}", rf"Saved {len(rows)} .* to {came}")
    same(rows_of(came), rows)


def at(north_e7: float, east_e7: float) -> tuple[float, float]:
    return (HOME[0] + north_e7 * 1e-7, HOME[1] + east_e7 * 1e-7)


MISSION: tuple[Row, ...] = (
    (0, 1, 3, 22, 0, 0, 0, math.nan, *at(0, 0), 8, 1),
    (1, 0, 3, 16, 0, 1.5, 0, math.nan, *at(1500, 0), 10, 1),
    (2, 0, 2, 178, 1, 4, -1, 0, 0, 0, 0, 1),
    (3, 0, 3, 16, 1, 0, 0, 90, *at(1500, 1500), 8, 1),
    (4, 0, 2, 20, 0, 0, 0, 0, 0, 0, 0, 1),
)
FENCE: tuple[Row, ...] = (
    (0, 0, 3, 5001, 3, 0, 0, 0, *at(-9000, -12000), 0, 1),
    (1, 0, 3, 5001, 3, 0, 0, 0, *at(24000, -12000), 0, 1),
    (2, 0, 3, 5001, 3, 0, 0, 0, *at(6000, 22000), 0, 1),
    (3, 0, 3, 5004, 15, 0, 0, 0, *at(9000, -3000), 0, 1),
)
RALLY: tuple[Row, ...] = (
    (0, 0, 3, 5100, 0, 0, 0, 0, *at(500, 1000), 25, 1),
    (1, 0, 3, 5100, 0, 0, 0, 0, *at(2500, 1000), 30, 1),
)


def saved_parameters(path: Path) -> dict[str, float]:
    pairs = (line.split() for line in path.read_text().splitlines() if line.strip())
    apart = {"_HASH_CHECK", *READ_ONLY}
    return {name: float(value) for name, value in pairs if name not in apart}


@pytest.fixture(scope="module")
def declared(tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    """Every parameter of a new vehicle, but for the facts that it finds out by itself."""
    registry = autopilot(tmp_path_factory.mktemp("declared")).registry
    names = set(registry.names()) - READ_ONLY
    return {name: registry.declaration(name).default for name in names}


def value_of(session: Session, name: str) -> float:
    """What the vehicle says when asked for one parameter."""
    return float(session.proxy.ask(f"param fetch {name}", rf"{name} = (\S+)\s").group(1))


def set_parameter(session: Session, name: str, value: float) -> None:
    session.proxy.type(f"param set {name} {value:g}")
    wait_for(lambda: value_of(session, name) == value, f"{name} = {value}")


def test_every_parameter_and_its_default_come_by_file(
    session: Session, declared: dict[str, float]
) -> None:
    for name in (f"mav_{SYSTEM}_1.parm", "defaults.parm"):
        fetched = saved_parameters(session.proxy.log_folder / name)
        assert fetched == pytest.approx(declared, rel=1e-5)


def test_an_integer_is_set_by_a_client_that_knows_no_types(session: Session) -> None:
    """The file that MAVProxy has read makes it send each value as a real."""
    set_parameter(session, "NAV_RCL_ACT", 3.0)
    set_parameter(session, "NAV_RCL_ACT", 2.0)


def test_every_parameter_comes_by_list(session: Session, declared: dict[str, float]) -> None:
    proxy = session.proxy
    proxy.type("set param_ftp False")
    proxy.ask("param fetch", rf"Received {len(declared) + len(READ_ONLY)} parameters\s")
    saved = Path(proxy.until(r"Saved \d+ parameters to (\S+)").group(1))
    fetched = saved_parameters(saved)
    assert fetched == pytest.approx(declared, rel=1e-5)


def test_a_parameter_is_set_and_guarded(session: Session) -> None:
    set_parameter(session, "MIS_TAKEOFF_ALT", 6.5)
    set_parameter(session, "NAV_RCL_ACT", 3.0)
    session.proxy.ask("param set NAV_DLL_ACT 77", "Failed to set NAV_DLL_ACT to 77")
    assert value_of(session, "NAV_DLL_ACT") == 0.0


@pytest.mark.promise
def test_a_waypoint_file_comes_down_as_it_went_up(session: Session) -> None:
    exchanged(session, "wp", *MISSION)


def test_a_fence_comes_down_as_it_went_up(session: Session) -> None:
    exchanged(session, "fence", *FENCE)
    session.proxy.ask("fence list", rf"Requesting {len(FENCE)} fence items")
    session.proxy.until(r"5004 3 .* p1=15\.0")


def test_rally_points_come_down_as_they_went_up(session: Session) -> None:
    exchanged(session, "rally", *RALLY)
    session.proxy.ask("rally list", rf"Requesting {len(RALLY)} rally items")
    session.proxy.until(r"5100 3 .* 30\.0")


def test_the_plans_do_not_disturb_each_other(session: Session) -> None:
    for kind, rows in (("wp", MISSION), ("fence", FENCE), ("rally", RALLY)):
        exchanged(session, kind, *rows)
    came = session.folder / "again.txt"
    session.proxy.ask(f"wp save {came}", f"Saved {len(MISSION)} ")
    same(rows_of(came), MISSION)


def test_a_file_of_1000_waypoints_comes_down_as_it_went_up(session: Session) -> None:
    way = tuple(
        (seq, 0, 3, 16, 0, 0, 0, math.nan, *at(2 * seq, -seq), 10, 1) for seq in range(1, 1000)
    )
    exchanged(session, "wp", MISSION[0], *way)


def test_a_take_off_as_for_any_autopilot_climbs_to_the_set_height(session: Session) -> None:
    proxy = session.proxy
    proxy.ask("takeoff 10", "Got COMMAND_ACK: NAV_TAKEOFF: ACCEPTED")
    proxy.ask("arm throttle", "ARMED")
    proxy.until("Mode LOITER")
    proxy.ask("long NAV_LAND 0 0 0 nan nan nan nan", "Mode LAND")
    proxy.until("DISARMED")


def test_a_mission_is_flown_and_ended_by_a_return(session: Session) -> None:
    proxy = session.proxy
    exchanged(session, "wp", *MISSION)
    proxy.ask("long DO_SET_MODE 29 4 4", "Mode MISSION")
    proxy.ask("arm throttle", "ARMED")
    for seq in (1, 3):
        proxy.until(f"waypoint {seq}")
    proxy.ask("long DO_SET_MODE 29 4 5", "Mode RTL")
    proxy.until("DISARMED")


def test_the_log_of_a_flight_is_listed_and_downloaded_both_ways(session: Session) -> None:
    proxy, folder = session.proxy, session.folder
    flown = min((session.state / f"vehicle-{SYSTEM}" / "log").glob("*/*.ulg"))
    whole = flown.read_bytes()
    listed = proxy.ask("log list", r"Log 0 +numLogs \d+ lastLog \d+ size (\d+)")
    assert int(listed.group(1)) == len(whole)
    by_data = folder / "by_data.ulg"
    proxy.ask(f"log download 0 {by_data}", f"Finished downloading {by_data}")
    assert by_data.read_bytes() == whole
    day = flown.parent.name
    proxy.ask(f"ftp list @MAV_LOG/{day}", rf"{flown.name}\s+{len(whole)}\s")
    by_file = folder / "by_file.ulg"
    proxy.ask(f"ftp get @MAV_LOG/{day}/{flown.name} {by_file}", rf"Wrote {len(whole)} bytes")
    wait_for(lambda: by_file.read_bytes() == whole, "the whole file, which is closed later")


def test_a_file_is_put_listed_checked_fetched_and_removed(session: Session) -> None:
    proxy, folder = session.proxy, session.folder
    sent, back = folder / "sent.bin", folder / "back.bin"
    content = bytes(range(256)) * 100
    sent.write_bytes(content)
    proxy.ask(f"ftp put {sent} /fs/microsd/sent.bin", rf"Sent file of length {len(content)}")
    proxy.ask("ftp list /fs/microsd", rf"sent\.bin\s+{len(content)}\s")
    own = proxy.ask(f"ftp crclocal {sent}", r"crclocal: \S+ (0x[0-9a-f]+) ").group(1)
    proxy.ask("ftp crc /fs/microsd/sent.bin", rf"crc: /fs/microsd/sent\.bin {own} ")
    proxy.ask(f"ftp get /fs/microsd/sent.bin {back}", rf"Wrote {len(content)} bytes")
    wait_for(lambda: back.read_bytes() == content, "the whole file, which is closed later")
    proxy.type("ftp rm /fs/microsd/sent.bin")
    listing = proxy.ask("ftp list /fs/microsd", r"Listing(?s:.*?)Total size").group()
    assert "sent.bin" not in listing
