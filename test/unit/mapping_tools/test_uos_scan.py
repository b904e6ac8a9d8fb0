"""Scans of 3DTK: centimetres, left-handed, with and without a first line that tells their size."""

from pathlib import Path

import numpy as np
import pytest

from mapping_tools.cloud_files import CloudFileError
from mapping_tools.uos_scan import read_uos_scan


@pytest.mark.parametrize("first", ["", "4 x 361\n", "2\n"])
def test_points_are_turned_to_metres_ahead_left_and_up(tmp_path: Path, first: str) -> None:
    path = tmp_path / "scan000.3d"
    path.write_text(first + "100 20 300\n-50 0 700 12\n")
    np.testing.assert_allclose(read_uos_scan(path).points, [[3.0, -1.0, 0.2], [7.0, 0.5, 0.0]])


@pytest.mark.parametrize("content", ["1 2 3\n4 5\n", "1 2 3\n4 five 6\n", "a b c d\n1 2 3\n", "1 2 3\n1,0 2,0 3,0\n", "1 2 3\n\xff\n"])
def test_damaged_scan_is_named(tmp_path: Path, content: str) -> None:
    path = tmp_path / "scan000.3d"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(CloudFileError, match=r"scan000\.3d: expected lines of x y z in centimetres"):
        read_uos_scan(path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("content", ["", "2\n"])
def test_scan_without_points_is_named(tmp_path: Path, content: str) -> None:
    path = tmp_path / "scan000.3d"
    path.write_text(content)
    with pytest.raises(CloudFileError, match="holds no points"):
        read_uos_scan(path)


def test_absent_scan_is_named(tmp_path: Path) -> None:
    with pytest.raises(CloudFileError, match=r"none\.3d: cannot be read"):
        read_uos_scan(tmp_path / "none.3d")
