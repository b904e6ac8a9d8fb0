"""Compiles every numba kernel into its cache, so that the first sweep of a run does not wait for the compiler."""

import importlib
import sys
from pathlib import Path

SRC = Path(__file__).resolve().parents[1] / "src"


def modules_with_warm_up() -> list[str]:
    """Names of the modules below src/ that define `compile_kernels`."""
    files = sorted(p for p in SRC.rglob("*.py") if "\ndef compile_kernels(" in p.read_text(encoding="utf-8"))
    return [".".join(p.relative_to(SRC).with_suffix("").parts) for p in files]


def forget_kernels() -> None:
    """numba takes a kernel out of its cache also when a function that it calls, of another file, has changed."""
    for pattern in ("*.nbi", "*.nbc"):
        for file in SRC.rglob(pattern):
            file.unlink()


def main() -> None:
    sys.path.insert(0, str(SRC))
    forget_kernels()
    for name in modules_with_warm_up():
        importlib.import_module(name).compile_kernels()
        print(f"compiled {name}")


if __name__ == "__main__":
    main()
