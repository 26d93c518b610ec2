"""Settings of the launcher: environment variables, as the Makefile exports them."""

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim.gnss_receivers import GNSS_RECEIVERS

MAXIMUM_WIND_M_S: Final = 30.0
MAXIMUM_SEED: Final = 2**32 - 1
_SWITCH: Final = frozenset({"0", "no", "false", "1", "yes", "true"})
MAXIMUM_VEHICLES: Final = 100
MAXIMUM_PORT: Final = 65_535
VARIABLES: Final[Mapping[str, tuple[str, str]]] = {
    "VEHICLES": ("1", "number of vehicles, system ids from 1"),
    "SPEED": ("1", "simulated over real time; 0: as fast as possible"),
    "WIND": ("0", "mean wind [m/s]"),
    "GPS": ("m9n", "satellite receiver of the vehicles: m9n or rtk"),
    "SEED": ("1", "seed of all random numbers"),
    "EDGE_PORT": ("8000", "HTTP port of the edge server"),
    "CLOUD_PORT": ("8100", "HTTP port of the mock cloud"),
    "MQTT_PORT": ("0", "send records through a Mosquitto on this port instead of HTTP; 0: none"),
    "MAVLINK_PORT": ("14540", "UDP port of the broker"),
    "GCS_PORT": ("14550", "UDP port of a ground station"),
    "VEHICLE_PORT_BASE": ("14580", "UDP port of vehicle N: this plus N"),
    "TESTERS": ("0", "persons who may stand in for vehicles, with the system ids that follow"),
    "TESTER_SCRIPT": ("", "file of input lines for the testers"),
    "STATE_DIR": ("var", "folder of all state"),
    "TRUTH": ("0", "1: each vehicle writes its true track"),
    "PLAN": ("", "plan of demo and fly, else examples/plans/first_flight.json"),
    "OUT": ("", "folder of the report of fly, else STATE_DIR/flight"),
    "UNSIGNED_SYSTEMS": ("", "further systems that cannot sign, as in 3,7"),
}
"""Default and meaning of each variable; the vehicles read WIND, GPS, SEED and TRUTH themselves."""


IMAGE_FOLDER: Final = "image"
"""Where a vehicle's camera stores its pictures, in the vehicle's folder."""


class SettingsError(Exception):
    """A variable has an invalid value; the message names it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """One system: number of vehicles, speed, ports, state folder."""

    vehicles: int
    speed: float  # [-] Simulated over real time; 0 means as fast as it goes
    edge_port: int
    cloud_port: int
    mavlink_port: int
    gcs_port: int
    vehicle_port_base: int
    state_dir: Path
    plan: Path | None
    mqtt_port: int | None = None  # A broker's, over which the edge server reaches the mock cloud
    mosquitto: str | None = None  # Where that broker's program is
    testers: int = 0  # Vehicles that persons stand in for; their numbers follow the vehicles'
    tester_script: Path | None = None  # Typed in place of the persons
    unsigned_systems: str = ""  # Further systems that cannot sign, as the broker reads them

    @property
    def edge_url(self) -> str:
        """Base address of the edge server."""
        return f"http://127.0.0.1:{self.edge_port}"

    @property
    def cloud_url(self) -> str:
        """Base address of the mock cloud."""
        return f"http://127.0.0.1:{self.cloud_port}"

    @property
    def mqtt_url(self) -> str | None:
        """Broker and topics of the farm, if records go over MQTT."""
        return f"mqtt://127.0.0.1:{self.mqtt_port}/afarcloud/farm" if self.mqtt_port else None

    @property
    def tester_ids(self) -> range:
        """System ids of the testers."""
        return range(self.vehicles + 1, self.vehicles + self.testers + 1)

    @property
    def started_ids(self) -> range:
        """System ids of all that the launcher starts; a person sits down when it pleases them."""
        last = self.vehicles + (self.testers if self.tester_script else 0)
        return range(1, last + 1)

    @property
    def keys_dir(self) -> Path:
        """Folder of all keys."""
        return self.state_dir / "keys"

    @property
    def tlog_dir(self) -> Path:
        """Folder of the broker's frame log."""
        return self.state_dir / "tlog"

    def key_path(self, role: str) -> Path:
        """File that holds the access key of a role."""
        return self.keys_dir / f"{role}.key"

    def signing_key_path(self, system_id: int) -> Path:
        """File that holds the key of the link between a vehicle and the broker."""
        return self.keys_dir / f"signing-{system_id}.key"

    def vehicle_port(self, system_id: int) -> int:
        """UDP port that a vehicle listens on."""
        return self.vehicle_port_base + system_id


def vehicle_folder(folder: Path, vehicle_id: int) -> Path:
    """Folder of one vehicle in a folder of all, as the vehicles name theirs."""
    return folder / f"vehicle-{vehicle_id}"


def example_plan() -> Path:
    """File of the first flight: that of the checkout, else the one that is installed."""
    in_checkout = Path("examples/plans/first_flight.json")
    if in_checkout.is_file():
        return in_checkout
    return Path(__file__).parent.parent / "examples" / in_checkout.name


def from_environment(environment: Mapping[str, str]) -> Settings:
    """Read the settings.

    Raises:
        SettingsError: naming the variable that does not fit.
    """
    _check_those_of_the_vehicles(environment)
    testers = _integer(environment, "TESTERS", 0, MAXIMUM_VEHICLES)
    settings = Settings(
        vehicles=_integer(environment, "VEHICLES", int(testers == 0), MAXIMUM_VEHICLES),
        testers=testers,
        tester_script=_file(environment, "TESTER_SCRIPT"),
        unsigned_systems=environment.get("UNSIGNED_SYSTEMS", ""),
        speed=_number(environment, "SPEED", 0.0, 1000.0),
        edge_port=_integer(environment, "EDGE_PORT", 1, MAXIMUM_PORT),
        cloud_port=_integer(environment, "CLOUD_PORT", 1, MAXIMUM_PORT),
        mavlink_port=_integer(environment, "MAVLINK_PORT", 1, MAXIMUM_PORT),
        gcs_port=_integer(environment, "GCS_PORT", 1, MAXIMUM_PORT),
        vehicle_port_base=_integer(environment, "VEHICLE_PORT_BASE", 1, MAXIMUM_PORT - 100),
        state_dir=Path(_text(environment, "STATE_DIR")),
        plan=_file(environment, "PLAN"),
        mqtt_port=_integer(environment, "MQTT_PORT", 0, MAXIMUM_PORT) or None,
        mosquitto=shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin"),
    )
    if settings.mqtt_port is not None and settings.mosquitto is None:
        raise SettingsError("MQTT_PORT: mosquitto is not installed")
    if settings.vehicles + settings.testers > MAXIMUM_VEHICLES:
        raise SettingsError(f"TESTERS: with the vehicles they are {MAXIMUM_VEHICLES} at most")
    return settings


def _check_those_of_the_vehicles(environment: Mapping[str, str]) -> None:
    """Refuse at once what a vehicle would refuse once the other programs have started."""
    _number(environment, "WIND", 0.0, MAXIMUM_WIND_M_S)
    _integer(environment, "SEED", 0, MAXIMUM_SEED)
    receiver, truth = _text(environment, "GPS"), _text(environment, "TRUTH")
    if receiver not in GNSS_RECEIVERS:
        raise SettingsError(f"GPS: must be {' or '.join(GNSS_RECEIVERS)}, not {receiver!r}")
    if truth not in _SWITCH:
        raise SettingsError(f"TRUTH: {truth!r} is neither 0 nor 1")


def _file(environment: Mapping[str, str], name: str) -> Path | None:
    path = Path(environment[name]) if environment.get(name) else None
    if path is not None and not path.is_file():
        raise SettingsError(f"{name}: there is no file {path}")
    return path


def _text(environment: Mapping[str, str], name: str) -> str:
    return environment.get(name) or VARIABLES[name][0]


def _number(environment: Mapping[str, str], name: str, low: float, high: float) -> float:
    text = _text(environment, name)
    try:
        value = float(text)
    except ValueError:
        raise SettingsError(f"{name}: {text!r} is not a number") from None
    if not low <= value <= high:
        raise SettingsError(f"{name}: must be {low:g} to {high:g}, not {text}")
    return value


def _integer(environment: Mapping[str, str], name: str, low: int, high: int) -> int:
    value = _number(environment, name, low, high)
    if value != int(value):
        raise SettingsError(f"{name}: must be a whole number, not {environment[name]}")
    return int(value)
