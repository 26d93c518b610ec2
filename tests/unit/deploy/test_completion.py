"""Completion in bash: commands, the commands below them, and flags of each program."""

import subprocess

import pytest

from tests.unit.deploy.dockerfile import ROOT

FOLDER = ROOT / "deploy/completion"


def completed(program: str, *words: str) -> list[str]:
    """What bash offers for the last word."""
    line = " ".join(f"'{word}'" for word in (program, *words))
    script = f"""
        source {FOLDER / program}
        COMP_WORDS=({line}) COMP_CWORD={len(words)}
        _{program.replace("-", "_")}
        printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    shown = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    return shown.stdout.split()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("farm-edge", "ke"), ["keys"]),
        (("farm-edge", "keys", "ro"), ["rotate"]),
        (("farm-edge", "keys", "rotate", "--o"), ["--overlap-hours"]),
        (("farm-edge", "--host", "0.0.0.0", "users", "li"), ["list", "link"]),
        (("farm-broker", "sign"), ["sign-setup"]),
        (("farm-broker", "sign-setup", "1", "--re"), ["--replace", "--remove"]),
        (("farm-broker", "dead-letters", "re"), ["retry"]),
        (("farm-vehicle", "--sys"), ["--system-id"]),
        (("farm-sim", "d"), ["demo"]),
        (("farm-edge", "nothing-of-this"), []),
    ],
)
def test_a_word_is_completed_where_it_stands(words: tuple[str, ...], offered: list[str]) -> None:
    assert completed(*words) == offered
