"""Files and logs of the vehicle, put together: what is served, and what becomes of an upload."""

from collections.abc import Callable, Sequence

from uav_firmware.cal.files import Card
from uav_firmware.modules.mavlink.files.metadata_files import MetadataFiles
from uav_firmware.modules.mavlink.files.parameter_files import ParameterFiles
from uav_firmware.modules.mavlink.files.roots import vehicle_tree
from uav_firmware.modules.mavlink.files.server import FileServer
from uav_firmware.modules.mavlink.log.server import MESSAGE_TYPES, LogServer
from uav_firmware.modules.mavlink.parameters.parameter_server import ParameterServer
from uav_firmware.modules.mavlink.telemetry.status_text import StatusTexts
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.pace import Pace
from uav_firmware.parameters import Registry


class FileService:
    """Serves FILE_TRANSFER_PROTOCOL and, where there is a card, the log protocol."""

    def __init__(
        self,
        *,
        system_id: int,
        registry: Registry,
        card: Card | None,
        topics: MavlinkTopics,
        texts: StatusTexts,
        parameters: ParameterServer,
        metadata: MetadataFiles,
    ) -> None:
        """Take what the files are about; `parameters` tells peers of an uploaded parameter file."""
        self._topics = topics
        self._texts = texts
        self._parameters = parameters
        self._asides: list[Outgoing] = []
        files = ParameterFiles(registry, taken=self._taken, refused=self._refused)
        self._server = FileServer(
            system_id=system_id, store=vehicle_tree(card, files, metadata), pace=Pace()
        )
        self._logs = (
            None
            if card is None
            else LogServer(
                system_id=system_id, store=card.logs, is_armed=self._is_armed, texts=texts
            )
        )
        self._handlers: dict[str, Callable[[Message, Sender, int], list[Outgoing]]] = {
            "FILE_TRANSFER_PROTOCOL": self._server.handle
        }
        if self._logs is not None:
            self._handlers |= dict.fromkeys(MESSAGE_TYPES, self._logs.handle)

    @property
    def message_types(self) -> frozenset[str]:
        """Names of the messages that are served."""
        return frozenset(self._handlers)

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take a message of either protocol."""
        outgoing = self._handlers[message.get_type()](message, sender, now_us)
        return outgoing + self._take_asides()

    def tick(self, now_us: int) -> list[Outgoing]:
        """Go on with what is under way."""
        outgoing = self._server.tick(now_us)
        if self._logs is not None:
            outgoing += self._logs.tick(now_us)
        return outgoing + self._take_asides()

    def _is_armed(self) -> bool:
        status = self._topics.vehicle_status.value
        return status is not None and status.armed

    def _taken(self, names: Sequence[str]) -> None:
        self._asides += self._parameters.changed_together(names)

    def _refused(self, sentence: str) -> None:
        self._asides += self._texts.say(mavlink.MAV_SEVERITY_WARNING, sentence)

    def _take_asides(self) -> list[Outgoing]:
        """What is to be said besides the replies."""
        asides, self._asides = self._asides, []
        return asides
