"""The live view shows what the camera sees from one order to the other, and no frame without."""

from tests.unit.uav_firmware.modules.payload.harness import PayloadHarness
from uav_firmware.cal.camera import Exposure
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult

START, STOP = PayloadCommand.VIDEO_START_STREAMING, PayloadCommand.VIDEO_STOP_STREAMING
URI = "http://127.0.0.1:14581/stream"


class Screen:
    """Notes what it is shown."""

    uri = URI

    def __init__(self, *, starts_at_once: bool = False) -> None:
        self.starts_at_once = starts_at_once
        self.shown: list[Exposure] = []
        self.closed = 0
        self.reason = ""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        assert rate_hz == 4.0
        self.shown.append(exposure)
        return self.reason

    def close(self) -> None:
        self.closed += 1


def test_frames_are_streamed_at_the_video_rate() -> None:
    screen = Screen()
    harness = PayloadHarness(streamer=screen)
    harness.run(2.0)
    assert screen.shown == []
    assert harness.command(START, 1) == CommandResult.ACCEPTED
    harness.run(5.0)
    assert 19 <= len(screen.shown) <= 22
    assert harness.command(STOP, 1) == CommandResult.ACCEPTED
    count = len(screen.shown)
    harness.run(2.0)
    assert len(screen.shown) == count
    assert screen.closed == 1


def test_a_view_that_is_offered_from_the_start_needs_no_command() -> None:
    screen = Screen(starts_at_once=True)
    harness = PayloadHarness(streamer=screen)
    harness.run(2.0)
    assert len(screen.shown) >= 7
    assert harness.command(STOP, 1) == CommandResult.ACCEPTED
    assert screen.closed <= 1


def test_the_stream_status_has_uri_and_state() -> None:
    harness = PayloadHarness(streamer=Screen())
    harness.run(0.2)
    streams = []
    for order in (STOP, START, STOP):
        harness.command(order, 0)
        assert harness.camera_status.stream is not None
        streams.append((harness.camera_status.stream.uri, harness.camera_status.stream.running))
    assert streams == [(URI, False), (URI, True), (URI, False)]


def test_a_failing_stream_ends_with_a_status_text() -> None:
    screen = Screen()
    screen.reason = "Address already in use"
    harness = PayloadHarness(streamer=screen)
    harness.command(START, 0)
    harness.run(1.0)
    assert len(screen.shown) == 1
    assert "Live view ended: Address already in use" in harness.status_texts()


def test_without_a_streamer_there_is_no_stream() -> None:
    harness = PayloadHarness()
    assert harness.command(START, 0) == CommandResult.FAILED
    assert harness.camera_status.stream is None


def test_another_stream_is_refused() -> None:
    assert PayloadHarness(streamer=Screen()).command(START, 2) == CommandResult.DENIED
