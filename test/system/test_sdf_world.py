"""A world as Gazebo's people have them, made here: it is opened as it is, explored, and judged."""

from pathlib import Path

import trimesh
from exploring import ExploreRun, summary

LIMIT_S = 300.0


def wall(name: str, pose: str, size: str) -> str:
    shape = f"<collision name='c'><geometry><box><size>{size}</size></box></geometry></collision>"
    return f"<model name='{name}'><static>1</static><pose>{pose}</pose><link name='l'>{shape}</link></model>"


def hall(folder: Path) -> Path:
    """Two rooms of 5 x 6 m with a gap between them: walls inline, a table from a folder of models, and what nobody has."""
    table = folder / "far" / "table"
    (table / "meshes").mkdir(parents=True)
    trimesh.creation.box((100.0, 60.0, 90.0)).apply_translation((0.0, 0.0, 45.0)).export(table / "meshes" / "table.stl")
    mesh = "<mesh><uri>model://table/meshes/table.stl</uri><scale>0.01 0.01 0.01</scale></mesh>"
    link = f"<link name='l'><visual name='v'><geometry>{mesh}</geometry></visual></link>"
    (table / "model.config").write_text("<model><name>table</name><sdf version='1.6'>table.sdf</sdf></model>")
    (table / "table.sdf").write_text(f"<sdf version='1.6'><model name='table'>{link}</model></sdf>")
    walls = [
        wall("west", "-5 0 1.2 0 0 0", "0.2 6.2 2.4"),
        wall("east", "5 0 1.2 0 0 0", "0.2 6.2 2.4"),
        wall("south", "0 -3 1.2 0 0 0", "10.2 0.2 2.4"),
        wall("north", "0 3 1.2 0 0 1.5707963", "0.2 10.2 2.4"),
        wall("between", "0 1.2 1.2 0 0 0", "0.2 3.6 2.4"),
    ]
    included = [
        "<include><uri>model://ground_plane</uri></include>",
        "<include><uri>model://sun</uri></include>",
        "<include><uri>model://table</uri><pose degrees='true'>3 2 0 0 0 30</pose></include>",
        "<include><uri>model://cafe</uri></include>",
    ]
    world = folder / "hall.world"
    world.write_text(f"<sdf version='1.7'><world name='hall'>{''.join([*included, *walls])}</world></sdf>")
    described = folder / "hall.yaml"
    described.write_text("world: hall.world\nmodels: far\nstart: [-3.0, -1.0, 0.0]\n")
    return described


def test_world_with_its_models_is_explored_as_it_is(tmp_path: Path) -> None:
    with ExploreRun("--world", hall(tmp_path), "--mapping", "driving", "--headless", "--out", tmp_path / "run") as run:
        assert run.wait(LIMIT_S) == 0, run.text
    assert "hall.world:1: model model://cafe, which is in no folder of models: left out" in run.text
    result = summary(tmp_path / "run")
    assert result["success"] is True and result["collisions"] == 0, result
    assert result["coverage"] >= 0.98, result  # type: ignore[operator]
    corners = trimesh.load(tmp_path / "run" / "world.ply").vertices
    assert corners[abs(corners[:, 2] - 0.9) < 1e-4][:, :2].mean(axis=0).round(3).tolist() == [3.0, 2.0]  # the table's top
