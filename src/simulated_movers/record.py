"""movers.csv: where the movers truly were, for the judge alone."""

from pathlib import Path

from simulated_movers.crowd import Crowd
from whole_files import WaitingLines

MOVERS_FILE = "movers.csv"
_EVERY = 4  # ticks


class MoverRecord:
    """Writes the places of all movers, five times a second."""

    def __init__(self, path: Path, crowd: Crowd) -> None:
        """What the disk does not take waits."""
        self._crowd, self._ticks = crowd, 0
        self._file = WaitingLines(path)
        self._file.add("stamp,name,kind,x,y,z,yaw\n")

    @property
    def problem(self) -> str:
        """Why something waits; empty when all is on disk."""
        return self._file.problem

    def add(self, stamp_s: float) -> None:
        """After each tick."""
        if self._ticks % _EVERY == 0:
            for name, kind, place in zip(self._crowd.names, self._crowd.kinds, self._crowd.places().tolist(), strict=True):
                self._file.add(f"{stamp_s:.3f},{name},{kind}," + ",".join(f"{v:.3f}" for v in place) + "\n")
        self._ticks += 1
