"""Builds the hardware that the configuration names; the only file that imports drivers.

The simulated vehicle is imported only when it is configured.
"""

import ipaddress
import socket
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from uav_firmware.cal.faults import FaultInjector
from uav_firmware.cal.files import Card
from uav_firmware.cal.link import Address
from uav_firmware.cal.log_store import LogStore
from uav_firmware.cal.storage import Storage
from uav_firmware.cal.vehicle import Fitted, Vehicle
from uav_firmware.config import ConfigError, Endpoint, VehicleConfig
from uav_firmware.drivers.background import BackgroundLogs, BackgroundStorage, close_all
from uav_firmware.drivers.file_room import Room
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.file_tree import image_folder, image_tree, storage_card
from uav_firmware.drivers.jammed_link import JammedLink
from uav_firmware.drivers.key_file import KeyFileError, read_key
from uav_firmware.drivers.log_folder import LogFolder
from uav_firmware.drivers.named_link import NamedLink, PeerResolver
from uav_firmware.drivers.udp_link import UdpLink

_VEHICLES_PER_SEED = 256  # vehicles of one seed must not share their noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """Drivers of the flight stack."""

    vehicle: Vehicle
    link: UdpLink | JammedLink
    storage: Storage
    log_store: LogStore
    card: Card
    background: Sequence[BackgroundStorage | BackgroundLogs] = ()  # Threads that write

    def close(self) -> bool:
        """End the pending writes; release files and sockets. Return False if one does not end."""
        is_written = close_all(self.background)
        self.link.close()
        self.vehicle.close()
        return is_written


def build_hardware(config: VehicleConfig, start_time_utc_us: int) -> Hardware:
    """Make the drivers; the port is bound first, since it may be in use.

    `start_time_utc_us` is the world's time [us since 1970] at the vehicle's time zero.

    Raises:
        OSError: if the port is in use or a file cannot be opened.
        ConfigError: if the driver rejects its configuration.
    """
    link = bind_link(config)
    try:
        logs, images = LogFolder(config.folder / "log"), image_tree(config.folder)
        vehicle = build_vehicle(config, start_time_utc_us, images.room)
        hardware = Hardware(
            vehicle=vehicle,
            link=JammedLink(link, vehicle) if isinstance(vehicle, FaultInjector) else link,
            storage=FileStorage(config.folder),
            log_store=logs,
            card=storage_card(config.folder, logs, images),
        )
    except BaseException:
        link.close()
        raise
    return hardware if config.speed == 0.0 else _in_real_time(hardware)


def _in_real_time(hardware: Hardware) -> Hardware:
    """The same hardware with storage and logs that are written in threads."""
    storage, logs = BackgroundStorage(hardware.storage), BackgroundLogs(hardware.log_store)
    return replace(hardware, storage=storage, log_store=logs, background=(storage, logs))


def bind_link(config: VehicleConfig) -> UdpLink:
    """Bind the vehicle's port.

    Raises:
        OSError: naming the port, if it is in use.
        ConfigError: if a peer's host name has no address.
    """
    names = [address for address in addresses(config) if not _is_numeric(address)]
    try:
        if names:
            return NamedLink(config.bind, config.port, PeerResolver(names))
        return UdpLink(config.bind, config.port)
    except OSError as error:
        raise OSError(
            error.errno, f"UDP {config.bind}:{config.port} cannot be used: {error.strerror}"
        ) from error


def build_vehicle(
    config: VehicleConfig, start_time_utc_us: int, images: Room | None = None
) -> Vehicle:
    """Make the vehicle's driver; `images` is the quota of its camera, None for no camera.

    Raises:
        ConfigError: if the driver does not exist or rejects its configuration.
        OSError: if its truth log cannot be written.
    """
    if config.driver != "jsbsim":
        raise ConfigError(f"--driver: there is no driver {config.driver!r}")
    from uav_firmware.drivers.jsbsim_build import (  # noqa: PLC0415  # only when named
        Pictures,
        simulated_vehicle,
    )

    home = config.home
    try:
        return simulated_vehicle(
            number=config.system_id,
            seed=config.seed * _VEHICLES_PER_SEED + config.system_id,
            farm_seed=config.seed,
            home=None
            if home is None
            else (home.latitude_deg, home.longitude_deg, home.altitude_amsl_m, home.heading_deg),
            world=config.world,
            wind_m_s=config.wind_m_s,
            wind_from_deg=config.wind_from_deg,
            gps=config.gps,
            fitted=Fitted(config.imus, config.barometers, config.compasses),
            noise_factor=config.noise,
            start_time_utc_us=start_time_utc_us,
            faults_path=config.faults,
            console_folder=config.folder,
            pictures=None
            if images is None
            else Pictures(
                image_folder(config.folder),
                images,
                in_step=config.speed == 0.0,
                hurried=config.speed > 1.0,
                live_port=config.port,
                live_at_once=config.live_view,
            ),
            truth_path=config.folder / "truth.csv" if config.truth else None,
        )
    except ValueError as error:
        raise ConfigError(str(error)) from error


def addresses(config: VehicleConfig) -> tuple[Address, Address]:
    """Addresses of the broker and of the ground station, as the autopilot uses them.

    They are numeric except for a name of another host: that may get another address while
    the vehicle flies, so the link resolves it (`uav_firmware/drivers/named_link.py`).

    Raises:
        ConfigError: if a host name has no address.
    """
    return _resolve("--broker", config.broker), _resolve("--gcs", config.gcs)


def signing_keys(config: VehicleConfig) -> tuple[bytes | None, bytes | None]:
    """Keys of the broker's and of the ground station's link; None for a link without one.

    Raises:
        ConfigError: if a file contains no key, or others may read it.
        OSError: if a file cannot be read.
    """
    return (
        _signing_key("--broker-signing-key", config.broker_signing_key),
        _signing_key("--gcs-signing-key", config.gcs_signing_key),
    )


def _signing_key(name: str, path: Path | None) -> bytes | None:
    try:
        return None if path is None else read_key(path)
    except KeyFileError as error:
        raise ConfigError(f"{name}: {error}") from error


def _resolve(name: str, endpoint: Endpoint) -> Address:
    try:
        numeric = socket.gethostbyname(endpoint.host)
    except OSError as error:
        raise ConfigError(f"{name}: {endpoint.host} has no address: {error.strerror}") from error
    here = ipaddress.ip_address(numeric).is_loopback
    return numeric if here else endpoint.host, endpoint.port


def _is_numeric(address: Address) -> bool:
    try:
        ipaddress.ip_address(address[0])
    except ValueError:
        return False
    return True
