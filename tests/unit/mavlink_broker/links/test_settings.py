"""Links, forwarding and frame log, from flags and environment."""

from pathlib import Path

import pytest

from mavlink_broker.config import load
from mavlink_broker.links.url import LinkUrl

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
