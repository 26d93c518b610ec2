from random import Random

from dst.scheduler import Scheduler
from dst.world.network import Conditions, Path, corrupt


def delivered(conditions: Conditions, count: int = 200, seed: int = 1) -> list[bytes]:
    scheduler, received = Scheduler(seed), list[bytes]()
    path = Path(scheduler, "up", received.append, conditions)
    for number in range(count):
        path.send(number.to_bytes(4))
    scheduler.run_until(60.0)
    return received


def test_a_perfect_path_delivers_everything_once() -> None:
    assert sorted(delivered(Conditions())) == [number.to_bytes(4) for number in range(200)]


def test_datagrams_arrive_after_their_delay() -> None:
    scheduler, arrivals = Scheduler(1), list[float]()
    path = Path(
        scheduler, "up", lambda _: arrivals.append(scheduler.now_s), Conditions(delay_s=0.3)
    )
    path.send(b"x")
    scheduler.run_until(1.0)
    assert arrivals == [0.3]


def test_loss_and_duplication_follow_their_rates() -> None:
    assert 80 < len(delivered(Conditions(loss=0.5))) < 120
    assert 280 < len(delivered(Conditions(duplication=0.5))) < 320


def test_jitter_reorders() -> None:
    received = delivered(Conditions(jitter_s=1.0))
    assert received != sorted(received)


def test_corruption_changes_a_datagram() -> None:
    random = Random(1)
    for _ in range(100):
        assert corrupt(b"abcd", random) != b"abcd"
    assert len(delivered(Conditions(corruption=1.0))) == 200


def test_the_same_seed_has_the_same_faults() -> None:
    conditions = Conditions(loss=0.2, duplication=0.2, corruption=0.2, jitter_s=0.5)
    assert delivered(conditions) == delivered(conditions)
    assert delivered(conditions) != delivered(conditions, seed=2)


def test_nothing_arrives_while_the_path_is_down() -> None:
    scheduler, received = Scheduler(1), list[bytes]()
    path = Path(scheduler, "up", received.append, Conditions(delay_s=1.0))
    path.send(b"on its route when the path went down")
    path.is_up = False
    path.send(b"sent while it was down")
    scheduler.run_until(2.0)
    path.is_up = True
    path.send(b"afterwards")
    scheduler.run_until(4.0)
    assert received == [b"afterwards"]
