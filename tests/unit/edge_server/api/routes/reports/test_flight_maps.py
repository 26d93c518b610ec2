"""The map of a survey is made on demand, kept in the archive, and goes with its flight."""

import base64
import io
import sqlite3
import threading
from typing import Any

import pytest
from PIL import Image

from edge_server.archive import upkeep
from edge_server.pictures import footprint, mosaics
from edge_server.pictures.program import UnreadableError
from tests.support.polling import wait_until
from tests.unit.edge_server.archive.flown import begin, send
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import JPEG

POLL_S = 0.1
"""Another process makes a map; each look at it is a request, which costs this one time."""
XMP = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/" drone-dji:GpsLatitude="40.4436" '
    'drone-dji:GpsLongitude="{longitude}" drone-dji:RelativeAltitude="+40.0" '
    'drone-dji:GimbalYawDegree="+30.0" drone-dji:GimbalPitchDegree="-90.0" '
    'drone-dji:GimbalRollDegree="+0.0" Camera:PerspectiveFocalLength="4.5" '
    'Camera:PrincipalPoint="3.15,2.3625"{band}/>'
)


def taken(longitude: float, band: str = "") -> bytes:
    """A small picture straight down."""
    out = io.BytesIO()
    xmp = XMP.format(longitude=longitude, band=band and f' Camera:BandName="{band}"').encode()
    Image.new("RGB", (64, 48), (40, 160, 40)).save(out, "JPEG", xmp=xmp)
    return out.getvalue()


def fly(edge: Edge, *pictures: bytes) -> None:
    begin(edge)
    for number, data in enumerate(pictures):
        frame = base64.b64encode(data).decode()
        send(edge, "image", sequence_number=number, image_size=len(data), frame=frame)


@pytest.fixture
def survey(edge: Edge) -> Edge:
    fly(edge, taken(-3.7382), taken(-3.7380), JPEG)
    return edge


def made(edge: Edge, query: str = "") -> Any:
    answer = edge.ask("POST", f"/flights/1/map{query}", "operator")
    assert answer.status_code == 202, answer.json
    about = f"/flights/1/map{query}"
    wait_until(lambda: edge.get(about)["state"] != "making", period_s=POLL_S)
    return edge.get(f"/flights/1/map{query}")


def test_a_map_is_made_of_the_pictures_that_look_down(survey: Edge) -> None:
    before = survey.get("/flights/1/map")
    assert (before["state"], before["url"], before["corners"]) == ("none", None, None)
    assert survey.ask("GET", "/flights/1/map/picture", "farmer").status_code == 404
    found = made(survey)
    assert (found["state"], found["pictures"], found["reason"]) == ("ready", 2, None)
    assert len(found["corners"]) == 4
    assert 0.0 < found["metres_per_px"] < 1.0
    answer = survey.ask("GET", found["url"], "farmer")
    assert answer.content_type == "image/webp"
    assert max(Image.open(io.BytesIO(answer.data)).size) == mosaics.LONGEST_SIDE_PX


def test_a_flight_without_a_survey_has_no_map(edge: Edge) -> None:
    fly(edge, taken(-3.7382), JPEG)
    answer = edge.ask("POST", "/flights/1/map", "operator")
    assert answer.status_code == 409
    assert "look down" in answer.get_data(as_text=True)
    assert edge.ask("POST", "/flights/9/map", "operator").status_code == 404
    assert edge.ask("GET", "/flights/9/map", "operator").status_code == 404


def test_pictures_of_each_band_make_a_map_of_their_own(edge: Edge) -> None:
    """As a camera for colours and one for the vegetation index beside it take them."""
    places = (-3.7382, -3.7380, -3.7378)
    fly(edge, *(taken(place, band) for place in places for band in ("RGB", "NDVI", "RedEdge")))
    bands = [one["band"] for one in edge.get("/flights/1/footprints", "farmer")]
    assert bands == ["rgb", "ndvi", "other"] * 3
    colours, index = made(edge), made(edge, "?band=ndvi")
    assert [(one["band"], one["pictures"]) for one in (colours, index)] == [("rgb", 3), ("ndvi", 3)]
    shown = [edge.ask("GET", one["url"], "farmer").data for one in (colours, index)]
    assert shown[0] != shown[1]
    assert edge.get("/flights/1/map?band=nir")["state"] == "none"
    assert edge.ask("POST", "/flights/1/map?band=nir", "operator").status_code == 409
    assert edge.ask("GET", "/flights/1/map?band=red", "operator").status_code == 422


def test_the_maps_that_are_made_are_listed_the_newest_last(survey: Edge) -> None:
    assert survey.get("/flight_maps/") == []
    made(survey)
    (first,) = survey.get("/flight_maps/", "farmer")
    assert (first["flight_id"], first["vehicle_id"], first["band"]) == (1, 1, "rgb")
    assert first["plan_name"] == "North field"
    about = survey.get("/flights/1/map")
    assert all(first[name] == about[name] for name in ("url", "corners", "pictures", "made_at"))
    assert survey.get(f"/flight_maps/?after={first['id']}") == []
    made(survey)
    (again,) = survey.get("/flight_maps/")
    assert again["flight_id"] == 1
    assert survey.get("/flight_maps/?vehicle_id=2") == []


def test_a_key_lists_the_maps_of_its_own_vehicles(survey: Edge) -> None:
    made(survey)
    for vehicle_ids, count in (([2], 0), ([1, 2], 1)):
        body = {"name": f"drones-{count}", "role": "operator", "vehicle_ids": vehicle_ids}
        answer = survey.post("/keys/", body, "admin").json
        assert answer is not None
        headers = {"X-API-Key": answer["key"]}
        listed_maps = survey.ask("GET", "/flight_maps/", None, headers=headers).json
        assert listed_maps is not None
        assert len(listed_maps) == count


def listed(*names: str) -> str:
    """A band name as an element with one entry or several, as cameras with several bands write."""
    entries = "".join(f"<rdf:li>{name}</rdf:li>" for name in names)
    return f"><Camera:BandName><rdf:Seq>{entries}</rdf:Seq></Camera:BandName"


@pytest.mark.parametrize(
    ("named", "band"),
    [
        (' Camera:BandName="RGB"', "rgb"),
        (' Camera:BandName="NIR"', "nir"),
        ("><Camera:BandName>ndvi</Camera:BandName", "ndvi"),
        (listed("NDVI"), "ndvi"),
        (listed("Red", "Green", "Blue"), "rgb"),
        (listed("Red edge"), "other"),
        (listed("Red", "NIR"), "other"),
        (' Camera:BandName=""', "other"),
        ("", "rgb"),
    ],
)
def test_the_band_is_what_the_camera_has_named(named: str, band: str) -> None:
    assert footprint.band(f"<rdf:Description{named}/>".encode()) == band


def test_one_map_is_made_at_a_time(survey: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()

    def wait(*_: object, **__: object) -> mosaics.Mosaic:
        assert go_on.wait(30.0)
        raise UnreadableError("it has rained")

    monkeypatch.setattr(mosaics, "lay_out", wait)
    assert survey.ask("POST", "/flights/1/map", "operator").status_code == 202
    assert survey.get("/flights/1/map")["state"] == "making"
    assert survey.ask("POST", "/flights/1/map", "operator").status_code == 429
    go_on.set()
    wait_until(lambda: survey.get("/flights/1/map")["state"] == "failed")
    assert survey.get("/flights/1/map")["reason"] == "it has rained"
    monkeypatch.undo()
    assert made(survey)["state"] == "ready"


def test_a_map_goes_with_its_flight(survey: Edge) -> None:
    made(survey)
    with sqlite3.connect(survey.config.archive_path) as connection:
        connection.execute("UPDATE flight SET dropped = 1")
        while upkeep.drop_part(connection):
            pass
        assert connection.execute("SELECT count(*) FROM flight_map").fetchone() == (0,)


def test_an_archive_of_before_keeps_its_flights(survey: Edge) -> None:
    with sqlite3.connect(survey.config.archive_path) as connection:
        connection.execute("DROP TABLE flight_map")
    survey.context.archive.close()
    assert survey.get("/flights/1/map")["state"] == "none"
    assert made(survey)["state"] == "ready"


def test_a_farmer_sees_maps_and_makes_none(survey: Edge) -> None:
    assert survey.ask("POST", "/flights/1/map", "farmer").status_code == 403
    assert survey.ask("GET", "/flights/1/map", "farmer").status_code == 200
