"""Where clients find what: the tree of files of the vehicle, with PX4's names."""

from typing import Final

from uav_firmware.cal.files import Card, FileStore, Place
from uav_firmware.modules.mavlink.files import metadata_files
from uav_firmware.modules.mavlink.files.metadata_files import MetadataFiles
from uav_firmware.modules.mavlink.files.parameter_files import ParameterFiles
from uav_firmware.modules.mavlink.files.tree import MountedTree
from uav_firmware.modules.mavlink.wire.addressing import AUTOPILOT_COMPONENT

CARD: Final[Place] = ("fs", "microsd")
LOGS: Final[Place] = (*CARD, "log")
IMAGES: Final[Place] = (*CARD, "image")
IMAGES_URL: Final = f"mftp://[;comp={AUTOPILOT_COMPONENT}]/{'/'.join(IMAGES)}"
"""URL of that folder for a peer that hears of it from the camera, which serves no files itself."""
LOGS_BY_SERVICE: Final[Place] = ("@MAV_LOG",)
PARAMETERS: Final[Place] = ("@PARAM",)


def vehicle_tree(
    card: Card | None, parameters: ParameterFiles, metadata: MetadataFiles
) -> MountedTree:
    """The whole tree; without a card there are only the parameters and what they mean."""
    mounts: dict[Place, FileStore] = {PARAMETERS: parameters, metadata_files.FOLDER: metadata}
    if card is not None:
        mounts |= {
            CARD: card.files,
            LOGS: card.logs,
            IMAGES: card.images,
            LOGS_BY_SERVICE: card.logs,
        }
    return MountedTree(mounts)
