"""The broker's configuration: environment variables, overridden by flags, read once.

SettingError  a value that is not valid
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias
from urllib.parse import urlsplit

from farm_flight_bridge import VERSION, program_name
from mavlink_broker.links.url import (
    ANY_ADDRESS,
    DEFAULT_MAVLINK_PORT,
    LinkKind,
    LinkUrl,
    LinkUrlError,
    parse_links,
)

DEFAULT_EDGE_PORT: Final = 8000
DEFAULT_SYSTEM_ID: Final = 254
DEFAULT_STATE_VECTOR_INTERVAL_S: Final = 1.0
DEFAULT_BATTERY_CAPACITY_AH: Final = 5.2
"""For a vehicle that does not report it: that of the first vehicle of this system."""
MAX_INTERVAL_S: Final = 86_400.0
DEFAULT_SPOOL_MIB: Final = 16
MAX_SPOOL_MIB: Final = 1024
DEFAULT_VEHICLE_LOG_MIB: Final = 64
MAX_VEHICLE_LOG_MIB: Final = 1024
DEFAULT_VEHICLE_LOG_TIME_S: Final = 600.0
DEFAULT_TLOG_MIB: Final = 32
DEFAULT_TLOG_FILES: Final = 8
LOOPBACK: Final = "127.0.0.1"
LOG_LEVELS: Final = ("DEBUG", "INFO", "WARNING", "ERROR")
_YES: Final = frozenset({"1", "yes", "true", "on"})
_NO: Final = frozenset({"", "0", "no", "false", "off"})
_SYSTEMS: Final = frozenset(range(1, 256))


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """Links of vehicles and ground stations, and the frame log."""

    links: tuple[LinkUrl, ...] = ()  # Empty: listen at MAVLINK_HOST and MAVLINK_PORT
    forward: tuple[LinkUrl, ...] = ()  # To ground stations
    forward_commands: bool = False  # They may command while a mission of the broker runs
    tlog_dir: Path | None = None  # None: no frame log
    tlog_mib: int = DEFAULT_TLOG_MIB  # [MiB] Size at which the next file starts
    tlog_files: int = DEFAULT_TLOG_FILES  # Number of files kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """All settings."""

    edge_url: str = f"http://127.0.0.1:{DEFAULT_EDGE_PORT}"
    edge_ca_file: Path | None = None  # PEM; None: the default certificate authorities
    key_file: Path = Path("var/keys/broker.key")
    database_folder: Path = Path("var/broker")
    spool_mib: int = DEFAULT_SPOOL_MIB  # [MiB] Largest size of the posts in the database
    vehicle_log_mib: int = DEFAULT_VEHICLE_LOG_MIB  # [MiB] Largest log fetched; 0: none
    vehicle_log_time_s: float = DEFAULT_VEHICLE_LOG_TIME_S  # Longest transfer of a log
    mavlink_host: str = ANY_ADDRESS
    mavlink_port: int = DEFAULT_MAVLINK_PORT
    system_id: int = DEFAULT_SYSTEM_ID
    vehicle_of_system: Mapping[int, int] = field(default_factory=dict)
    signing_keys: Path | None = None  # Folder of signing-N.key; None: nothing is signed
    unsigned_systems: frozenset[int] = frozenset()  # Systems that cannot sign
    state_vector_every_s: float = DEFAULT_STATE_VECTOR_INTERVAL_S
    observations_every_s: float = 0.0  # In flight; 0: with finished commands alone
    battery_capacity_ah: float = DEFAULT_BATTERY_CAPACITY_AH
    follow_targets: Mapping[int, int | Path] = field(default_factory=dict)
    """Per vehicle the target that it follows: another vehicle, or a track in a file."""
    log_level: str = "INFO"
    log_file: Path | None = None  # In addition to the standard error
    observes: bool = False  # Changes nothing on the vehicles
    traffic: LinkSettings = field(default_factory=LinkSettings)

    @property
    def vehicle_links(self) -> tuple[LinkUrl, ...]:
        """Links to vehicles; by default a listening UDP port."""
        listening = LinkUrl(LinkKind.UDP_IN, self.mavlink_host, self.mavlink_port)
        return self.traffic.links or (listening,)

    def vehicle_id(self, system_id: int) -> int | None:
        """Vehicle id of a MAVLink system id; None if another system has that vehicle id."""
        if system_id in self.vehicle_of_system:
            return self.vehicle_of_system[system_id]
        return None if system_id in self.vehicle_of_system.values() else system_id

    def system_of(self, vehicle_id: int) -> int | None:
        """MAVLink system id of a vehicle id; None if no system can be that vehicle."""
        reverse = {vehicle: system for system, vehicle in self.vehicle_of_system.items()}
        if vehicle_id in reverse:
            return reverse[vehicle_id]
        is_free = vehicle_id in _SYSTEMS and vehicle_id not in self.vehicle_of_system
        return vehicle_id if is_free else None


class SettingError(argparse.ArgumentTypeError, ValueError):
    """A setting is not valid; argparse prints the text."""


def parse_vehicle_ids(text: str) -> dict[int, int]:
    """Read `7:1,8:2`, vehicle 7 is system 1 and so on, as system id to vehicle id.

    Raises:
        SettingError: if the format is wrong, or an id is repeated or out of range.
    """
    pairs = [part.partition(":") for part in text.split(",") if part.strip()]
    try:
        numbers = [(int(vehicle), int(system)) for vehicle, _, system in pairs]
    except ValueError:
        raise SettingError(f"vehicle ids must look like 7:1,8:2, not {text!r}") from None
    of_system = {system: vehicle for vehicle, system in numbers}
    if len(of_system) != len(numbers) or len(set(of_system.values())) != len(numbers):
        raise SettingError(f"vehicle ids name a vehicle or a system twice: {text!r}")
    if not (of_system.keys() <= _SYSTEMS and all(vehicle > 0 for vehicle in of_system.values())):
        raise SettingError(f"vehicles are 1 and above, systems 1 to 255, not {text!r}")
    return of_system


def parse_systems(text: str) -> frozenset[int]:
    """Read `3,7` as system ids.

    Raises:
        SettingError: if the format is wrong, or a system id is out of range.
    """
    try:
        systems = frozenset(int(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise SettingError(f"systems must look like 3,7, not {text!r}") from None
    if not systems <= _SYSTEMS:
        raise SettingError(f"systems are 1 to 255, not {text!r}")
    return systems


def parse_targets(text: str) -> dict[int, int | Path]:
    """Read `1:2,3:tractor.csv`: vehicle 1 follows vehicle 2, vehicle 3 the track in a file.

    Raises:
        SettingError: if the format is wrong, or a vehicle is repeated or follows itself.
    """
    targets: dict[int, int | Path] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        follower, _, target = part.partition(":")
        if not (follower.isdecimal() and target) or int(follower) in targets:
            raise SettingError(f"targets must look like 1:2,3:tractor.csv, not {text!r}")
        if target == follower:
            raise SettingError(f"vehicle {follower} cannot follow itself")
        targets[int(follower)] = int(target) if target.isdecimal() else Path(target)
    return targets


def load(arguments: Sequence[str], environment: Mapping[str, str]) -> Config:
    """Read the configuration; an invalid value ends the program with its error and status 2."""
    parser = settings_parser(
        environment,
        prog=program_name("mavlink_broker"),
        description="Flies the edge server's missions over MAVLink.",
        epilog="Other commands, each with its own --help: translate, vehicles, fly, sign-setup, "
        "dead-letters. Exit status: 0 done, or ended by a signal; 1 failed; 2 a wrong setting, or "
        "a link that cannot be used; 130 a command that Ctrl-C has ended.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {VERSION}")
    return settings(parser, parser.parse_args(arguments))


def _is_http(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    except ValueError:
        return False


def settings(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Config:
    """Check the options; an invalid one ends the program with its error and status 2."""
    if not 1 <= options.system_id <= 255:
        parser.error("--mavlink-system-id must be 1 to 255")
    if not 0 <= options.mavlink_port <= 65_535:
        parser.error("--mavlink-port must be 0 to 65535")
    if not _is_http(options.edge_url):
        parser.error(f"--edge-url must be an http or https address, not {options.edge_url!r}")
    if options.log_level.upper() not in LOG_LEVELS:
        parser.error(f"--log-level must be one of {', '.join(LOG_LEVELS)}")
    if not 0.0 < options.battery_capacity <= 100.0:
        parser.error("--battery-capacity must be above 0, at most 100 Ah")
    if not 1 <= options.spool_mib <= MAX_SPOOL_MIB:
        parser.error(f"--spool-mib must be 1 to {MAX_SPOOL_MIB}")
    if not 0 <= options.vehicle_log_mib <= MAX_VEHICLE_LOG_MIB:
        parser.error(f"--vehicle-log-mib must be 0 to {MAX_VEHICLE_LOG_MIB}")
    _check_times(parser, options)
    return Config(
        edge_url=options.edge_url,
        edge_ca_file=options.edge_ca_file,
        key_file=options.key_file or options.state_dir / "keys" / "broker.key",
        database_folder=options.state_dir / "broker",
        spool_mib=options.spool_mib,
        vehicle_log_mib=options.vehicle_log_mib,
        vehicle_log_time_s=options.vehicle_log_time,
        mavlink_host=options.mavlink_host,
        mavlink_port=options.mavlink_port,
        system_id=options.system_id,
        vehicle_of_system=options.vehicle_ids,
        signing_keys=options.signing_keys,
        unsigned_systems=options.unsigned_systems,
        state_vector_every_s=options.state_vector_interval,
        observations_every_s=options.observation_interval,
        battery_capacity_ah=options.battery_capacity,
        follow_targets=options.follow_targets,
        log_level=options.log_level.upper(),
        log_file=options.log_file,
        traffic=_link_settings(parser, options),
    )


def _check_times(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Check intervals and durations; an invalid one ends the program as in `settings`."""
    if not 0.0 < options.state_vector_interval <= MAX_INTERVAL_S:
        parser.error(f"--state-vector-interval must be above 0, at most {MAX_INTERVAL_S:.0f} s")
    if not 1.0 <= options.vehicle_log_time <= MAX_INTERVAL_S:
        parser.error(f"--vehicle-log-time must be 1 to {MAX_INTERVAL_S:.0f} s")
    if not 0.0 <= options.observation_interval <= MAX_INTERVAL_S:
        parser.error(f"--observation-interval must be 0 to {MAX_INTERVAL_S:.0f} s")


def _link_settings(parser: argparse.ArgumentParser, options: argparse.Namespace) -> LinkSettings:
    """Check the options of the links; an invalid one ends the program as in `settings`."""
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


_Setting: TypeAlias = tuple[str, Any, object, str]
"""Name in the environment, function that reads the text, default, help."""


def settings_parser(environment: Mapping[str, str], **about: str) -> argparse.ArgumentParser:
    """Return a parser of every setting; `about` are the texts of the command's help."""
    parser = argparse.ArgumentParser(**about)  # type: ignore[arg-type]  # only its texts
    edge_port = environment.get("EDGE_PORT") or DEFAULT_EDGE_PORT
    options: tuple[_Setting, ...] = (
        ("EDGE_URL", str, f"http://127.0.0.1:{edge_port}", "URL of the edge server"),
        ("EDGE_CA_FILE", Path, None, "certificate authority of the edge server, PEM"),
        ("STATE_DIR", Path, "var", "folder of the system's state and keys"),
        ("KEY_FILE", Path, None, "the broker's access key; in STATE_DIR/keys unless given"),
        ("SPOOL_MIB", int, DEFAULT_SPOOL_MIB, "largest spool of posts for the edge server, MiB"),
        (
            "VEHICLE_LOG_MIB",
            int,
            DEFAULT_VEHICLE_LOG_MIB,
            "largest log fetched from a vehicle after its flight, MiB; 0: none",
        ),
        (
            "VEHICLE_LOG_TIME",
            float,
            DEFAULT_VEHICLE_LOG_TIME_S,
            "longest transfer of a vehicle's log, seconds; one that would take longer is left",
        ),
        ("MAVLINK_HOST", str, ANY_ADDRESS, "address to listen on"),
        ("MAVLINK_PORT", int, DEFAULT_MAVLINK_PORT, "UDP port to listen on"),
        ("MAVLINK_SYSTEM_ID", int, DEFAULT_SYSTEM_ID, "the broker's own MAVLink system id"),
        ("VEHICLE_IDS", parse_vehicle_ids, "", "vehicle_id:system_id, ... where they differ"),
        ("SIGNING_KEYS", Path, None, "folder of signing-N.key, one per system; else unsigned"),
        ("UNSIGNED_SYSTEMS", parse_systems, "", "systems that cannot sign, as in 3,7"),
        (
            "STATE_VECTOR_INTERVAL",
            float,
            DEFAULT_STATE_VECTOR_INTERVAL_S,
            "seconds between state vectors",
        ),
        (
            "OBSERVATION_INTERVAL",
            float,
            0.0,
            "seconds between observations in flight; 0: only with finished commands",
        ),
        (
            "BATTERY_CAPACITY",
            float,
            DEFAULT_BATTERY_CAPACITY_AH,
            "Ah, for vehicles that do not report it",
        ),
        ("FOLLOW_TARGETS", parse_targets, "", "vehicle:vehicle or vehicle:file.csv, ... to follow"),
        ("LOG_LEVEL", str, "INFO", "DEBUG, INFO, WARNING or ERROR"),
        ("LOG_FILE", Path, None, "log file besides the standard error; at most five of 10 MiB"),
    )
    _add_settings(parser, environment, options)
    _add_link_settings(parser, environment)
    return parser


def _add_link_settings(parser: argparse.ArgumentParser, environment: Mapping[str, str]) -> None:
    for flag, name, peers in (
        ("--link", "LINKS", "vehicles"),
        ("--forward", "FORWARD", "ground stations"),
    ):
        parser.add_argument(
            flag,
            dest=name.lower(),
            metavar="URL",
            action=_AddLinks,
            default=environment.get(name) or "",
            help=f"URL of a link to {peers}, several by commas or again {flag} "
            f"(environment: {name})",
        )
    parser.add_argument(
        "--forward-commands",
        nargs="?",
        const="yes",
        default=environment.get("FORWARD_COMMANDS") or "",
        help="ground stations may command during missions (environment: FORWARD_COMMANDS)",
    )
    options: tuple[_Setting, ...] = (
        ("TLOG_DIR", Path, None, "folder of the frame log; without it there is none"),
        ("TLOG_MIB", int, DEFAULT_TLOG_MIB, "size at which its next file starts, MiB"),
        ("TLOG_FILES", int, DEFAULT_TLOG_FILES, "number of its files that are kept"),
    )
    _add_settings(parser, environment, options)


def _add_settings(
    parser: argparse.ArgumentParser, environment: Mapping[str, str], settings: Iterable[_Setting]
) -> None:
    for name, kind, default, text in settings:
        parser.add_argument(
            "--" + name.lower().replace("_", "-"),
            dest="system_id" if name == "MAVLINK_SYSTEM_ID" else name.lower(),
            type=kind,
            default=environment.get(name) or default,
            help=f"{text} (environment: {name})",
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
