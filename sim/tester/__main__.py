"""`python -m sim.tester`: stand in for a vehicle at the keyboard, as the broker's substitute."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import os
import random
import socket
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Final

from sim.config import SimulationConfig, start_east_m
from sim.physics.earth import degrees_per_metre
from sim.tester.terminal.lines import Lines, WakeableQueue, wait
from sim.tester.terminal.operator import ExitCondition, Operator
from sim.tester.terminal.script import Script, ScriptError
from sim.tester.vehicle.events import LinkEvent
from sim.tester.vehicle.mavsdk_link import LinkError, MavsdkVehicle
from sim.tester.vehicle.stand_in import StandIn
from sim.tester.vehicle.telemetry import Home

_SCRIPT_LOOK_S: Final = 0.05


def main(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run until the lines end or Ctrl-C; gives the exit code."""
    options = _options(arguments, environment)
    for number in (signal.SIGINT, signal.SIGTERM):  # Also if the parent process ignores them
        signal.signal(number, _interrupt)
    try:
        return _run(options)
    except KeyboardInterrupt:
        _write("\n")
        return 0


def _run(options: argparse.Namespace) -> int:
    try:
        script = None if options.script is None else Script(_read(options.script))
    except OSError as error:
        print(f"tester: --script {options.script}: {error.strerror}", file=sys.stderr)
        return 2
    except ScriptError as error:
        print(f"tester: --script: {error}", file=sys.stderr)
        return 2
    woken: WakeableQueue[LinkEvent] = WakeableQueue()
    try:
        link = MavsdkVehicle(options.system_id, _url(options.broker), woken.put)
    except (LinkError, OSError, ValueError) as error:
        print(f"tester: --broker {options.broker}: {error}", file=sys.stderr)
        return 2
    _write(f"Vehicle {options.system_id}, to the broker at {options.broker}.\n")
    _write("Waiting for a mission. Ctrl-C ends.\n")
    draw = random.Random(options.seed).uniform
    vehicle = StandIn(_home(options.system_id), time.monotonic())
    operator = Operator(vehicle, link, draw, _write)
    try:
        _run_operator(operator, Lines(_stdin() if script is None else None), script, woken)
    finally:
        link.close()
        woken.close()
    return 0


def _url(broker: str) -> str:
    """MAVSDK's connection URL of the broker, with a numeric address.

    Raises:
        OSError: if the name cannot be resolved.
        ValueError: if it is not a host and port.
    """
    host, colon, port = broker.rpartition(":")
    if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65_536):
        raise ValueError("must be host:port")
    return f"udpout://{socket.gethostbyname(host)}:{port}"


def _home(system_id: int) -> Home:
    """Home of the simulated vehicle of that number."""
    place = SimulationConfig()
    latitude_deg = place.home_latitude_deg
    altitude_amsl_m = place.home_altitude_amsl_m
    east_deg = start_east_m(system_id) * degrees_per_metre(latitude_deg, altitude_amsl_m).east
    return Home(latitude_deg, place.home_longitude_deg + east_deg, altitude_amsl_m)


def _run_operator(
    operator: Operator, lines: Lines, script: Script | None, woken: WakeableQueue[LinkEvent]
) -> None:
    """Run until there is no more input and the broker has received the last message."""
    exit_condition = ExitCondition()
    while True:
        now = time.monotonic()
        for event in woken.take():
            operator.receive(event, now)
        _enter_lines(operator, lines, script, now)
        has_ended = script.is_over if script else not lines.is_open
        asked = operator.menu.is_asking
        if has_ended and exit_condition.is_due(
            operator.vehicle, now, is_asked=asked, lines_left=lines.has_line
        ):
            return
        due = operator.tick(now)
        wait(lines, woken, min(due, _SCRIPT_LOOK_S + now if script else due) - now)


def _enter_lines(operator: Operator, lines: Lines, script: Script | None, now: float) -> None:
    """Handle the lines of input while a prompt is open."""
    while operator.takes_line(now):
        if script is not None:
            line = script.next_line(operator.menu.place, now)
            if line is None:
                return
            _write(f"{line}\n")
        elif lines.has_line:
            line = lines.pop()
        else:
            return
        operator.answer(line, now)


def _options(arguments: Sequence[str], environment: Mapping[str, str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="sim.tester", description="Stand in for a vehicle at the keyboard."
    )
    port = environment.get("MAVLINK_PORT") or "14540"
    parser.add_argument(
        "--system-id",
        type=_system_id,
        default=environment.get("SYSTEM_ID") or "1",
        help="1 to 255 (environment: SYSTEM_ID)",
    )
    parser.add_argument(
        "--broker",
        default=environment.get("BROKER") or f"127.0.0.1:{port}",
        help="host:port of the broker (environment: BROKER, or MAVLINK_PORT on this machine)",
    )
    parser.add_argument(
        "--script",
        type=Path,
        default=environment.get("SCRIPT") or None,
        help="a file to read instead of the keyboard (environment: SCRIPT)",
    )
    parser.add_argument("--seed", type=int, help="of what is drawn at random; else it differs")
    return parser.parse_args(arguments)


def _system_id(text: str) -> int:
    number = int(text)
    if not 1 <= number <= 255:
        raise argparse.ArgumentTypeError(f"system ids are 1 to 255, not {text}")
    return number


def _read(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def _stdin() -> int | None:
    """Descriptor of the standard input, if there is one."""
    return None if sys.stdin is None else sys.stdin.fileno()


def _write(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Interrupt at the first signal; what closes the link is not interrupted again."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], os.environ))
