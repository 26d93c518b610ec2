"""The page of measurements carries the thesis's figures that the bench compares with."""

import re
from pathlib import Path

import pytest

from tests.bench.seed_table import THESIS

PAGE = Path(__file__).parents[2] / "docs/explanation/first-system.md"


@pytest.mark.parametrize("kind", THESIS)
def test_the_page_shows_the_figures_of_the_thesis(kind: str) -> None:
    (row,) = re.findall(rf"^\| {kind} \| (.*) \|$", PAGE.read_text(), re.MULTILINE)
    shown = [float(cell.split(",")[0]) for cell in row.split("|")]
    without, with_queues = THESIS[kind]
    assert shown == [
        *(without.propagation, with_queues.propagation),
        *(without.processing, with_queues.processing),
        round(without.memory, 1),
    ]
