"""What the operating system says about a process and all that it has started."""

import os
from pathlib import Path

TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")


def family(process_id: int) -> list[int]:
    """Give a process and its descendants."""
    children = Path(f"/proc/{process_id}/task/{process_id}/children").read_text().split()
    return [process_id, *(pid for child in children for pid in family(int(child)))]


def cpu_seconds(process_id: int) -> float:
    """Give the processor time [s] used so far by a process and its descendants."""
    return sum(_own_cpu_seconds(pid) for pid in family(process_id))


def _own_cpu_seconds(process_id: int) -> float:
    fields = Path(f"/proc/{process_id}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_SECOND


def resident_mb(process_id: int) -> float:
    """Give the memory [MB] of a process and its descendants.

    Proportional set size: a page that several of them share is counted once in all.
    """
    return sum(_own_resident_mb(pid) for pid in family(process_id))


def _own_resident_mb(process_id: int) -> float:
    for line in Path(f"/proc/{process_id}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024.0
    return 0.0
