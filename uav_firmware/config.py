"""What a vehicle is started with: flags over environment over defaults, frozen, checked once.

ConfigError(ValueError) names the flag and the reason.
"""

import argparse
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from farm_flight_bridge import VERSION, program_name

_DRIVERS: Final = ("jsbsim",)
_SETUP_TRUSTS: Final = ("never", "signed", "loopback")
_LARGEST_SPEED: Final = 1000.0
_NEGATIVE: Final = re.compile(r"-\.?\d")


class ConfigError(ValueError):
    """A flag or an environment variable cannot be used; the message names it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Home:
    """Position of the vehicle at the start."""

    latitude_deg: float  # [deg] WGS-84
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m]
    heading_deg: float  # [deg] Clockwise from true north


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """Host and UDP port of a peer."""

    host: str
    port: int


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleConfig:
    """Everything in which one vehicle differs from another."""

    system_id: int  # [-] MAVLink system id, 1 to 250
    driver: str  # Name of the driver of the component abstraction layer
    speed: float  # [-] Times the wall clock; 0 unpaced
    seed: int  # [-] Of all randomness
    wind_m_s: float  # [m/s] Mean wind of the simulation
    wind_from_deg: float  # [deg] Where it blows from
    gps: str  # Satellite receiver of the simulation, by name
    noise: float  # [-] Factor on all sensor noise
    imus: int  # [-] Inertial units of the simulated vehicle, 1 to 3
    barometers: int  # [-]
    compasses: int  # [-]
    world: str  # Name of the place that the simulation flies at
    home: Home | None  # None: the world's home, 3 m apart to the east
    faults: Path | None  # File of faults of the simulation, none when None
    bind: str  # Own address; loopback while the link is unsigned
    port: int  # [-] Own UDP port; 0 is a free port chosen by the system
    broker: Endpoint
    gcs: Endpoint
    broker_signing_key: Path | None  # File; with one, the link must be signed
    gcs_signing_key: Path | None  # The same for the ground station's link
    setup_signing: str  # Who may set a key by SETUP_SIGNING: never, signed, loopback
    state_dir: Path
    truth: bool  # Write the true track
    live_view: bool  # Offer it from the start, and not on command only

    @property
    def folder(self) -> Path:
        """Where this vehicle keeps its files."""
        return self.state_dir / f"vehicle-{self.system_id}"


def read_config(arguments: Sequence[str], environment: Mapping[str, str]) -> VehicleConfig:
    """Read the command line on top of the environment.

    Raises:
        ConfigError: on a value that cannot be used.
        SystemExit: on --help, and on flags that do not exist.
    """
    flags = _parser(environment).parse_args(_joined(arguments))
    system_id = _integer("--system-id", flags.system_id, 1, 250)
    port_base = _integer(
        "VEHICLE_PORT_BASE", environment.get("VEHICLE_PORT_BASE", "14580"), 1, 65535
    )
    port = flags.port if flags.port is not None else str(port_base + system_id)
    return VehicleConfig(
        system_id=system_id,
        driver=flags.driver,
        speed=_speed(flags.speed),
        seed=_integer("--seed", flags.seed, 0, 2**32 - 1),
        wind_m_s=_number("--wind", flags.wind, 0.0, 30.0),
        wind_from_deg=_number("--wind-from", flags.wind_from, 0.0, 360.0),
        noise=_number("--noise", flags.noise, 0.0, 100.0),
        gps=flags.gps,
        imus=_integer("--imus", flags.imus, 1, 3),
        barometers=_integer("--barometers", flags.barometers, 1, 3),
        compasses=_integer("--compasses", flags.compasses, 1, 3),
        world=flags.world,
        faults=_path(flags.faults),
        home=None if flags.home is None else _home(flags.home),
        bind=flags.bind,
        port=_integer("--port", port, 0, 65535),
        broker=_endpoint("--broker", flags.broker),
        gcs=_endpoint("--gcs", flags.gcs),
        broker_signing_key=_path(flags.broker_signing_key),
        gcs_signing_key=_path(flags.gcs_signing_key),
        setup_signing=_choice("--setup-signing", flags.setup_signing, _SETUP_TRUSTS),
        state_dir=Path(flags.state_dir),
        truth=_switch("--truth", flags.truth),
        live_view=_switch("--live-view", flags.live_view),
    )


def _joined(arguments: Sequence[str]) -> list[str]:
    """Each negative value with its flag: argparse takes `-33.9,151.2,20,0` for a flag."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1].startswith("--") and _NEGATIVE.match(argument):
            joined[-1] = f"{joined[-1]}={argument}"
        else:
            joined.append(argument)
    return joined


def _parser(environment: Mapping[str, str]) -> argparse.ArgumentParser:
    """Flags whose defaults come from the environment."""
    get = environment.get
    parser = argparse.ArgumentParser(
        prog=program_name("python -m uav_firmware"),
        description="One vehicle: the autopilot around its driver. Flags override environment.",
        epilog="Exit status: 0 ended by a signal; 2 a wrong setting, port or signing state.",
    )
    add = parser.add_argument
    add("--version", action="version", version=f"%(prog)s {VERSION}")
    add("--system-id", default=get("SYSTEM_ID", "1"), help="MAVLink system id, 1 to 250")
    add("--driver", default=get("DRIVER", "jsbsim"), choices=_DRIVERS, help="vehicle to fly")
    add("--speed", default=get("SPEED", "1"), help="times real time; 0 or max: as fast as it goes")
    add("--seed", default=get("SEED", "1"), help="of all randomness; same seed, same flight")
    add("--wind", default=get("WIND", "0"), help="mean wind of the simulation [m/s]")
    add("--wind-from", default=get("WIND_FROM", "270"), help="where it blows from [deg]")
    add("--noise", default=get("NOISE", "1"), help="factor on the noise of all sensors")
    add("--gps", default=get("GPS") or "m9n", help="receiver of the simulation: m9n or rtk")
    add("--imus", default=get("IMUS", "3"), help="inertial units of the simulation, 1 to 3")
    add("--barometers", default=get("BAROMETERS", "2"), help="barometers, 1 to 3")
    add("--compasses", default=get("COMPASSES", "2"), help="compasses, 1 to 3")
    add("--world", default=get("WORLD", "farm"), help="place that the simulation flies at")
    add("--faults", default=get("FAULTS"), help="file of what breaks and when, in the simulation")
    add("--home", default=get("VEHICLE_HOME"), help="latitude,longitude,altitude,heading")
    add("--bind", default=get("VEHICLE_BIND", "127.0.0.1"), help="own address")
    add("--port", help="own UDP port (default VEHICLE_PORT_BASE, 14580, plus system id)")
    broker = f"127.0.0.1:{get('MAVLINK_PORT', '14540')}"
    gcs = f"127.0.0.1:{get('GCS_PORT', '14550')}"
    add("--broker", default=get("BROKER", broker), help="host:port of the broker")
    add("--gcs", default=get("GCS", gcs), help="host:port of the ground station")
    key = "file with the key that signs the {}'s link (default: not signed)"
    add("--broker-signing-key", default=get("BROKER_SIGNING_KEY"), help=key.format("broker"))
    add("--gcs-signing-key", default=get("GCS_SIGNING_KEY"), help=key.format("ground station"))
    trust = f"who may set a key by SETUP_SIGNING: {', '.join(_SETUP_TRUSTS)}"
    add("--setup-signing", default=get("SETUP_SIGNING", "never"), help=trust)
    add("--state-dir", default=get("STATE_DIR", "var"), help="folder of parameters and logs")
    add("--truth", nargs="?", const="1", default=get("TRUTH", "0"), help="1: write the true track")
    live_view = "1: offer the live picture from the start, not on command only"
    add("--live-view", nargs="?", const="1", default=get("LIVE_VIEW", "0"), help=live_view)
    return parser


def _choice(name: str, text: str, choices: Sequence[str]) -> str:
    if text not in choices:
        raise ConfigError(f"{name}: {text!r} is none of {', '.join(choices)}")
    return text


def _path(text: str | None) -> Path | None:
    return Path(text) if text else None


def _number(name: str, text: str, minimum: float, maximum: float) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ConfigError(f"{name}: {text!r} is no number") from None
    if not minimum <= value <= maximum:
        raise ConfigError(f"{name}: {text} is outside {minimum:g}..{maximum:g}")
    return value


def _integer(name: str, text: str, minimum: int, maximum: int) -> int:
    try:
        value = int(text)
    except ValueError:
        raise ConfigError(f"{name}: {text!r} is no whole number") from None
    if not minimum <= value <= maximum:
        raise ConfigError(f"{name}: {value} is outside {minimum}..{maximum}")
    return value


def _speed(text: str) -> float:
    if text.lower() == "max":
        return 0.0
    return _number("--speed", text, 0.0, _LARGEST_SPEED)


def _switch(name: str, text: str) -> bool:
    if text in {"0", "", "no", "false"}:
        return False
    if text in {"1", "yes", "true"}:
        return True
    raise ConfigError(f"{name}: {text!r} is neither 0 nor 1")


def _endpoint(name: str, text: str) -> Endpoint:
    host, colon, port = text.rpartition(":")
    if not colon or not host:
        raise ConfigError(f"{name}: {text!r} is not host:port")
    return Endpoint(host=host, port=_integer(name, port, 1, 65535))


def _home(text: str) -> Home:
    parts = text.split(",")
    if len(parts) != 4:
        raise ConfigError(f"--home: {text!r} is not latitude,longitude,altitude,heading")
    limits = ((-85.0, 85.0), (-180.0, 180.0), (-500.0, 6000.0), (-math.inf, math.inf))
    latitude, longitude, altitude, heading = (
        _number("--home", part, *limit) for part, limit in zip(parts, limits, strict=True)
    )
    if not math.isfinite(heading):
        raise ConfigError(f"--home: heading {heading} is not finite")
    return Home(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=altitude,
        heading_deg=heading % 360.0,
    )
