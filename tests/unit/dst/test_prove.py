"""Each mistake can be made in the product as it is, and leaves a program that can be compiled."""

from pathlib import Path

import pytest

from dst.prove import BREAKS, ROOT, Break, Change, apply


def copied(folder: Path, mistake: Break) -> None:
    for name in {change.file for change in mistake.changes}:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text((ROOT / name).read_text())


@pytest.mark.parametrize("mistake", BREAKS, ids=lambda one: one.mistake)
def test_each_mistake_can_be_made(mistake: Break, tmp_path: Path) -> None:
    copied(tmp_path, mistake)
    for change in mistake.changes:
        apply(tmp_path, change)
    for change in mistake.changes:
        text = (tmp_path / change.file).read_text()
        assert text != (ROOT / change.file).read_text()
        compile(text, change.file, "exec")


def test_a_mistake_that_fits_nowhere_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text("x = 1\n")
    with pytest.raises(LookupError, match=r"'x = 2' is not once in program\.py"):
        apply(tmp_path, Change("program.py", "x = 2", "x = 3"))
