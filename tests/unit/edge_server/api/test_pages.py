"""Lists are bounded in bytes, and no list has more than a few pictures in memory."""

import base64
import gc
import tracemalloc
from typing import Any

import pytest

from edge_server.services.reports import listing
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import telemetry

JPEG = b"\xff\xd8\xff" + bytes(300_000) + b"\xff\xd9"


def walk(edge: Edge, path: str, headers: dict[str, str] | None = None) -> list[list[int]]:
    """Follow a list to its end; the ids of each page."""
    pages: list[list[int]] = []
    after = 0
    while True:
        options = {"headers": headers} if headers else {}
        role = None if headers else "operator"
        answer = edge.ask("GET", f"{path}?after={after}&limit=1000", role, **options)
        items: Any = answer.json
        if not items:
            return pages
        pages.append([item["id"] for item in items])
        after = pages[-1][-1]


@pytest.mark.first_case
@pytest.mark.parametrize("is_restricted", [False, True])
def test_a_page_ends_for_its_size_and_the_next_one_goes_on(
    edge: Edge, monkeypatch: pytest.MonkeyPatch, *, is_restricted: bool
) -> None:
    monkeypatch.setattr(listing, "MOST_BYTES", 2000)
    ids = [
        edge.report("pose", telemetry("pose", number, 1 + number % 3)).json["id"]  # type: ignore[index]  # it is an object
        for number in range(60)
    ]
    headers = None
    if is_restricted:
        body = {"name": "narrow", "role": "operator", "vehicle_ids": [1, 2, 3]}
        made = edge.post("/keys/", body, "admin").json
        assert made is not None
        headers = {"X-API-Key": made["key"]}
    pages = walk(edge, "/pose/", headers)
    assert [identifier for page in pages for identifier in page] == ids
    assert len(pages) >= 3


def test_a_thing_that_is_larger_than_a_page_is_a_page(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listing, "MOST_BYTES", 10)
    for number in range(3):
        edge.report("pose", telemetry("pose", number))
    assert walk(edge, "/pose/") == [[1], [2], [3]]


@pytest.mark.thorough
def test_a_list_of_pictures_has_few_of_them_in_memory(edge: Edge) -> None:
    picture = {"frame": base64.b64encode(JPEG).decode(), "image_size": len(JPEG)}
    number = 40
    for sequence_number in range(number):
        assert (
            edge.report("image", telemetry("image", sequence_number) | picture).status_code == 201
        )
    gc.collect()
    tracemalloc.start()
    try:
        assert len(edge.get("/image/?limit=1000")) == number
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 12 * len(JPEG)


def test_of_many_faults_fifty_are_reported_and_the_rest_is_counted(edge: Edge) -> None:
    body = telemetry("pose") | {f"unknown_{number}": number for number in range(20_000)}
    answer = edge.report("pose", body)
    assert answer.status_code == 422
    assert answer.json is not None
    faults = answer.json["detail"]["json"]
    assert len(faults) == 51
    assert faults[""] == ["and 19950 more faults"]
    assert len(answer.data) < 10_000


@pytest.mark.thorough
def test_many_faults_of_a_list_are_counted_too(edge: Edge) -> None:
    body = telemetry("observation") | {"observation_array": [{}] * 50_000}
    answer = edge.report("observation", body)
    assert answer.status_code == 422
    assert answer.json is not None
    assert len(answer.json["detail"]["json"]) == 51
    assert len(answer.data) < 20_000
