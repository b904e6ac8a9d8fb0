"""Pictures as height maps: white is as high as the size says, whatever the mode; what has another white is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from world_files import read_height_map

RAMP = np.tile(np.linspace(0.0, 1.0, 16), (8, 1))


def saved(folder: Path, values: np.ndarray, mode: str = "") -> Path:
    picture = Image.fromarray(values)
    (picture.convert(mode) if mode else picture).save(folder / "a.png", format="TIFF" if values.dtype.itemsize == 4 else "PNG")
    return folder / "a.png"


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P"])
def test_picture_of_8_bits_reaches_its_height(tmp_path: Path, mode: str) -> None:
    found = read_height_map(saved(tmp_path, (RAMP * 255).astype(np.uint8), mode), (16.0, 8.0, 2.0))
    np.testing.assert_allclose(found.heights, RAMP * 2.0, atol=0.02)


@pytest.mark.parametrize("kind", [np.uint16, np.int32])
def test_picture_of_16_bits_reaches_its_height(tmp_path: Path, kind: type) -> None:
    found = read_height_map(saved(tmp_path, (RAMP * 65535).astype(kind)), (16.0, 8.0, 2.0))
    np.testing.assert_allclose(found.heights, RAMP * 2.0, atol=1e-4)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (RAMP.astype(np.float32) * 900, "of mode F with values from 0 to 900: expected 8 or 16 bits"),
        ((RAMP * 1e6).astype(np.int32), "of mode I with values from 0 to 1e[+]06"),
        ((RAMP * 100).astype(np.int32) - 5, "of mode I with values from -5 to 95"),
    ],
)
def test_picture_without_a_known_white_is_refused_by_its_mode(tmp_path: Path, values: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        read_height_map(saved(tmp_path, values), (16.0, 8.0, 2.0))
