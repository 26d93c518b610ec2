"""Completion of the installed programs in bash, made from their `--help`."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

_FLAG: Final = re.compile(r"^  (?:-h, )?(--[\w-]+)", re.MULTILINE)
_CHOICES: Final = re.compile(r"^  \{([\w,-]+)\}", re.MULTILINE)

PROGRAMS: Final[Mapping[str, str]] = {
    "farm-edge": "edge_server",
    "farm-broker": "mavlink_broker",
    "farm-vehicle": "uav_firmware",
    "farm-sim": "sim",
}
"""Installed programs and their modules."""
_BROKER_COMMANDS: Final = ("run", "fly", "translate", "vehicles", "sign-setup", "dead-letters")
"""Each has a parser of its own, which that of the program does not list."""
_LEAVES: Final = frozenset({"dead-letters", "sim"})
"""Commands whose choices are values, not commands with a help of their own."""
_SCRIPT: Final = """\
# Completion of {program} in bash; in zsh after `autoload -U bashcompinit && bashcompinit`.
# Made by `make reference` from the program's --help.
_{function}() {{
    local current=${{COMP_WORDS[COMP_CWORD]}} command='' word words=''
    for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        case "$command $word" in
            {commands}) command="$command $word" ;;
        esac
    done
    case $command in
{cases}
    esac
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}}
complete -o default -F _{function} {program}
"""


def scripts(help_of: Callable[[Sequence[str]], str]) -> dict[str, str]:
    """The script of each program, by its name; `help_of` gives the help of a command."""
    return {
        program: _script(program, dict(_words(module, help_of)))
        for program, module in PROGRAMS.items()
    }


def _words(module: str, help_of: Callable[[Sequence[str]], str]) -> Iterator[tuple[str, list[str]]]:
    """What may follow each command: its flags, and the commands or values below it."""
    waiting: list[tuple[str, ...]] = [()]
    while waiting:
        path = waiting.pop(0)
        text = help_of((module, *path))
        choices = _CHOICES.search(text)
        below = choices[1].split(",") if choices else []
        if module == "mavlink_broker" and not path:
            below = list(_BROKER_COMMANDS)
        yield " ".join(path), [*below, *_FLAG.findall(text)]
        if not {module, *path} & _LEAVES or (module == "edge_server" and below):
            waiting += [(*path, name) for name in below]


def _script(program: str, words: Mapping[str, Sequence[str]]) -> str:
    commands = [f'" {path}"' for path in words if path]
    cases = [
        f"        '{' ' if path else ''}{path}') words='{' '.join(found)}' ;;"
        for path, found in words.items()
    ]
    return _SCRIPT.format(
        program=program,
        function=program.replace("-", "_"),
        commands="|".join(commands) or "' '",
        cases="\n".join(cases),
    )
