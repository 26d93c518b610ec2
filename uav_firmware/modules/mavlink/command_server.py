"""The command protocol's vehicle end: each command is carried out once and answered once.

Sans-IO: messages and answers in, messages out, time as an argument. A command is refused here
when it is unknown, answered here when it concerns the link, and otherwise passed to the
commander as a VehicleCommand with a token. From then on it is pending until the commander's
final answer, or until the commander has been silent for too long, which is a failure.

    received --refused-----------------> answered
    received --about the link----------> answered
    received --forwarded---------------> pending
    pending  --the commander's answer--> answered
    pending  --progress----------------> pending   limit 10 s
    pending  --2 s of silence----------> answered  FAILED
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from uav_firmware.bus import Queue
from uav_firmware.modules.mavlink import mode_commands
from uav_firmware.modules.mavlink.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.commands import (
    BAD_FRAME,
    KNOWN,
    Command,
    from_int,
    from_long,
    is_honoured,
)
from uav_firmware.modules.mavlink.dialect import Message, mavlink
from uav_firmware.modules.mavlink.dialect_extensions import MAV_CMD_DO_SET_STANDARD_MODE
from uav_firmware.modules.mavlink.requests import RequestServer
from uav_firmware.msg.status import VehicleCommand, VehicleCommandAck

ANSWER_LIMIT_US: Final = 2_000_000
"""Silence of the commander after which a command has failed."""
PROGRESS_LIMIT_US: Final = 10_000_000
"""As above, once the commander has reported progress."""
REPEAT_MEMORY_US: Final = 5_000_000
"""How long an answer is kept for a sender that repeats its command because the answer was lost."""
MAX_PENDING: Final = 64
_MAX_REMEMBERED: Final = 32

_IN_PROGRESS: Final[int] = mavlink.MAV_RESULT_IN_PROGRESS
_DENIED: Final[int] = mavlink.MAV_RESULT_DENIED
_FAILED: Final[int] = mavlink.MAV_RESULT_FAILED
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED
_BUSY: Final[int] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
_PROGRESS_UNKNOWN: Final = 255
_OPEN_TO_ALL_SYSTEMS: Final = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    }
)


@dataclass(slots=True)
class _Pending:
    """A command that the commander is carrying out."""

    number: int  # As the sender wrote it
    command: Command
    sender: Sender | None  # None when the message has no answer (SET_MODE)
    deadline_us: int
    in_progress: bool = False


class _Answered(NamedTuple):
    """The answer given to a command, kept for repetitions."""

    result: int
    time_us: int


class CommandServer:
    """Serves COMMAND_LONG, COMMAND_INT, SET_MODE and MISSION_SET_CURRENT."""

    def __init__(
        self,
        *,
        system_id: int,
        requests: RequestServer,
        commander: Queue[VehicleCommand],
        mission_length: Callable[[], int],
    ) -> None:
        """Take the queue that the commander reads, and a way to ask for the mission's length."""
        self._system_id = system_id
        self._requests = requests
        self._commander = commander
        self._mission_length = mission_length
        self._pending: dict[int, _Pending] = {}
        self._answered: OrderedDict[tuple[tuple[int, int], Command], _Answered] = OrderedDict()
        self._next_token = 1

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take COMMAND_LONG or COMMAND_INT."""
        if not self._is_addressed(message):
            return []
        if message.command not in KNOWN:
            return [_acknowledge(message.command, _UNSUPPORTED, sender)]
        is_long = message.get_type() == "COMMAND_LONG"
        command = from_long(message) if is_long else from_int(message)
        if command is None:
            return [_acknowledge(message.command, BAD_FRAME, sender)]
        repeated = is_long and message.confirmation > 0
        return self._take(command, sender, now_us, repeated=repeated)

    def set_mode(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take SET_MODE, which has no answer but the next HEARTBEAT."""
        if message.target_system != self._system_id:
            return []
        command = mode_commands.from_set_mode(message.base_mode, message.custom_mode)
        if command is not None:
            self._forward(command, command, sender, now_us, answer=False)
        return []

    def set_current_item(self, seq: int, sender: Sender, now_us: int) -> bool:
        """Take MISSION_SET_CURRENT, which has no acknowledgement; False when out of range."""
        if not 0 <= seq < self._mission_length():
            return False
        command = Command(
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, (float(seq), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0
        )
        return self._forward(command, command, sender, now_us, answer=False)

    def answers(self, acks: Iterable[VehicleCommandAck], now_us: int) -> list[Outgoing]:
        """Turn the commander's answers into COMMAND_ACKs, each to whoever sent the command."""
        return [message for ack in acks for message in self._answer(ack, now_us)]

    def tick(self, now_us: int) -> list[Outgoing]:
        """Fail the commands that the commander has not answered."""
        late = [token for token, pending in self._pending.items() if pending.deadline_us <= now_us]
        return [message for token in late for message in self._finish(token, _FAILED, now_us)]

    def _is_addressed(self, message: Message) -> bool:
        """Whether a command is for this component; requests may go to every system at once."""
        if message.target_system == 0 and message.command in _OPEN_TO_ALL_SYSTEMS:
            return message.target_component in {0, 1}
        return is_for_us(message, self._system_id)

    def _take(
        self, command: Command, sender: Sender, now_us: int, *, repeated: bool
    ) -> list[Outgoing]:
        earlier = self._earlier(command, sender, now_us, repeated=repeated)
        if earlier is not None:
            return earlier
        if not is_honoured(command):
            return [_acknowledge(command.number, _DENIED, sender)]
        answer = self._requests.answer(command, sender, now_us)
        if answer is not None:
            to = None if answer.to_all else sender.address
            return [
                _acknowledge(command.number, answer.result, sender),
                *(Outgoing(message, to) for message in answer.messages),
            ]
        meant = self._meaning(command)
        if isinstance(meant, int):
            return [_acknowledge(command.number, meant, sender)]
        if not self._forward(command, meant, sender, now_us, answer=True):
            return [_acknowledge(command.number, _BUSY, sender)]
        return []

    def _earlier(
        self, command: Command, sender: Sender, now_us: int, *, repeated: bool
    ) -> list[Outgoing] | None:
        """Answer to a command that is running or was just answered; None for a new one."""
        for pending in self._pending.values():
            if pending.sender is None or pending.number != command.number:
                continue
            if pending.sender.identity == sender.identity and _same(pending.command, command):
                return [_in_progress(pending, _PROGRESS_UNKNOWN)] if pending.in_progress else []
            if pending.in_progress:
                return [_acknowledge(command.number, _BUSY, sender)]
        known = self._answered.get((sender.identity, _comparable(command)))
        if repeated and known is not None and now_us - known.time_us <= REPEAT_MEMORY_US:
            return [_acknowledge(command.number, known.result, sender)]
        return None

    def _meaning(self, command: Command) -> Command | int:
        """The command as the commander reads it, or the MAV_RESULT that refuses it."""
        if command.number == mavlink.MAV_CMD_DO_SET_MODE:
            return mode_commands.from_do_set_mode(command) or _DENIED
        if command.number == MAV_CMD_DO_SET_STANDARD_MODE:
            return mode_commands.from_standard_mode(command) or _FAILED
        return command

    def _forward(
        self, written: Command, meant: Command, sender: Sender, now_us: int, *, answer: bool
    ) -> bool:
        """Hand a command to the commander; False when too many are pending."""
        if len(self._pending) >= MAX_PENDING:
            return False
        token = self._next_token
        self._next_token += 1
        self._pending[token] = _Pending(
            number=written.number,
            command=written,
            sender=sender if answer else None,
            deadline_us=now_us + ANSWER_LIMIT_US,
        )
        self._commander.publish(_vehicle_command(meant, sender, token, now_us))
        return True

    def _answer(self, ack: VehicleCommandAck, now_us: int) -> list[Outgoing]:
        pending = self._pending.get(ack.token)
        if pending is None:
            return []
        if ack.result != _IN_PROGRESS:
            return self._finish(ack.token, ack.result, now_us)
        pending.in_progress = True
        pending.deadline_us = now_us + PROGRESS_LIMIT_US
        return [] if pending.sender is None else [_in_progress(pending, ack.progress)]

    def _finish(self, token: int, result: int, now_us: int) -> list[Outgoing]:
        """End a pending command with its one final answer."""
        pending = self._pending.pop(token)
        if pending.sender is None:
            return []
        key = (pending.sender.identity, _comparable(pending.command))
        self._answered[key] = _Answered(result, now_us)
        self._answered.move_to_end(key)
        if len(self._answered) > _MAX_REMEMBERED:
            self._answered.popitem(last=False)
        return [_acknowledge(pending.number, result, pending.sender)]


def _comparable(command: Command) -> Command:
    """The command with NaN replaced, because NaN equals nothing, not even itself."""
    beyond_float32 = 1e300  # What no wire value can be
    parameters = tuple(beyond_float32 if math.isnan(p) else p for p in command.parameters)
    return command._replace(parameters=parameters)  # type: ignore[arg-type]  # still seven


def _same(left: Command, right: Command) -> bool:
    return _comparable(left) == _comparable(right)


def _vehicle_command(command: Command, sender: Sender, token: int, now_us: int) -> VehicleCommand:
    return VehicleCommand(
        now_us,
        command.number,
        *command.parameters,
        frame=command.frame,
        source_system=sender.system,
        source_component=sender.component,
        token=token,
    )


def _acknowledge(number: int, result: int, sender: Sender) -> Outgoing:
    message = mavlink.MAVLink_command_ack_message(
        command=number,
        result=result,
        target_system=sender.system,
        target_component=sender.component,
    )
    return Outgoing(message, sender.address)


def _in_progress(pending: _Pending, progress: int) -> Outgoing:
    sender = pending.sender
    if sender is None:
        raise ValueError("progress of a command that has no answer")
    answer = _acknowledge(pending.number, _IN_PROGRESS, sender)
    answer.message.progress = min(max(progress, 0), _PROGRESS_UNKNOWN)
    return answer
