"""Each state has a phase, and a phase returns only events that the table of states has."""

import inspect
import re

import pytest

from afarcloud.plan import Mission
from mavlink_broker.edge.wire import MissionWork
from mavlink_broker.mavlink.dialect import Route
from mavlink_broker.mission.mission_executor import MissionExecutor
from mavlink_broker.mission.phases.phase import Phase
from mavlink_broker.mission.states import TRANSITIONS, Event, State
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.broker_world import first_flight

SEGMENT_EVENTS = {Event.LIVE_NEXT, Event.ITEMS_NEXT, Event.GROUND_NEXT}


def phases() -> dict[State, Phase]:
    vehicle = Vehicle(1, Route(254, 191, 1, 1))
    work = MissionWork(
        work_id=1, plan_id="1", vehicle_id=1, mission=Mission.model_validate(first_flight())
    )
    return MissionExecutor(work, vehicle, Reporter(vehicle, "session"))._phases


def returned_events(phase: Phase) -> set[Event]:
    source = inspect.getsource(type(phase))
    events = {Event[name] for name in re.findall(r"\bEvent\.([A-Z_]+)", source)}
    return events | (SEGMENT_EVENTS if "event_of_segment()" in source else set())


def test_each_state_has_a_phase_of_its_own() -> None:
    assert set(phases()) == set(State)
    assert len({type(phase) for phase in phases().values()}) == len(State)


@pytest.mark.parametrize("state", State)
def test_a_phase_returns_only_events_of_its_state(state: State) -> None:
    for event in returned_events(phases()[state]):
        assert (state, event) in TRANSITIONS


@pytest.mark.parametrize("state", State)
def test_no_phase_inherits_from_the_phase_of_another_state(state: State) -> None:
    others = {type(phase) for other, phase in phases().items() if other is not state}
    assert others.isdisjoint(type(phases()[state]).__mro__)
