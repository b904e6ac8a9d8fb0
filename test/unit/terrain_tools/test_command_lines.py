"""Whatever is wrong with a file, every tool says it in one line that names the file, ends with 2 and leaves nothing behind."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mapping_tools import calibrate_mount, map_bag, merge_maps, optimize_graph, register_clouds
from terrain_tools import classify_map, export_map

POINT = ("1", "2", "0")
TOOLS: dict[str, tuple[Callable[[Sequence[str]], int], Callable[[Path, Path], list[str]], str]] = {
    "map_bag": (map_bag.main, lambda file, out: [str(file), "--out", str(out)], ".bag"),
    "register_clouds": (register_clouds.main, lambda file, out: [str(file), str(file), "--out", str(out)], ".pcd"),
    "optimize_graph": (optimize_graph.main, lambda file, out: [str(file), "--out", str(out)], ".g2o"),
    "classify_map": (classify_map.main, lambda file, out: [str(file), "--start", *POINT, "--out", str(out)], ".pcd"),
    "export_map": (export_map.main, lambda file, out: [str(file), "--out", str(out.with_suffix(".pcd"))], ".bt"),
}


def made(path: Path, what: str) -> Path:
    """A file of a kind of wrongness."""
    if what == "folder":
        path.mkdir()
    elif what == "loop":
        path.symlink_to(path)
    elif what == "unreadable":
        path.symlink_to("/proc/self/mem")
    elif what != "missing":
        path.write_bytes({"empty": b"", "noise": np.random.default_rng(1).bytes(3000), "prose": b"to whom it may concern\n"}[what])
    return path


@pytest.mark.parametrize(
    ("module", "work"),
    [
        (map_bag, "map_recording"),
        (merge_maps, "merge"),
        (register_clouds, "register"),
        (optimize_graph, "optimize"),
        (classify_map, "classify_map"),
        (export_map, "export_map"),
        (calibrate_mount, "calibrate"),
    ],
)
def test_memory_that_does_not_suffice_is_one_line_and_exit_code_two(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, module: Any, work: str
) -> None:
    def too_large(*_: object) -> int:
        raise MemoryError

    monkeypatch.setattr(module, work, too_large)
    tool = module.__name__.rpartition(".")[2]
    words = {"calibrate_mount": ["--from", "a", "--out", "b"], "merge_maps": ["a", "b", "--out", "c"]}
    assert module.main(words.get(tool, TOOLS[tool][1](tmp_path / "a", tmp_path / "b") if tool in TOOLS else [])) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and said.err.startswith(f"./{tool}: the memory does not suffice")


@pytest.mark.parametrize("what", ["missing", "folder", "loop", "unreadable", "empty", "noise", "prose"])
@pytest.mark.parametrize("tool", TOOLS)
def test_wrong_file_is_one_line_and_exit_code_two(tmp_path: Path, capsys: pytest.CaptureFixture[str], tool: str, what: str) -> None:
    main, words, suffix = TOOLS[tool]
    file = made(tmp_path / f"the_file{suffix}", what)
    assert main(words(file, tmp_path / "out")) == 2
    said = capsys.readouterr()
    lines = said.err.splitlines()
    assert said.out == "" and len(lines) == 1 and lines[0].startswith(f"./{tool}: ") and file.name in lines[0], said
    out = tmp_path / "out"
    assert not out.exists() or not any(path.is_file() for path in out.rglob("*"))
