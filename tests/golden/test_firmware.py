"""What the firmware shows to an operator's tools, on record: parameters and telemetry.

`make golden` writes the records anew; the difference is then read in the version control.
"""

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path

from pymavlink.dialects.v20 import common

from tests.support.parameter_table import autopilot
from uav_firmware.modules.mavlink.telemetry.streams import STREAMS

FOLDER = Path(__file__).parent / "firmware"


def compare(name: str, rows: Sequence[Sequence[object]]) -> None:
    """Hold a table against its record, or write the record anew."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    path = FOLDER / name
    if os.environ.get("GOLDEN") == "rewrite":
        path.write_text(text.getvalue(), encoding="utf-8")
    assert text.getvalue().splitlines() == path.read_text(encoding="utf-8").splitlines()


def test_the_parameters_are_those_on_record(tmp_path: Path) -> None:
    registry = autopilot(tmp_path).registry
    declarations = [registry.declaration(name) for name in registry.names()]
    rows = [
        (d.name, "INT32" if d.is_integer else "REAL32", f"{d.default:g}", f"{d.minimum:g}",
         f"{d.maximum:g}", d.unit, d.meaning)
        for d in declarations
    ]  # fmt: skip
    assert len(rows) > 100
    compare(
        "parameters.csv", [("name", "type", "default", "minimum", "maximum", "unit", "what"), *rows]
    )


def name_of(message_id: int) -> str:
    known = common.mavlink_map.get(message_id)
    return str(message_id) if known is None else str(known.msgname)


def test_the_telemetry_is_that_on_record() -> None:
    rows = [
        (name_of(stream.message_id), f"{stream.ground_station_hz:g}", f"{stream.onboard_hz:g}")
        for stream in STREAMS
    ]
    compare("streams.csv", [("message", "ground_station_hz", "onboard_hz"), *rows])
