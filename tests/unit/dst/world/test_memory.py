"""What counts as held by broker and edge server."""

from collections import deque
from datetime import UTC, datetime
from types import SimpleNamespace

from dst.world.memory import held_bytes
from edge_server.services.brokers import WorkSignal
from mavlink_broker.edge.outbox import Outbox
from mavlink_broker.pictures.attribution import Attribution, PictureCommand


def commands(count: int) -> Attribution:
    attribution = Attribution()
    for number in range(count):
        attribution.update(PictureCommand("1/PLAN", 7, number, number + 1, 0), float(number))
    return attribution


def test_what_grows_is_found_in_what_refers_to_it() -> None:
    few, many = held_bytes([commands(10)]), held_bytes({"fleet": (commands(500),)})
    assert many > few + 490 * 200


def test_objects_of_the_edge_server_count() -> None:
    signal = WorkSignal()
    before = held_bytes({"context": signal})
    signal.__dict__["waiting"] = [f"broker {number}" for number in range(1000)]
    assert held_bytes({"context": signal}) > before + 1000 * 50


def test_what_is_bounded_does_not_grow() -> None:
    assert held_bytes(commands(3000)) < 1.2 * held_bytes(commands(1500))


def test_each_object_counts_once_and_a_circle_ends() -> None:
    one: list[object] = ["text" * 1000]
    alone = held_bytes(one)
    assert held_bytes([one, one]) < alone + 200
    one.append(one)
    assert held_bytes(one) < alone + 200


def test_objects_of_others_end_the_search_but_not_those_made_of_the_products() -> None:
    class Fake(Outbox):
        """As the simulation's own client."""

    large = deque(["text"] * 10_000)
    assert held_bytes(SimpleNamespace(large=large)) == 0
    assert held_bytes(datetime.now(UTC)) == 0
    fake = Fake.__new__(Fake)
    fake.__dict__["large"] = large
    assert held_bytes(fake) > 80_000
