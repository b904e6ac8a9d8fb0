"""The measures of the house, by `scripts/count_house.py`, and that it counts what it says."""

from pathlib import Path

import count_house
import pytest


@pytest.mark.parametrize("count", count_house.house_counts(), ids=lambda count: count.name)
def test_house_keeps_to_its_measures(count: count_house.Count) -> None:
    assert not count.found


@pytest.mark.parametrize("count", count_house.terrain_counts(), ids=lambda count: count.name)
def test_terrain_keeps_to_its_bars(count: count_house.Count) -> None:
    assert count.value <= count.bar, count.found


@pytest.mark.parametrize("count", count_house.readme_counts(), ids=lambda count: count.name)
def test_readme_is_read_in_a_hurry(count: count_house.Count) -> None:
    assert count.value <= count.bar, count.found


def written(folder: Path, files: dict[str, str]) -> Path:
    """A folder with these files."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def test_circle_is_found_across_packages_that_load_their_parts(tmp_path: Path) -> None:
    circle = {
        "p/__init__.py": "from p.a import x",
        "p/a.py": "import q.b",
        "q/__init__.py": "",
        "q/b.py": "def late():\n    from p import y",
    }
    none = {"r/__init__.py": "from r.s import t", "r/s.py": "from q.b import late"}
    assert count_house.import_circles(written(tmp_path, circle | none)) == ["p -> p.a -> q.b -> p"]


def test_signatures_are_read_with_their_classes_and_without_what_is_private(tmp_path: Path) -> None:
    module = """
class A:
    def __init__(self, a, b): pass
    def _own(self, x: Any): pass
class _B:
    def f(self, x: Any): pass
@njit
def kernel(x: list[Any], *rest: int) -> int: pass
def plain(a: int, *, b: "Any" = 0): pass
"""
    found = dict(count_house.public_functions(written(tmp_path, {"m.py": module}) / "m.py", tmp_path))
    assert list(found) == ["m.py:A.__init__", "m.py:kernel", "m.py:plain"]
    assert [len(count_house.arguments(f)) for f in found.values()] == [2, 1, 2]
    assert [name for name, f in found.items() if count_house.speaks_of_any(f)] == ["m.py:kernel", "m.py:plain"]


def test_words_and_sentences_are_those_that_one_reads() -> None:
    page = "# Ground\n\nA [surface](x.md#y) is 0.5 m high. It has\na `sigma`!\n\n```\nnot counted\n```\n\n- five words\n- and more\n"
    assert len(count_house.words_of(page)) == 1 + 6 + 4 + 2 + 2
    assert count_house.sentence_lengths(page) == [6, 4, 2, 2]
