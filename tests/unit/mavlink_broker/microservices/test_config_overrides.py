"""Parameters are overridden, and restored to their original values."""

import random

import pytest

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.config_overrides import OverriddenParameter, ParameterOverrider
from mavlink_broker.microservices.parameter import (
    MAX_CONTRADICTIONS,
    Limit,
    ParameterEncoding,
    Setting,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, received

REAL32 = mavlink.MAV_PARAM_TYPE_REAL32
TARGET = (Setting("CIRCLE_RATE", 12.0),)
OTHER = (Setting("CIRCLE_OPTIONS", 2.0),)
MOST = (Limit("FLW_TGT_MAX_VEL", 3.0),)
RENAMED = (Setting("WP_RADIUS_M", 3.0), Setting("WPNAV_RADIUS", 300.0))


class Vehicle:
    """Has the parameters that it has; others are not answered."""

    def __init__(self, **values: float) -> None:
        self.values = values
        self.writes: list[tuple[str, float]] = []
        self.late = 0.0
        self.frozen: set[str] = set()

    def answer(self, message: Message) -> list[Message]:
        name = message.param_id
        if name not in self.values:
            return []
        if message.get_type() == "PARAM_SET":
            self.writes.append((name, message.param_value))
            if name not in self.frozen:
                self.values[name] = message.param_value
        value = mavlink.MAVLink_param_value_message(name.encode(), self.values[name], REAL32, 9, 1)
        return [received(value)]


class Exchange:
    """A keeper and a vehicle that talk, over a link that may lose."""

    def __init__(self, vehicle: Vehicle, *, loss: float = 0.0, seed: int = 1) -> None:
        self.overrider = ParameterOverrider()
        self.vehicle = vehicle
        self.now = 0.0
        self.is_saved = True
        self._loss = loss
        self._dice = random.Random(seed)

    def run(self, seconds: float = 60.0) -> None:
        end = self.now + seconds
        trip = RoundTrip()
        sent: list[Message] = []
        while self.now < end:
            self.now += 0.05
            arrived = [received(message) for message in sent if self._arrives]
            answers = [a for message in arrived for a in self.vehicle.answer(message)]
            sent = self.overrider.tick(
                self.now, ROUTE, trip, ParameterEncoding.C_CAST, lambda: self.is_saved
            )
            for answer in answers:
                if self._arrives:
                    sent += self.overrider.receive(answer, self.now)

    @property
    def _arrives(self) -> bool:
        return self._dice.random() >= self._loss


@pytest.mark.parametrize("seed", range(10))
def test_overridden_parameters_are_restored(seed: int) -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=20.0, CIRCLE_OPTIONS=1.0), loss=0.2, seed=seed)
    exchange.overrider.set_overrides((TARGET, OTHER))
    before = exchange.overrider.is_settled
    exchange.run()
    assert (before, exchange.overrider.is_settled) == (False, True)
    assert exchange.vehicle.values == {"CIRCLE_RATE": 12.0, "CIRCLE_OPTIONS": 2.0}
    exchange.overrider.set_overrides(())
    exchange.run()
    assert exchange.vehicle.values == {"CIRCLE_RATE": 20.0, "CIRCLE_OPTIONS": 1.0}
    assert exchange.overrider.is_idle


def test_a_second_wish_does_not_forget_what_was_there_first() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=20.0))
    for wish in (12.0, 8.0):
        exchange.overrider.set_overrides(((Setting("CIRCLE_RATE", wish),),))
        exchange.run(5.0)
        assert exchange.vehicle.values == {"CIRCLE_RATE": wish}
    exchange.overrider.set_overrides(())
    exchange.run(5.0)
    assert exchange.vehicle.values == {"CIRCLE_RATE": 20.0}


def test_what_is_right_already_is_not_touched() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=12.0))
    exchange.overrider.set_overrides((TARGET,))
    exchange.run(5.0)
    exchange.overrider.set_overrides(())
    exchange.run(5.0)
    assert exchange.vehicle.writes == []


@pytest.mark.parametrize(("own", "held"), [(5.0, 3.0), (3.0, 3.0), (1.0, 1.0)])
def test_a_limit_leaves_a_lower_value_as_it_is(own: float, held: float) -> None:
    exchange = Exchange(Vehicle(FLW_TGT_MAX_VEL=own))
    exchange.overrider.set_overrides((MOST,))
    exchange.run(5.0)
    assert exchange.overrider.is_settled
    assert exchange.vehicle.values == {"FLW_TGT_MAX_VEL": held}
    exchange.overrider.set_overrides(())
    exchange.run(5.0)
    assert exchange.vehicle.values == {"FLW_TGT_MAX_VEL": own}
    assert len(exchange.vehicle.writes) == (2 if own > 3.0 else 0)
    assert exchange.overrider.is_idle


def test_a_limit_that_is_raised_is_no_more_than_the_original_value() -> None:
    exchange = Exchange(Vehicle(FLW_TGT_MAX_VEL=2.0))
    for limit, held in ((1.0, 1.0), (3.0, 2.0), (1.5, 1.5)):
        exchange.overrider.set_overrides(((Limit("FLW_TGT_MAX_VEL", limit),),))
        exchange.run(5.0)
        assert exchange.overrider.is_settled
        assert exchange.vehicle.values == {"FLW_TGT_MAX_VEL": held}
    exchange.overrider.set_overrides(())
    exchange.run(5.0)
    assert exchange.vehicle.values == {"FLW_TGT_MAX_VEL": 2.0}


def test_what_stays_requested_is_not_set_again() -> None:
    """Else what comes next waits for it, behind all that is restored first."""
    exchange = Exchange(Vehicle(CIRCLE_RATE=12.0, CIRCLE_OPTIONS=1.0))
    exchange.overrider.set_overrides((TARGET, OTHER))
    exchange.run()
    exchange.overrider.set_overrides((TARGET,))
    assert exchange.overrider.is_settled


def test_an_override_during_a_write_loses_neither() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=20.0, CIRCLE_OPTIONS=1.0))
    exchange.overrider.set_overrides((TARGET,))
    exchange.run(0.1)
    exchange.overrider.set_overrides((OTHER,))
    exchange.run(5.0)
    assert exchange.vehicle.values == {"CIRCLE_RATE": 20.0, "CIRCLE_OPTIONS": 2.0}


@pytest.mark.parametrize("there", [{"WP_RADIUS_M": 2.0}, {"WPNAV_RADIUS": 200.0}])
def test_the_spelling_that_the_vehicle_knows_is_used(there: dict[str, float]) -> None:
    exchange = Exchange(Vehicle(**there))
    exchange.overrider.set_overrides((RENAMED,))
    exchange.run()
    assert exchange.overrider.is_settled
    assert not exchange.overrider.refusals
    (value,) = exchange.vehicle.values.values()
    assert value in {3.0, 300.0}


def test_missing_and_unchanged_parameters_are_reported() -> None:
    vehicle = Vehicle(CIRCLE_OPTIONS=1.0)
    vehicle.frozen.add("CIRCLE_OPTIONS")
    exchange = Exchange(vehicle)
    exchange.overrider.set_overrides((TARGET, OTHER))
    exchange.run()
    assert exchange.overrider.is_settled
    refusals = exchange.overrider.refusals
    assert "no answer" in refusals["CIRCLE_RATE"]
    assert "keeps it at 1" in refusals["CIRCLE_OPTIONS"]
    exchange.overrider.set_overrides(())
    exchange.run()
    assert exchange.overrider.is_idle
    assert vehicle.values == {"CIRCLE_OPTIONS": 1.0}


class LateVehicle(Vehicle):
    """Obeys, while answers of before are received: a slow link that doubles and reorders them."""

    def answer(self, message: Message) -> list[Message]:
        before = self.values.get(message.param_id, 0.0)
        answers = super().answer(message)
        if message.get_type() == "PARAM_SET" and len(self.writes) <= MAX_CONTRADICTIONS:
            self.late = before if len(self.writes) == 1 else self.late
            name = message.param_id.encode()
            return [received(mavlink.MAVLink_param_value_message(name, self.late, REAL32, 9, 1))]
        return answers


def test_a_parameter_whose_refusal_was_a_late_answer_is_restored() -> None:
    exchange = Exchange(LateVehicle(CIRCLE_RATE=20.0))
    exchange.overrider.set_overrides((TARGET,))
    exchange.run()
    assert exchange.overrider.refusals
    assert exchange.vehicle.values == {"CIRCLE_RATE": 12.0}
    exchange.overrider.set_overrides(())
    exchange.run()
    assert exchange.vehicle.values == {"CIRCLE_RATE": 20.0}


def test_a_failed_restore_is_retried() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=20.0))
    exchange.overrider.set_overrides((TARGET,))
    exchange.run(5.0)
    exchange.vehicle.frozen.add("CIRCLE_RATE")
    exchange.overrider.set_overrides(())
    exchange.run(10.0)
    exchange.vehicle.frozen.clear()
    exchange.run(30.0)
    assert exchange.vehicle.values == {"CIRCLE_RATE": 20.0}


def test_nothing_is_set_before_it_has_been_noted_what_it_was() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=20.0))
    exchange.is_saved = False
    exchange.overrider.set_overrides((TARGET,))
    exchange.run()
    assert exchange.vehicle.writes == []
    assert exchange.overrider.overridden == {"CIRCLE_RATE": OverriddenParameter(20.0, (12.0,))}
    assert not exchange.overrider.refusals
    exchange.is_saved = True
    exchange.run(2.0)
    assert exchange.vehicle.values == {"CIRCLE_RATE": 12.0}


def test_overrides_of_an_earlier_run_are_restored_when_none_is_requested() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=12.0))
    exchange.overrider.load({"CIRCLE_RATE": OverriddenParameter(20.0, (5.0, 12.0))})
    exchange.run()
    assert exchange.vehicle.values == {"CIRCLE_RATE": 12.0}
    exchange.overrider.set_overrides(())
    exchange.run(2.0)
    assert exchange.vehicle.values == {"CIRCLE_RATE": 20.0}
    assert exchange.overrider.is_idle


def test_a_value_of_another_client_is_not_restored() -> None:
    exchange = Exchange(Vehicle(CIRCLE_RATE=15.0))
    exchange.overrider.load({"CIRCLE_RATE": OverriddenParameter(20.0, (12.0,))})
    exchange.overrider.set_overrides(())
    exchange.run(2.0)
    assert exchange.vehicle.writes == []
    assert exchange.overrider.is_idle


def test_a_value_that_a_vehicle_has_rounded_is_ours() -> None:
    assert OverriddenParameter(20.0, (7.6,)).is_ours(8.0)
    assert OverriddenParameter(20.0, (0.1,)).is_ours(0.10000000149011612)
    assert not OverriddenParameter(20.0, (7.6,)).is_ours(7.0)
