"""The shapes are stood in as the benchmarks' drives are: their module knows where a robot can stand, and how it leans there."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[3] / "benchmarks"))
