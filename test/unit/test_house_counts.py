"""The measures of the house, by `scripts/count_house.py`, and that it counts what it says."""

from pathlib import Path

import count_house
import pytest

NO_JUDGEMENT = {
    "distance._FOOT": "hits of what stands are taken from above the ground's own voxel",
    "fill._BEHIND": "columns over which the slope beside a gap is taken",
    "fill._MOST_RISE": "voxels that a slope rises over the widest gap",
    "graph.ROWS": "rows of a plane beside an edge: the wheel base",
    "graph._POINTS": "size of an array",
    "graph._ROUNDS": "of a fit until it stands",
    "graph._PRIOR": "keeps a fit defined",
    "planes._COVERED": "share of a window with ground from which it counts as a plane of that size",
    "planes._OF_STEP": "slope of a step of height 1 under a window of five columns: (1 + 2) / 10",
    "planes._PULL": "keeps a fit defined",
    "planes._REACH": "voxels in which a surface of the same sheet is looked for",
}
"""Numbers in terrain/ that decide nothing by themselves, and what they do."""


@pytest.mark.parametrize("count", count_house.house_counts(), ids=lambda count: count.name)
def test_house_keeps_to_its_measures(count: count_house.Count) -> None:
    assert not count.found


@pytest.mark.parametrize("count", count_house.terrain_counts(), ids=lambda count: count.name)
def test_terrain_keeps_to_its_bars(count: count_house.Count) -> None:
    judging = [found for found in count.found if found.partition(" = ")[0] not in NO_JUDGEMENT]
    assert (len(judging) if count.bar == 0 else count.value) <= count.bar, judging


@pytest.mark.parametrize("count", count_house.readme_counts(), ids=lambda count: count.name)
def test_readme_is_read_in_a_hurry(count: count_house.Count) -> None:
    assert count.value <= count.bar, count.found


def written(folder: Path, files: dict[str, str]) -> Path:
    """A folder with these files."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def test_calls_are_followed_through_imports_methods_constructors_and_names_that_are_handed_on(tmp_path: Path) -> None:
    a = """
from p import b
from p.b import C, far
def start(x):
    c = C(x)
    c.walk()
    map(kernel, x)
    b.near()
def kernel(x): pass
def other(): far()
"""
    b = """
class C:
    def __init__(self, x): pass
    def walk(self): self.rest()
    def rest(self): pass
    def fly(self): pass
def far(): pass
def near(): near()
"""
    src = written(tmp_path, {"p/__init__.py": "", "p/a.py": a, "p/b.py": b})
    reached = count_house.calls_reached(src, "p", "p.a:start")
    assert reached == ["p.a:kernel", "p.a:start", "p.b:C.__init__", "p.b:C.rest", "p.b:C.walk", "p.b:near"]


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


def test_names_that_stand_for_a_number_are_found(tmp_path: Path) -> None:
    module = "A = 0.5\nB: int = -(2 ** 3)\nC, D = 0, 1\nE = [1]\nF = 'x'\nG = math.tan(A)\nH = True\n"
    assert [f.partition(" =")[0] for f in count_house.numeric_constants(written(tmp_path, {"m.py": module}))] == ["m.A", "m.B", "m.G"]
