"""Video becomes a file while it is recorded, and one file for each recording."""

from tests.unit.uav_firmware.modules.payload.bench import Bench
from uav_firmware.cal.camera import Exposure, FilmGrowth
from uav_firmware.cal.files import Place
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult

START, STOP = PayloadCommand.VIDEO_START_CAPTURE, PayloadCommand.VIDEO_STOP_CAPTURE
FORMAT = PayloadCommand.STORAGE_FORMAT


class Recorder:
    """Notes what it is told; breaks when it is asked to."""

    def __init__(self) -> None:
        self.films: list[list[Exposure]] = []
        self.rates_hz: list[float] = []
        self.is_open = False
        self.is_busy = False
        self.works = True
        self.growth = FilmGrowth(0)

    def begin_film(self, exposure: Exposure, rate_hz: float) -> Place:
        self._check()
        self.films.append([exposure])
        self.rates_hz.append(rate_hz)
        self.is_open = True
        return (f"{len(self.films)}.avi",)

    def add_frame(self, exposure: Exposure) -> None:
        self._check()
        self.films[-1].append(exposure)

    def end_film(self) -> None:
        self.is_open = False

    def film_growth(self) -> FilmGrowth:
        growth, self.growth = self.growth, FilmGrowth(0)
        return growth

    def _check(self) -> None:
        if not self.works:
            raise OSError("no sensor")


def recording(**params: float) -> tuple[Bench, Recorder]:
    recorder = Recorder()
    bench = Bench(recorder=recorder, **params)  # type: ignore[arg-type]  # names of parameters
    bench.ask(START, 0, 0, 0)
    return bench, recorder


def test_a_recording_is_a_film_at_the_parameters_rate() -> None:
    bench, recorder = recording(CAM_VIDEO_RATE=5.0, CAM_VIDEO_WIDTH=320)
    bench.run(4.0)
    bench.ask(STOP, 0)
    bench.run(1.0)
    (film,) = recorder.films
    assert 19 <= len(film) <= 22
    assert recorder.rates_hz == [5.0]
    assert film[0].lens.width_px == 320
    assert not recorder.is_open


def test_a_film_keeps_its_size_when_the_parameter_changes_meanwhile() -> None:
    bench, recorder = recording(CAM_VIDEO_RATE=5.0, CAM_VIDEO_WIDTH=320)
    bench.run(1.0)
    bench.registry.set("CAM_VIDEO_RATE", 1.0)
    bench.registry.set("CAM_VIDEO_WIDTH", 640)
    bench.run(1.0)
    assert {exposure.lens.width_px for exposure in recorder.films[0]} == {320}
    assert 9 <= len(recorder.films[0]) <= 12
    bench.ask(STOP, 0)
    bench.ask(START, 0, 0, 0)
    bench.run(0.1)
    assert recorder.films[1][0].lens.width_px == 640
    assert recorder.rates_hz == [5.0, 1.0]


def test_every_recording_has_its_own_film() -> None:
    bench, recorder = recording()
    bench.run(1.0)
    bench.ask(STOP, 0)
    bench.ask(START, 0, 0, 0)
    bench.run(1.0)
    assert len(recorder.films) == 2
    assert recorder.is_open


def test_a_camera_that_breaks_ends_the_recording_and_says_so() -> None:
    bench, recorder = recording()
    bench.run(1.0)
    recorder.works = False
    bench.run(1.0)
    assert bench.seen.recording_since_us == -1
    assert "Video ended: no sensor" in bench.said()


def test_a_full_storage_ends_the_recording() -> None:
    bench, recorder = recording(CAM_STORAGE_SIZE=64.0)
    bench.run(1.0)
    recorder.growth = FilmGrowth(1 << 40)
    bench.run(1.0)
    assert bench.seen.recording_since_us == -1
    assert "the storage is full" in bench.said()
    assert not recorder.is_open


def test_no_film_begins_on_a_full_storage() -> None:
    recorder = Recorder()
    bench = Bench(recorder=recorder, CAM_STORAGE_SIZE=1.0)
    bench.ask(FORMAT, 1, 1)
    bench.run(0.1)
    assert bench.ask(START, 0, 0, 0) == CommandResult.FAILED
    assert recorder.films == []
    assert "the storage is full" in bench.said()


def test_nothing_is_formatted_while_a_film_is_on_its_way_to_the_card() -> None:
    bench, recorder = recording()
    bench.run(1.0)
    recorder.is_busy = True
    bench.ask(STOP, 0)
    bench.run(0.2)
    assert bench.ask(FORMAT, 1, 1) == CommandResult.TEMPORARILY_REJECTED
    recorder.is_busy = False
    bench.run(0.2)
    assert bench.ask(FORMAT, 1, 1) == CommandResult.ACCEPTED


def test_what_films_take_is_counted() -> None:
    bench, recorder = recording()
    recorder.growth = FilmGrowth(5 << 20)
    bench.run(0.2)
    assert bench.seen.used_mib == 5.0


def test_without_a_recorder_the_camera_still_says_that_it_records() -> None:
    bench = Bench()
    bench.ask(START, 0, 0, 0)
    bench.run(1.0)
    assert bench.seen.recording_since_us >= 0
