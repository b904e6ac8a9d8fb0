"""A ROS package is found by the name in its package.xml, at any depth."""

from pathlib import Path

from mesh_files import package_folders, package_roots


def package(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><name> {name} </name></package>")
    return folder


def test_package_lies_deep_in_a_workspace_and_bears_another_folder_s_name(tmp_path: Path) -> None:
    mine = package(tmp_path / "src" / "vendor" / "robots" / "master", "mine")
    package(tmp_path / "src" / "mine", "other")
    ignored = package(tmp_path / "src" / "old" / "mine", "mine")
    (ignored.parent / "CATKIN_IGNORE").touch()
    (tmp_path / "src" / "again").symlink_to(tmp_path / "src")
    roots = package_roots({"ROS_PACKAGE_PATH": f"/nowhere:{tmp_path / 'src'}"})
    assert list(package_folders("mine", None, roots)) == [mine]
    assert list(package_folders("master", None, roots)) == []


def test_package_lies_around_a_file_above_it_or_beside_its_own(tmp_path: Path) -> None:
    robot, meshes = package(tmp_path / "a" / "robot-1.2", "robot"), package(tmp_path / "a" / "meshes", "meshes")
    deep = robot / "urdf" / "parts" / "arm"
    deep.mkdir(parents=True)
    assert list(package_folders("robot", deep, ())) == [robot]
    assert list(package_folders("meshes", deep, ())) == [meshes]
    assert set(package_folders("arm", deep, ())) == {deep}  # it has no package.xml: its folder's name counts
