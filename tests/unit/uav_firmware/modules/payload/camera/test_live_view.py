"""The live view shows what the camera sees from one order to the other, and no frame without."""

from tests.unit.uav_firmware.modules.payload.bench import Bench
from uav_firmware.cal.camera import Exposure
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult

START, STOP = PayloadCommand.VIDEO_START_STREAMING, PayloadCommand.VIDEO_STOP_STREAMING
URI = "http://127.0.0.1:14581/stream"


class Screen:
    """Notes what it is shown."""

    uri = URI

    def __init__(self) -> None:
        self.shown: list[Exposure] = []
        self.closed = 0
        self.reason = ""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        assert rate_hz == 4.0
        self.shown.append(exposure)
        return self.reason

    def close(self) -> None:
        self.closed += 1


def test_frames_come_at_the_video_s_rate_while_it_streams() -> None:
    screen = Screen()
    bench = Bench(streamer=screen)
    bench.run(2.0)
    assert screen.shown == []
    assert bench.ask(START, 1) == CommandResult.ACCEPTED
    bench.run(5.0)
    assert 19 <= len(screen.shown) <= 22
    assert bench.ask(STOP, 1) == CommandResult.ACCEPTED
    count = len(screen.shown)
    bench.run(2.0)
    assert len(screen.shown) == count
    assert screen.closed == 1


def test_the_stream_is_told_with_its_address_and_whether_it_runs() -> None:
    bench = Bench(streamer=Screen())
    bench.run(0.2)
    told = []
    for order in (STOP, START, STOP):
        bench.ask(order, 0)
        assert bench.seen.stream is not None
        told.append((bench.seen.stream.uri, bench.seen.stream.running))
    assert told == [(URI, False), (URI, True), (URI, False)]


def test_a_view_that_cannot_be_shown_ends_with_a_sentence() -> None:
    screen = Screen()
    screen.reason = "Address already in use"
    bench = Bench(streamer=screen)
    bench.ask(START, 0)
    bench.run(1.0)
    assert len(screen.shown) == 1
    assert "Live view ended: Address already in use" in bench.said()


def test_without_a_streamer_there_is_no_stream() -> None:
    bench = Bench()
    assert bench.ask(START, 0) == CommandResult.FAILED
    assert bench.seen.stream is None


def test_another_stream_is_refused() -> None:
    assert Bench(streamer=Screen()).ask(START, 2) == CommandResult.DENIED
