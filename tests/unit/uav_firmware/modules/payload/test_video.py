"""Video becomes a file while it is recorded, and one file for each recording."""

from tests.unit.uav_firmware.modules.payload.harness import PayloadHarness
from uav_firmware.cal.camera import Exposure, FilmGrowth
from uav_firmware.cal.files import Place
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult

START, STOP = PayloadCommand.VIDEO_START_CAPTURE, PayloadCommand.VIDEO_STOP_CAPTURE
FORMAT = PayloadCommand.STORAGE_FORMAT


class Recorder:
    """Records its calls; can be made to fail."""

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


def recording(**params: float) -> tuple[PayloadHarness, Recorder]:
    recorder = Recorder()
    harness = PayloadHarness(recorder=recorder, **params)  # type: ignore[arg-type]  # names of parameters
    harness.command(START, 0, 0, 0)
    return harness, recorder


def test_a_recording_has_the_parameters_rate() -> None:
    harness, recorder = recording(CAM_VIDEO_RATE=5.0, CAM_VIDEO_WIDTH=320)
    harness.run(4.0)
    harness.command(STOP, 0)
    harness.run(1.0)
    (film,) = recorder.films
    assert 19 <= len(film) <= 22
    assert recorder.rates_hz == [5.0]
    assert film[0].lens.width_px == 320
    assert not recorder.is_open


def test_a_video_keeps_its_size_when_the_parameter_changes() -> None:
    harness, recorder = recording(CAM_VIDEO_RATE=5.0, CAM_VIDEO_WIDTH=320)
    harness.run(1.0)
    harness.registry.set("CAM_VIDEO_RATE", 1.0)
    harness.registry.set("CAM_VIDEO_WIDTH", 640)
    harness.run(1.0)
    assert {exposure.lens.width_px for exposure in recorder.films[0]} == {320}
    assert 9 <= len(recorder.films[0]) <= 12
    harness.command(STOP, 0)
    harness.command(START, 0, 0, 0)
    harness.run(0.1)
    assert recorder.films[1][0].lens.width_px == 640
    assert recorder.rates_hz == [5.0, 1.0]


def test_every_recording_has_its_own_file() -> None:
    harness, recorder = recording()
    harness.run(1.0)
    harness.command(STOP, 0)
    harness.command(START, 0, 0, 0)
    harness.run(1.0)
    assert len(recorder.films) == 2
    assert recorder.is_open


def test_a_failing_camera_ends_the_recording_with_a_status_text() -> None:
    harness, recorder = recording()
    harness.run(1.0)
    recorder.works = False
    harness.run(1.0)
    assert harness.camera_status.recording_since_us == -1
    assert "Video ended: no sensor" in harness.status_texts()


def test_full_storage_ends_the_recording() -> None:
    harness, recorder = recording(CAM_STORAGE_SIZE=64.0)
    harness.run(1.0)
    recorder.growth = FilmGrowth(1 << 40)
    harness.run(1.0)
    assert harness.camera_status.recording_since_us == -1
    assert "the storage is full" in harness.status_texts()
    assert not recorder.is_open


def test_full_storage_refuses_a_recording() -> None:
    recorder = Recorder()
    harness = PayloadHarness(recorder=recorder, CAM_STORAGE_SIZE=1.0)
    harness.command(FORMAT, 1, 1)
    harness.run(0.1)
    assert harness.command(START, 0, 0, 0) == CommandResult.FAILED
    assert recorder.films == []
    assert "the storage is full" in harness.status_texts()


def test_format_is_rejected_while_a_video_is_being_stored() -> None:
    harness, recorder = recording()
    harness.run(1.0)
    recorder.is_busy = True
    harness.command(STOP, 0)
    harness.run(0.2)
    assert harness.command(FORMAT, 1, 1) == CommandResult.TEMPORARILY_REJECTED
    recorder.is_busy = False
    harness.run(0.2)
    assert harness.command(FORMAT, 1, 1) == CommandResult.ACCEPTED


def test_video_counts_as_used_space() -> None:
    harness, recorder = recording()
    recorder.growth = FilmGrowth(5 << 20)
    harness.run(0.2)
    assert harness.camera_status.used_mib == 5.0


def test_without_a_recorder_the_status_shows_recording() -> None:
    harness = PayloadHarness()
    harness.command(START, 0, 0, 0)
    harness.run(1.0)
    assert harness.camera_status.recording_since_us >= 0
