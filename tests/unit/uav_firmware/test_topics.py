"""Modules that take the whole bus: what they state to read and write is what they use."""

import re
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import pytest

from uav_firmware.modules.commander import module as commander
from uav_firmware.modules.logger import module as logger
from uav_firmware.modules.mavlink import module as mavlink
from uav_firmware.modules.navigator import module as navigator
from uav_firmware.topics import Topics

DECLARED = {entry.name for entry in fields(Topics)}


def source_of(module: ModuleType) -> str:
    folder = Path(str(module.__file__)).parent
    return "\n".join(path.read_text(encoding="utf-8") for path in folder.rglob("*.py"))


@pytest.mark.parametrize("module", [commander, navigator, logger, mavlink])
def test_a_module_uses_the_topics_that_it_states(module: ModuleType) -> None:
    source = source_of(module)
    used = set(re.findall(r"\b(?:topics|_topics|t)\.(\w+)", source)) & DECLARED
    assert used == {*module.READS, *module.WRITES}


@pytest.mark.parametrize("module", [commander, navigator, logger, mavlink])
def test_what_a_module_publishes_is_among_what_it_writes(module: ModuleType) -> None:
    published = set(re.findall(r"\b_?topics\.(\w+)\.publish\(", source_of(module)))
    assert published <= set(module.WRITES)
