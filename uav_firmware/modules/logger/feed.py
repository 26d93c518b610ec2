"""What is logged, passed on to a peer that has asked for a stream."""

from collections.abc import Callable

from uav_firmware.bus import Queue, Topic
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest


class LogFeed:
    """Begins each stream with the definitions, whether a file is being written or not."""

    def __init__(
        self,
        request: Topic[LogStreamRequest],
        stream: Queue[LogStreamChunk],
        describe: Callable[[int], bytes],
    ) -> None:
        """`describe` makes the definitions from the time at which the stream begins [us]."""
        self._request = request
        self._stream = stream
        self._describe = describe
        self._number = 0

    @property
    def is_wanted(self) -> bool:
        """Whether somebody wants a stream."""
        request = self._request.value
        return request is not None and request.number != 0

    def pass_on(self, began_us: int, chunk: bytes) -> None:
        """Pass a chunk on, if it is wanted."""
        request = self._request.value
        number = 0 if request is None else request.number
        if number == 0:
            return
        if number != self._number:
            self._number = number
            definitions = self._describe(began_us)
            self._stream.publish(
                LogStreamChunk(number, began_us, is_definition=True, data=definitions)
            )
        self._stream.publish(LogStreamChunk(number, began_us, is_definition=False, data=chunk))
