"""The output of `make sim`: one live line per vehicle on a terminal, plain log lines otherwise."""

import threading
from collections.abc import Mapping, Sequence
from typing import Any, Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TaskID, TextColumn
from rich.text import Text

TERMINAL = 3
"""mission_status_id and command_status_id from here on are final."""


def status_line(vehicle_id: int, vehicle: Mapping[str, Any] | None) -> str:
    """Describe a vehicle in one line."""
    if vehicle is None:
        return f"vehicle {vehicle_id}  not connected"
    parts = [f"vehicle {vehicle_id}", str(vehicle.get("link_state", "unknown"))]
    parts.append("armed" if vehicle.get("armed") else "disarmed")
    if vehicle.get("mode"):
        parts.append(str(vehicle["mode"]))
    if vehicle.get("altitude") is not None:
        parts.append(f"{vehicle['altitude']:6.1f} m")
    if vehicle.get("battery_percentage") is not None:
        parts.append(f"battery {vehicle['battery_percentage']:4.0%}")
    if vehicle.get("mission_id") is not None:
        parts.append(f"mission {vehicle['mission_id']}")
    return "  ".join(parts)


def mission_line(mission: Mapping[str, Any]) -> tuple[str, int, int]:
    """Give a mission's label, its number of ended commands and of all commands."""
    commands = mission["command_array"]
    ended = sum(int(command["command_status_id"]) >= TERMINAL for command in commands)
    name = mission.get("mission_status_name", mission["mission_status_id"])
    label = f"mission {mission['mission_id']}  vehicle {mission['vehicle_id']}  {name}"
    return label, ended, len(commands)


class Screen:
    """The output of one run; safe to call from the threads that read the programs' logs."""

    def __init__(self, *, plain: bool | None = None) -> None:
        self._console = Console(highlight=False, soft_wrap=True)
        self.plain = (not self._console.is_terminal) if plain is None else plain
        self._lock = threading.Lock()
        self._vehicle_lines: list[str] = []
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:.0f}/{task.total:.0f} commands"),
            console=self._console,
        )
        self._tasks: dict[int, TaskID] = {}
        self._last_said: dict[int, str] = {}
        self._live = Live(console=self._console, refresh_per_second=4, get_renderable=self._render)

    def __enter__(self) -> Self:
        if not self.plain:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if not self.plain:
            self._live.stop()

    def say(self, text: str) -> None:
        """Print lines above the live part."""
        with self._lock:
            self._console.print(Text(text))

    def log(self, program: str, line: str) -> None:
        """Show a program's log line; on a terminal only warnings and errors."""
        if self.plain or program == "sim" or " WARNING " in line or " ERROR " in line:
            self.say(f"[{program}] {line}")

    def vehicles(self, count: int, vehicles: Mapping[int, Mapping[str, Any]]) -> None:
        """Refresh the live line of each vehicle."""
        self._vehicle_lines = [status_line(n, vehicles.get(n)) for n in range(1, count + 1)]

    def missions(self, missions: Sequence[Mapping[str, Any]]) -> None:
        """Refresh the progress bar of each mission; plain: a line when something changed."""
        for mission in missions:
            label, ended, total = mission_line(mission)
            number = int(mission["mission_id"])
            if self.plain:
                text = f"{label}  {ended}/{total} commands"
                if self._last_said.get(number) != text:
                    self._last_said[number] = text
                    self.say(text)
                continue
            if number not in self._tasks:
                self._tasks[number] = self._progress.add_task(label, total=total)
            self._progress.update(self._tasks[number], completed=ended, description=label)

    def _render(self) -> Group:
        lines = [Text(line) for line in self._vehicle_lines]
        return Group(*lines, *([self._progress] if self._tasks else []))
