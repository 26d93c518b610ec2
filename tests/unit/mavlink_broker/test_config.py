"""Environment, flags over it, errors reported."""

from pathlib import Path

import pytest

from mavlink_broker.config import Config, load, parse_targets, parse_vehicle_ids
from mavlink_broker.links.url import LinkUrl


def test_without_settings_the_system_of_the_readme_is_used() -> None:
    assert load([], {}) == Config()


def test_the_environment_is_read_and_flags_override_it() -> None:
    environment = {"EDGE_PORT": "15401", "MAVLINK_PORT": "15402", "STATE_DIR": "/tmp/x"}
    settings = load(["--mavlink-port", "15403"], environment)
    assert settings.edge_url == "http://127.0.0.1:15401"
    assert settings.mavlink_port == 15403
    assert settings.key_file == Path("/tmp/x/keys/broker.key")
    assert settings.database_folder == Path("/tmp/x/broker")


def test_a_url_overrides_a_port() -> None:
    settings = load([], {"EDGE_PORT": "1", "EDGE_URL": "http://edge.farm:80"})
    assert settings.edge_url == "http://edge.farm:80"


def test_vehicles_may_have_other_numbers_than_their_systems() -> None:
    settings = load(["--vehicle-ids", "7:1,8:2"], {})
    assert [settings.vehicle_id(system) for system in (1, 2, 3)] == [7, 8, 3]
    assert [settings.system_of(vehicle) for vehicle in (7, 8, 3)] == [1, 2, 3]


def test_a_number_that_was_assigned_means_no_other_vehicle() -> None:
    settings = load(["--vehicle-ids", "7:1"], {})
    assert settings.system_of(1) is None
    assert settings.vehicle_id(7) is None


def test_a_target_to_follow_is_a_vehicle_or_a_file() -> None:
    settings = load(["--follow-targets", "1:2, 3:fields/tractor.csv"], {})
    assert settings.follow_targets == {1: 2, 3: Path("fields/tractor.csv")}


@pytest.mark.parametrize("text", ["1", "x:2", "1:", "1:1", "1:2,1:3"])
def test_targets_that_make_no_sense_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"vehicle|targets"):
        parse_targets(text)


@pytest.mark.parametrize("text", ["7", "7:x", "7:1,7:2", "7:1,8:1", "7:256", "0:1"])
def test_numbers_that_make_no_sense_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=text):
        parse_vehicle_ids(text)


@pytest.mark.parametrize(
    ("flag", "value", "why"),
    [
        ("--vehicle-ids", "7:1,8:1", "name a vehicle or a system twice: '7:1,8:1'"),
        ("--unsigned-systems", "0", "systems are 1 to 255, not '0'"),
        ("--follow-targets", "1:1", "vehicle 1 cannot follow itself"),
    ],
)
def test_a_refused_number_is_reported_with_its_reason(
    flag: str, value: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        load([flag, value], {})
    assert why in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["--spool-mib", "0"],
        ["--spool-mib", "1025"],
        ["--spool-mib", "much"],
        ["--vehicle-log-mib", "-1"],
        ["--vehicle-log-mib", "1025"],
        ["--vehicle-log-time", "0"],
        ["--vehicle-log-time", "nan"],
        ["--mavlink-port", "70000"],
        ["--mavlink-port", "many"],
        ["--mavlink-system-id", "0"],
        ["--vehicle-ids", "7"],
        ["--state-vector-interval", "0"],
        ["--state-vector-interval", "nan"],
        ["--state-vector-interval", "inf"],
        ["--state-vector-interval", "86401"],
        ["--battery-capacity", "5200"],
        ["--log-level", "LOUD"],
        ["--edge-url", "edge-server:8000"],
        ["--edge-url", "nonsense"],
        ["--edge-url", "http://:8000"],
        ["--edge-url", "http://edge:80000"],
    ],
)
def test_a_fault_ends_the_program_with_status_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        load(arguments, {})
    assert caught.value.code == 2
    assert arguments[0] in capsys.readouterr().err


def test_nothing_is_signed_by_default() -> None:
    config = load([], {"SIGNING_KEYS": "", "UNSIGNED_SYSTEMS": ""})
    assert config.signing_keys is None
    assert config.unsigned_systems == frozenset()


def test_a_folder_of_keys_and_the_systems_that_cannot_sign() -> None:
    config = load(["--unsigned-systems", "3, 7"], {"SIGNING_KEYS": "var/keys"})
    assert config.signing_keys == Path("var/keys")
    assert config.unsigned_systems == {3, 7}


@pytest.mark.parametrize("text", ["x", "0", "256", "-1", "3;7"])
def test_what_is_no_system_is_refused(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        load([f"--unsigned-systems={text}"], {})
    assert "--unsigned-systems" in capsys.readouterr().err


RADIO = "serial:///dev/ttyUSB0:57600"
WIFI = "udpin://0.0.0.0:14541"


def urls(*texts: str) -> tuple[LinkUrl, ...]:
    return tuple(LinkUrl.parse(text) for text in texts)


def test_the_default_link_is_a_listening_udp_port() -> None:
    assert load([], {"MAVLINK_PORT": "14600"}).vehicle_links == urls("udpin://0.0.0.0:14600")


def test_configured_links_replace_it_in_their_order() -> None:
    config = load([], {"LINKS": f"{RADIO} {WIFI}", "MAVLINK_PORT": "14600"})
    assert config.vehicle_links == urls(RADIO, WIFI)


def test_flags_add_up_and_replace_the_environment() -> None:
    config = load(["--link", WIFI, "--link", RADIO], {"LINKS": "tcp://127.0.0.1:5760"})
    assert config.vehicle_links == urls(WIFI, RADIO)


def test_by_default_there_is_no_forwarding_and_no_frame_log() -> None:
    traffic = load([], {}).traffic
    assert (traffic.forward, traffic.forward_commands, traffic.tlog_dir) == ((), False, None)


def test_a_ground_station_may_be_forwarded_to_and_may_command() -> None:
    flags = ["--forward", "udpin://127.0.0.1:14551", "--forward-commands"]
    for traffic in (
        load(flags, {}).traffic,
        load([], {"FORWARD": "udpin://127.0.0.1:14551", "FORWARD_COMMANDS": "yes"}).traffic,
    ):
        assert traffic.forward == urls("udpin://127.0.0.1:14551")
        assert traffic.forward_commands
    assert not load(
        ["--forward-commands", "no"], {"FORWARD_COMMANDS": "1"}
    ).traffic.forward_commands


def test_forwarding_listens_on_the_loopback_by_default() -> None:
    assert load(["--forward", "udpin://:14551"], {}).traffic.forward[0].is_loopback
    assert not load(["--forward", "udpin://0.0.0.0:14551"], {}).traffic.forward[0].is_loopback


def test_a_folder_of_the_frame_log_and_how_much_it_may_hold() -> None:
    traffic = load(["--tlog-files", "3"], {"TLOG_DIR": "var/tlog", "TLOG_MIB": "5"}).traffic
    assert (traffic.tlog_dir, traffic.tlog_mib, traffic.tlog_files) == (Path("var/tlog"), 5, 3)


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (["--link", "nowhere"], "nowhere"),
        (["--link", WIFI, "--link", WIFI], "twice"),
        (["--link", WIFI, "--forward", WIFI], "cannot be"),
        (["--forward-commands", "perhaps"], "perhaps"),
        (["--tlog-mib", "0"], "--tlog-mib"),
        (["--tlog-files", "0"], "--tlog-files"),
    ],
)
def test_an_invalid_setting_ends_the_program_with_its_reason(
    arguments: list[str], option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        load(arguments, {})
    assert caught.value.code == 2
    assert option in capsys.readouterr().err
