"""config/ and urdf/ are found from the sources and from an install space of catkin."""

from pathlib import Path

from robot_body import DEFAULT_ROBOT_FILE
from robot_body.package_folder import package_folder


def test_sources_have_their_files_beside_src(tmp_path: Path) -> None:
    (tmp_path / "config").mkdir()
    assert package_folder(tmp_path / "src/robot_body/package_folder.py") == tmp_path


def test_install_space_has_them_in_its_share(tmp_path: Path) -> None:
    share = tmp_path / "share/explore_3dnav"
    (share / "config").mkdir(parents=True)
    assert package_folder(tmp_path / "lib/python3/dist-packages/robot_body/package_folder.py") == share


def test_own_robot_is_found() -> None:
    assert DEFAULT_ROBOT_FILE.is_file()
