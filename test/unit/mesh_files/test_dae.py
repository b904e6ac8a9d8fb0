"""Parts of a COLLADA file that its reader leaves out are named."""

import re
from pathlib import Path

import pytest
import trimesh
import trimesh.exchange.dae

from mesh_files import read_triangles


def boxes(path: Path) -> list[tuple[str, str]]:
    """A file of two boxes; the ids and names of their geometries."""
    parts = [trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.creation.box((1.0, 1.0, 9.0))]
    path.write_bytes(trimesh.exchange.dae.export_collada(parts))
    return re.findall('<geometry id="([^"]+)" name="([^"]+)"', path.read_text())


STRIPS = '<linestrips count="1"><input semantic="VERTEX" source="#{0}" offset="0"/><p>0 1 2</p></linestrips></mesh>'


def spoilt(path: Path, how: str) -> str:
    """Changes the second box; its name."""
    second, name = boxes(path)[1]
    text = path.read_text()
    if how == "strips":
        first, end = text.rsplit("</mesh>", 1)
        vertices = re.findall('<vertices id="([^"]+)"', text)[-1]
        text = first + STRIPS.format(vertices) + end
    elif how == "lines":
        first, end = text.rsplit("<triangles", 1)
        text = first + "<lines" + end.replace("</triangles>", "</lines>")
    elif how == "skin":
        text = text.replace(f'<instance_geometry url="#{second}"', '<instance_controller url="#skin"')
        last = text.rindex("</instance_geometry>")
        text = text[:last] + "</instance_controller>" + text[last + len("</instance_geometry>") :]
        controllers = f'<library_controllers><controller id="skin"><skin source="#{second}"/></controller></library_controllers>'
        text = text.replace("<library_visual_scenes>", controllers + "<library_visual_scenes>")
    else:
        text = text.replace(f'url="#{second}"', 'url="other.dae#far"')
    path.write_text(text)
    return "other.dae#far" if how == "elsewhere" else name


@pytest.mark.parametrize("how", ["strips", "skin", "elsewhere"])
def test_geometry_that_is_shown_and_not_read_is_named(tmp_path: Path, how: str) -> None:
    name = spoilt(tmp_path / "a.dae", how)
    found = read_triangles(tmp_path / "a.dae")
    assert found.missing == (name,) and len(found.triangles) == 12


def test_lines_are_no_surface_and_a_whole_file_lacks_nothing(tmp_path: Path) -> None:
    boxes(tmp_path / "a.dae")
    assert read_triangles(tmp_path / "a.dae").missing == ()
    spoilt(tmp_path / "b.dae", "lines")
    found = read_triangles(tmp_path / "b.dae")
    assert found.missing == () and len(found.triangles) == 12
