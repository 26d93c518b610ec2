"""Message requests: REQUEST_MESSAGE, SET_ and GET_MESSAGE_INTERVAL, and deprecated ones."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.modules.mavlink.commands.commands import (
    Answer,
    Command,
    as_index,
    denied,
    temporarily_rejected,
)
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.link import autopilot_version, available_modes
from uav_firmware.modules.mavlink.telemetry.streams import (
    BUILDERS,
    MIN_INTERVAL_US,
    build,
    stream_key,
)
from uav_firmware.modules.mavlink.wire.addressing import AUTOPILOT_COMPONENT, Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import ProtocolVersion
from uav_firmware.modules.mavlink.wire.peers import Channel, PeerTable

_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED

_TO_ALL: Final = 2.0
_TARGETS: Final = frozenset({0.0, 1.0, _TO_ALL})
_INTERVAL_OFF: Final = -1
_LONGEST_INTERVAL_US: Final = 2**31 - 1
"""Limit of MESSAGE_INTERVAL's int32 [us]."""

_SLOWEST_HEARTBEAT_US: Final = 1_000_000
"""Longest interval of a heartbeat that may be set [us]: the protocol requires 1 Hz."""


class RequestServer:
    """Answers the commands of the message-request and message-interval protocols."""

    def __init__(
        self,
        peers: PeerTable,
        context: Callable[[int], Context],
        component: int = AUTOPILOT_COMPONENT,
    ) -> None:
        """Serve requests to `component`.

        `context` builds the context at a time [us].
        """
        self._component = component
        self._peers = peers
        self._context = context
        self._answers: Mapping[int, Callable[[Command, Sender, int], Answer]] = {
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._home,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._version,
            mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: self._protocol_version,
        }

    def answer(self, command: Command, sender: Sender, now_us: int) -> Answer | None:
        """Answer a request; None for any other command."""
        handler = self._answers.get(command.number)
        return None if handler is None else handler(command, sender, now_us)

    def _request_message(self, command: Command, sender: Sender, now_us: int) -> Answer:
        message_id, target = as_index(command.parameter(1)), _target(command)
        if message_id is None or target is None:
            return _denied(command)
        to_all = target == _TO_ALL
        if message_id == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            return _modes(command, to_all=to_all)
        if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return self._version(command, sender, now_us)._replace(to_all=to_all)
        if message_id == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            return self._get_interval(interval_query(command), sender, now_us)
        return self._built(message_id, now_us, to_all=to_all)

    def _built(self, message_id: int, now_us: int, *, to_all: bool) -> Answer:
        builder = BUILDERS.get(self._key(message_id))
        if builder is None:
            return Answer(_UNSUPPORTED)
        messages = build(builder, self._context(now_us))
        if not messages:
            return temporarily_rejected(f"message {message_id} has no contents yet")
        return Answer(_ACCEPTED, messages, to_all)

    def _version(self, _command: Command, _sender: Sender, now_us: int) -> Answer:
        return Answer(_ACCEPTED, (autopilot_version(self._context(now_us).system_id),))

    def _protocol_version(self, command: Command, sender: Sender, now_us: int) -> Answer:
        return self._one(ProtocolVersion.id, command, sender, now_us)

    def _home(self, command: Command, sender: Sender, now_us: int) -> Answer:
        return self._one(mavlink.MAVLINK_MSG_ID_HOME_POSITION, command, sender, now_us)

    def _one(self, message_id: int, command: Command, sender: Sender, now_us: int) -> Answer:
        """Answer a deprecated command for one message like REQUEST_MESSAGE."""
        parameters = (float(message_id), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return self._request_message(command._replace(parameters=parameters), sender, now_us)

    def _set_interval(self, command: Command, sender: Sender, now_us: int) -> Answer:
        message_id, target = as_index(command.parameter(1)), _target(command)
        interval = command.parameter(2)
        if message_id is None or target is None:
            return _denied(command)
        if not _is_interval(interval):
            return denied(f"{interval:g} us is no interval; 0 is the default, -1 is off")
        key = self._key(message_id)
        if key not in BUILDERS:
            return Answer(_UNSUPPORTED)
        if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and not _is_heartbeat_interval(interval):
            return denied("a heartbeat is sent at least once a second")
        for channel in self._channels(sender, to_all=target == _TO_ALL):
            _apply_interval(channel, key, interval, now_us)
        return Answer(_ACCEPTED)

    def _get_interval(self, command: Command, sender: Sender, _now_us: int) -> Answer:
        """Answer with MESSAGE_INTERVAL: -1 for a message that is off, 0 for an unknown one."""
        message_id, target = as_index(command.parameter(1)), _target(command)
        if message_id is None or target is None or message_id > 0xFFFF:
            return _denied(command)
        channel, key = self._peers.get(sender.address), self._key(message_id)
        interval = channel.schedule.interval_us(key) if channel is not None else 0
        if interval == 0 and key in BUILDERS:
            interval = _INTERVAL_OFF
        message = mavlink.MAVLink_message_interval_message(
            message_id=message_id, interval_us=interval
        )
        return Answer(_ACCEPTED, (message,), to_all=target == _TO_ALL)

    def _key(self, message_id: int) -> int:
        return stream_key(self._component, message_id)

    def _channels(self, sender: Sender, *, to_all: bool) -> list[Channel]:
        if to_all:
            return list(self._peers)
        channel = self._peers.get(sender.address)
        return [] if channel is None else [channel]


def _modes(command: Command, *, to_all: bool) -> Answer:
    """AVAILABLE_MODES of the index in parameter 2, or of all (0)."""
    index = as_index(command.parameter(2))
    modes = tuple(available_modes(index)) if index is not None else ()
    if not modes:
        return denied(f"parameter 2: there is no mode {command.parameter(2):g}")
    return Answer(_ACCEPTED, modes, to_all)


def interval_query(command: Command) -> Command:
    """GET_MESSAGE_INTERVAL of the same meaning as a REQUEST_MESSAGE for MESSAGE_INTERVAL."""
    parameters = (command.parameter(2), 0.0, 0.0, 0.0, 0.0, 0.0, command.parameter(7))
    return command._replace(number=mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, parameters=parameters)


def _apply_interval(channel: Channel, key: int, requested: float, now_us: int) -> None:
    """Set an interval in the encoding of SET_MESSAGE_INTERVAL: 0 default, -1 off, else [us].

    A shorter one than the vehicle can send becomes the shortest, which MESSAGE_INTERVAL reports.
    """
    if requested == 0.0:
        interval_us = channel.schedule.default_interval_us(key)
    elif requested == _INTERVAL_OFF:
        interval_us = 0
    else:
        interval_us = max(round(requested), MIN_INTERVAL_US)
    channel.schedule.set_interval(key, interval_us, now_us)


def _denied(command: Command) -> Answer:
    """Deny a request by the parameter that names no message, or nobody to respond to."""
    if _target(command) is None:
        return denied(f"parameter 7 is {command.parameter(7):g}, no response target")
    return denied(f"there is no message {command.parameter(1):g}")


def _target(command: Command) -> float | None:
    """Response target: 0 or 1 the requester, 2 all peers; None for another value."""
    target = 0.0 if math.isnan(command.parameter(7)) else command.parameter(7)
    return target if target in _TARGETS else None


def _is_interval(interval: float) -> bool:
    return 0.0 <= interval <= _LONGEST_INTERVAL_US or interval == _INTERVAL_OFF


def _is_heartbeat_interval(interval: float) -> bool:
    return 0.0 <= interval <= _SLOWEST_HEARTBEAT_US
