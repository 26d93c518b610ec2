"""Settings of the links: vehicles, ground stations, frame log."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mavlink_broker.links.url import LOOPBACK, LinkUrl, LinkUrlError, parse_links

DEFAULT_TLOG_MIB: Final = 32
DEFAULT_TLOG_FILES: Final = 8
_YES: Final = frozenset({"1", "yes", "true", "on"})
_NO: Final = frozenset({"", "0", "no", "false", "off"})


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
