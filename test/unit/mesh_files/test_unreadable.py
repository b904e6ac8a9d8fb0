"""Meshes that cannot be read: one line names the file, and says that it is damaged or what is missing."""

import json
import re
import struct
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


def requiring(folder: Path, extension: str, suffix: str, changes: dict[str, object]) -> Path:
    """A glTF file of a box that requires an extension."""
    whole = trimesh.Scene(trimesh.creation.box((4.0, 4.0, 0.5))).export(file_type="glb")
    length = int.from_bytes(whole[12:16], "little")
    header, blobs = json.loads(whole[20 : 20 + length]), whole[20 + length :]
    header["extensionsRequired"] = [extension]
    header["accessors"] = [{**accessor, **changes} for accessor in header["accessors"]]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    if suffix == ".glb":
        total = 20 + len(text) + len(blobs)
        return written(folder / "box.glb", b"glTF" + struct.pack("<IIII", 2, total, len(text), 0x4E4F534A) + text + blobs)
    header["buffers"] = [{"byteLength": len(blobs) - 8, "uri": "box.bin"}]
    (folder / "box.bin").write_bytes(blobs[8:])
    return written(folder / "box.gltf", json.dumps(header).encode())


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("extension", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_new"])
def test_gltf_that_needs_what_nobody_decodes_is_refused_by_its_name(tmp_path: Path, suffix: str, extension: str) -> None:
    assert said_of(requiring(tmp_path, extension, suffix, {})) == f"it needs {extension}, which is not known: export it without"
    assert len(read_mesh(requiring(tmp_path, "KHR_texture_transform", suffix, {})).triangles) == 12


def test_quantized_gltf_is_read_unless_its_numbers_are_shares(tmp_path: Path) -> None:
    assert len(read_mesh(requiring(tmp_path, "KHR_mesh_quantization", ".glb", {})).triangles) == 12
    assert "KHR_mesh_quantization" in said_of(requiring(tmp_path, "KHR_mesh_quantization", ".glb", {"normalized": True}))


@pytest.mark.parametrize("corner", ["2 0 0", "0 1e-12 0"])
def test_mesh_without_a_triangle_of_any_area_is_empty(tmp_path: Path, corner: str) -> None:
    (tmp_path / "line.obj").write_text(f"v 0 0 0\nv 1 0 0\nv {corner}\nf 1 2 3\n")
    with pytest.raises(ValueError, match="line.obj is empty: none of its triangles has an area"):
        read_mesh(tmp_path / "line.obj")
