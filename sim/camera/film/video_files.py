"""Films that are being made: a frame is rendered and appended, and the last order ends the film.

A frame that was left out shows what the one before it did, so that a film lasts as long as what it
shows.
"""

import io
from pathlib import Path
from typing import Final

from PIL import Image as PillowImage

from sim.camera.film.motion_jpeg import Film
from sim.camera.film.orders import Frame
from sim.camera.film.picture_file import Stored
from sim.camera.picture import render

QUALITY: Final = 75  # Of a film's frames
NOTHING: Final = Stored(0, 0)


class VideoFiles:
    """Every film that has begun and not ended."""

    def __init__(self) -> None:
        self._films: dict[str, Film] = {}

    def take(self, frame: Frame) -> Stored:
        """Append a frame, or end the film.

        Raises:
            OSError: if the film cannot be begun or goes no further; one that exists is not
                written over.
        """
        if frame.is_end:
            film = self._films.pop(frame.path, None)
            return NOTHING if film is None else _ended(film, frame.place)
        film = self._films.get(frame.path)
        is_new = film is None
        if film is None:
            path = Path(frame.path)
            path.parent.mkdir(parents=True, exist_ok=True)
            lens = frame.lens
            film = Film(path.open("xb"), lens.width_px, lens.height_px, frame.rate_hz)
            self._films[frame.path] = film
        grown = film.extend(frame.place)
        return Stored(grown + film.add(jpeg_of(frame, QUALITY)), int(is_new))

    def close(self) -> None:
        """End what has been left open."""
        while self._films:
            _, film = self._films.popitem()
            film.close()


def _ended(film: Film, frames: int) -> Stored:
    """A film of so many frames, as far as the file has room for them."""
    try:
        grown = film.extend(frames)
    finally:
        index = film.close()
    return Stored(grown + index, 0)


def jpeg_of(frame: Frame, quality: int) -> bytes:
    """What a frame shows, as a JPEG of a quality of 1 to 95."""
    stream = io.BytesIO()
    PillowImage.fromarray(render(frame.shot).colour).save(stream, "JPEG", quality=quality)
    return stream.getvalue()
