"""Outputs that a tool is told to write: each that would replace an input, or cannot be written, is named before anything is touched."""

from pathlib import Path

import pytest

from whole_files import check_files, check_folder, lies_in


def refusal(path: Path, inputs: list[Path]) -> str:
    with pytest.raises(ValueError, match="^--out ") as found:
        check_files([("--out", path)], inputs)
    assert "\n" not in str(found.value)
    return str(found.value)


def test_output_is_a_new_file_or_another_one(tmp_path: Path) -> None:
    (tmp_path / "in").write_text("in")
    (tmp_path / "old").write_text("old")
    check_files([("--out", tmp_path / "new"), ("--json", tmp_path / "old")], [tmp_path / "in", tmp_path / "absent"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", "old"]


@pytest.mark.parametrize("way", ["itself", "through its folder", "symbolic link", "hard link", "the input is the link"])
def test_output_is_no_input_by_whatever_way_it_is_named(tmp_path: Path, way: str) -> None:
    given, out = tmp_path / "in", tmp_path / "in"
    given.write_text("in")
    if way == "through its folder":
        (tmp_path / "sub").mkdir()
        out = tmp_path / "sub" / ".." / "in"
    elif way == "symbolic link":
        out = tmp_path / "link"
        out.symlink_to(given)
    elif way == "hard link":
        out = tmp_path / "link"
        out.hardlink_to(given)
    elif way == "the input is the link":
        given = tmp_path / "link"
        given.symlink_to(out)
    assert "is the input" in refusal(out, [given])


def test_two_outputs_are_two_files_also_before_they_are_there(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="--json .* the same file as --out"):
        check_files([("--out", tmp_path / "x"), ("--json", tmp_path / "." / "x")])


def test_file_of_an_input_folder_is_not_replaced_and_a_new_one_may_be_there(tmp_path: Path) -> None:
    run = tmp_path / "run"
    (run / "sweeps").mkdir(parents=True)
    (run / "sweeps" / "0.npz").write_text("a sweep")
    assert "is a file of" in refusal(run / "sweeps" / "0.npz", [run])
    check_files([("--out", run / "new.ply")], [run])


def test_what_is_no_file_or_has_no_folder_is_named(tmp_path: Path) -> None:
    assert "is a folder, expected a file" in refusal(tmp_path, [])
    assert "no such folder" in refusal(tmp_path / "absent" / "x", [])
    assert "device" in refusal(Path("/dev/null"), [])


def test_folder_is_new_or_one_and_holds_no_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in")
    check_folder("--out", tmp_path / "new" / "below")
    check_folder("--out", tmp_path, [tmp_path / "file"], ["other"])
    for folder, said in ((tmp_path / "file", "is a file, expected a folder"), (tmp_path / "file" / "x", "is a file, expected a folder")):
        with pytest.raises(ValueError, match=said):
            check_folder("--out", folder)
    with pytest.raises(ValueError, match="its file is the input"):
        check_folder("--out", tmp_path, [tmp_path / "file"], ["file"])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_path_lies_in_a_folder_through_links(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "run")
    assert lies_in(tmp_path / "link" / "new" / "x", tmp_path / "run") and lies_in(tmp_path / "run", tmp_path / "link")
    assert not lies_in(tmp_path / "other", tmp_path / "run")
