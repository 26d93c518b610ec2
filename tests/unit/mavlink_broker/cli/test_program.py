"""The broker's log files have a limited size; its database has one user and no earlier format."""

import logging
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavlink_broker import config
from mavlink_broker.cli.program import LogFile, UsageError, configure_logging, open_database
from mavlink_broker.config import Config


@pytest.fixture
def log() -> Iterator[logging.Logger]:
    one = logging.getLogger("tests.log_file")
    one.propagate = False
    one.setLevel(logging.INFO)
    yield one
    for handler in list(one.handlers):
        handler.close()
        one.removeHandler(handler)


def test_size_and_number_of_files_are_limited(tmp_path: Path, log: logging.Logger) -> None:
    log.addHandler(LogFile(tmp_path / "broker.log", max_bytes=1000, max_files=2))
    for number in range(500):
        log.info("line %04d", number)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["broker.log", "broker.log.1", "broker.log.2"]
    assert all(path.stat().st_size <= 1000 for path in tmp_path.iterdir())
    assert "line 0499" in (tmp_path / "broker.log").read_text()


def test_a_file_that_cannot_be_written_costs_lines_and_is_reported_once(
    tmp_path: Path, log: logging.Logger, caplog: pytest.LogCaptureFixture
) -> None:
    handler = LogFile(tmp_path / "missing" / "broker.log")
    log.addHandler(handler)
    for _ in range(10):
        log.info("line")
    assert handler.lines_lost == 10
    assert caplog.text.count("cannot be written") == 1
    (tmp_path / "missing").mkdir()
    log.info("there again")
    assert "there again" in (tmp_path / "missing" / "broker.log").read_text()


def test_the_log_file_is_set_by_flag_or_environment(tmp_path: Path) -> None:
    path = tmp_path / "broker.log"
    assert config.load([], {"LOG_FILE": str(path)}).log_file == path
    assert config.load(["--log-file", str(path)], {}).log_file == path
    assert config.load([], {}).log_file is None


def test_the_log_goes_there_and_to_the_standard_error(tmp_path: Path) -> None:
    root = logging.getLogger()
    before = list(root.handlers)
    try:
        configure_logging("INFO", tmp_path / "broker.log")
        logging.getLogger("tests.somewhere").warning("something has happened")
        assert "something has happened" in (tmp_path / "broker.log").read_text()
    finally:
        for handler in [one for one in root.handlers if one not in before]:
            handler.close()
            root.removeHandler(handler)


def test_a_second_program_on_one_folder_is_refused(tmp_path: Path) -> None:
    settings = Config(database_folder=tmp_path)
    first = open_database(settings)
    with pytest.raises(UsageError, match="each broker needs a STATE_DIR of its own"):
        open_database(settings)
    first.close()
    open_database(settings).close()


def test_files_of_an_earlier_format_are_named_in_the_log_unless_they_are_empty(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("spool.words", "vehicle-1.json"):
        (tmp_path / name).write_text("something")
    (tmp_path / "spool.pictures").touch()
    open_database(Config(database_folder=tmp_path)).close()
    (logged,) = caplog.messages
    assert "are not read: ['spool.words', 'vehicle-1.json']" in logged
    assert (tmp_path / "vehicle-1.json").exists()
