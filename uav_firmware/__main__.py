"""Starts one vehicle: `python -m uav_firmware --system-id N`."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import gc
import os
import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

from uav_firmware.config import ConfigError, VehicleConfig, read_config
from uav_firmware.drivers.jammed_link import JammedLink
from uav_firmware.drivers.line_writer import LineWriter
from uav_firmware.drivers.udp_link import UdpLink
from uav_firmware.modules.mavlink.commands.preflight_commands import PowerAction
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.modules.mavlink.wire.signing_setup import SetupTrust
from uav_firmware.modules.mavlink.wire.signing_store import SigningStoreError
from uav_firmware.scheduler import LateSteps, Pacer
from uav_firmware.topology import Autopilot
from uav_firmware.vehicle import Hardware, addresses, build_hardware, signing_keys

EXIT_REFUSED = 2
_LOOPBACK = "127.0.0.1"


class Stop:
    """Set by SIGINT or SIGTERM; the loop ends after the present step."""

    def __init__(self) -> None:
        self.requested = False
        self.reboots = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._request)

    def ask(self, action: PowerAction) -> None:
        """End the loop as a peer wishes, and begin anew after a reboot."""
        self.requested = True
        self.reboots = action is PowerAction.REBOOT

    def _request(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True


def main() -> int:
    """Run until a signal stops the process; gives the exit code."""
    stop = Stop()
    try:
        config = read_config(sys.argv[1:], os.environ)
        peers = _peers(config)
        boot_time_utc_us = _world_us()
        hardware = build_hardware(config, boot_time_utc_us)
    except (ConfigError, OSError) as error:
        return _refuse(error)
    lines = LineWriter(sys.stdout)
    write = _line_format(config.system_id, lines)
    try:
        autopilot = Autopilot(
            hardware.vehicle,
            hardware.link,
            hardware.storage,
            system_id=config.system_id,
            peers=peers,
            boot_time_utc_us=boot_time_utc_us,
            write_line=write,
            log_store=hardware.log_store,
            card=hardware.card,
            world_us=_world_us,
            setup_signing=SetupTrust(config.setup_signing),
            request_power=stop.ask,
        )
        if not any(peer.signing_key for peer in peers) and config.bind != _LOOPBACK:
            warning = f"MAVLink on {config.bind} is unsigned: whoever reaches it can fly this"
            write(0, warning)
        _run(config, hardware, autopilot, stop, write)
    except SigningStoreError as error:
        return _refuse(error)
    finally:
        if not hardware.close():
            write(hardware.vehicle.time_us, "WARNING the medium hangs: what waits for it is lost")
        lines.close()
    if stop.reboots:
        _begin_anew()
    return 0


def _begin_anew() -> NoReturn:
    """Run the same program in this process; a simulated vehicle is at home again."""
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])  # noqa: S606 - its own command line


def _world_us() -> int:
    """The machine's clock [us since 1970]; signatures live by it, at any simulation speed."""
    return time.time_ns() // 1000


def _refuse(error: ConfigError | SigningStoreError | OSError) -> int:
    print(f"vehicle not started: {_sentence(error)}", file=sys.stderr, flush=True)
    return EXIT_REFUSED


def _sentence(error: Exception) -> str:
    """What went wrong, without an error number."""
    if not isinstance(error, OSError) or error.strerror is None:
        return str(error)
    return error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"


def _peers(config: VehicleConfig) -> tuple[Peer, Peer]:
    broker, gcs = addresses(config)
    broker_key, gcs_key = signing_keys(config)
    return (
        Peer(address=broker, profile=Profile.ONBOARD, signing_key=broker_key),
        Peer(address=gcs, profile=Profile.GROUND_STATION, signing_key=gcs_key),
    )


def _run(
    config: VehicleConfig,
    hardware: Hardware,
    autopilot: Autopilot,
    stop: Stop,
    write: Callable[[int, str], None],
) -> None:
    """Step and pace until a signal or a peer ends it."""
    vehicle, step = hardware.vehicle, autopilot.scheduler.step
    gc.freeze()  # what lives as long as the process need not be looked through in mid-flight
    pacer = Pacer(
        config.speed,
        clock=time.monotonic,
        wait=_link_server(hardware.link, autopilot.serve_link),
        batch_us=autopilot.batch_us,
        is_command_pending=autopilot.is_command_pending,
    )
    speed = "as fast as it goes" if config.speed == 0.0 else f"at {config.speed:g} times real time"
    host, port = hardware.link.address
    write(vehicle.time_us, f"flying {config.driver} {speed}, MAVLink on UDP {host}:{port}")
    late = LateSteps(pacer, write)
    while not stop.requested:
        step()
        pacer.pace(vehicle.time_us)
        if pacer.steps == late.due:
            late.report(vehicle.time_us)
    autopilot.logger.close()
    fault = autopilot.parameter_storage.finish()
    if fault:
        write(vehicle.time_us, f"WARNING {fault}")
    write(
        vehicle.time_us,
        f"stopped after {pacer.steps} steps, {pacer.overruns} of them late, "
        f"{pacer.given_up_s:.1f} s given up",
    )


def _link_server(link: UdpLink | JammedLink, serve: Callable[[], None]) -> Callable[[float], None]:
    """A wait that ends with a datagram and its answer: no peer waits for the next step."""

    def wait(seconds: float) -> None:
        if link.wait(seconds):
            serve()

    return wait


def _line_format(system_id: int, lines: LineWriter) -> Callable[[int, str], None]:
    """Log lines with the vehicle's id and its time."""

    def write(time_us: int, text: str) -> None:
        lines.write(f"vehicle {system_id} {time_us * 1e-6:9.2f} s  {text}")

    return write


if __name__ == "__main__":
    sys.exit(main())
