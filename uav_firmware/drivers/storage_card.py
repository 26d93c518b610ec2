"""The vehicle's storage card as folders of this machine."""

from pathlib import Path
from typing import Final

from uav_firmware.cal.files import Card
from uav_firmware.drivers.file_tree import FileTree
from uav_firmware.drivers.log_folder import LogFolder

FILES_FOLDER: Final = "files"
IMAGE_FOLDER: Final = "image"


def image_folder(folder: Path) -> Path:
    """Where a vehicle's camera stores its pictures."""
    return folder / IMAGE_FOLDER


def image_tree(folder: Path) -> FileTree:
    """The pictures of a vehicle, to read and to remove."""
    return FileTree(image_folder(folder), may_write=False)


def storage_card(folder: Path, logs: LogFolder, images: FileTree) -> Card:
    """The card in a vehicle's folder; a log that is being written cannot be removed."""
    return Card(
        files=FileTree(folder / FILES_FOLDER),
        logs=FileTree(logs.folder, may_write=False, is_in_use=logs.is_being_written),
        images=images,
    )
