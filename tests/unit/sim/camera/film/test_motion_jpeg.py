"""A film holds its frames as they were, and plays whenever its writing ended."""

import io
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.camera.film import motion_jpeg
from sim.camera.film.motion_jpeg import Film, FilmFullError


class Kept(io.BytesIO):
    """A file that can be read after it was closed."""

    def close(self) -> None:
        self.content = self.getvalue()


def chunks(content: bytes) -> dict[str, bytes]:
    """Chunks and lists of a RIFF level, one after the other."""
    found, at = {}, 0
    while at < len(content):
        name, size = struct.unpack_from("<4sI", content, at)
        body = content[at + 8 : at + 8 + size]
        assert len(body) == size
        key = name.decode() if name != b"LIST" else body[:4].decode()
        found[key] = body if name != b"LIST" else body[4:]
        at += 8 + size + size % 2
    return found


def frames(movi: bytes) -> list[bytes]:
    found, at = [], 0
    while at < len(movi):
        name, size = struct.unpack_from("<4sI", movi, at)
        assert name == b"00dc"
        found.append(movi[at + 8 : at + 8 + size])
        at += 8 + size + size % 2
    return found


def played(content: bytes) -> tuple[dict[str, bytes], list[bytes]]:
    """Lists of a film, and its frames."""
    assert content[:4] == b"RIFF"
    assert content[8:12] == b"AVI "
    (size,) = struct.unpack_from("<I", content, 4)
    assert size == len(content) - 8
    lists = chunks(content[12:])
    return lists, frames(lists["movi"])


@given(st.lists(st.binary(min_size=1, max_size=60), max_size=12))
def test_the_frames_come_back_and_the_index_points_at_them(given_frames: list[bytes]) -> None:
    file = Kept()
    film = Film(file, 64, 48, 5.0)
    header_bytes = len(file.getvalue())
    grown = sum(film.add(frame) for frame in given_frames) + film.close()
    lists, found = played(file.content)
    assert found == given_frames
    assert grown == len(file.content) - header_bytes
    entries = list(struct.iter_unpack("<4sIII", lists["idx1"]))
    for (_, _, offset, size), frame in zip(entries, given_frames, strict=True):
        assert (b"movi" + lists["movi"])[offset + 8 : offset + 8 + size] == frame


@given(st.lists(st.binary(min_size=1, max_size=60), min_size=1, max_size=6))
def test_a_film_whose_end_never_came_plays_to_its_last_frame(given_frames: list[bytes]) -> None:
    file = Kept()
    film = Film(file, 64, 48, 5.0)
    for frame in given_frames:
        film.add(frame)
    assert played(file.getvalue())[1] == given_frames


def test_it_tells_its_size_its_rate_and_its_length() -> None:
    file = Kept()
    film = Film(file, 640, 480, 2.5)
    for _ in range(4):
        film.add(b"frame")
    film.close()
    header = chunks(played(file.content)[0]["hdrl"])
    interval_us, *_ = struct.unpack_from("<I", header["avih"])
    (count,) = struct.unpack_from("<I", header["avih"], 16)
    assert (interval_us, count) == (400_000, 4)
    assert struct.unpack_from("<II", header["avih"], 32) == (640, 480)
    stream = chunks(header["strl"])
    assert stream["strh"][:8] == b"vidsMJPG"
    scale, rate = struct.unpack_from("<II", stream["strh"], 20)
    assert rate / scale == 2.5


def test_a_full_film_stays_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_jpeg, "LARGEST_BYTES", 400)
    file = Kept()
    film = Film(file, 64, 48, 5.0)
    film.add(b"a" * 40)
    with pytest.raises(FilmFullError):
        film.add(b"b" * 400)
    film.close()
    assert played(file.content)[1] == [b"a" * 40]


def test_a_film_is_a_file_on_the_card(tmp_path: Path) -> None:
    path = tmp_path / "film.avi"
    film = Film(path.open("xb"), 64, 48, 5.0)
    film.add(b"frame")
    film.close()
    assert played(path.read_bytes())[1] == [b"frame"]
