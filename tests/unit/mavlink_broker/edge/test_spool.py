"""The spool on disk: one broker at a time, words before pictures, a bound that holds."""

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool import (
    LOCK,
    MIB,
    PICTURES,
    WORDS,
    Spool,
    SpoolBusyError,
    SpoolError,
)
from tests.support.spooled_posts import numbers, picture, post


def opened(folder: Path, most_bytes: int = MIB) -> Spool:
    return Spool(folder, most_bytes=most_bytes)


def numbered(spool: Spool, *posts: Post) -> list[Post]:
    for one in posts:
        one.kept_as = spool.next_number()
    return list(posts)


def left_in(spool: Spool) -> list[int]:
    """Which posts an earlier run has left."""
    return numbers(list(spool.take_left()))


def long(number: int) -> dict[str, Any]:
    return {"sequence_number": number, "text": "x" * 1000}


def kept(spool: Spool, posts: list[Post]) -> list[int]:
    return numbers([one for one in posts if one.kept_as is not None and one.kept_as in spool])


def test_what_waits_is_there_for_the_next_run_in_order(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    words = numbered(spool, post(number=1), post(number=2), post(number=3))
    spool.keep_words(words)
    spool.keep_pictures(numbered(spool, picture(4)))
    spool.settle(frozenset({words[1].kept_as or 0}))
    spool.close()
    again = opened(tmp_path)
    left = list(again.take_left())
    assert numbers(left) == [1, 3, 4]
    assert [one.idempotency_key for one in left[:2]] == [
        "mission_report-1",
        "mission_report-3",
    ]
    assert again.next_number() > max(one.kept_as or 0 for one in left)


def test_a_spool_that_is_not_needed_writes_nothing(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    spool.settle(frozenset())
    assert spool.writes == 0
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]


def test_two_brokers_cannot_have_one_folder(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    with pytest.raises(SpoolBusyError, match="another broker"):
        opened(tmp_path)
    spool.close()
    opened(tmp_path).close()


def test_a_broker_that_was_killed_holds_nobody_up(tmp_path: Path) -> None:
    """The lock goes with the process."""
    words = f"Spool(Path({str(tmp_path)!r}), most_bytes=1000); os.kill(os.getpid(), 9)"
    imports = "import os; from pathlib import Path; from mavlink_broker.edge.spool import Spool; "
    ended = subprocess.run([sys.executable, "-c", imports + words], check=False)
    assert ended.returncode == -9
    opened(tmp_path).close()


def _is_a_file(folder: Path) -> None:
    folder.write_text("not a folder")


def _has_a_folder_for_words(folder: Path) -> None:
    (folder / WORDS).mkdir(parents=True)


def _has_a_link_for_a_lock(folder: Path) -> None:
    folder.mkdir()
    (folder / LOCK).symlink_to("/dev/null")


@pytest.mark.parametrize("spoil", [_is_a_file, _has_a_folder_for_words, _has_a_link_for_a_lock])
def test_a_folder_that_cannot_be_used_says_so(
    spoil: Callable[[Path], None], tmp_path: Path
) -> None:
    spoil(tmp_path / "broker")
    with pytest.raises(SpoolError, match="broker"):
        opened(tmp_path / "broker")


def test_rubbish_is_counted_and_everything_else_is_told(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    spool.keep_words(numbered(spool, post(number=1)))
    spool.close()
    with (tmp_path / WORDS).open("ab") as file:
        file.write(b"\x00\xff rubbish\n\n{}\n")
    again = opened(tmp_path)
    assert again.damaged == 3
    assert left_in(again) == [1]
    again.keep_words(numbered(again, post(number=2)))
    again.close()
    assert left_in(opened(tmp_path)) == [1, 2]


def test_pictures_have_half_of_the_room_and_the_oldest_are_kept(tmp_path: Path) -> None:
    spool = opened(tmp_path, 20_000)
    pictures = numbered(spool, *(picture(n, 3000) for n in range(6)))
    with pytest.raises(OSError, match="used up"):
        spool.keep_pictures(pictures)
    assert kept(spool, pictures) == [0, 1, 2]


def test_a_small_picture_does_not_overtake_one_that_has_no_room(tmp_path: Path) -> None:
    spool = opened(tmp_path, 20_000)
    pictures = numbered(spool, picture(0, 6000), picture(1, 6000), picture(2, 10))
    with pytest.raises(OSError, match="used up"):
        spool.keep_pictures(pictures)
    assert kept(spool, pictures) == [0]


def test_pictures_give_way_to_words(tmp_path: Path) -> None:
    spool = opened(tmp_path, 20_000)
    pictures = numbered(spool, picture(0, 8000))
    spool.keep_pictures(pictures)
    words = numbered(spool, *(post(number=n, body=long(n)) for n in range(14)))
    spool.keep_words(words)
    assert kept(spool, words) == list(range(14))
    assert spool.take_given_up() == {pictures[0].kept_as}
    assert spool.take_given_up() == frozenset()
    assert (tmp_path / PICTURES).stat().st_size == 0


def test_of_words_beyond_the_bound_the_first_are_kept(tmp_path: Path) -> None:
    spool = opened(tmp_path, 3000)
    words = numbered(spool, *(post(number=n, body=long(n)) for n in range(5)))
    spool.keep_words(words[:1])
    with pytest.raises(OSError, match="used up"):
        spool.keep_words(words[1:])
    assert kept(spool, words) == [0, 1]
    spool.close()
    assert (tmp_path / WORDS).stat().st_size <= 3000
    assert left_in(opened(tmp_path)) == [0, 1]


def test_the_bound_holds_however_much_comes_and_goes(tmp_path: Path) -> None:
    spool = opened(tmp_path, 10_000)
    last: list[Post] = []
    for number in range(200):
        words = numbered(spool, post(number=number, body={"n": number, "text": "x" * 1000}))
        spool.keep_words(words)
        assert (tmp_path / WORDS).stat().st_size <= 10_000
        spool.settle(frozenset(one.kept_as or 0 for one in last))
        last = words
    spool.close()
    assert [one.body["n"] for one in opened(tmp_path).take_left()] == [199]


def test_pictures_give_way_to_words_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spool = opened(tmp_path)
    pictures = numbered(spool, picture(0, 5000))
    spool.keep_pictures(pictures)
    write = os.write

    def write_if_there_is_room(descriptor: int, words: bytes) -> int:
        if (tmp_path / PICTURES).stat().st_size:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(descriptor, words)

    monkeypatch.setattr(os, "write", write_if_there_is_room)
    words = numbered(spool, post(number=1))
    spool.keep_words(words)
    assert kept(spool, words) == [1]
    assert kept(spool, pictures) == []
    assert spool.take_given_up() == {pictures[0].kept_as}
