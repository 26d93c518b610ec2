"""JSON to types and back; the only file that knows envelopes and spells error paths.

Every kind is read in its envelope, `{"pose": {...}}`, or bare, and written bare. A bare mission
is read as a plan of one mission. Other systems' spellings are imported first. Faults carry the
path in the document as it was sent, envelope left out.
"""

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import StrEnum
from itertools import islice
from typing import Any, Final, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from afarcloud.commands import TAG_PREFIX
from afarcloud.faults import MOST_FAULTS, Fault, InvalidError, SyntaxFaultError
from afarcloud.importers.canonical import import_event_document, import_names, import_plan
from afarcloud.importers.document import Imported
from afarcloud.importers.spellings import ENVELOPES, SPELLINGS
from afarcloud.numbers import FIELD_RULE, Model, parse_number
from afarcloud.plan import Event, LatestStateVector, Plan
from afarcloud.state import Alarm, Battery, Image, MissionReport, ObservationList, Pose, StateVector

_Model = TypeVar("_Model", bound=Model)


class Kind(StrEnum):
    """What a document is; the value is its envelope key and its place in a URL."""

    PLAN = "plan"
    EVENT = "event"
    LATEST_STATE_VECTOR = "latest_state_vector"
    POSE = "pose"
    BATTERY = "battery"
    IMAGE = "image"
    OBSERVATION = "observation"
    STATE_VECTOR = "state_vector"
    MISSION_REPORT = "mission_report"
    ALARM = "alarm"


MODELS: Final[Mapping[Kind, type[Model]]] = {
    Kind.PLAN: Plan,
    Kind.EVENT: Event,
    Kind.LATEST_STATE_VECTOR: LatestStateVector,
    Kind.POSE: Pose,
    Kind.BATTERY: Battery,
    Kind.IMAGE: Image,
    Kind.OBSERVATION: ObservationList,
    Kind.STATE_VECTOR: StateVector,
    Kind.MISSION_REPORT: MissionReport,
    Kind.ALARM: Alarm,
}

TELEMETRY: Final = (
    Kind.POSE,
    Kind.BATTERY,
    Kind.IMAGE,
    Kind.OBSERVATION,
    Kind.STATE_VECTOR,
    Kind.MISSION_REPORT,
    Kind.ALARM,
)
"""The kinds that go up to the cloud, in no order."""

_IMPORTERS: Final = {Kind.PLAN: import_plan, Kind.EVENT: import_event_document}

_CODES: Final = {"mission_id": (400, "NO_MISSION_ID"), "command_array": (404, "NO_COMMANDS")}
"""AFarCloud's validation codes for a field that is missing or empty."""


class DuplicateNameError(ValueError):
    """An object of a JSON text has a member twice."""


def unique_members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make an object of its members, as `object_pairs_hook`; raises DuplicateNameError."""
    found = dict(pairs)
    if len(found) != len(pairs):
        ((name, _),) = Counter(name for name, _ in pairs).most_common(1)
        raise DuplicateNameError(f"an object has the member {name[:64]!a} twice")
    return found


def parse_json(raw: bytes, parse_constant: Callable[[str], Any] | None = None) -> Any:
    """Parse bytes as JSON; NaN, Infinity and what underflows fail later with their path.

    `parse_constant` takes NaN and the infinities, and may raise SyntaxFaultError.

    A name that occurs twice in an object is refused: who reads the first one and who reads the
    last one would fly to different places (RFC 8259, section 4; RFC 7493, section 2.3).

    Raises:
        SyntaxFaultError: if the bytes are not UTF-8 or not JSON, nest too deep, repeat a name or
            hold an integer with more digits than Python converts.
    """
    try:
        return json.loads(
            raw.decode("utf-8"),
            object_pairs_hook=unique_members,
            parse_float=parse_number,
            parse_constant=parse_constant,
        )
    except DuplicateNameError as error:
        raise SyntaxFaultError((Fault("", str(error)),)) from None
    except UnicodeDecodeError as error:
        raise SyntaxFaultError((Fault("", f"not UTF-8 at byte {error.start}"),)) from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno} column {error.colno}"
        raise SyntaxFaultError((Fault("", f"not JSON: {error.msg} at {place}"),)) from None
    except RecursionError:
        raise SyntaxFaultError((Fault("", "arrays and objects nest too deep"),)) from None
    except ValueError:  # Python converts no more digits, to be safe from slow conversions
        limit = sys.get_int_max_str_digits()
        raise SyntaxFaultError((Fault("", f"a number has more than {limit} digits"),)) from None


def read(kind: Kind, document: Any) -> Model:
    """Turn a parsed document of a known kind into its type.

    Raises:
        InvalidError: with one fault per faulty field.
    """
    body = _without_envelope(kind, document)
    if not isinstance(body, dict):
        article = "an" if kind.value[0] in "aeio" else "a"
        raise InvalidError((Fault("", f"must be a JSON object with {article} {kind.value}"),))
    prefix = ""
    if kind is Kind.PLAN and _is_mission(body):
        body, prefix = {"missions": [body]}, "missions.0."
    imported = _IMPORTERS.get(kind, import_names)(body)
    return _typed(MODELS[kind], imported, prefix)


def _is_mission(body: dict[str, Any]) -> bool:
    names = {SPELLINGS.get(name, name) for name in body}
    return "missions" not in names and not names.isdisjoint({"vehicle_id", "command_array"})


def read_as(model: type[_Model], body: Any) -> _Model:
    """Turn a parsed bare object in canonical spelling into a type.

    Raises:
        InvalidError: with one fault per faulty field.
    """
    if not isinstance(body, dict):
        raise InvalidError((Fault("", "must be a JSON object"),))
    return _typed(model, Imported(body), "")


def _typed(model: type[_Model], imported: Imported, prefix: str) -> _Model:
    """Validate an imported document by its type; faults name the place as it was sent."""
    faults, uncounted = list(imported.faults), 0
    try:
        typed = model.model_validate(imported.document)
    except ValidationError as error:
        found, uncounted = _first_faults(model, error, imported)
        faults += found
    except RecursionError:
        faults.append(Fault("", "nests too deep"))
    if faults:
        in_envelope = tuple(f._replace(path=f.path.removeprefix(prefix)) for f in faults)
        raise InvalidError(in_envelope, uncounted)
    return typed


_MANY_FAULTS: Final = 1000
_MOST_MEMBERS: Final = 1000  # More than any AFarCloud object has


def _first_faults(
    model: type[_Model], error: ValidationError, imported: Imported
) -> tuple[list[Fault], int]:
    """Give the first faults as they were sent, and how many there are besides, at most.

    Pydantic lists all errors or none, and to list a hundred thousand stops every thread for
    seconds. Of so many, those of the document's first parts are listed.
    """
    total = error.error_count()
    errors: Sequence[ErrorDetails] = ()
    if total <= _MANY_FAULTS:
        errors = error.errors(include_url=False, include_input=False)
    else:
        cut: list[int] = []
        try:
            model.model_validate(_first_parts(imported.document, cut))
        except ValidationError as smaller:
            listed = smaller.errors(include_url=False, include_input=False)
            # Of an object that was cut, what is missing may be in the part that was left out
            errors = [one for one in listed if not cut or one["type"] != "missing"]
    found = (
        fault._replace(path=imported.sent_path(fault.path))
        for fault in _faults(errors)
        if not imported.is_unread(fault.path)
    )
    first = list(islice(found, MOST_FAULTS))
    if total > _MANY_FAULTS:
        return first or [Fault("", "has too many faults to list them")], total - len(first)
    return first, len(errors) - len(first) if len(first) == MOST_FAULTS else 0


def _first_parts(value: Any, cut: list[int]) -> Any:
    """Cut lists and objects to their first members; notes the sizes of objects so cut."""
    if isinstance(value, list):
        return [_first_parts(one, cut) for one in value[:MOST_FAULTS]]
    if isinstance(value, dict):
        if len(value) > _MOST_MEMBERS:
            cut.append(len(value))
        members = islice(value.items(), _MOST_MEMBERS)
        return {name: _first_parts(one, cut) for name, one in members}
    return value


def read_plan(raw: bytes) -> Plan:
    """Read a plan from bytes; raises SyntaxFaultError or InvalidError."""
    plan = read(Kind.PLAN, parse_json(raw))
    if not isinstance(plan, Plan):
        raise TypeError(type(plan))
    return plan


def write(model: Model) -> dict[str, Any]:
    """Give the canonical bare JSON object; what is not set is left out."""
    return model.model_dump(mode="json", exclude_none=True)


def envelope_of(document: Mapping[str, Any]) -> str:
    """The canonical key of the envelope that an object with one member is."""
    (key,) = document
    return ENVELOPES.get(key, key)


def _without_envelope(kind: Kind, document: Any) -> Any:
    if isinstance(document, dict) and len(document) == 1 and envelope_of(document) == kind.value:
        (body,) = document.values()
        return body
    return document


def _faults(errors: Sequence[ErrorDetails]) -> Iterable[Fault]:
    for error in errors:
        if error["type"] == "too_short" and _has_deeper(errors, error["loc"]):
            continue  # A list counts only its valid entries; the invalid one has its own fault.
        steps = [str(s) for s in error["loc"] if not str(s).startswith(TAG_PREFIX)]
        context = error.get("ctx", {})
        if error["type"] == FIELD_RULE:
            steps.append(context["field"])
        elif error["type"] in {"union_tag_invalid", "union_tag_not_found"}:
            steps.append("command_type_id")
        path = ".".join(steps)
        code, name = _code_of(error["type"], steps[-1] if steps else "")
        yield Fault(path, _message(error), code, name)


def _has_deeper(errors: Sequence[ErrorDetails], place: tuple[int | str, ...]) -> bool:
    return any(len(e["loc"]) > len(place) and e["loc"][: len(place)] == place for e in errors)


def _code_of(error_type: str, field: str) -> tuple[int | None, str | None]:
    if error_type in {"missing", "too_short"} and field in _CODES:
        return _CODES[field]
    return None, None


def _message(error: ErrorDetails) -> str:
    """Return in one sentence what is wrong; the input itself is never echoed."""
    context = error.get("ctx", {})
    match error["type"]:
        case "union_tag_invalid" | "union_tag_not_found":
            return "must be a known command type, 1 to 11"
        case "missing":
            return "is required"
        case "extra_forbidden":
            return "is not a known field"
        case "too_short":
            return f"is too short: at least {context['min_length']}"
        case "too_long":
            return f"is too long: at most {context['max_length']}"
        case _:
            message = error["msg"].removeprefix("Value error, ")
            return message.replace("Input should", "must", 1)
