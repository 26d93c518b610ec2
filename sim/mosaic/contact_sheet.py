"""Pictures side by side, each with a line below it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image, ImageDraw, ImageFont

_GAP_PX: Final = 8
_LINE_PX: Final = 22
_TEXT_PX: Final = 15
_PAPER, _INK = (255, 255, 255), (40, 46, 52)
_QUALITY: Final = 84


class Print(NamedTuple):
    """A picture of the sheet."""

    path: Path
    caption: str


def write_contact_sheet(
    prints: Sequence[Print], path: Path, *, columns: int = 4, width_px: int = 320
) -> None:
    """Write the sheet as a JPEG, pictures from left to right and down, each `width_px` wide.

    Raises:
        ValueError: if there is no picture, or no column.
        OSError: if a picture cannot be read or the sheet not be written.
    """
    if not prints or columns < 1:
        raise ValueError(f"a sheet of {len(prints)} pictures in {columns} columns is none")
    small = [_small(each.path, width_px) for each in prints]
    columns = min(columns, len(small))
    tall = max(each.height for each in small) + _LINE_PX
    rows = -(-len(small) // columns)
    size = (_GAP_PX + columns * (width_px + _GAP_PX), _GAP_PX + rows * (tall + _GAP_PX))
    sheet = Image.new("RGB", size, _PAPER)
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(_TEXT_PX)
    for number, (image, each) in enumerate(zip(small, prints, strict=True)):
        left = _GAP_PX + number % columns * (width_px + _GAP_PX)
        top = _GAP_PX + number // columns * (tall + _GAP_PX)
        sheet.paste(image, (left, top))
        pen.text((left + 2, top + image.height + 3), each.caption, fill=_INK, font=font)
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path, "JPEG", quality=_QUALITY)


def _small(path: Path, width_px: int) -> Image.Image:
    with Image.open(path) as image:
        height = max(1, round(width_px * image.height / image.width))
        return image.convert("RGB").resize((width_px, height), Image.Resampling.LANCZOS)
