"""When a short disk costs flights, and how much they have to make free."""

import pytest

from edge_server.archive.shortage import PATIENCE_S, Room, can_help, wanted_bytes

LIMIT = 64


@pytest.mark.parametrize(
    ("free", "lacking", "short_for_s", "wanted"),
    [
        (63, 0, 0.0, 0),
        (0, 0, PATIENCE_S - 0.1, 0),
        (63, 0, PATIENCE_S, LIMIT),
        (64, 0, PATIENCE_S, 0),
        (15, 16, 0.0, 16),
        (16, 16, 0.0, 0),
        (16, 16, PATIENCE_S, LIMIT),
        (15, 100, 0.0, LIMIT),
        (64, 100, 0.0, 0),
    ],
)
def test_so_much_has_to_become_free(
    free: int, lacking: int, short_for_s: float, wanted: int
) -> None:
    assert wanted_bytes(Room(free, LIMIT, lacking), short_for_s) == wanted


@pytest.mark.parametrize(("droppable", "helps"), [(4, False), (5, True)])
def test_flights_help_if_they_bring_it_over_the_limit(droppable: int, helps: bool) -> None:
    assert can_help(Room(59, LIMIT), droppable, LIMIT) is helps
