"""Server of the command protocol: executes and answers each command once.

Sans-IO. An unknown command is refused. A command of the link or the parameters is executed here.
Any other is forwarded to the commander as a VehicleCommand with a token, and is pending until the
commander's final answer or a timeout, which is a failure. So is one that saves the parameters.

    received --refused-----------------> answered
    received --executed here------------> answered
    received --forwarded---------------> pending
    pending  --final answer------------> answered
    pending  --progress----------------> pending   limit 10 s
    pending  --0.9 s since report------> pending   progress sent again
    pending  --2 s without answer------> answered  FAILED

Who is refused here gets a STATUSTEXT with command and reason; the modules that execute commands
send their own. A repetition gets the same answer without the text again.

COMMAND_CANCEL is passed on to the module that executes the command, which answers CANCELLED.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Final, Protocol, TypeAlias

from uav_firmware.modules.mavlink.commands import modes
from uav_firmware.modules.mavlink.commands.command_history import CommandHistory, comparable
from uav_firmware.modules.mavlink.commands.commands import (
    BAD_FRAME,
    KNOWN,
    REFUSALS,
    Answer,
    Command,
    PendingAnswer,
    denied,
    failed,
    from_int,
    from_long,
    ignored_parameter,
    name_of,
    temporarily_rejected,
)
from uav_firmware.modules.mavlink.wire.addressing import (
    AUTOPILOT_COMPONENT,
    Outgoing,
    Sender,
    is_for_us,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MAV_CMD_DO_SET_STANDARD_MODE
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.status import PROGRESS_UNKNOWN, VehicleCommand, VehicleCommandAck

ANSWER_LIMIT_US: Final = 2_000_000
"""Time without an answer of the commander after which a command has failed."""
PROGRESS_LIMIT_US: Final = 10_000_000
"""The same after a report of progress."""
PROGRESS_INTERVAL_US: Final = 900_000
"""Interval of progress messages of a running command: a sender may time out after 1 s."""
MAX_PENDING: Final = 64

_IN_PROGRESS: Final[int] = mavlink.MAV_RESULT_IN_PROGRESS
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED
_WARNING: Final[int] = mavlink.MAV_SEVERITY_WARNING
_NOTICE: Final[int] = mavlink.MAV_SEVERITY_NOTICE
_READING: Final = frozenset(
    {
        mavlink.MAV_CMD_GET_HOME_POSITION,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS,
        mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS,
        mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION,
        mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION,
        mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS,
    }
)
"""Requests for telemetry. A refusal, perhaps of a message that is not known yet, warns nobody; the
answer is their sender's alone."""
_OPEN_TO_ALL_SYSTEMS: Final = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    }
)

LocalHandler: TypeAlias = Callable[[Command, Sender, int], Answer | PendingAnswer | None]
"""Executes commands without the commander; returns None for unknown ones."""


@dataclass(slots=True)
class _Pending:
    """A command that the commander executes."""

    number: int  # As sent
    command: Command
    sender: Sender | None  # None when no answer is due (SET_MODE)
    deadline_us: int
    progress: int | None = None  # [%] None before the first report
    reported_us: int = 0  # Time of the last progress message


class CommandSink(Protocol):
    """Receives commands to execute."""

    def publish(self, item: VehicleCommand) -> None:
        """Forward a command."""


class CommandServer:
    """Serves COMMAND_LONG, COMMAND_INT, COMMAND_CANCEL, SET_MODE and MISSION_SET_CURRENT.

    Each component of the vehicle has its own server.
    """

    def __init__(
        self,
        *,
        system_id: int,
        local_handlers: Sequence[LocalHandler],
        commander: CommandSink,
        mission_length: Callable[[], int],
        texts: StatusTexts,
        cancel: Callable[[int], None] = lambda _token: None,
        component: int = AUTOPILOT_COMPONENT,
        known: Container[int] = KNOWN,
        tokens: Iterator[int] | None = None,
    ) -> None:
        """Start without pending commands.

        Args:
            system_id: System id of the vehicle.
            local_handlers: Tried in order before a command is forwarded.
            commander: Queue of the commander, or a router to it.
            mission_length: Returns the number of items of the mission.
            texts: Encodes reasons for the senders of refused commands.
            cancel: Cancels the command with a token.
            component: Component id that commands must name.
            known: Numbers of the supported commands.
            tokens: Tokens of forwarded commands, shared by the servers of a vehicle.
        """
        self._component = component
        self._known = known
        self._tokens = tokens or count(1)
        self._system_id = system_id
        self._local_handlers = local_handlers
        self._commander = commander
        self._mission_length = mission_length
        self._texts = texts
        self._cancel = cancel
        self._pending: dict[int, _Pending] = {}
        self._history = CommandHistory()

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle COMMAND_LONG or COMMAND_INT."""
        if not self._is_addressed(message):
            return []
        if message.command not in self._known:
            return [_acknowledge(message.command, _UNSUPPORTED, sender)]
        is_long = message.get_type() == "COMMAND_LONG"
        command = from_long(message) if is_long else from_int(message)
        if command is None:
            return [_acknowledge(message.command, BAD_FRAME, sender)]
        repeated = self._history.is_repetition(command, message, sender, now_us)
        return self._handle(command, sender, now_us, repeated=repeated)

    def cancel(self, message: Message, _sender: Sender, _now_us: int) -> list[Outgoing]:
        """Handle COMMAND_CANCEL; ignored unless the command is running."""
        if is_for_us(message, self._system_id, self._component):
            for token, pending in self._pending.items():
                if pending.number == message.command and pending.progress is not None:
                    self._cancel(token)
        return []

    def set_mode(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle SET_MODE, which has no answer."""
        if message.target_system != self._system_id:
            return []
        command = modes.command_from_set_mode(message.base_mode, message.custom_mode)
        if command is not None:
            self._forward(command, command, sender, now_us, answer=False)
        return []

    def set_current_item(self, seq: int, sender: Sender, now_us: int) -> bool:
        """Handle MISSION_SET_CURRENT; return False when it is out of range."""
        if not 0 <= seq < self._mission_length():
            return False
        command = Command(
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, (float(seq), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0
        )
        return self._forward(command, command, sender, now_us, answer=False)

    def answers(
        self, acks: Iterable[VehicleCommandAck], now_us: int, *, reason: str = ""
    ) -> list[Outgoing]:
        """Translate answers to pending commands to COMMAND_ACKs to the senders.

        `reason` of a failure that whoever executes the command does not report.
        """
        return [message for ack in acks for message in self._answer(ack, now_us, reason)]

    def tick(self, now_us: int) -> list[Outgoing]:
        """Fail the commands that have timed out; report the progress of running ones."""
        late = [token for token, pending in self._pending.items() if pending.deadline_us <= now_us]
        outgoing = [
            message
            for token in late
            for message in self._finish(token, failed("no answer in time"), now_us)
        ]
        for pending in self._pending.values():
            if (
                pending.progress is not None
                and now_us - pending.reported_us >= PROGRESS_INTERVAL_US
            ):
                outgoing += _in_progress(pending, now_us)
        return outgoing

    def _is_addressed(self, message: Message) -> bool:
        """Whether a command is for this component; requests may be for all systems."""
        if message.target_system == 0 and message.command in _OPEN_TO_ALL_SYSTEMS:
            return message.target_component in {0, self._component}
        return is_for_us(message, self._system_id, self._component)

    def _handle(
        self, command: Command, sender: Sender, now_us: int, *, repeated: bool
    ) -> list[Outgoing]:
        earlier = self._earlier(command, sender, now_us, repeated=repeated)
        if earlier is not None:
            return earlier
        ignored = ignored_parameter(command)
        if ignored is not None:
            answer = denied(f"parameter {ignored} is set but has no effect")
            return self._reply(command.number, answer, sender)
        executed = self._execute_here(command, sender, now_us)
        if executed is not None:
            return executed
        normalised = self._normalised(command)
        if isinstance(normalised, Answer):
            return self._reply(command.number, normalised, sender)
        if not self._forward(command, normalised, sender, now_us, answer=True):
            answer = temporarily_rejected("too many commands wait for their answers")
            return self._reply(command.number, answer, sender)
        return []

    def _execute_here(self, command: Command, sender: Sender, now_us: int) -> list[Outgoing] | None:
        """Answer to a command of the link or the parameters; None for any other."""
        for handler in self._local_handlers:
            answer = handler(command, sender, now_us)
            if isinstance(answer, PendingAnswer):
                self._await_answer(answer.token, command, sender, now_us)
                return []
            if answer is not None:
                return self._reply(command.number, answer, sender)
        return None

    def _reply(self, number: int, answer: Answer, sender: Sender) -> list[Outgoing]:
        """Send a final answer with its messages, and with the reason of a refusal."""
        to = None if answer.to_all else sender.address
        reply = [
            _acknowledge(number, answer.result, sender),
            *(Outgoing(message, to) for message in answer.messages),
        ]
        if answer.reason:
            text = f"{name_of(number)} {REFUSALS[answer.result]}: {answer.reason}"
            chunks = self._texts.encode(_NOTICE if number in _READING else _WARNING, text)
            reply += [chunk._replace(to=sender.address) for chunk in chunks]
        return reply

    def _earlier(
        self, command: Command, sender: Sender, now_us: int, *, repeated: bool
    ) -> list[Outgoing] | None:
        """Answer to a command that is running or was answered recently; None for a new one."""
        for pending in self._pending.values():
            if pending.sender is None or pending.number != command.number:
                continue
            if pending.sender.identity == sender.identity and _same(pending.command, command):
                return _in_progress(pending, now_us)
            if pending.progress is not None:
                answer = temporarily_rejected("another one is being executed")
                return self._reply(command.number, answer, sender)
        known = self._history.answer(command, sender, now_us) if repeated else None
        return None if known is None else [_acknowledge(command.number, known, sender)]

    def _normalised(self, command: Command) -> Command | Answer:
        """The command in the form of the commander, or the answer that refuses it."""
        if command.number == mavlink.MAV_CMD_DO_SET_MODE:
            in_form = modes.command_from_do_set_mode(command)
            return denied(in_form) if isinstance(in_form, str) else in_form
        if command.number == MAV_CMD_DO_SET_STANDARD_MODE:
            in_form = modes.command_from_standard_mode(command)
            return failed(in_form) if isinstance(in_form, str) else in_form
        return command

    def _forward(
        self, original: Command, normalised: Command, sender: Sender, now_us: int, *, answer: bool
    ) -> bool:
        """Forward a command to the commander; return False when too many are pending."""
        if len(self._pending) >= MAX_PENDING:
            return False
        token = next(self._tokens)
        self._await_answer(token, original, sender if answer else None, now_us)
        self._commander.publish(_vehicle_command(normalised, sender, token, now_us))
        return True

    def _await_answer(
        self, token: int, command: Command, sender: Sender | None, now_us: int
    ) -> None:
        """Add a pending command; without a sender its answer is not sent."""
        self._pending[token] = _Pending(
            number=command.number,
            command=command,
            sender=sender,
            deadline_us=now_us + ANSWER_LIMIT_US,
        )

    def _answer(self, ack: VehicleCommandAck, now_us: int, reason: str) -> list[Outgoing]:
        pending = self._pending.get(ack.token)
        if pending is None:
            return []
        if ack.result != _IN_PROGRESS:
            return self._finish(ack.token, Answer(ack.result, reason=reason), now_us)
        pending.progress = min(max(ack.progress, 0), PROGRESS_UNKNOWN)
        pending.deadline_us = now_us + PROGRESS_LIMIT_US
        return _in_progress(pending, now_us)

    def _finish(self, token: int, answer: Answer, now_us: int) -> list[Outgoing]:
        """Remove a pending command and send its final answer."""
        pending = self._pending.pop(token)
        if pending.sender is None:
            return []
        self._history.store_answer(pending.command, pending.sender, answer.result, now_us)
        return self._reply(pending.number, answer, pending.sender)


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
    """Answer a sender with COMMAND_ACK; all peers receive that of what changes the vehicle.

    As from PX4 they see whose order the vehicle obeys. That of a request is its sender's alone.
    """
    message = mavlink.MAVLink_command_ack_message(
        command=number,
        result=result,
        target_system=sender.system,
        target_component=sender.component,
    )
    return Outgoing(message, sender.address if number in _READING else None)


def _in_progress(pending: _Pending, now_us: int) -> list[Outgoing]:
    """IN_PROGRESS for a command with known progress whose sender awaits an answer."""
    if pending.sender is None or pending.progress is None:
        return []
    pending.reported_us = now_us
    answer = _acknowledge(pending.number, _IN_PROGRESS, pending.sender)
    answer.message.progress = pending.progress
    return [answer]
