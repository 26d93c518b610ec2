"""Colours and marks that all panels share."""

from typing import Final

from matplotlib.axes import Axes

TRUE: Final = "#1b4f8f"
ESTIMATED: Final = "#e07a1f"
SETPOINT: Final = "#3a9a4b"
PLANNED: Final = "#6b6b6b"
FORBIDDEN: Final = "#c23b3b"
AXES: Final = ("#1b4f8f", "#e07a1f", "#3a9a4b", "#8b4fb0")
MODE_COLOURS: Final = ("#eef3fa", "#fdf3e7", "#edf7ee", "#f6eef9", "#f9eeee")
LABELS: Final = "#256b33"
GRID: Final = "#d8dde3"


def legend(axes: Axes) -> None:
    """A legend beside the title, where it hides nothing."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        fontsize=8,
        ncols=7,
        frameon=False,
        borderpad=0.1,
        columnspacing=1.2,
        handlelength=1.6,
    )
