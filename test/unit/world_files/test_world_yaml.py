"""The YAML file that describes a world: what it says, what is given over it, and what it must not say."""

from pathlib import Path

import pytest

from world_files import WorldDescription, described, read_description


def written(folder: Path, text: str) -> Path:
    (folder / "w.yaml").write_text(text)
    return folder / "w.yaml"


def test_file_and_folders_are_relative_to_the_description_and_movers_stay_as_they_are(tmp_path: Path) -> None:
    text = "world: a/hall.sdf\nstart: [1, 2, 1.5]\narea: [20, 15.5]\nmodels: [m, /far]\nground: 0\nmovers:\n- {kind: person}\n"
    found = read_description(written(tmp_path, text))
    assert found == WorldDescription(
        world=str(tmp_path / "a/hall.sdf"),
        start=(1.0, 2.0, 1.5),
        area=(20.0, 15.5),
        models=(tmp_path / "m", Path("/far")),
        ground=0.0,
        movers=[{"kind": "person"}],
    )


def test_built_in_world_is_named_as_it_is(tmp_path: Path) -> None:
    assert read_description(written(tmp_path, "world: rooms")) == WorldDescription("rooms")


def test_what_is_given_stands_over_what_the_file_says(tmp_path: Path) -> None:
    path = written(tmp_path, "world: hall.stl\nstart: [1, 2, 3, 0]\nscale: 0.001\nup: y\n")
    found = described(WorldDescription(str(path), start=(5.0, 6.0, 0.0), ground=0.0))
    assert (found.start, found.scale, found.up, found.ground) == ((5.0, 6.0, 0.0), 0.001, "y", 0.0)
    assert found.world == str(tmp_path / "hall.stl")
    assert described(WorldDescription("hall.stl", scale=2.0)) == WorldDescription("hall.stl", scale=2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("world: a.sdf\nstrat: [1, 2, 3]", "unknown key strat, did you mean start[?]"),
        ("world: a.sdf\nxyzzy: 1", "unknown key xyzzy; known: world, start, area"),
        ("start: [1, 2, 3]", "of which world: FILE is one"),
        ("[1, 2]", "of which world: FILE is one"),
        ("world: 3", "of which world: FILE is one"),
        ("world: [", "cannot be read as YAML"),
        ("world: a.sdf\nstart: [1, 2]", "start: .* is no list of 3 or 4 finite numbers"),
        ("world: a.sdf\nstart: [1, 2, .nan]", "start: .* finite"),
        ("world: a.sdf\nstart: here", "start: 'here'"),
        ("world: a.sdf\narea: [1, 2, 3]", "area: .* list of 2"),
        ("world: a.sdf\narea: 5", "area: 5"),
        ("world: a.sdf\nground: low", "ground: 'low' is no finite number"),
        ("world: a.sdf\nscale: true", "scale: True"),
        ("world: a.sdf\nmodels: 3", "models: 3 is no list of folders"),
        ("world: a.sdf\nup: 3", "up: 3"),
        ("world: a.sdf\nstart: [1, 2, 0]\nstart: [2, 1, 0]", "key start stands in line 2, and again in line 3"),
        ("world: b.yaml", "b.yaml is a description, too"),
    ],
)
def test_what_is_wrong_is_named_with_file_and_key_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=said) as refused:
        read_description(path)
    assert str(refused.value).startswith(f"{path}: ") and "\n" not in str(refused.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="none.yaml: cannot be read"):
        read_description(tmp_path / "none.yaml")
