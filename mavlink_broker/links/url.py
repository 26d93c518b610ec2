"""Which links a broker has: URLs of links, addresses of the peers on them, and their settings.

    udpin://0.0.0.0:14540         listens, answers every sender
    udpout://192.168.1.20:14550   sends first
    tcp://127.0.0.1:5760          connects, and reconnects without end
    tcpin://127.0.0.1:5790        accepts connections
    serial:///dev/ttyUSB0:57600   a telemetry radio, or a cable

`udp` is short for `udpin` and `tcpout` for `tcp`, as in other MAVLink programs. `?trusted` after
the URL of a serial line or the loopback accepts unsigned frames of systems that have a key.

"""

import argparse
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final, NamedTuple, Self
from urllib.parse import SplitResult, urlsplit

DEFAULT_MAVLINK_PORT: Final = 14540
DEFAULT_BAUD: Final = 57_600
"""Factory setting of telemetry radios."""
ANY_ADDRESS: Final = "0.0.0.0"  # noqa: S104  # vehicles come from anywhere on the farm
LOOPBACK: Final = "127.0.0.1"
LARGEST_PORT: Final = 65_535
FASTEST_BAUD: Final = 4_000_000
_ALIASES: Final = {"udp": "udpin", "tcpout": "tcp"}
_DEVICE: Final = re.compile(r"(?P<path>/[^:]*)(?::(?P<baud>[0-9]+))?")
DEFAULT_TLOG_MIB: Final = 32
DEFAULT_TLOG_FILES: Final = 8
_YES: Final = frozenset({"1", "yes", "true", "on"})
_NO: Final = frozenset({"", "0", "no", "false", "off"})


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


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """Links of vehicles and ground stations, and the frame log."""

    links: tuple[LinkUrl, ...] = ()  # Empty: listen at MAVLINK_HOST and MAVLINK_PORT
    forward: tuple[LinkUrl, ...] = ()  # To ground stations
    forward_commands: bool = False  # They may command while a mission of the broker runs
    tlog_dir: Path | None = None  # None: no frame log
    tlog_mib: int = DEFAULT_TLOG_MIB  # [MiB] Size at which the next file starts
    tlog_files: int = DEFAULT_TLOG_FILES  # Number of files kept


def add_options(parser: argparse.ArgumentParser, environment: Mapping[str, str]) -> None:
    """Add the settings of the links to a parser."""
    for name, text in (
        ("LINKS", "URL of a link to vehicles, several by commas or again --link"),
        ("FORWARD", "URL of a link to ground stations, several by commas or again --forward"),
    ):
        parser.add_argument(
            "--link" if name == "LINKS" else "--forward",
            dest=name.lower(),
            metavar="URL",
            action=_AddLinks,
            default=environment.get(name) or "",
            help=f"{text} (environment: {name})",
        )
    parser.add_argument(
        "--forward-commands",
        nargs="?",
        const="yes",
        default=environment.get("FORWARD_COMMANDS") or "",
        help="ground stations may command during missions (environment: FORWARD_COMMANDS)",
    )
    options: tuple[tuple[str, Any, object, str], ...] = (
        ("TLOG_DIR", Path, None, "folder of the frame log; without it there is none"),
        ("TLOG_MIB", int, DEFAULT_TLOG_MIB, "size at which its next file starts, MiB"),
        ("TLOG_FILES", int, DEFAULT_TLOG_FILES, "number of its files that are kept"),
    )
    for name, kind, default, text in options:
        parser.add_argument(
            "--" + name.lower().replace("_", "-"),
            type=kind,
            default=environment.get(name) or default,
            help=f"{text} (environment: {name})",
        )


def read_options(parser: argparse.ArgumentParser, options: argparse.Namespace) -> LinkSettings:
    """Check the options; an invalid one ends the program with its error and status 2."""
    try:
        links, forward = parse_links(options.links), parse_links(options.forward, LOOPBACK)
    except LinkUrlError as error:
        parser.error(str(error))
    both = next((url for url in forward if url[:3] in [link[:3] for link in links]), None)
    if both is not None:
        parser.error(f"{both} cannot be a link to vehicles and to a ground station")
    if options.forward_commands.lower() not in _YES | _NO:
        parser.error(f"--forward-commands is yes or no, not {options.forward_commands!r}")
    if not 1 <= options.tlog_mib <= 4096 or not 1 <= options.tlog_files <= 10_000:
        parser.error("--tlog-mib must be 1 to 4096, --tlog-files 1 to 10000")
    return LinkSettings(
        links=links,
        forward=forward,
        forward_commands=options.forward_commands.lower() in _YES,
        tlog_dir=options.tlog_dir,
        tlog_mib=options.tlog_mib,
        tlog_files=options.tlog_files,
    )


class _AddLinks(argparse.Action):
    """Collects URLs; the first one given as a flag replaces those of the environment."""

    def __init__(self, option_strings: Sequence[str], dest: str, **more: Any) -> None:
        super().__init__(option_strings, dest, **more)
        self._is_begun = False

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        del parser, option_string
        before = f"{getattr(namespace, self.dest)}," if self._is_begun else ""
        self._is_begun = True
        setattr(namespace, self.dest, f"{before}{values}")
