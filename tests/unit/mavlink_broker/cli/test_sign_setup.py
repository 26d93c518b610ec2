"""`sign-setup` loads the broker's key into a vehicle, and keeps the file safe whatever happens."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mavlink_broker.cli import sign_setup
from mavlink_broker.cli.program import FAILED, UsageError
from mavlink_broker.microservices.signing_setup import Outcome

ROOT = Path(__file__).parents[4]
CABLE = ("--connect", "udpout://127.0.0.1:14550")  # Nothing is sent


@pytest.fixture
def outcomes(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Outcome, bytes | None, bytes | None]]:
    """The outcome of each try, first in first out; afterwards with key and present key."""
    planned: list[tuple[Outcome, bytes | None, bytes | None]] = []

    def set_up(
        _url: object, _system: int, key: bytes | None, current: bytes | None
    ) -> tuple[Outcome, list[str]]:
        outcome, _, _ = planned.pop(0)
        planned.append((outcome, key, current))
        return outcome, []

    monkeypatch.setattr(sign_setup, "_set_up", set_up)
    return planned


def key_in(file: Path) -> bytes:
    return bytes.fromhex(file.read_text())


def test_a_first_key_is_made_for_its_owner_alone(
    tmp_path: Path, outcomes: list[tuple[Outcome, bytes | None, bytes | None]]
) -> None:
    outcomes.append((Outcome.DONE, None, None))
    assert sign_setup.run(["3", "--state-dir", str(tmp_path), *CABLE], {}) == 0
    file = tmp_path / "keys/signing-3.key"
    assert file.stat().st_mode & 0o777 == 0o600
    assert outcomes == [(Outcome.DONE, key_in(file), None)]


def test_a_replaced_key_that_is_not_confirmed_is_tried_again(
    tmp_path: Path, outcomes: list[tuple[Outcome, bytes | None, bytes | None]]
) -> None:
    arguments = ["3", "--state-dir", str(tmp_path), *CABLE]
    outcomes.append((Outcome.DONE, None, None))
    sign_setup.run(arguments, {})
    file = tmp_path / "keys/signing-3.key"
    first = key_in(file)
    outcomes[:] = [(Outcome.UNCONFIRMED, None, None)]
    assert sign_setup.run([*arguments, "--replace"], {}) == FAILED
    assert key_in(file) == first
    second = outcomes[0][1]
    outcomes[:] = [(Outcome.ALREADY, None, None)]
    assert sign_setup.run([*arguments, "--replace"], {}) == 0
    assert outcomes == [(Outcome.ALREADY, second, first)]
    assert key_in(file) == second != first
    assert list(file.parent.iterdir()) == [file]


def test_a_refused_replacement_leaves_nothing_behind(
    tmp_path: Path, outcomes: list[tuple[Outcome, bytes | None, bytes | None]]
) -> None:
    outcomes.append((Outcome.ARMED, None, None))
    assert sign_setup.run(["3", "--replace", "--state-dir", str(tmp_path), *CABLE], {}) == FAILED
    assert list((tmp_path / "keys").iterdir()) == []


def test_no_key_is_made_for_a_device_that_is_not_there(tmp_path: Path) -> None:
    device = tmp_path / "ttyACM9"
    with pytest.raises(UsageError, match=f"{device}: No such file"):
        sign_setup.run(["3", "--state-dir", str(tmp_path), "--connect", f"serial://{device}"], {})
    assert list(tmp_path.iterdir()) == []


def test_a_key_does_not_travel_over_a_network_unless_it_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="in the clear"):
        sign_setup.run(
            ["3", "--state-dir", str(tmp_path), "--connect", "udpout://192.168.1.2:14550"], {}
        )
    assert not (tmp_path / "keys").exists()


def test_a_file_that_is_no_key_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "signing-3.key").write_text("no key")
    with pytest.raises(UsageError, match="is not a key"):
        sign_setup.run(["3", "--signing-keys", str(tmp_path), *CABLE], {})
    assert (tmp_path / "signing-3.key").read_text() == "no key"


@contextmanager
def a_vehicle(folder: Path) -> Iterator[int]:
    """The project's vehicle, which takes keys from this machine; gives the port it sends to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as chosen:
        chosen.bind(("127.0.0.1", 0))
        port = chosen.getsockname()[1]
    command = [
        *(sys.executable, "-m", "uav_firmware", "--system-id", "3", "--port", "0"),
        *("--broker", f"127.0.0.1:{port}", "--gcs", "127.0.0.1:9"),
        *("--setup-signing", "loopback", "--state-dir", str(folder)),
    ]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        try:
            yield port
        finally:
            process.terminate()


@pytest.mark.thorough
def test_the_projects_vehicle_takes_a_key_and_gives_it_up(tmp_path: Path) -> None:
    with a_vehicle(tmp_path) as port:
        for flags, answer in (
            ((), "vehicle 3 signs with"),
            (("--replace",), "vehicle 3 signs with"),
            (("--remove",), "vehicle 3 signs no more"),
        ):
            shown = subprocess.run(
                [
                    *(sys.executable, "-m", "mavlink_broker", "sign-setup", "3", *flags),
                    *("--connect", f"udpin://127.0.0.1:{port}"),
                ],
                cwd=ROOT,
                env=os.environ | {"STATE_DIR": str(tmp_path / "broker")},
                capture_output=True,
                text=True,
                check=True,
            ).stdout
            assert answer in shown
        state = (tmp_path / "vehicle-3/signing.json").read_text()
    assert '"key": null' in state
