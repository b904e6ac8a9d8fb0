"""SDF files and models for the tests."""

from pathlib import Path

GROUND = "<model name='ground_plane'><link name='l'><collision name='c'><geometry><plane/></geometry></collision></link></model>"


def collision(geometry: str, pose: str = "") -> str:
    """A collision with a geometry."""
    return f"<collision name='c'>{pose}<geometry>{geometry}</geometry></collision>"


def box(size: str = "1 1 1") -> str:
    return f"<box><size>{size}</size></box>"


def model(name: str, *shapes: str, pose: str = "", link_pose: str = "") -> str:
    """A model of one link."""
    return f"<model name='{name}'>{pose}<link name='link'>{link_pose}{''.join(shapes)}</link></model>"


def pose(text: str, **attributes: str) -> str:
    return f"<pose {' '.join(f'{key}={value!r}' for key, value in attributes.items())}>{text}</pose>"


def world_file(folder: Path, *elements: str, name: str = "test.world") -> Path:
    """A world, an element a line from line 3 on."""
    path = folder / name
    path.write_text("<?xml version='1.0'?>\n<sdf version='1.9'><world name='w'>\n" + "\n".join(elements) + "\n</world></sdf>\n")
    return path


def model_folder(folder: Path, name: str, text: str, config: str = "") -> Path:
    """A folder with a model.sdf, and a model.config where one is given."""
    (folder / name).mkdir(parents=True)
    (folder / name / "model.sdf").write_text(f"<sdf version='1.6'>{text}</sdf>")
    if config:
        (folder / name / "model.config").write_text(config)
    return folder / name
