"""Write the reference pages that come from code: `make reference`.

A test compares the pages with what this module writes, so that a change of the code shows as a
reviewed change of the page.
"""

import argparse
import io
import os
import re
import runpy
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Final
from unittest.mock import patch

from docs.tools import completion
from sim.config import SimulationConfig
from sim.simulation import Simulation
from uav_firmware.cal.link import Address
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.topology import Autopilot

DOCS: Final = Path(__file__).parents[1]


class _SilentLink:
    """Implements `uav_firmware.cal.link.Link`: nothing arrives, nothing is sent."""

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        return ()

    def send(self, datagram: bytes, address: Address) -> None:
        pass

    def refused_addresses(self) -> Sequence[Address]:
        return ()

    def close(self) -> None:
        pass


def parameters() -> str:
    """Every parameter of the autopilot, by name."""
    with tempfile.TemporaryDirectory() as folder:
        registry = Autopilot(
            JsbsimVehicle(Simulation(SimulationConfig())),
            _SilentLink(),
            FileStorage(Path(folder)),
            system_id=1,
            peers=(),
            boot_time_utc_us=0,
            write_line=lambda _time_us, _text: None,
        ).registry
    rows = []
    for name in registry.names():
        entry = registry.declaration(name)
        span = f"{entry.minimum:g} to {entry.maximum:g}"
        rows.append(f"| `{name}` | {entry.default:g} | {entry.unit} | {span} | {entry.meaning} |")
    return _page(
        "Parameters of the autopilot",
        "Names, types and meanings are PX4's. Changed values are saved to "
        "`STATE_DIR/vehicle-N/parameters.json`. The default gains are tuned for the F450; the "
        "vehicle also flies with twice and with half the rate gains. A parameter that may be set "
        "in flight keeps the vehicle in control over its whole range. A parameter that describes "
        "the vehicle (`CA_*`, `THR_MDL_FAC`, `DSHOT_MIN`, `RL_*`, `FD_ACT_*`, `LNDMC_*`, `EKF2_*` "
        "except the declination and the drag coefficients, `COM_FAIL_ACK`) is refused while "
        "armed, with PARAM_ERROR PERMISSION_DENIED.",
        ("name", "default", "unit", "range", "meaning"),
        rows,
    )


def _page(title: str, about: str, head: Sequence[str], rows: Sequence[str]) -> str:
    table = (f"| {' | '.join(head)} |", "|" + "---|" * len(head), *rows)
    return f"# {title}\n\n{about}\n\n" + "\n".join(table) + "\n"


PROGRAMS: Final = (
    ("edge_server",),
    ("mavlink_broker", "run"),
    ("mavlink_broker", "translate"),
    ("mavlink_broker", "vehicles"),
    ("mavlink_broker", "fly"),
    ("mavlink_broker", "sign-setup"),
    ("mavlink_broker", "dead-letters"),
    ("uav_firmware",),
    ("sim",),
    ("sim.tester",),
    ("sim.cloud",),
    ("sim.mosaic",),
    ("sim.camera.views",),
)
"""Every command line that a person uses, beside `make`."""
_OPTION: Final = re.compile(
    r"^  (?:-h, )?(--[\w-]+|\w[\w-]*|\{[\w,-]+\})(?: (\S+(?: \S+)*))?(?:  +(\S.*))?$"
)
_CHOICES: Final = re.compile(r"^  \{([\w,-]+)\}", re.MULTILINE)


def command_lines() -> str:
    """Arguments and flags of every program, as its `--help` lists them."""
    about = (
        "Arguments and flags of every program, from its `--help`. Defaults and details: "
        "[edge server](edge-server-settings.md), [broker](broker-settings.md), "
        "[autopilot](autopilot-settings.md), [simulation](../how-to/run-the-simulation.md).\n\n"
        "| exit status | meaning |\n|---|---|\n"
        "| 0 | done, or ended by SIGINT or SIGTERM where the program serves until then |\n"
        "| 1 | failed: a mission, a check, a delivery; the standard error has the reason |\n"
        "| 2 | cannot start: a wrong argument or setting, a port, link, folder or database |\n"
        "| 129, 130, 143 | a command that SIGHUP, SIGINT or SIGTERM has ended before its end |"
    )
    parts = ["# Command lines", "", about]
    for program in PROGRAMS:
        for command, text in _commands(program):
            rows = list(_arguments(text))
            parts += ["", f"## {' '.join(command)}", ""]
            parts += ["| argument | meaning |", "|---|---|", *rows] if rows else ["No arguments."]
    return "\n".join(parts) + "\n"


def _commands(command: Sequence[str]) -> Iterator[tuple[Sequence[str], str]]:
    """Give a command with its help, then its subcommands; a mere group of them is left out."""
    text = _help(command)
    choices = _CHOICES.search(text) if command[0] == "edge_server" else None
    if choices is None or len(command) == 1:
        yield command, text
    if choices is not None:
        for name in choices[1].split(","):
            yield from _commands((*command, name))


def _help(command: Sequence[str]) -> str:
    """What `python -m COMMAND --help` prints, on a terminal so wide that nothing is wrapped."""
    printed = io.StringIO()
    with (
        warnings.catch_warnings(action="ignore", category=RuntimeWarning),  # Imported before
        patch.dict(os.environ, {"COLUMNS": "2000"}, clear=True),
        patch.object(sys, "argv", [*command, "--help"]),
        redirect_stdout(printed),
    ):
        try:
            runpy.run_module(command[0], run_name="__main__", alter_sys=False)
        except SystemExit:
            return printed.getvalue()
    raise AssertionError(f"{command} ignores --help")


def _arguments(text: str) -> Iterator[str]:
    """One row for each argument and flag, `--help` left out."""
    lines = text.replace("\n" + " " * 24, "  ").splitlines()  # Help below a long flag
    for line in lines:
        found = _OPTION.match(line)
        if found is not None and found[1] != "--help":
            meaning = (found[3] or "").replace("|", "\\|")
            yield f"| `{' '.join(filter(None, (found[1], found[2])))}` | {meaning} |"


def _completion(program: str) -> Callable[[], str]:
    return lambda: completion.scripts(_help)[program]


PAGES: Final[Mapping[str, Callable[[], str]]] = {
    "reference/autopilot-parameters.md": parameters,
    "reference/command-lines.md": command_lines,
    **{f"../deploy/completion/{program}": _completion(program) for program in completion.PROGRAMS},
}
"""The generated files by their path, starting from `docs/`."""


def main() -> None:
    """Write every page that differs."""
    argparse.ArgumentParser(
        prog="docs.tools.reference", description="Write the files that come from code."
    ).parse_args()
    for path, written in PAGES.items():
        page = DOCS / path
        if (text := written()) != (page.read_text(encoding="utf-8") if page.exists() else ""):
            page.write_text(text, encoding="utf-8")
            print(f"written: {page.resolve().relative_to(DOCS.parent)}")


if __name__ == "__main__":
    main()
