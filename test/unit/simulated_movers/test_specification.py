"""What a file says of movers, and what is wrong with it."""

import pytest

from simulated_movers import MoverSpec, drawn_movers, read_movers, specs_of


def test_list_of_a_world_s_file_becomes_specifications_with_names():
    found = specs_of([{"kind": "cart", "walk": "path", "path": [[0, 0], [1, 2]]}, {"name": "Ann", "start": [1, 2]}])
    assert found[0] == MoverSpec(kind="cart", name="cart_1", walk="path", path=(0.0, 0.0, 1.0, 2.0)) and found[0].places == [(0, 0), (1, 2)]
    assert found[1] == MoverSpec(name="Ann", start=(1.0, 2.0))


def test_places_of_a_far_world_are_brought_near_its_origin():
    spec = MoverSpec(walk="path", start=(1001.0, 2001.0), path=(1002.0, 2002.0, 1003.0, 2003.0)).relative_to((1000.0, 2000.0, 50.0))
    assert spec.start == (1.0, 1.0) and spec.path == (2.0, 2.0, 3.0, 3.0)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"kind": "horse"}, "mover 1: kind = 'horse' is none of person, cart, robot, door"),
        ({"walk": "away"}, "walk = 'away' is none of"),
        ({"sped_mps": 1.0}, "did you mean speed_mps"),
        ({"speed_mps": 30.0}, "speed_mps = 30.0 is above 3.0"),
        ({"start": [1.0]}, r"start is \[1.0\], expected x and y"),
        ({"start": ["a", "b"]}, "expected x and y"),
        ({"walk": "path"}, "walk: path and a path go together"),
        ({"walk": "path", "path": [[1, 2]]}, r"path has one place, \[\[1.0, 2.0\]\], expected two or more, as \[\[x, y\], \[x, y\]\]"),
        ({"walk": "path", "path": [[1, 2], [1, 2]]}, r"path has 2 places, all at \[1.0, 2.0\], expected two that differ"),
        ({"walk": "path", "path": [1, 1, 2]}, "expected x, y, x, y"),
        ({"kind": "door"}, "a door needs start"),
        ("person", "mover 1 is 'person', expected fields such as kind"),
    ],
)
def test_what_is_wrong_with_a_mover_is_said_in_one_line(entry, said):
    with pytest.raises(ValueError, match=said) as error:
        specs_of([entry])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "entries",
    [[{"name": "a"}, {"kind": "cart"}, {"kind": "cart", "name": "a"}], [{"kind": "person"}, {"kind": "cart"}, {"name": "person_1"}]],
)
def test_two_movers_of_one_name_are_refused(entries):
    with pytest.raises(ValueError, match="^mover 3: its name, (a|person_1), is that of mover 1, too$"):
        specs_of(entries)


def test_path_may_come_by_a_place_twice():
    assert specs_of([{"walk": "path", "path": [[0, 0], [1, 0], [1, 0], [0, 0]]}])[0].places[1] == (1.0, 0.0)


TWICE = ("- {name: a, name: b}", "no YAML: key name stands in line 1, and again in line 1")


@pytest.mark.parametrize(
    ("text", "said"), [("- [", "no YAML"), ("movers: 3", "movers is int, expected a list"), ("- kind: cat", "mover 1: kind"), TWICE]
)
def test_file_that_cannot_be_used_is_named(tmp_path, text, said):
    path = tmp_path / "movers.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"movers.yaml: {said}") as error:
        read_movers(path)
    assert "\n" not in str(error.value)


def test_file_may_be_a_world_s_with_movers_in_it(tmp_path):
    path = tmp_path / "world.yaml"
    path.write_text("area: [9, 9]\nmovers:\n- kind: person\n")
    assert read_movers(path) == (MoverSpec(name="person_1"),)


def test_drawn_movers_come_from_the_seed_and_more_of_them_begin_with_the_same():
    assert drawn_movers(3, 7) == drawn_movers(5, 7)[:3] != drawn_movers(3, 8)
    assert [(m.kind, m.walk) for m in drawn_movers(4, 1)] == [
        ("person", "random"), ("person", "steps_in"), ("cart", "random"), ("robot", "random")
    ]  # fmt: skip
    assert all(not m.validate() for m in drawn_movers(8, 1))
    with pytest.raises(ValueError, match="51 movers, expected 0 to 50"):
        drawn_movers(51, 1)
