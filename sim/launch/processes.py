"""The system on one page: which programs it is made of and how each is started.

They are started together, in no order: each waits for the others on its own.
"""

import sys
from typing import NamedTuple

from sim.launch.settings import Settings


class Program(NamedTuple):
    """One program of the system."""

    name: str
    arguments: tuple[str, ...]
    tcp_port: int | None = None
    udp_port: int | None = None
    port_setting: str = ""
    """The setting that chooses its port."""


def programs(settings: Settings) -> list[Program]:
    """Give the programs of one system; settings reach them by environment."""
    return [
        *_mqtt_broker(settings),
        Program(
            "cloud",
            _module("sim.cloud"),
            tcp_port=settings.cloud_port,
            port_setting="CLOUD_PORT",
        ),
        Program(
            "edge",
            _module("edge_server"),
            tcp_port=settings.edge_port,
            port_setting="EDGE_PORT",
        ),
        Program(
            "broker",
            _broker(settings),
            udp_port=settings.mavlink_port,
            port_setting="MAVLINK_PORT",
        ),
        *(
            Program(
                f"vehicle-{system_id}",
                _vehicle(settings, system_id),
                udp_port=settings.vehicle_port(system_id),
                port_setting="VEHICLE_PORT_BASE",
            )
            for system_id in range(1, settings.vehicles + 1)
        ),
        *_testers(settings),
    ]


def fleet_limits() -> dict[str, str]:
    """Environment that sets how far our vehicles fly: what their missions' check refuses."""
    return {"FARTHEST_M": "10000", "LONGEST_LEG_M": "900"}


def live_pictures(settings: Settings) -> dict[str, str]:
    """Environment that has the vehicles offer their live picture, and the edge server show it."""
    numbers = range(1, settings.vehicles + 1)
    streams = (f"{n}=http://127.0.0.1:{settings.vehicle_port(n)}/stream" for n in numbers)
    return {"LIVE_VIEW": "1", "VIDEO_STREAMS": ",".join(streams)}


def uplink(settings: Settings) -> dict[str, str]:
    """Environment that says how records reach the mock cloud: straight, or over a broker."""
    url = settings.mqtt_url
    return {"CLOUD_URL": url or settings.cloud_url, "CLOUD_MQTT_URL": url or ""}


def _mqtt_broker(settings: Settings) -> list[Program]:
    if settings.mqtt_port is None or settings.mosquitto is None:
        return []
    # Without a file of configuration Mosquitto listens on this machine alone, and checks no user.
    command = (settings.mosquitto, "-p", str(settings.mqtt_port))
    return [Program("mosquitto", command, tcp_port=settings.mqtt_port, port_setting="MQTT_PORT")]


def _broker(settings: Settings) -> tuple[str, ...]:
    flags = ("--signing-keys", str(settings.keys_dir), "--tlog-dir", str(settings.tlog_dir))
    return (*_module("mavlink_broker"), *flags, *_unsigned(settings))


def _unsigned(settings: Settings) -> tuple[str, ...]:
    """Name the testers: MAVSDK cannot sign."""
    systems = [settings.unsigned_systems, *map(str, settings.tester_ids)]
    named = ",".join(filter(None, systems))
    return ("--unsigned-systems", named) if named else ()


def _testers(settings: Settings) -> list[Program]:
    """Testers that a script types for; a person's is started at the person's own terminal."""
    if settings.tester_script is None:
        return []
    script = ("--script", str(settings.tester_script))
    return [
        Program(f"tester-{n}", (*_module("sim.tester"), "--system-id", str(n), *script))
        for n in settings.tester_ids
    ]


def _vehicle(settings: Settings, system_id: int) -> tuple[str, ...]:
    key = str(settings.signing_key_path(system_id))
    flags = ("--system-id", str(system_id), "--broker-signing-key", key)
    return (*_module("uav_firmware"), *flags)


def _module(name: str) -> tuple[str, ...]:
    return (sys.executable, "-m", name)
