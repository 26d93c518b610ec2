"""Models of the ground stations in use against the vehicle's mission server, over bad links.

A client of another's design may give up; what it may not is believe in a plan that the vehicle
does not hold, nor leave the vehicle with anything but the old plan or the new one.
"""

from collections.abc import Callable, Sequence
from itertools import product

import pytest

from tests.support.lossy_link import Conditions
from tests.support.mission_clients import (
    DONE,
    Client,
    Download,
    MavproxyDownload,
    MavproxyUpload,
    MavsdkDownload,
    MavsdkUpload,
    Message,
    PersistentUpload,
    QgcDownload,
    QgcUpload,
)
from tests.support.mission_field import Field, plan_of

OLD, NEW = plan_of(7, height_m=5.0), plan_of(40, height_m=50.0)
LOSSES = (0.0, 0.05, 0.2, 0.3)
ROUND_TRIPS_S = (0.0, 0.3, 1.5)
UPLOADS: tuple[Callable[[Sequence[Message]], Client], ...] = (
    QgcUpload,
    MavsdkUpload,
    MavproxyUpload,
    PersistentUpload,
)
DOWNLOADS: tuple[Callable[[], Download], ...] = (QgcDownload, MavsdkDownload, MavproxyDownload)
MATRIX = list(product(LOSSES, ROUND_TRIPS_S, (False, True)))


def conditions(loss: float, round_trip_s: float, *, muddled: bool) -> Conditions:
    """A link; a muddled one duplicates and reorders a tenth each."""
    share = 0.1 if muddled else 0.0
    return Conditions(
        loss=loss,
        delay_us=round(round_trip_s * 5e5),
        duplication=share,
        reordering=share,
        hold_us=80_000,
    )


def a_field_with(plan: Sequence[Message], then: Conditions, seed: int = 1) -> Field:
    """A vehicle that holds a plan, and a link that has gone bad since."""
    field = Field(seed=seed)
    assert field.run(QgcUpload(plan)) == DONE
    field.link.degrade(then, then)
    return field


def holds(field: Field, plan: Sequence[Message]) -> bool:
    mission = field.vehicle.mission.value
    assert mission is not None
    return [(item.seq, item.param1, item.z) for item in mission.items] == [
        (item.seq, item.param1, item.z) for item in plan
    ]


def as_numbers(items: Sequence[Message]) -> list[tuple[float, ...]]:
    return [(i.seq, i.frame, i.command, i.param1, i.x, i.y, i.z) for i in items]


@pytest.mark.parametrize("upload", UPLOADS)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.thorough)])
def test_an_upload_ends_right_or_in_a_definite_error(
    upload: Callable[[Sequence[Message]], Client], seed: int
) -> None:
    for loss, round_trip_s, muddled in MATRIX:
        link = conditions(loss, round_trip_s, muddled=muddled)
        field = a_field_with(OLD, link, seed)
        outcome = field.run(upload(NEW))
        assert holds(field, NEW) or (holds(field, OLD) and outcome != DONE), (link, outcome)


@pytest.mark.parametrize("upload", UPLOADS)
@pytest.mark.parametrize("round_trip_s", [0.0, 0.3])
def test_a_clean_link_is_enough_for_everybody(
    upload: Callable[[Sequence[Message]], Client], round_trip_s: float
) -> None:
    for muddled in (False, True):
        field = a_field_with(OLD, conditions(0.0, round_trip_s, muddled=muddled))
        assert field.run(upload(NEW)) == DONE
        assert holds(field, NEW)


@pytest.mark.parametrize("download", DOWNLOADS)
def test_a_download_ends_right_or_in_a_definite_error(download: Callable[[], Download]) -> None:
    for loss, round_trip_s, muddled in MATRIX:
        link = conditions(loss, round_trip_s, muddled=muddled)
        field = a_field_with(NEW, link)
        client = download()
        if field.run(client) == DONE:
            received = [client.items[seq] for seq in range(len(NEW))]
            assert as_numbers(received) == as_numbers(NEW), link
        else:
            assert loss > 0.0 or round_trip_s > 1.0, link
        assert holds(field, NEW), link


@pytest.mark.first_case
@pytest.mark.parametrize("round_trip_s", [0.02, 0.3])
def test_a_persistent_client_brings_a_hundred_of_a_hundred_up_at_a_fifth_lost(
    round_trip_s: float,
) -> None:
    for seed in range(50):
        field = a_field_with(OLD, conditions(0.2, round_trip_s, muddled=seed % 2 == 1), seed)
        assert field.run(PersistentUpload(NEW)) == DONE
        assert holds(field, NEW)


@pytest.mark.thorough
def test_five_requests_outstanding_bring_a_hundred_of_a_hundred_at_a_fifth_lost() -> None:
    for seed in range(100):
        field = a_field_with(NEW, conditions(0.2, 0.02, muddled=True), seed)
        client = MavproxyDownload()
        assert field.run(client) == DONE
        assert as_numbers([client.items[seq] for seq in range(len(NEW))]) == as_numbers(NEW)


def test_a_ground_station_that_tries_again_gets_its_plan_through_at_a_fifth_lost() -> None:
    for seed in range(10):
        field = a_field_with(OLD, conditions(0.2, 0.02, muddled=False), seed)
        outcomes: list[str] = []
        while DONE not in outcomes and len(outcomes) < 20:
            outcomes.append(field.run(QgcUpload(NEW)))
        assert outcomes[-1] == DONE, outcomes
        assert holds(field, NEW)


def test_during_an_upload_a_download_is_served_and_a_second_upload_denied() -> None:
    field = a_field_with(OLD, conditions(0.0, 0.02, muddled=False))
    first, second, reader = QgcUpload(NEW), MavsdkUpload(plan_of(3)), MavsdkDownload()
    outcomes = field.run_all({255: first, 254: second, 253: reader})
    assert outcomes == {255: DONE, 254: "vehicle: 14", 253: DONE}
    assert as_numbers(list(reader.items.values())) == as_numbers(OLD)
    assert holds(field, NEW)


def test_an_uploader_that_vanishes_leaves_the_old_plan_and_the_next_upload_succeeds() -> None:
    field = a_field_with(OLD, Conditions())
    client = QgcUpload(NEW)
    for message in client.start(0.0):
        field.send([message], 254)
    field.pass_seconds(14.0)
    assert field.run(QgcUpload(plan_of(3))) == "vehicle: 14"
    field.pass_seconds(2.0)
    assert holds(field, OLD)
    assert field.run(QgcUpload(plan_of(3))) == DONE
