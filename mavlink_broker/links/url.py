"""URLs of links, and addresses of the peers on them.

    udpin://0.0.0.0:14540         listens, answers every sender
    udpout://192.168.1.20:14550   sends first
    tcp://127.0.0.1:5760          connects, and reconnects without end
    tcpin://127.0.0.1:5790        accepts connections
    serial:///dev/ttyUSB0:57600   a telemetry radio, or a cable

`udp` is short for `udpin` and `tcpout` for `tcp`, as in other MAVLink programs. `?trusted` after
the URL of a serial line or the loopback accepts unsigned frames of systems that have a key.
"""

import re
from enum import Enum
from ipaddress import ip_address
from typing import Final, NamedTuple, Self
from urllib.parse import SplitResult, urlsplit

DEFAULT_MAVLINK_PORT: Final = 14540
DEFAULT_BAUD: Final = 57_600
"""Factory setting of telemetry radios."""
ANY_ADDRESS: Final = "0.0.0.0"  # noqa: S104  # vehicles come from anywhere on the farm
LARGEST_PORT: Final = 65_535
FASTEST_BAUD: Final = 4_000_000
_ALIASES: Final = {"udp": "udpin", "tcpout": "tcp"}
_DEVICE: Final = re.compile(r"(?P<path>/[^:]*)(?::(?P<baud>[0-9]+))?")


class LinkUrlError(ValueError):
    """A link's URL is not valid; the text says which and why."""


class LinkKind(Enum):
    """Kind of a link; the values are the URLs' schemes."""

    UDP_IN = "udpin"
    UDP_OUT = "udpout"
    TCP_OUT = "tcp"
    TCP_IN = "tcpin"
    SERIAL = "serial"


class Address(NamedTuple):
    """One peer: host and port, or device and baud, and the number of its link."""

    host: str
    port: int
    link: int = 0

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class LinkUrl(NamedTuple):
    """A configured link."""

    kind: LinkKind
    host: str  # Host name or address; the device of a serial line
    port: int  # Or the baud rate of a serial line
    is_trusted: bool = False

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind.value}://{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether the other end is on this machine."""
        if self.kind is LinkKind.SERIAL:
            return False
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @classmethod
    def parse(cls, text: str, here: str = ANY_ADDRESS) -> Self:
        """Read a URL; `here` is the address of a listening link without a host.

        Raises:
            LinkUrlError: if it is not a valid link URL.
        """
        try:
            parts = urlsplit(text.strip())
            kind = LinkKind(_ALIASES.get(parts.scheme, parts.scheme))
            url = cls(
                kind, *_device(parts) if kind is LinkKind.SERIAL else _host(parts, kind, here)
            )
        except ValueError as error:
            kinds = ", ".join(f"{kind.value}://" for kind in LinkKind)
            reason = error if isinstance(error, LinkUrlError) else f"it must begin with {kinds}"
            raise LinkUrlError(f"{text!r} is not a valid link: {reason}") from None
        if parts.fragment or parts.query not in {"", "trusted"}:
            raise LinkUrlError(
                f"{text!r} is not a valid link: only ?trusted may follow the address"
            )
        if parts.query and not (kind is LinkKind.SERIAL or url.is_loopback):
            raise LinkUrlError(f"{text!r}: only a serial line or the loopback can be trusted")
        return url._replace(is_trusted=bool(parts.query))


def parse_links(text: str, here: str = ANY_ADDRESS) -> tuple[LinkUrl, ...]:
    """Read URLs separated by commas or blanks; those without a host listen at `here`.

    Raises:
        LinkUrlError: if one of them is not valid, or one is named twice.
    """
    links = tuple(LinkUrl.parse(part, here) for part in re.split(r"[,\s]+", text) if part)
    for link in links:
        if sum(other[:3] == link[:3] for other in links) > 1:
            raise LinkUrlError(f"{link} is named twice")
    return links


def _host(parts: SplitResult, kind: LinkKind, here: str) -> tuple[str, int]:
    if parts.path not in {"", "/"} or parts.username is not None:
        raise LinkUrlError("it must contain only a host and a port")
    try:
        port = parts.port
    except ValueError:
        port = -1
    if port is None:
        port = DEFAULT_MAVLINK_PORT if kind is LinkKind.UDP_IN else -1
    listens = kind in {LinkKind.UDP_IN, LinkKind.TCP_IN}
    if not (0 if listens else 1) <= port <= LARGEST_PORT:
        raise LinkUrlError("its port must be 1 to 65535")
    host = parts.hostname or (here if listens else "")
    if not host:
        raise LinkUrlError("it names no host")
    return host, port


def _device(parts: SplitResult) -> tuple[str, int]:
    found = _DEVICE.fullmatch(parts.path)
    if parts.netloc or found is None:
        raise LinkUrlError("a serial line is written as in serial:///dev/ttyUSB0:57600")
    baud = int(found["baud"] or DEFAULT_BAUD)
    if not 0 < baud <= FASTEST_BAUD:
        raise LinkUrlError(f"its baud rate must be 1 to {FASTEST_BAUD}")
    return found["path"], baud
