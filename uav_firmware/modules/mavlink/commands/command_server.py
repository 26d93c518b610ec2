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
    pending  --1 s since progress told-> pending   told again
    pending  --2 s of silence----------> answered  FAILED

COMMAND_CANCEL is passed to whoever carries the command out; the final answer then says so.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Final, Protocol, TypeAlias

from uav_firmware.modules.mavlink.commands import mode_commands
from uav_firmware.modules.mavlink.commands.command_memory import CommandMemory, comparable
from uav_firmware.modules.mavlink.commands.commands import (
    BAD_FRAME,
    KNOWN,
    Command,
    from_int,
    from_long,
    is_honoured,
)
from uav_firmware.modules.mavlink.telemetry.requests import Answer
from uav_firmware.modules.mavlink.wire.addressing import (
    AUTOPILOT_COMPONENT,
    Outgoing,
    Sender,
    is_for_us,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MAV_CMD_DO_SET_STANDARD_MODE
from uav_firmware.msg.status import VehicleCommand, VehicleCommandAck

ANSWER_LIMIT_US: Final = 2_000_000
"""Silence of the commander after which a command has failed."""
PROGRESS_LIMIT_US: Final = 10_000_000
"""As above, once the commander has reported progress."""
PROGRESS_TOLD_US: Final = 900_000
"""How often a running command's progress is told, reported or not: a sender may wait but 1 s."""
MAX_PENDING: Final = 64

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

Answerer: TypeAlias = Callable[[Command, Sender, int], Answer | None]
"""Answers commands that need no commander; None for those that it does not know."""


@dataclass(slots=True)
class _Pending:
    """A command that the commander is carrying out."""

    number: int  # As the sender wrote it
    command: Command
    sender: Sender | None  # None when the message has no answer (SET_MODE)
    deadline_us: int
    progress: int | None = None  # [%] As last reported; None before the first report
    told_us: int = 0  # When the sender last heard of it


class CommandSink(Protocol):
    """Takes commands that are to be carried out, such as a queue."""

    def publish(self, item: VehicleCommand) -> None:
        """Hand a command on."""


class CommandServer:
    """Serves COMMAND_LONG, COMMAND_INT, COMMAND_CANCEL, SET_MODE and MISSION_SET_CURRENT.

    It speaks for one component; a vehicle has one server for each.
    """

    def __init__(
        self,
        *,
        system_id: int,
        answerers: Sequence[Answerer],
        commander: CommandSink,
        mission_length: Callable[[], int],
        cancel: Callable[[int], None] = lambda _token: None,
        component: int = AUTOPILOT_COMPONENT,
        known: Container[int] = KNOWN,
        tokens: Iterator[int] | None = None,
    ) -> None:
        """Begin with nothing pending.

        Args:
            system_id: Of this vehicle.
            answerers: Asked in order before a command goes to the commander.
            commander: The queue that the commander reads, or what leads there.
            mission_length: Gives the number of items of the mission.
            cancel: Tells whoever carries out the command of a token to end it.
            component: That commands must name.
            known: Numbers of the commands that are not refused at once.
            tokens: Numbers for what is forwarded; servers of one vehicle share them.
        """
        self._component = component
        self._known = known
        self._tokens = tokens or count(1)
        self._system_id = system_id
        self._answerers = answerers
        self._commander = commander
        self._mission_length = mission_length
        self._cancel = cancel
        self._pending: dict[int, _Pending] = {}
        self._memory = CommandMemory()

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take COMMAND_LONG or COMMAND_INT."""
        if not self._is_addressed(message):
            return []
        if message.command not in self._known:
            return [_acknowledge(message.command, _UNSUPPORTED, sender)]
        is_long = message.get_type() == "COMMAND_LONG"
        command = from_long(message) if is_long else from_int(message)
        if command is None:
            return [_acknowledge(message.command, BAD_FRAME, sender)]
        repeated = self._memory.is_repetition(message, sender, now_us)
        return self._take(command, sender, now_us, repeated=repeated)

    def cancel(self, message: Message, _sender: Sender, _now_us: int) -> list[Outgoing]:
        """Take COMMAND_CANCEL; one that names no running command is ignored."""
        if is_for_us(message, self._system_id, self._component):
            for token, pending in self._pending.items():
                if pending.number == message.command and pending.progress is not None:
                    self._cancel(token)
        return []

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
        """Fail the commands that the commander has not answered; tell of those that run."""
        late = [token for token, pending in self._pending.items() if pending.deadline_us <= now_us]
        outgoing = [message for token in late for message in self._finish(token, _FAILED, now_us)]
        for pending in self._pending.values():
            if pending.progress is not None and now_us - pending.told_us >= PROGRESS_TOLD_US:
                outgoing += _in_progress(pending, now_us)
        return outgoing

    def _is_addressed(self, message: Message) -> bool:
        """Whether a command is for this component; requests may go to every system at once."""
        if message.target_system == 0 and message.command in _OPEN_TO_ALL_SYSTEMS:
            return message.target_component in {0, self._component}
        return is_for_us(message, self._system_id, self._component)

    def _take(
        self, command: Command, sender: Sender, now_us: int, *, repeated: bool
    ) -> list[Outgoing]:
        earlier = self._earlier(command, sender, now_us, repeated=repeated)
        if earlier is not None:
            return earlier
        if not is_honoured(command):
            return [_acknowledge(command.number, _DENIED, sender)]
        for answerer in self._answerers:
            answer = answerer(command, sender, now_us)
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
                return _in_progress(pending, now_us)
            if pending.progress is not None:
                return [_acknowledge(command.number, _BUSY, sender)]
        known = self._memory.answer(command, sender, now_us) if repeated else None
        return None if known is None else [_acknowledge(command.number, known, sender)]

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
        token = next(self._tokens)
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
        pending.progress = min(max(ack.progress, 0), _PROGRESS_UNKNOWN)
        pending.deadline_us = now_us + PROGRESS_LIMIT_US
        return _in_progress(pending, now_us)

    def _finish(self, token: int, result: int, now_us: int) -> list[Outgoing]:
        """End a pending command with its one final answer."""
        pending = self._pending.pop(token)
        if pending.sender is None:
            return []
        self._memory.remember(pending.command, pending.sender, result, now_us)
        return [_acknowledge(pending.number, result, pending.sender)]


def _same(left: Command, right: Command) -> bool:
    return comparable(left) == comparable(right)


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


def _in_progress(pending: _Pending, now_us: int) -> list[Outgoing]:
    """IN_PROGRESS for a command whose progress is known and whose sender awaits an answer."""
    if pending.sender is None or pending.progress is None:
        return []
    pending.told_us = now_us
    answer = _acknowledge(pending.number, _IN_PROGRESS, pending.sender)
    answer.message.progress = pending.progress
    return [answer]
