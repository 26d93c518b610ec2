"""The state folder is prepared before the edge server serves."""

import re
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.process.preparation import NoSpaceError, prepare
from edge_server.store.migrate import is_ready
from tests.support.small_disk import NoSmallDiskError, fill_up, small_disk


def test_a_first_start_on_a_full_disk_asks_for_space_and_works_with_it(tmp_path: Path) -> None:
    try:
        with small_disk(tmp_path / "disk", 20) as folder:
            config = Config(state_dir=folder / "state")
            fill_up(folder / "others")
            with pytest.raises(
                NoSpaceError, match=f"the disk of {re.escape(str(config.state_dir))} is full; free"
            ):
                prepare(config)
            (folder / "others").unlink()
            prepare(config)
            assert is_ready(config.database)
    except NoSmallDiskError as error:
        pytest.skip(f"no file system can be mounted here: {error}")
