"""An operator looks back at what was flown, in a real Chromium and without a broker."""

import base64
import io
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import requests
from PIL import Image

from afarcloud.numbers import format_time
from edge_server.api.routes.planning.fields import EXAMPLE
from tests.support.browser import TEST_TIMEOUT_S, console_journey, link_at
from tests.support.geotiff import geotiff
from tests.support.pmtiles import archive_at, vector_archive_at
from tests.support.system import short_plan
from tests.unit.edge_server.documents import VEHICLE_LOG, mission, mission_report, plan, telemetry
from tests.unit.edge_server.program import Program, program_in

RUNNING, FINISHED = 2, 3
PICTURES = 3
XMP = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/" drone-dji:GpsLatitude="{latitude}" '
    'drone-dji:GpsLongitude="-3.7382" drone-dji:RelativeAltitude="+40.0" '
    'drone-dji:GimbalYawDegree="+30.0" drone-dji:GimbalPitchDegree="-90.0" '
    'drone-dji:GimbalRollDegree="+0.0" Camera:PerspectiveFocalLength="4.5" '
    'Camera:PrincipalPoint="3.15,2.3625"/>'
)
"""Straight down, the top of the picture to the north-east."""
MAP_COLOUR = (200, 80, 160)


class Archive:
    """Reports of a broker to a running edge server."""

    def __init__(self, program: Program) -> None:
        self._program = program

    def ask(self, method: str, path: str, role: str, body: Any) -> None:
        headers = {"Authorization": f"Bearer {self._program.key(role)}"}
        url = self._program.url + path
        answer = requests.request(method, url, json=body, headers=headers, timeout=30)
        assert answer.ok, answer.text

    def put_file(self, path: str, data: bytes) -> None:
        headers = {
            "Authorization": f"Bearer {self._program.key('broker')}",
            "Content-Type": "application/octet-stream",
        }
        url = self._program.url + path
        answer = requests.patch(url, data=data, headers=headers, timeout=30)
        assert answer.ok, answer.text

    def send(self, kind: str, **fields: Any) -> None:
        self.ask("POST", f"/{kind}/", "broker", telemetry(kind) | fields)

    def report(self, status: int) -> None:
        self.ask("POST", "/mission_report/", "broker", mission_report(status, 3, 3, 3))


def jpeg(red: int, latitude: float) -> bytes:
    """A picture of one colour, larger than any screen shows it in the list."""
    out = io.BytesIO()
    xmp = XMP.format(latitude=latitude).encode()
    Image.new("RGB", (1200, 900), (red, 120, 60)).save(out, "JPEG", xmp=xmp)
    return out.getvalue()


def fly(archive: Archive) -> None:
    """Fly one mission to the north with pictures and measurements."""
    archive.ask("PUT", "/vehicles/1", "broker", {"link_state": "connected"})
    archive.ask("POST", "/plans/", "operator", plan(mission()))
    archive.ask("POST", "/broker/commands/1/ack", "broker", {"status": "accepted"})
    began = format_time(datetime.now(UTC))
    archive.report(RUNNING)
    for number in range(PICTURES):
        place = {"latitude": 40.4434 + number * 2e-4, "longitude": -3.7382}
        archive.send("state_vector", sequence_number=number, **place)
        data = jpeg(60 * number, 40.4436 + number * 1e-4)
        archive.send(
            "image",
            sequence_number=number,
            image_size=len(data),
            frame=base64.b64encode(data).decode(),
        )
        (one,) = telemetry("observation")["observation_array"]
        measured = [{**one, "result_value": 18.0 + 3 * number}]
        archive.send("observation", sequence_number=number, observation_array=measured, **place)
    archive.report(FINISHED)
    log = b"ULog" + bytes(99_996)
    times = {"started_at": began, "ended_at": format_time(datetime.now(UTC))}
    described = VEHICLE_LOG | times | {"size_bytes": len(log)}
    archive.ask("PUT", "/vehicles/1/logs/flown", "broker", described)
    archive.put_file("/vehicles/1/logs/flown?offset=0&is_last=true", log)


@contextmanager
def farm_of(folder: Path) -> Iterator[tuple[Program, dict[str, str]]]:
    """Run an edge server with a flight, a draft, a field and maps; gives an administrator's key."""
    with program_in(folder / "farm") as program:
        program.start()
        archive = Archive(program)
        fly(archive)
        draft = short_plan() | {"dispatch": False, "name": "Draft"}
        archive.ask("POST", "/plans/", "operator", draft)
        archive.ask("POST", "/fields/", "operator", EXAMPLE)
        maps = folder / "farm" / "maps"
        maps.mkdir()
        (maps / "Aerial.pmtiles").write_bytes(archive_at(40.4434, -3.7382, MAP_COLOUR))
        (maps / "Lake.pmtiles").write_bytes(vector_archive_at(40.4434, -3.7382, "water"))
        (maps / "North.tif").write_bytes(
            geotiff(Image.new("F", (40, 40), 1.0), -3.7392, 40.4444, 5e-5)
        )
        (maps / "Broken.pmtiles").write_bytes(b"not a map")
        yield program, {"Authorization": f"Bearer {program.key('admin')}"}


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_flight_is_looked_back_at(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, farm_of(tmp_path) as (program, headers):
        take("look_back", OPERATOR_LINK=link_at(program.url, headers, "operator", "juan"))


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_stop_is_above_each_dialog(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, farm_of(tmp_path) as (program, headers):
        admin = link_at(program.url, headers, "admin", "ana")
        take("stop_in_dialogs", ADMIN_LINK=admin, DRAFT="2", FIELD="1")
