"""The pack: energy goes one way, voltage sags, charge is counted."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.noise import generators
from sim.sensors.battery import (
    INTERNAL_RESISTANCE_OHM,
    Battery,
    current_for_power_a,
    open_circuit_voltage_v,
)

HOVER_W = 177.0

charges = st.floats(0.0, 1.0)


def battery(*, charge: float = 1.0, factor: float = 0.0) -> Battery:
    return Battery(generators(1)["battery"], capacity_ah=5.2, initial_charge=charge, factor=factor)


def test_a_full_pack_has_sixteen_point_eight_volts_and_an_empty_one_thirteen() -> None:
    assert open_circuit_voltage_v(1.0) == pytest.approx(16.8)
    assert open_circuit_voltage_v(0.0) == pytest.approx(13.2)


@given(charges, charges)
def test_more_charge_is_more_voltage(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert open_circuit_voltage_v(low) <= open_circuit_voltage_v(high)


@given(st.floats(0.0, 2000.0), charges)
def test_terminal_voltage_times_current_is_the_power_that_was_asked_for(
    power_w: float, charge: float
) -> None:
    open_circuit_v = open_circuit_voltage_v(charge)
    current_a = current_for_power_a(power_w, open_circuit_v)
    most_w = open_circuit_v**2 / (4.0 * INTERNAL_RESISTANCE_OHM)
    given_w = (open_circuit_v - current_a * INTERNAL_RESISTANCE_OHM) * current_a
    assert given_w == pytest.approx(min(power_w, most_w), rel=1e-6, abs=1e-6)


def test_a_load_makes_the_voltage_sag() -> None:
    idle, loaded = battery(), battery()
    idle.draw(0.0, 1.0)
    loaded.draw(500.0, 1.0)
    assert loaded.voltage_v < idle.voltage_v - 0.5


def test_a_hover_lasts_about_as_long_as_that_of_a_real_quadrotor() -> None:
    pack = battery()
    minutes = 0
    while pack.charge > 0.1:
        pack.draw(HOVER_W, 60.0)
        minutes += 1
    assert 18 <= minutes <= 28


def test_charge_only_ever_falls() -> None:
    pack = battery()
    remaining = []
    for _ in range(2000):
        pack.draw(HOVER_W, 1.0)
        remaining.append(pack.charge)
    assert remaining == sorted(remaining, reverse=True)
    assert remaining[-1] == 0.0


def test_the_charge_falls_by_the_current_drawn() -> None:
    pack = battery(charge=0.8)
    pack.draw(HOVER_W, 600.0)
    assert pack.charge == pytest.approx(0.8 - pack.read(0).current_a / 6.0 / 5.2)


def test_an_empty_pack_gives_nothing() -> None:
    pack = battery(charge=0.0)
    pack.draw(HOVER_W, 1.0)
    reading = pack.read(0)
    assert (reading.voltage_v, reading.current_a, pack.charge) == (0.0, 0.0, 0.0)


def test_the_monitor_is_noisy() -> None:
    noisy = battery(factor=1.0)
    noisy.draw(HOVER_W, 1.0)
    readings = [noisy.read(0) for _ in range(100)]
    assert len({reading.voltage_v for reading in readings}) == 100
