import stat
from pathlib import Path

from sim.launch import signing_keys
from sim.launch.settings import from_environment
from uav_firmware.drivers.key_file import read_key


def test_every_vehicle_has_a_key_of_its_own_that_only_its_owner_reads(tmp_path: Path) -> None:
    settings = from_environment({"STATE_DIR": str(tmp_path), "VEHICLES": "3"})
    signing_keys.prepare(settings)
    paths = [settings.signing_key_path(system_id) for system_id in (1, 2, 3)]
    assert {stat.S_IMODE(path.stat().st_mode) for path in paths} == {0o600}
    assert stat.S_IMODE(settings.keys_dir.stat().st_mode) == 0o700
    assert len({read_key(path) for path in paths}) == 3


def test_a_key_stays_what_it_is_and_a_half_written_one_is_made_anew(tmp_path: Path) -> None:
    settings = from_environment({"STATE_DIR": str(tmp_path)})
    path = settings.signing_key_path(1)
    path.parent.mkdir(parents=True)
    path.with_suffix(".new").write_text("half")
    signing_keys.prepare(settings)
    key = read_key(path)
    signing_keys.prepare(settings)
    assert read_key(path) == key
    assert list(settings.keys_dir.iterdir()) == [path]
