"""MAVSDK's client moves files and logs from and to the autopilot process."""

import base64
import io
import json
import queue
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.action import Action
from mavsdk.plugins.component_metadata import ComponentMetadata, MetadataType
from mavsdk.plugins.ftp import FilesystemEntry, Ftp, FtpError, FtpResult
from mavsdk.plugins.log_files import LogFiles, LogFilesError, LogFilesResult
from mavsdk.plugins.log_streaming import LogStreaming
from mavsdk.plugins.telemetry import Telemetry
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no annotations

from tests.conformance.mavsdk_client import connected
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 4
SPEED = 5
CARD = "/fs/microsd"
PATIENCE_S = 120.0


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle, and the vehicle's folder."""

    action: Any
    files: Any
    logs: Any
    stream: Any
    metadata: Any
    telemetry: Any
    folder: Path


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    state = tmp_path_factory.mktemp("vehicle")
    with connected(SYSTEM, SPEED, state) as system:
        made = Client(
            action=Action(system),
            files=Ftp(system),
            logs=LogFiles(system),
            stream=LogStreaming(system),
            metadata=ComponentMetadata(system),
            telemetry=Telemetry(system),
            folder=state / f"vehicle-{SYSTEM}",
        )
        yield made


def outcome(begin: Callable[..., None], *arguments: Any, more: int) -> Any:
    """Begin something that reports its progress; gives its final result."""
    results: queue.Queue[Any] = queue.Queue()
    begin(*arguments, lambda result, _data, _user_data=None: results.put(result))
    while (result := results.get(timeout=PATIENCE_S)) == more:
        pass
    return result


def upload(client: Client, path: Path, folder: str = CARD) -> Any:
    return outcome(client.files.upload_async, str(path), folder, more=FtpResult.NEXT)


def download(client: Client, path: str, folder: Path, *, burst: bool) -> Any:
    begin = client.files.download_async
    return outcome(begin, path, str(folder), burst, more=FtpResult.NEXT)


def names(client: Client, folder: str) -> tuple[list[str], list[str]]:
    """Folders and files."""
    found = client.files.list_directory(folder).entries
    return tuple(  # type: ignore[return-value]  # of two kinds
        [entry.name for entry in found if entry.entry_type == kind]
        for kind in (FilesystemEntry.EntryType.DIRECTORY, FilesystemEntry.EntryType.FILE)
    )


@pytest.mark.parametrize("burst", [False, True])
@pytest.mark.parametrize("size", [0, 239 * 4, 30_001])
def test_an_uploaded_file_is_downloaded_unchanged(
    client: Client, tmp_path: Path, burst: bool, size: int
) -> None:
    local = tmp_path / "up.bin"
    local.write_bytes(random.Random(size).randbytes(size))
    assert upload(client, local) == FtpResult.SUCCESS
    assert (client.folder / "files" / "up.bin").read_bytes() == local.read_bytes()
    back = tmp_path / "back"
    back.mkdir()
    assert download(client, f"{CARD}/up.bin", back, burst=burst) == FtpResult.SUCCESS
    assert (back / "up.bin").read_bytes() == local.read_bytes()


def test_files_are_listed_compared_renamed_and_removed(client: Client, tmp_path: Path) -> None:
    local = tmp_path / "one.bin"
    local.write_bytes(random.Random(1).randbytes(5_000))
    client.files.create_directory(f"{CARD}/folder")
    assert upload(client, local, f"{CARD}/folder") == FtpResult.SUCCESS
    folders, files = names(client, f"{CARD}/folder")
    assert (folders, files) == ([], ["one.bin"])
    assert client.files.are_files_identical(str(local), f"{CARD}/folder/one.bin")
    other = tmp_path / "two.bin"
    other.write_bytes(b"something else")
    assert not client.files.are_files_identical(str(other), f"{CARD}/folder/one.bin")
    client.files.rename(f"{CARD}/folder/one.bin", f"{CARD}/folder/two.bin")
    assert names(client, f"{CARD}/folder")[1] == ["two.bin"]
    client.files.remove_file(f"{CARD}/folder/two.bin")
    client.files.remove_directory(f"{CARD}/folder")
    assert "folder" not in names(client, CARD)[0]


def test_a_long_folder_is_listed_whole(client: Client) -> None:
    folder = client.folder / "files" / "many"
    folder.mkdir(parents=True)
    for i in range(120):
        (folder / f"picture-{i:04}.jpg").write_bytes(b"x")
    assert names(client, f"{CARD}/many")[1] == sorted(path.name for path in folder.iterdir())


def test_the_parameters_are_described(client: Client) -> None:
    updates: queue.Queue[Any] = queue.Queue()
    client.metadata.subscribe_metadata_available(
        lambda update, _user_data=None: updates.put(update)
    )
    client.metadata.request_autopilot_component()
    while (update := updates.get(timeout=PATIENCE_S)).type != MetadataType.PARAMETER:
        assert update.type != MetadataType.ALL_COMPLETED
    described = {each["name"]: each for each in json.loads(update.json_metadata)["parameters"]}
    height = described["MIS_TAKEOFF_ALT"]
    assert (height["type"], height["units"], height["default"]) == ("Float", "m", 2.5)
    assert height["min"] < height["default"] < height["max"]


def test_refusals_are_understood(client: Client, tmp_path: Path) -> None:
    missing = download(client, f"{CARD}/no-such-file", tmp_path, burst=True)
    assert missing == FtpResult.FILE_DOES_NOT_EXIST
    with pytest.raises(FtpError) as gone:
        client.files.remove_file(f"{CARD}/no-such-file")
    assert gone.value.result == FtpResult.FILE_DOES_NOT_EXIST
    with pytest.raises(FtpError) as protected:
        client.files.create_directory(f"{CARD}/log/mine")
    assert protected.value.result == FtpResult.FILE_PROTECTED
    client.files.create_directory(f"{CARD}/twice")
    with pytest.raises(FtpError) as there:
        client.files.create_directory(f"{CARD}/twice")
    assert there.value.result == FtpResult.FILE_EXISTS


def test_each_flight_leaves_one_log_that_comes_down_whole(client: Client, tmp_path: Path) -> None:
    with pytest.raises(LogFilesError) as none:
        client.logs.get_entries()
    assert none.value.args[0] == LogFilesResult.NO_LOGFILES
    for flight in (1, 2):
        fly(client, flight)
    entries = client.logs.get_entries()
    stored = sorted((client.folder / "log").rglob("*.ulg"))
    assert [entry.id for entry in entries] == [0, 1]
    assert [entry.size_bytes for entry in entries] == [path.stat().st_size for path in stored]
    for entry, path in zip(entries, stored, strict=True):
        assert entry.date == path.parent.name + "T" + path.stem[:8].replace("_", ":") + "Z"
        local = tmp_path / f"{entry.id}.ulg"
        begin = client.logs.download_log_file_async
        result = outcome(begin, entry, str(local), more=LogFilesResult.NEXT)
        assert result == LogFilesResult.SUCCESS
        assert local.read_bytes() == path.read_bytes()
        armed = ULog(str(local)).get_dataset("vehicle_status").data["arming_state"]
        assert set(armed) == {1, 2}  # From before arming to after disarming
    by_burst = tmp_path / "burst"
    by_burst.mkdir()
    remote = f"@MAV_LOG/{stored[0].parent.name}/{stored[0].name}"
    assert download(client, remote, by_burst, burst=True) == FtpResult.SUCCESS
    assert (by_burst / stored[0].name).read_bytes() == stored[0].read_bytes()
    client.logs.erase_all_log_files()
    wait_for(lambda: not list((client.folder / "log").rglob("*.ulg")), "the logs to be erased")


def test_the_log_is_streamed_while_it_is_made(client: Client) -> None:
    pieces: list[bytes] = []
    client.stream.subscribe_log_streaming_raw(
        lambda raw, _user_data=None: pieces.append(base64.b64decode(raw.data_base64))
    )
    client.stream.start_log_streaming()
    wait_for(lambda: sum(map(len, pieces)) > 60_000, "some seconds of the log")
    client.stream.stop_log_streaming()
    log = ULog(io.BytesIO(b"".join(pieces)))
    assert log.initial_parameters["MAV_TYPE"] == 2
    assert log.get_dataset("vehicle_attitude").data["timestamp"].size > 100


def fly(client: Client, flight: int) -> None:
    """Arm and disarm, until the log is closed."""

    def logs() -> list[Path]:
        return sorted((client.folder / "log").rglob("*.ulg"))

    wait_for(client.telemetry.health_all_ok, "a vehicle that is ready")
    client.action.arm()
    wait_for(lambda: len(logs()) == flight, "a log that begins")
    client.action.disarm()
    wait_for(lambda: not client.telemetry.armed(), "disarmed")
    sizes: list[int] = []

    def closed() -> bool:
        """Whether the log has ceased to grow, behind the disarming."""
        sizes.append(logs()[-1].stat().st_size)
        if len(sizes) <= 20 or len(set(sizes[-20:])) > 1:
            return False
        states = ULog(str(logs()[-1])).get_dataset("vehicle_status").data["arming_state"]
        return bool(states[-1] == 1)

    wait_for(closed, "the end of the log")
