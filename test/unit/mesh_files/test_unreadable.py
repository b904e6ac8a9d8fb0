"""Meshes that cannot be read: one line names the file, and says that it is damaged or what is missing."""

import json
import re
from pathlib import Path

import pytest
import trimesh

from world_files import read_mesh


def with_buffer(folder: Path, name: str, content: bytes | None) -> Path:
    """A .gltf of a box, whose buffer of 100,000 bytes is the file of that name beside it; None: that is not there."""
    files = trimesh.Scene(trimesh.creation.box((4.0, 4.0, 0.5))).export(file_type="gltf")
    tree = json.loads(files["model.gltf"])
    tree["buffers"] = [{"uri": name, "byteLength": 100_000} for _ in tree["buffers"]]
    (folder / "box.gltf").write_text(json.dumps(tree))
    if content is not None:
        (folder / name).write_bytes(content)
    return folder / "box.gltf"


def said_of(path: Path) -> str:
    with pytest.raises(ValueError, match=f"^cannot read the mesh {re.escape(str(path))}: ") as refused:
        read_mesh(path)
    return str(refused.value).partition(f"{path}: ")[2]


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def test_gltf_that_ends_too_early_is_damaged(tmp_path: Path) -> None:
    whole = with_buffer(tmp_path, "box.bin", b"").read_bytes()
    assert said_of(written(tmp_path / "trunc.gltf", whole[:-40])).startswith("it is damaged: no JSON, ")


def test_file_that_a_gltf_names_is_missing_or_damaged(tmp_path: Path) -> None:
    assert said_of(with_buffer(tmp_path, "gone.bin", None)) == "gone.bin, which it names, is missing"
    assert said_of(with_buffer(tmp_path, "box.bin", b"short")) == "box.bin, which it names, is damaged: 5 bytes of 100000"


@pytest.mark.parametrize("name", ["empty.glb", "empty.ply", "empty.dae", "empty.gltf"])
def test_file_of_no_bytes_is_empty(tmp_path: Path, name: str) -> None:
    assert said_of(written(tmp_path / name, b"")) == "it is empty"


@pytest.mark.parametrize(
    ("name", "content"),
    [("box.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999\n"), ("box.glb", b"glTF" + bytes(10)), ("box.ply", b"\0\1\2")],
)
def test_file_on_which_its_reader_stumbles_is_damaged(tmp_path: Path, name: str, content: bytes) -> None:
    said = said_of(written(tmp_path / name, content))
    assert said.startswith("it is damaged, or of a kind that is not known (") and "\n" not in said and not said.endswith(": )")


def test_mesh_that_the_system_does_not_give_is_told_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "world.obj").symlink_to("/proc/self/mem")
    assert said_of(tmp_path / "world.obj") == "Input/output error"
