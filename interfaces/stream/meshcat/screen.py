"""A message as a picture for a robot's screen, as large as it fits. Loads Pillow: import it where it's used."""

from __future__ import annotations

import io
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from PIL import Image, ImageDraw, ImageFont

from vrs.errors import FormatError

SIZE: Final = (448, 268)
"""Pixels across and down."""
PAPER: Final = (26, 60, 84)
INK: Final = (240, 246, 250)
LARGEST, SMALLEST = 72, 14
"""Height of the letters [pixels]."""
MARGIN: Final = 18
_SPACING: Final = 1.25


@lru_cache(maxsize=1)
def _letters() -> Path:
    """The letters that matplotlib brings, found without loading it.

    Raises:
        FormatError: If they aren't there.
    """
    spec = find_spec("matplotlib")
    if spec is None or spec.origin is None:
        raise FormatError("matplotlib", "not installed; its letters are those of the robot's screen")
    return Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"


def lettered(text: str) -> bytes:
    """A PNG with a text in its middle, in lines broken between words, else within; what doesn't fit is left out."""
    for size in range(LARGEST, SMALLEST - 1, -2):
        font = ImageFont.truetype(_letters(), size)
        lines = broken(text, font, SIZE[0] - 2 * MARGIN, within=size == SMALLEST)
        if lines and len(lines) * size * _SPACING <= SIZE[1] - 2 * MARGIN:
            break
    image = Image.new("RGB", SIZE, PAPER)
    draw = ImageDraw.Draw(image)
    step = size * _SPACING
    top = max((SIZE[1] - len(lines) * step) / 2, MARGIN)
    for k, line in enumerate(lines):
        draw.text((SIZE[0] / 2, top + (k + 0.5) * step), line, INK, font, anchor="mm")
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    return file.getvalue()


def broken(text: str, font: ImageFont.FreeTypeFont, width: float, *, within: bool) -> list[str]:
    """Break a text into lines.

    Args:
        text: The text.
        font: Of its letters.
        width: Of a line at most [pixels].
        within: Whether words that are too long are broken as well; else there are no lines then.
    """
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font.getlength(longer) <= width:
            lines[-1] = longer
        elif font.getlength(word) <= width:
            lines.append(word)
        elif within:
            lines += _pieces(word, font, width)
        else:
            return []
    return lines


def _pieces(word: str, font: ImageFont.FreeTypeFont, width: float) -> list[str]:
    pieces = [""]
    for letter in word:
        if pieces[-1] and font.getlength(pieces[-1] + letter) > width:
            pieces.append("")
        pieces[-1] += letter
    return pieces
