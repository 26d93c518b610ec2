"""The statuses of a mission and its commands; a terminal one is never left.

LedgerError  a status that would follow a terminal one
"""

from collections.abc import Iterator, Sequence
from typing import Final

from afarcloud.commands import Command
from afarcloud.enumerations import Status
from afarcloud.state import MESSAGE_LENGTH, CommandReport, MissionReport

_SEPARATOR: Final = "; "


class LedgerError(Exception):
    """Exactly one terminal status per mission and per command."""


WHOLE_UP_TO: Final = 100
"""Commands of a mission whose every report lists all of them: AFarCloud's own limit."""


class MissionLedger:
    """What is reported of one mission."""

    def __init__(
        self,
        mission_id: int,
        commands: Sequence[Command],
        *,
        name: str = "",
        work_id: int | None = None,
        plan_id: str | None = None,
    ) -> None:
        """Start with a mission's commands, and what identifies it among all missions.

        `work_id` and `plan_id` show in its reports which flight of a `mission_id` they describe.
        """
        self.mission_id = mission_id
        self._work_id, self._plan_id = work_id, plan_id
        self._name = name
        self.status = Status.NOT_STARTED
        self.message: str | None = None
        self._ids = [command.command_id for command in commands]
        self._statuses = [Status.NOT_STARTED] * len(commands)
        self._messages: list[str | None] = [None] * len(commands)
        self._added: list[list[str]] = [[] for _ in commands]
        self._reported: list[tuple[Status, str | None]] | None = None  # As it was reported last

    @property
    def commands(self) -> tuple[Status, ...]:
        """Statuses of the commands in their order."""
        return tuple(self._statuses)

    @property
    def finished(self) -> int:
        """How many commands, counted from the first, have ended."""
        open_ones = (i for i, status in enumerate(self._statuses) if not status.is_terminal)
        return next(open_ones, len(self._statuses))

    @property
    def begun(self) -> int:
        """How many of these may have begun: up to the one behind the last that was flown.

        Others before it may have been skipped by another system.
        """
        flown = [i for i, status in enumerate(self._statuses) if status is Status.FINISHED]
        return min(max(flown, default=-1) + 2, self.finished)

    def name_of(self, index: int) -> str:
        """Name of a command among all commands ever; a restarted broker gives the same."""
        return f"{self._name}/{self.mission_id}/{self._ids[index]}"

    def restore(self, report: MissionReport) -> None:
        """Continue where an earlier report left off; terminal statuses are kept as they are."""
        known = {command.command_id: command for command in report.command_report_array}
        self.status = report.mission_status_id
        self.message = report.message
        for index, command_id in enumerate(self._ids):
            if command_id in known:
                self._statuses[index] = known[command_id].command_status_id
                self._messages[index] = known[command_id].message

    def remark(self, notes: Sequence[str]) -> None:
        """Set the message of the mission; its status stays."""
        if notes:
            self.message = _shorten(_SEPARATOR.join(notes))

    def replace_message(self, text: str) -> None:
        """Replace the message of the mission; its status stays."""
        self.message = _shorten(text)

    def note(self, index: int, notes: Sequence[str]) -> None:
        """Set the message of a command; its status stays."""
        if notes:
            self._messages[index] = _shorten(_SEPARATOR.join(notes))

    def add_note(self, index: int, text: str) -> None:
        """Add to the message of a command; its status stays."""
        self._added[index].append(text)

    def note_open(self, text: str) -> None:
        """Add a note to the first unfinished command, or to the last one."""
        self.add_note(min(self.finished, len(self._ids) - 1), text)

    @property
    def pause_note(self) -> str | None:
        """The last note of that command, also of an earlier report; None without any."""
        texts = list(self._texts())
        text = texts[min(self.finished, len(texts) - 1)]
        return None if text is None else text.rpartition(_SEPARATOR)[2]

    def set_command(self, index: int, status: Status, message: str | None = None) -> bool:
        """Change a command's status; whether it was another one.

        Raises:
            LedgerError: if the command has ended otherwise.
        """
        before = self._statuses[index]
        if before == status:
            return False
        if before.is_terminal:
            raise LedgerError(f"command {self._ids[index]} is {before.name}, not {status.name}")
        self._statuses[index] = status
        if message is not None:
            self._messages[index] = _shorten(message)
        return True

    def set_mission(self, status: Status, message: str | None = None) -> bool:
        """Change the mission's status; whether it was another one.

        Raises:
            LedgerError: if the mission has ended otherwise.
        """
        if self.status == status:
            return False
        if self.status.is_terminal:
            raise LedgerError(f"mission {self.mission_id} is {self.status.name}")
        self.status = status
        if message is not None:
            self.message = _shorten(message)
        return True

    def fail(self, reason: str, command: int | None = None) -> None:
        """End everything: one command FAILED, the other unfinished ones ABORTED.

        Without a named command it is the running one, or else the first unfinished one.
        """
        unfinished = [i for i, status in enumerate(self._statuses) if not status.is_terminal]
        if command is None or command not in unfinished:
            command = unfinished[0] if unfinished else None
        for index in unfinished:
            status = Status.FAILED if index == command else Status.ABORTED
            self.set_command(index, status, reason if index == command else None)
        self.set_mission(Status.FAILED, reason)

    def abort(self, reason: str) -> None:
        """End everything that has not ended as ABORTED.

        A command with notes, as of a pause, gets the reason too: its last note would look like it.
        """
        for index, status in enumerate(self._statuses):
            if not status.is_terminal:
                self.set_command(index, Status.ABORTED)
                if self._added[index] or self._messages[index]:
                    self.add_note(index, reason)
        self.set_mission(Status.ABORTED, reason)

    def report(self, *, vehicle_id: int, sequence_number: int) -> MissionReport:
        """Write it down for the cloud; remembers what it has written.

        A mission of more commands than AFarCloud's fixed array has room for is reported by what
        has changed since the last report and the first unfinished command; all of it in the first
        report and in the last one.
        """
        now = list(zip(self._statuses, self._texts(), strict=True))
        unfinished = self.finished
        before, self._reported = self._reported, now
        is_whole = before is None or self.status.is_terminal or len(now) <= WHOLE_UP_TO
        changed = {
            index
            for index, state in enumerate(now)
            if is_whole or before is None or before[index] != state or index == unfinished
        }
        return MissionReport(
            sequence_number=sequence_number,
            vehicle_id=vehicle_id,
            mission_id=self.mission_id,
            work_id=self._work_id,
            plan_id=self._plan_id,
            mission_status_id=self.status,
            message=self.message,
            command_report_array=tuple(
                CommandReport(command_id=self._ids[i], command_status_id=status, message=text)
                for i, (status, text) in enumerate(now)
                if i in changed
            ),
        )

    def _texts(self) -> Iterator[str | None]:
        """The message of each command: why its status is what it is, and the notes since."""
        for message, added in zip(self._messages, self._added, strict=True):
            parts = [message, *added] if message else added
            yield _shorten(_SEPARATOR.join(parts)) if parts else None


def _shorten(message: str) -> str:
    return message[:MESSAGE_LENGTH]
