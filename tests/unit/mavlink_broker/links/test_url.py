"""URLs of links, as people write them."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.url import LinkKind, LinkUrl, LinkUrlError, parse_links


@pytest.mark.parametrize(
    ("text", "kind", "host", "port"),
    [
        ("udpin://0.0.0.0:14540", LinkKind.UDP_IN, "0.0.0.0", 14540),
        ("udp://:14541", LinkKind.UDP_IN, "0.0.0.0", 14541),
        ("udpin://", LinkKind.UDP_IN, "0.0.0.0", 14540),
        ("udpin://[::1]:14540", LinkKind.UDP_IN, "::1", 14540),
        ("udpout://drone.farm:14550", LinkKind.UDP_OUT, "drone.farm", 14550),
        ("tcp://127.0.0.1:5760", LinkKind.TCP_OUT, "127.0.0.1", 5760),
        ("tcpout://127.0.0.1:5760", LinkKind.TCP_OUT, "127.0.0.1", 5760),
        ("tcpin://0.0.0.0:5790", LinkKind.TCP_IN, "0.0.0.0", 5790),
        ("serial:///dev/ttyUSB0:57600", LinkKind.SERIAL, "/dev/ttyUSB0", 57600),
        ("serial:///dev/serial/by-id/usb-FTDI-0:115200", LinkKind.SERIAL, None, 115200),
        ("serial:///dev/ttyUSB0", LinkKind.SERIAL, "/dev/ttyUSB0", 57600),
    ],
)
def test_every_kind_is_understood(text: str, kind: LinkKind, host: str | None, port: int) -> None:
    url = LinkUrl.parse(text)
    assert (url.kind, url.port) == (kind, port)
    assert url.host == (host or "/dev/serial/by-id/usb-FTDI-0")
    assert LinkUrl.parse(str(url)) == url


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "must begin with udpin://"),
        ("14540", "must begin with udpin://"),
        ("http://127.0.0.1:80", "must begin with udpin://"),
        ("udpout://127.0.0.1", "port"),
        ("udpout://127.0.0.1:0", "port"),
        ("udpout://:14550", "host"),
        ("tcp://127.0.0.1:99999", "port"),
        ("tcp://127.0.0.1:x", "port"),
        ("tcp://a@127.0.0.1:5760", "must contain only"),
        ("tcp://127.0.0.1:5760/x", "must contain only"),
        ("serial://ttyUSB0:57600", "serial:///dev"),
        ("serial:///dev/ttyUSB0:fast", "serial:///dev"),
        ("serial:///dev/ttyUSB0:0", "baud"),
        ("udpin://[::1", "must begin with udpin://"),
        ("udpin://0.0.0.0:14540?trusted", "serial line"),
        ("udpin://0.0.0.0:14540?open", "trusted"),
        ("serial:///dev/ttyUSB0:57600#x", "trusted"),
    ],
)
def test_an_invalid_link_is_refused_with_its_reason(text: str, reason: str) -> None:
    with pytest.raises(LinkUrlError, match=reason):
        LinkUrl.parse(text)


@given(st.text())
def test_any_text_is_a_link_or_an_error(text: str) -> None:
    with suppress(LinkUrlError):
        assert LinkUrl.parse(text).port <= 4_000_000


def test_only_a_cable_and_the_loopback_can_be_trusted() -> None:
    assert LinkUrl.parse("serial:///dev/ttyACM0:115200?trusted").is_trusted
    assert LinkUrl.parse("tcp://localhost:5760?trusted").is_trusted
    assert not LinkUrl.parse("serial:///dev/ttyACM0:115200").is_trusted


@pytest.mark.parametrize(
    ("text", "is_loopback"),
    [
        ("udpin://127.0.0.1:1", True),
        ("udpin://[::1]:1", True),
        ("udpout://localhost:1", True),
        ("udpin://0.0.0.0:1", False),
        ("udpout://192.168.1.2:1", False),
        ("serial:///dev/ttyUSB0", False),
    ],
)
def test_the_loopback_is_known(text: str, *, is_loopback: bool) -> None:
    assert LinkUrl.parse(text).is_loopback is is_loopback


def test_several_links_stand_in_one_text() -> None:
    links = parse_links("udpin://:14540, serial:///dev/ttyUSB0:57600\ntcp://127.0.0.1:5760")
    assert [link.kind for link in links] == [LinkKind.UDP_IN, LinkKind.SERIAL, LinkKind.TCP_OUT]
    assert parse_links("") == ()


def test_a_link_named_twice_is_refused() -> None:
    with pytest.raises(LinkUrlError, match="twice"):
        parse_links("udpin://:14540,udp://0.0.0.0:14540")
