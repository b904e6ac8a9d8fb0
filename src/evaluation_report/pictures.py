"""The picture of a run, small enough to be embedded: map_missed.png where it is there, else map_top.png."""

import io
from pathlib import Path

from PIL import Image

SOURCES = ("map_missed.png", "map_top.png")
_QUALITIES = (72, 60, 48, 36, 24)


def small_picture(folder: Path, width_px: int, limit_bytes: float) -> bytes | None:
    """WebP of at most so many bytes and columns; None when the run has no picture that can be read."""
    for name in SOURCES:
        try:
            with Image.open(folder / name) as image:
                return _encoded(image.convert("RGB"), width_px, limit_bytes)
        except (OSError, ValueError, SyntaxError):  # not there, or cut off: Pillow has all three for a damaged file
            continue
    return None


def _encoded(image: Image.Image, width_px: int, limit_bytes: float) -> bytes:
    """The best quality that fits; when none does the picture is made smaller."""
    small = image.copy()
    small.thumbnail((width_px, 4 * width_px), Image.Resampling.LANCZOS, reducing_gap=2.0)
    for quality in _QUALITIES:
        out = io.BytesIO()
        small.save(out, format="WEBP", quality=quality, method=4)
        if out.tell() <= limit_bytes:
            break
    else:
        if width_px > 100:
            return _encoded(small, round(0.75 * width_px), limit_bytes)
    return out.getvalue()
