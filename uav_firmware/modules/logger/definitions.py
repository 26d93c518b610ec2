"""Definitions section of a log: formats, vehicle information, parameters, subscriptions."""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from uav_firmware.modules.logger import ulog
from uav_firmware.modules.logger.ulog import LoggedMessage
from uav_firmware.parameters import Registry

HARDWARE: Final = "QUADROTOR"
MAV_TYPE_QUADROTOR: Final = 2


class Identity(NamedTuple):
    """Vehicle identity in a log."""

    system_id: int  # [-] MAVLink system id
    software_version: int  # [-] Major, minor, patch and type, a byte each


def definitions(
    time_us: int, identity: Identity, registry: Registry, messages: Sequence[LoggedMessage]
) -> bytes:
    """Encode everything before the first data message; message N gets subscription N."""
    return b"".join(
        (
            ulog.header(time_us),
            *(ulog.format_definition(message.name, message.fields) for message in messages),
            *_information(identity),
            *_parameters(registry),
            *(ulog.subscription(number, message.name) for number, message in enumerate(messages)),
        )
    )


def changed_parameters(registry: Registry, logged: dict[str, float | int]) -> bytes:
    """Encode the parameters that differ from those in `logged`, and update `logged`."""
    changed = {name: value for name, value in snapshot(registry).items() if logged[name] != value}
    logged.update(changed)
    return b"".join(ulog.parameter(name, value) for name, value in changed.items())


def snapshot(registry: Registry) -> dict[str, float | int]:
    """Return the current value of every parameter."""
    return {name: registry.get(name) for name in registry.names()}


def _information(identity: Identity) -> Iterable[bytes]:
    version = identity.software_version
    major, minor, patch = version >> 24, version >> 16 & 0xFF, version >> 8 & 0xFF
    facts: dict[str, str | int] = {
        "sys_name": "PX4",
        "ver_hw": HARDWARE,
        "ver_sw": f"{major}.{minor}.{patch}",
        "ver_sw_release": version,
        "ver_data_format": 1,
        "sys_uuid": f"{identity.system_id:018x}",
        "time_ref_utc": 0,
    }
    return (ulog.information(key, value) for key, value in facts.items())


def _parameters(registry: Registry) -> Iterable[bytes]:
    values = {"MAV_TYPE": MAV_TYPE_QUADROTOR, **snapshot(registry)}
    yield from (ulog.parameter(name, value) for name, value in values.items())
    for name in registry.changed():
        declaration = registry.declaration(name)
        default = declaration.default
        yield ulog.parameter_default(name, default if declaration.is_integer else float(default))
