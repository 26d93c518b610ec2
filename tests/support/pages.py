"""Pages of the documentation as tests read them: sections, table rows, diagrams."""

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
DOCS: Final = ROOT / "docs"


def text(page: str) -> str:
    """Contents of a page, by its path below `docs/`."""
    return (DOCS / page).read_text(encoding="utf-8")


def section(page: str, title: str) -> str:
    """What stands under a heading of the second level."""
    return text(page).split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(section_or_page: str) -> list[list[str]]:
    """Cells of the first table, without its head."""
    table: list[str] = []
    for line in section_or_page.splitlines():
        if line.startswith("|"):
            table.append(line)
        elif table:
            break
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table[2:]]
