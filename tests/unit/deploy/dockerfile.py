"""The Dockerfile as data: stages by name, with what they inherit."""

import json
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[3]
TARGETS = ("edge-server", "relay", "broker", "vehicle", "cloud", "tester", "acceptance")


@dataclass
class Stage:
    """One stage: its instructions in order, those of its parent first."""

    parent: str
    instructions: list[tuple[str, str]] = field(default_factory=list)

    def all(self, word: str) -> list[str]:
        """What follows a word, each time it comes."""
        return [rest for found, rest in self.instructions if found == word]

    def last(self, word: str) -> str:
        """What a word says in the end."""
        return self.all(word)[-1]

    @property
    def environment(self) -> dict[str, str]:
        """The variables that a program finds."""
        pairs = (pair for line in self.all("ENV") for pair in shlex.split(line))
        return dict(pair.split("=", 1) for pair in pairs)

    @property
    def module(self) -> str:
        """The module that is run."""
        python, flag, module, *_ = json.loads(self.last("CMD"))
        assert (python, flag) == ("python", "-m")
        return str(module)

    @property
    def health(self) -> str | None:
        """The program that the health check names."""
        line = self.last("HEALTHCHECK")
        return None if line == "NONE" else json.loads(line.split("CMD ", 1)[1])[-1]

    @property
    def copied(self) -> list[str]:
        """Files and folders of the tree."""
        lines = [line for line in self.all("COPY") if not line.startswith("--from")]
        return [name.rstrip("/") for line in lines for name in line.split()[:-1]]

    @property
    def files_from(self) -> str:
        """The stage whose files an image takes over."""
        (found,) = re.findall(r"^--from=(\S+)", "\n".join(self.all("COPY")), re.MULTILINE)
        return str(found)

    @property
    def installed(self) -> set[str]:
        """Packages that pip has to install."""
        (line,) = (line for line in self.all("RUN") if " install " in line)
        words = line.split("&&", maxsplit=1)[0].split(" install ", 1)[1].split()
        return {word.strip('"') for word in words if not word.startswith("--")}


def stages() -> dict[str, Stage]:
    """Read the Dockerfile."""
    text = (ROOT / "deploy/Dockerfile").read_text()
    lines = re.sub(r"^\s*#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", " ").splitlines()
    found: dict[str, Stage] = {}
    stage = Stage("")
    for line in filter(str.strip, lines):
        word, rest = line.split(maxsplit=1)
        if word == "FROM":
            parent, _, name = rest.split()
            inherited = found[parent].instructions if parent in found else []
            stage = found[name] = Stage(parent, list(inherited))
        else:
            stage.instructions.append((word, " ".join(rest.split())))
    return found
