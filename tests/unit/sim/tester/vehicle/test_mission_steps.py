"""The commands of a mission, found again in its items."""

import itertools
from typing import Any

import pytest
from hypothesis import given, settings

from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import GENERIC
from sim.tester.vehicle.mission_steps import Item, steps
from tests.support.translated_missions import missions, over_the_wire, stretches_of


def items_of(messages: list[Any]) -> list[Item]:
    return [
        Item(
            command=m.command,
            param1=m.param1,
            param2=m.param2,
            param3=m.param3,
            param4=m.param4,
            x=m.x,
            y=m.y,
            z=m.z,
        )
        for m in messages
    ]


def items(*commands: int, place: int = 1) -> list[Item]:
    return [Item(command=command, x=place, y=place, z=5.0) for command in commands]


@settings(max_examples=40)
@given(missions())
def test_a_person_finishes_what_the_plan_calls_a_command(mission: Mission) -> None:
    for plan in stretches_of(mission, GENERIC):
        found = steps(items_of(over_the_wire(plan)))
        assert [step.last for step in found] == list(plan.done_item)


@settings(max_examples=40)
@given(missions())
def test_every_item_but_the_hold_at_the_end_belongs_to_one_step(mission: Mission) -> None:
    for plan in stretches_of(mission, GENERIC):
        found = steps(items_of(over_the_wire(plan)))
        assert found[0].first == 0
        assert all(before.last + 1 >= after.first for before, after in itertools.pairwise(found))
        assert found[-1].last >= len(plan.items) - 2
        assert found[-1].lands == plan.ends_on_ground


@pytest.mark.parametrize(
    ("commands", "cut", "last_title"),
    [
        ((22, 16), [(0, 1)], "take off to 0.0000001, 0.0000001, 5 m"),
        ((178, 16, 16, 17), [(0, 1), (2, 2)], "fly to 0.0000001, 0.0000001, 5 m"),
        ((16, 1000, 2000, 93), [(0, 0), (1, 3)], "take pictures"),
        ((16, 1000, 93, 2000, 93), [(0, 0), (1, 4)], "take pictures"),
        ((16, 2000, 93, 1000, 2000, 93), [(0, 2), (3, 5)], "take pictures"),
        ((16, 16, 2000, 16, 2000, 93), [(0, 0), (1, 5)], "take a panorama"),
        ((2500, 2501), [(0, 0), (1, 1)], "stop the video of stream 0"),
        ((115, 16, 115, 21), [(0, 1), (2, 3)], "land at 0.0000001, 0.0000001, 5 m"),
        ((195, 16, 18, 197, 20), [(0, 1), (2, 3), (4, 4)], "return home and land"),
        ((31000,), [(0, 0)], "command 31000"),
        ((178,), [(0, 0)], "command 178"),
        ((17,), [(0, 0)], "hold at 0.0000001, 0.0000001, 5 m"),
    ],
)
def test_missions_of_other_hands_are_cut_too(
    commands: tuple[int, ...], cut: list[tuple[int, int]], last_title: str
) -> None:
    found = steps(items(*commands))
    assert [(step.first, step.last) for step in found] == cut
    assert found[-1].title == last_title


def test_a_waypoint_elsewhere_is_not_a_part_of_the_take_off() -> None:
    found = steps([*items(22), *items(16, place=2)])
    assert [(step.first, step.last) for step in found] == [(0, 0), (1, 1)]


def test_no_mission_has_no_steps() -> None:
    assert steps([]) == ()
