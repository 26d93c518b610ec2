"""The programs of the distribution, installed without the packages of their extra."""

import signal
from collections.abc import Iterator

import pytest

from farm_flight_bridge import programs


@pytest.fixture(autouse=True)
def _keep_the_signal() -> Iterator[None]:
    former = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, former)


def lacking(monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    """Have every program end while it loads: a module that it imports is not there."""

    def load(_name: str) -> None:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    monkeypatch.setattr(programs, "import_module", load)


def test_a_program_without_its_extra_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lacking(monkeypatch, "pymavlink.dialects")
    assert programs.mavlink_broker() == 2
    said = capsys.readouterr().err
    assert "the package pymavlink.dialects is not installed" in said
    assert "the extra 'broker'" in said


def test_a_module_of_our_own_that_is_missing_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    lacking(monkeypatch, "mavlink_broker.app")
    with pytest.raises(ModuleNotFoundError, match=r"mavlink_broker\.app"):
        programs.mavlink_broker()
