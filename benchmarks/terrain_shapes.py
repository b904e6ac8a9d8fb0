"""Which shapes each profile classifies as the robot needs it, and what is wrong with the others.

    python benchmarks/terrain_shapes.py [NAME ...] [--profiles ours thesis] [--picture FILE.png [--heights LOW HIGH]] [--json FILE]

A shape is a small world of boxes and planes that the simulated laser sees from a few places (`test/unit/terrain_shapes`); NAME is one, or
a part of its name. Each is judged along the grid of voxels and turned against it, by expectations that come from the robot alone. With
--picture one shape is drawn from above: its classes, what is expected, and in red what is missed.
"""

import argparse
import json
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "test" / "unit" / "terrain_shapes"))

from shape_judgement import Profile, misses, profile
from shape_picture import draw
from shapes import SHAPES

Wrong = dict[str, dict[str, list[str]]]


def judge(names: list[str], profiles: list[Profile]) -> Wrong:
    """Print one row a shape and how many are right; what is wrong with each, by profile."""
    print("| shape | " + " | ".join(of.name for of in profiles) + " | what is wrong |")
    print("|---" * (len(profiles) + 2) + "|")
    found: Wrong = {}
    for name in names:
        found[name] = wrong = {of.name: misses(SHAPES[name], of) for of in profiles}
        marks = " | ".join("wrong" if wrong[of.name] else "right" for of in profiles)
        print(f"| {name} | {marks} | {'; '.join(f'{who}: {texts[0]}' for who, texts in wrong.items() if texts)} |", flush=True)
    totals = " | ".join(f"{sum(not wrong[of.name] for wrong in found.values())} of {len(found)}" for of in profiles)
    print(f"| **right** | {totals} | |")
    return found


def named(parts: list[str]) -> list[str]:
    """Shapes of these names or, where there is none, with these parts in them; all without any. SystemExit for none."""
    found = [name for name in SHAPES if not parts or name in parts or any(p in name for p in parts if p not in SHAPES)]
    if not found:
        raise SystemExit(f"no shape is called {' or '.join(parts)}; there are: {'; '.join(SHAPES)}")
    return found


def main() -> None:
    """Judge and print, or draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="shapes, or parts of their names; all without any")
    parser.add_argument("--profiles", nargs="+", default=["ours", "thesis"], help="profiles of config/profiles")
    parser.add_argument("--picture", type=Path, help="draw the one shape that is named into this file")
    parser.add_argument(
        "--heights", type=float, nargs=2, default=(-100.0, 100.0), metavar=("LOW", "HIGH"), help="draw what lies between, m"
    )
    parser.add_argument("--json", type=Path, help="write all that is wrong to this file")
    arguments = parser.parse_args()
    names, profiles = named(arguments.names), [profile(name) for name in arguments.profiles]
    if arguments.picture:
        if len(names) > 1:
            parser.error(f"a picture is of one shape, not of {len(names)}: {'; '.join(names)}")
        return draw(SHAPES[names[0]], profiles, arguments.picture, tuple(arguments.heights))
    found = judge(names, profiles)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
