"""MAVSDK's client takes a picture, finds it by its URL among the files, and can look at it."""

import io
import queue
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from mavsdk.plugins.camera import Camera
from mavsdk.plugins.ftp import FilesystemEntry, Ftp, FtpResult
from mavsdk.plugins.param import Param
from PIL import Image

from tests.conformance.mavsdk_client import connected
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM, SPEED, CAMERA = 9, 5, 100
URL = re.compile(r"mftp://\[;comp=1\](/fs/microsd/image/(\w+\.jpg))")
PATIENCE_S = 120.0


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle."""

    camera: Any
    files: Any
    param: Any
    captures: "queue.Queue[Any]"


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        captures: queue.Queue[Any] = queue.Queue()
        made = Client(Camera(system), Ftp(system), Param(system), captures)
        made.camera.subscribe_capture_info(lambda capture, _data=None: captures.put(capture))
        wait_for(lambda: made.camera.camera_list().cameras, "MAVSDK's discovery of the camera")
        yield made


def downloaded(client: Client, path: str, folder: Path) -> bytes:
    results: queue.Queue[Any] = queue.Queue()
    report: Callable[..., None] = lambda result, _progress, _data=None: results.put(result)  # noqa: E731 - as MAVSDK calls it
    client.files.download_async(path, str(folder), True, report)
    while (result := results.get(timeout=PATIENCE_S)) == FtpResult.NEXT:
        pass
    assert result == FtpResult.SUCCESS
    return (folder / path.rpartition("/")[2]).read_bytes()


def photo(client: Client) -> tuple[str, str]:
    """Take one; gives its path among the files and its name."""
    client.camera.take_photo(CAMERA)
    capture = client.captures.get(timeout=PATIENCE_S)
    assert capture.is_success
    match = URL.fullmatch(capture.file_url)
    assert match is not None, capture.file_url
    return match[1], match[2]


def test_a_picture_is_listed_fetched_and_shows_the_ground(client: Client, tmp_path: Path) -> None:
    path, name = photo(client)
    listed = client.files.list_directory("/fs/microsd/image").entries
    kinds = FilesystemEntry.EntryType
    assert [entry.name for entry in listed if entry.entry_type == kinds.FILE] == [name]
    with Image.open(io.BytesIO(downloaded(client, path, tmp_path))) as picture:
        assert picture.size == (2048, 1536)
        assert picture.getexif().get_ifd(0x8825)[1] == "N"
        pixels = np.asarray(picture)
    assert 40.0 < pixels.mean() < 220.0
    assert pixels.std() > 10.0


def test_a_small_copy_fits_any_uplink_and_a_second_picture_comes_on_request(
    client: Client, tmp_path: Path
) -> None:
    client.param.set_param_int("CAM_IMAGE_SECOND", 2)
    client.param.set_param_int("CAM_IMAGE_WIDTH", 1200)
    path, name = photo(client)
    folder = path.rpartition("/")[0]
    small = downloaded(client, f"{folder}/thumbnail/{name}", tmp_path)
    assert len(small) < 200_000
    with Image.open(io.BytesIO(small)) as picture:
        assert picture.size == (640, 480)
    with Image.open(io.BytesIO(downloaded(client, f"{folder}/ndvi/{name}", tmp_path))) as index:
        assert (index.mode, index.size) == ("L", (1200, 900))
    client.files.remove_file(path)
    names = [entry.name for entry in client.files.list_directory(folder).entries]
    assert name not in names
