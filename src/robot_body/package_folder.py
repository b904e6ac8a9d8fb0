"""Where the package's own files are: config/ and urdf/."""

from pathlib import Path


def package_folder(module: Path) -> Path:
    """The folder of config/ and urdf/ for a module of src/PACKAGE/, or of an install space's lib/python3/dist-packages/PACKAGE/."""
    source = module.parents[2]
    installed = source.parents[1] / "share" / "explore_3dnav"
    return source if (source / "config").is_dir() or not installed.is_dir() else installed


PACKAGE_FOLDER = package_folder(Path(__file__).resolve())
