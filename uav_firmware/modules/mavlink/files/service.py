"""File service of the vehicle: the tree of files, MAVFTP and the log protocol."""

from collections.abc import Callable
from typing import Final

from uav_firmware.cal.files import Card, FileStore, Place
from uav_firmware.modules.mavlink.commands.parameter_server import ParameterServer
from uav_firmware.modules.mavlink.files import metadata_files
from uav_firmware.modules.mavlink.files.log_server import MESSAGE_TYPES, LogServer
from uav_firmware.modules.mavlink.files.metadata_files import MetadataFiles
from uav_firmware.modules.mavlink.files.parameter_files import ParameterFiles
from uav_firmware.modules.mavlink.files.server import FileServer
from uav_firmware.modules.mavlink.files.tree import MountedTree
from uav_firmware.modules.mavlink.wire.addressing import AUTOPILOT_COMPONENT, Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.modules.mavlink.wire.token_bucket import TokenBucket
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

CARD: Final[Place] = ("fs", "microsd")
LOGS: Final[Place] = (*CARD, "log")
IMAGES: Final[Place] = (*CARD, "image")
IMAGES_URL: Final = f"mftp://[;comp={AUTOPILOT_COMPONENT}]/{'/'.join(IMAGES)}"
"""URL of the folder of pictures; the autopilot serves it, not the camera."""
LOGS_BY_SERVICE: Final[Place] = ("@MAV_LOG",)
PARAMETERS: Final[Place] = ("@PARAM",)


def vehicle_tree(
    card: Card | None, parameters: ParameterFiles, metadata: MetadataFiles
) -> MountedTree:
    """The complete tree; without a card only parameters and metadata."""
    mounts: dict[Place, FileStore] = {PARAMETERS: parameters, metadata_files.FOLDER: metadata}
    if card is not None:
        mounts |= {
            CARD: card.files,
            LOGS: card.logs,
            IMAGES: card.images,
            LOGS_BY_SERVICE: card.logs,
        }
    return MountedTree(mounts)


class FileService:
    """Serves FILE_TRANSFER_PROTOCOL and, with a card, the log protocol."""

    def __init__(
        self,
        *,
        system_id: int,
        registry: Registry,
        card: Card | None,
        topics: Topics,
        texts: StatusTexts,
        parameters: ParameterServer,
        metadata: MetadataFiles,
    ) -> None:
        """`parameters` saves and publishes an uploaded parameter file."""
        self._topics = topics
        self._texts = texts
        self._pending: list[Outgoing] = []
        files = ParameterFiles(registry, applied=parameters.on_file_upload, refused=self._refused)
        self._server = FileServer(
            system_id=system_id, store=vehicle_tree(card, files, metadata), bucket=TokenBucket()
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
        """Names of the messages for `handle`."""
        return frozenset(self._handlers)

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle a message of either protocol."""
        outgoing = self._handlers[message.get_type()](message, sender, now_us)
        return outgoing + self._drain_pending()

    def tick(self, now_us: int) -> list[Outgoing]:
        """Continue transfers of files."""
        outgoing = self._server.tick(now_us)
        return outgoing + self._drain_pending()

    def tick_logs(self, now_us: int) -> list[Outgoing]:
        """Continue downloads of logs; called more often, so that few pieces are sent at once."""
        return [] if self._logs is None else self._logs.tick(now_us)

    def _is_armed(self) -> bool:
        status = self._topics.vehicle_status.value
        return status is not None and status.armed

    def _refused(self, text: str) -> None:
        self._pending += self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)

    def _drain_pending(self) -> list[Outgoing]:
        """Messages other than replies."""
        pending, self._pending = self._pending, []
        return pending
