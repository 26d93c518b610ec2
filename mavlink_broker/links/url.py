"""Where MAVLink comes from and goes to: the URLs of links, and who is reached through them.

    udpin://0.0.0.0:14540         listens; whoever sends a datagram is answered
    udpout://192.168.1.20:14550   speaks first
    tcp://127.0.0.1:5760          connects, for ever again
    tcpin://127.0.0.1:5790        is connected to
    serial:///dev/ttyUSB0:57600   a telemetry radio, or a cable

`udp` stands for `udpin` and `tcpout` for `tcp`, as other MAVLink programs spell them. `?trusted`
behind a cable's or the loopback's URL believes unsigned frames of systems that have a key.
"""

import re
from enum import Enum
from ipaddress import ip_address
from typing import Final, NamedTuple, Self
from urllib.parse import SplitResult, urlsplit

DEFAULT_MAVLINK_PORT: Final = 14540
DEFAULT_BAUD: Final = 57_600
"""What telemetry radios are delivered with."""
EVERYBODY: Final = "0.0.0.0"  # noqa: S104  # vehicles come from anywhere on the farm
LOOPBACK: Final = "127.0.0.1"
LARGEST_PORT: Final = 65_535
FASTEST_BAUD: Final = 4_000_000

_ALIASES: Final = {"udp": "udpin", "tcpout": "tcp"}
_DEVICE: Final = re.compile(r"(?P<path>/[^:]*)(?::(?P<baud>[0-9]+))?")


class LinkUrlError(ValueError):
    """A link's URL cannot be read; the text says which and why."""


class LinkKind(Enum):
    """How a link is made; the values are the URLs' schemes."""

    UDP_IN = "udpin"
    UDP_OUT = "udpout"
    TCP_OUT = "tcp"
    TCP_IN = "tcpin"
    SERIAL = "serial"


class Address(NamedTuple):
    """One correspondent: host and port, or device and baud, on the n-th link."""

    host: str
    port: int
    link: int = 0

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class LinkUrl(NamedTuple):
    """A link as it was asked for."""

    kind: LinkKind
    host: str  # Host name or address; of a serial line its device
    port: int  # Of a serial line its baud
    is_trusted: bool = False

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind.value}://{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether nobody beyond this machine can be at the other end."""
        if self.kind is LinkKind.SERIAL:
            return False
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @classmethod
    def parse(cls, text: str, here: str = EVERYBODY) -> Self:
        """Read a URL; one that listens and names no host does so at `here`.

        Raises:
            LinkUrlError: if it names no link.
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
            raise LinkUrlError(f"{text!r} is no link: {reason}") from None
        if parts.fragment or parts.query not in {"", "trusted"}:
            raise LinkUrlError(f"{text!r} is no link: only ?trusted may follow")
        if parts.query and not (kind is LinkKind.SERIAL or url.is_loopback):
            raise LinkUrlError(f"{text!r}: only a cable or the loopback can be trusted")
        return url._replace(is_trusted=bool(parts.query))


def parse_links(text: str, here: str = EVERYBODY) -> tuple[LinkUrl, ...]:
    """Read URLs that commas or blanks part; those that name no host listen at `here`.

    Raises:
        LinkUrlError: if one of them names no link, or one stands there twice.
    """
    links = tuple(LinkUrl.parse(part, here) for part in re.split(r"[,\s]+", text) if part)
    for link in links:
        if sum(other[:3] == link[:3] for other in links) > 1:
            raise LinkUrlError(f"{link} is named twice")
    return links


def _host(parts: SplitResult, kind: LinkKind, here: str) -> tuple[str, int]:
    if parts.path not in {"", "/"} or parts.username is not None:
        raise LinkUrlError("it is more than a host and a port")
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
        raise LinkUrlError("a line is named like serial:///dev/ttyUSB0:57600")
    baud = int(found["baud"] or DEFAULT_BAUD)
    if not 0 < baud <= FASTEST_BAUD:
        raise LinkUrlError(f"its speed must be 1 to {FASTEST_BAUD} baud")
    return found["path"], baud
