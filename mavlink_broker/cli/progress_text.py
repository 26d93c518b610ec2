"""Prints the progress of a plan: a line for every change, or every report as JSON."""

import json
from collections.abc import Callable
from typing import Any, Final

from afarcloud import wire
from afarcloud.enumerations import AlarmCode, CommandType, Status
from afarcloud.plan import Mission

_REPORT: Final = wire.Kind.MISSION_REPORT.value
_CODES: Final = frozenset(AlarmCode)


class ProgressPrinter:
    """Prints reports as lines; every change once."""

    def __init__(self, missions: tuple[Mission, ...], write: Callable[[str], None]) -> None:
        self._write = write
        self._kinds = {
            (mission.mission_id, command.command_id): command.command_type_id
            for mission in missions
            for command in mission.command_array
        }
        self._last: dict[tuple[Any, ...], Any] = {}

    def take(self, kind: str, body: dict[str, Any]) -> None:
        """Print a report; state vectors and poses are not printed."""
        match kind:
            case "mission_report":
                self._mission(body)
            case "vehicle":
                self._vehicle(body)
            case "alarm":
                code = body["alarm_code_id"]
                name = AlarmCode(code).name if code in _CODES else f"code {code}"
                self._write(
                    f"vehicle {body['vehicle_id']}: ALARM {name}: {body.get('message', '')}"
                )
            case "image":
                size = body["image_size"]
                self._write(f"vehicle {body['vehicle_id']}: image {body['name']}, {size} bytes")
            case "observation":
                for one in body["observation_array"]:
                    value = f"{one['result_value']:g} {one['result_uom']}"
                    self._write(f"vehicle {body['vehicle_id']}: {one['observed_property']} {value}")

    def _mission(self, report: dict[str, Any]) -> None:
        mission_id = report["mission_id"]
        for command in report["command_report_array"]:
            command_id, message = command["command_id"], command.get("message")
            state = Status(command["command_status_id"])
            if self._has_changed((mission_id, command_id), (state, message), Status.NOT_STARTED):
                name = CommandType(self._kinds[mission_id, command_id]).name
                self._write_status(
                    f"mission {mission_id}, command {command_id} {name}", state, message
                )
        state, message = Status(report["mission_status_id"]), report.get("message")
        if self._has_changed((mission_id,), (state, message), Status.NOT_STARTED):
            self._write_status(f"mission {mission_id}", state, message)

    def _vehicle(self, body: dict[str, Any]) -> None:
        state = body.get("link_state"), body.get("mode"), body.get("armed")
        if self._has_changed(("vehicle", body["vehicle_id"]), (state, None), None):
            link, mode, armed = state
            arms = "" if armed is None else ", armed" if armed else ", disarmed"
            text = f"{link}, {body.get('autopilot')}, {mode or 'mode unknown'}{arms}"
            self._write(f"vehicle {body['vehicle_id']}: {text}")

    def _has_changed(self, key: tuple[Any, ...], state: tuple[Any, str | None], first: Any) -> bool:
        before = self._last.get(key, (first, None))
        self._last[key] = state
        return bool(before != state)

    def _write_status(self, who: str, state: Status, message: str | None) -> None:
        self._write(f"{who}: {state.name}" + (f" ({message})" if message else ""))


class JsonPrinter:
    """Prints every report as a line of JSON, in its envelope."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write

    def take(self, kind: str, body: dict[str, Any]) -> None:
        """Print a report."""
        self._write(json.dumps({kind: body}))
