"""A bad hand in a run: it kills, stops and starves nodes, and spoils what sensors tell, as a seed draws it.

Blows come in simulated time, so that a slow machine strikes no more often; where its clock stands, after some seconds all the same.
"""

import csv
import random
import re
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from explore_command.parameters import ROBOT_NODES
from node_life import RevivalConfig
from roslaunch_process import descendants, send
from whole_files import WaitingLines

CHAOS_FILE = "chaos.csv"
KILL, STOP, STARVE = KINDS = ("kill", "stop", "starve")
FAULTS = ("silent", "nan", "late")
_SENSORS = ("/scan", "/joint_states", "/imu/data", "/wheel_odom")
_LOOK_S = 0.25
_ROW = "{},{},{},{},{},{}\n"
_STATUS = re.compile(r"\bt=([0-9.]+) s.*\| (.*)$", re.MULTILINE)


@dataclass(frozen=True)
class ChaosConfig:
    """How bad the hand is; seconds of wall time, of pauses and faults in simulated time."""

    pause_s: float = 1.5  # between two blows, on average and exponentially distributed: several nodes are away at once
    standing_s: float = 20.0  # after which a blow comes though the simulated clock stands: the run may be at its end
    shares: tuple[float, ...] = (0.6, 0.25, 0.15)  # of KINDS
    longest_s: float = 20.0  # of a stop (issue 42) and of a starving: a node that is stopped for 5 s is killed as hung
    starved_share: float = 0.1  # of the time a node that starves may run
    starved_period_s: float = 0.2
    fault_every_s: float = 20.0  # a sensor is silent, tells no numbers or is late, on average
    longest_fault_s: float = 1.0  # three times what stops the robot


@dataclass(frozen=True)
class Blow:
    """What is done to a node, `pause_s` of simulated time after the one before it; `lasts_s` is 0 for a kill."""

    pause_s: float
    kind: str
    node: str
    lasts_s: float


def blows(seed: str, config: ChaosConfig) -> Iterator[Blow]:
    """Without end; each node has its turn before one has the next."""
    draws = random.Random(seed)
    while True:
        for node in draws.sample(ROBOT_NODES, len(ROBOT_NODES)):
            pause_s, (kind,) = draws.expovariate(1.0 / config.pause_s), draws.choices(KINDS, config.shares)
            yield Blow(pause_s, kind, node, 0.0 if kind == KILL else draws.uniform(0.0, config.longest_s))


def faults(seed: str, until_s: float, config: ChaosConfig | None = None) -> str:
    """Of the sensors, as pybullet_sim_node's timing/faults has them."""
    config = config or ChaosConfig()
    draws, found, at_s = random.Random(f"{seed} faults"), [], 0.0
    while (at_s := at_s + draws.expovariate(1.0 / config.fault_every_s)) < until_s:
        lasts_s = draws.uniform(0.0, config.longest_fault_s) + 0.01
        found.append(f"{draws.choice(FAULTS)} {draws.choice(_SENSORS)} {at_s:.2f} {at_s + lasts_s:.2f}")
    return ", ".join(found)


@dataclass
class BadHand:
    """Strikes the nodes below a process, whose output `log` has, until `over`; what it did goes to the file `told`."""

    root: int
    log: Path
    told: Path
    config: ChaosConfig = field(default_factory=ChaosConfig)
    over: threading.Event = field(default_factory=threading.Event)

    def work(self, plan: Iterator[Blow]) -> None:
        """All blows of the plan that nodes survive by what is promised: who was struck as often as it may die is spared for a while."""
        begun_s, promised = time.monotonic(), RevivalConfig()
        spared_s = promised.within_s + promised.silent_s  # a node that hangs is killed so late
        struck_s: dict[str, list[float]] = {}
        lines = WaitingLines(self.told)
        lines.add(_ROW.format("wall_s", "sim_s", "doing", "kind", "node", "lasts_s"))
        for blow in plan:
            if not self._waits(blow.pause_s):
                break
            now_s, pid = time.monotonic(), node_pid(self.root, blow.node)
            recent = [at_s for at_s in struck_s.get(blow.node, ()) if now_s - at_s < spared_s]
            if pid is None or len(recent) >= promised.deaths - 1:
                continue
            sim_s, doing = _status(self.log)
            self._strike(pid, blow)
            struck_s[blow.node] = [*recent, time.monotonic()]
            lasted_s = time.monotonic() - now_s
            lines.add(_ROW.format(f"{now_s - begun_s:.2f}", sim_s, f'"{doing}"', blow.kind, blow.node, f"{lasted_s:.2f}"))
        lines.close()

    def _waits(self, pause_s: float) -> bool:
        """Until the simulated clock has gone on by so much, or has stood for long; False when the run is over before."""
        due_s, until_s = _clock_s(self.log) + pause_s, time.monotonic() + self.config.standing_s
        while _clock_s(self.log) < due_s and time.monotonic() < until_s:
            if self.over.wait(_LOOK_S):
                break
        return not self.over.is_set()

    def _strike(self, pid: int, blow: Blow) -> None:
        """Until the node may run again, or has ended."""
        if blow.kind == KILL:
            send(signal.SIGKILL, [pid])
            return
        begun_s, period_s = time.monotonic(), self.config.starved_period_s
        runs_s = self.config.starved_share * period_s if blow.kind == STARVE else 0.0
        while time.monotonic() - begun_s < blow.lasts_s and _runs(pid) and not self.over.is_set():
            send(signal.SIGSTOP, [pid])
            self.over.wait(period_s - runs_s)
            if runs_s:
                send(signal.SIGCONT, [pid])
                self.over.wait(runs_s)
        send(signal.SIGCONT, [pid])


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def node_pid(root: int, node: str) -> int | None:
    """The process of a node below another process; None while there is none."""
    for pid in descendants(root):
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:
            continue
        if f"__name:={node}" in words and "node_revival" not in words:
            return pid
    return None


def _status(log: Path) -> tuple[str, str]:
    """Simulated seconds and what the robot does, by the newest status line; empty before the first."""
    found = _STATUS.findall(log.read_text(errors="replace")) if log.exists() else []
    return found[-1] if found else ("", "")


def _clock_s(log: Path) -> float:
    return float(_status(log)[0] or 0.0)


@contextmanager
def hand_at_work(seed: str, root: int, log: Path, folder: Path) -> Iterator[None]:
    """A bad hand strikes what is below `root` until this is left."""
    hand = BadHand(root, log, folder / CHAOS_FILE)
    at_work = threading.Thread(target=hand.work, args=(blows(seed, hand.config),), daemon=True)
    at_work.start()
    try:
        yield
    finally:
        hand.over.set()
        at_work.join()


def told(folder: Path, restarts: Mapping[str, int]) -> dict[str, int]:
    """What was done in a run, each kind counted, and how often nodes were started again."""
    with (folder / CHAOS_FILE).open(newline="") as file:
        done = Counter(row["kind"] for row in csv.DictReader(file))
    return {**{kind: done[kind] for kind in KINDS}, "restarts": sum(restarts.values())}
