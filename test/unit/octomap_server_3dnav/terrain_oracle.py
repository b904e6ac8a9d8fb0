"""The terrain classification once more, slowly and in plain Python: what docs/terrain.md says, a voxel at a time.

Without measured heights, from a start that is given: surfaces, floor over gaps, steps by weighted least squares, what lies beside ground,
the flood, and the frontiers. Two things are not in it: how steep a node is is asked of a function that is passed in, and ground is not
parted into traversable and inflated, for distances have tests of their own. It shares no code with `terrain` but its numbers (`Limits`).
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from octomap_server_3dnav.terrain.config import Limits

Column = tuple[int, int]
SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))
TRAVERSABLE, OBSTACLE, CLIFF, _, FRONTIER, POTENTIAL_CLIFF = range(6)
GROUND, BLOCKED, DROP, UNKNOWN, EDGE = "GBDUE"
FREE, OCCUPIED = 1, 2


class Node(NamedTuple):
    """A surface voxel."""

    x: int
    y: int
    z: int


class Run(NamedTuple):
    """Voxels of one column above each other that are all free or all occupied."""

    low: int
    high: int
    occupied: bool


def moved(c: Column, by: Column, times: int = 1) -> Column:
    return c[0] + times * by[0], c[1] + times * by[1]


@dataclass
class Oracle:
    """The classes in a map of known voxels: (x, y, z) to FREE or OCCUPIED; all others are unknown."""

    voxels: dict[tuple[int, int, int], int]
    limits: Limits
    runs: dict[Column, list[Run]] = field(init=False)
    nodes: dict[Column, list[int]] = field(init=False)
    height: dict[Node, float] = field(init=False)
    filled: set[Node] = field(init=False)

    def __post_init__(self) -> None:
        self.step, self.clearance = self.limits.step, self.limits.clearance
        levels: dict[Column, list[int]] = {}
        for x, y, z in sorted(self.voxels):
            levels.setdefault((x, y), []).append(z)
        self.runs = {c: list(self._runs(c, zs)) for c, zs in levels.items()}
        self.nodes = {c: found for c in sorted(self.runs) if (found := self._tops(c))}
        self.height = {Node(*c, z): z + 0.5 for c, zs in self.nodes.items() for z in zs}
        floor = self._floor_over_gaps()
        self.filled = set(floor)
        self.height |= floor
        for x, y, z in floor:
            self.nodes[(x, y)] = sorted([*self.nodes.get((x, y), []), z])
        self.near, self.edge = cache(self._near), cache(self._edge)

    def _runs(self, c: Column, levels: list[int]) -> Iterator[Run]:
        low = before = levels[0]
        state = self.voxels[(*c, low)]
        for z in levels[1:]:
            if z != before + 1 or self.voxels[(*c, z)] != state:
                yield Run(low, before, state == OCCUPIED)
                low, state = z, self.voxels[(*c, z)]
            before = z
        yield Run(low, before, state == OCCUPIED)

    def occupied(self, c: Column, low: int, high: int) -> int | None:
        """Lowest occupied voxel from low to high."""
        return next((z for z in range(low, high + 1) if self.voxels.get((*c, z)) == OCCUPIED), None)

    def top_near(self, c: Column, z: int, reach: int) -> int | None:
        tops = [run.high for run in self.runs.get(c, []) if run.occupied and abs(run.high - z) <= reach]
        return min(tops, key=lambda top: abs(top - z), default=None)

    def seen_down_to(self, c: Column, z: int) -> int | None:
        lowest: int | None = None
        for run in reversed(self.runs.get(c, [])):
            if run.low > z + 1:
                continue
            if run.occupied or run.high < (z - 1 if lowest is None else lowest - 2):
                break
            lowest = run.low
        return lowest

    def is_free_through(self, c: Column, low: int, high: int) -> bool:
        return any(run.low <= low and run.high >= high and not run.occupied for run in self.runs.get(c, []))

    def blocks(self, c: Column, level: int) -> int | None:
        """Lowest voxel of what stands in the way, or hangs in it."""
        top = self.top_near(c, level, self.step)
        blocked = self.occupied(c, level + self.step + 1, level + self.clearance) is not None
        blocked = blocked or (top is not None and self.occupied(c, top + 1, top + self.clearance) is not None)
        return self.occupied(c, level - self.step, level + self.step + self.clearance) if blocked else None

    def find(self, c: Column, level: int, reach: int) -> Node | None:
        """The surface nearest to a level, the lower of two."""
        near = [z for z in self.nodes.get(c, []) if abs(z - level) <= reach]
        return Node(*c, min(near, key=lambda z: (abs(z - level), z))) if near else None

    def _tops(self, c: Column) -> list[int]:
        runs, found = self.runs[c], []
        for i, run in enumerate(runs):
            if not run.occupied or self.occupied(c, run.high + 1, run.high + self.clearance) is not None:
                continue
            top_unseen = i + 1 == len(runs) or runs[i + 1].low > run.high + 1
            air_below = i > 0 and not runs[i - 1].occupied and runs[i - 1].high >= run.low - 2
            strips = i
            while strips and runs[strips - 1].occupied and runs[strips].low - runs[strips - 1].high <= self.limits.strip:
                strips -= 1
            if not (top_unseen and (air_below or run.high - runs[strips].low >= self.step)):
                found.append(run.high)
        return found

    def _floor_over_gaps(self) -> dict[Node, float]:
        lines: dict[Column, list[tuple[int, int, float]]] = {}
        for a in sorted(self.height):
            for way in SIDES[:2]:
                b, gap = self._other_side(a, way)
                for j in range(1, gap):
                    height = self.height[a] + j / gap * (self.height[b] - self.height[a])
                    lines.setdefault(moved(a[:2], way, j), []).append((gap, -self._between(a, b, j, gap), height))
        floor: dict[Node, float] = {}
        for c, found in lines.items():
            for _, below, height in sorted(found, key=lambda line: line[:2]):
                if all(abs(n.z + below) > self.step for n in floor if n[:2] == c):
                    floor[Node(*c, -below)] = height
        return floor

    def _between(self, a: Node, b: Node, j: int, gap: int) -> int:
        return math.floor((a.z * (gap - j) + b.z * j) / gap + 0.5)

    def _other_side(self, a: Node, way: Column) -> tuple[Node, int]:
        for gap in range(2, self.limits.fill + 2):
            next_one = self.find(moved(a[:2], way), a.z, self.step)
            if next_one and not self._says_nothing(next_one, a.z, self.height[a]):
                break
            b = self.find(moved(a[:2], way, gap), a.z, max(self.step, 2))
            if b is None or self._says_nothing(b, a.z, self.height[a]):
                continue
            if abs(b.z - a.z) <= 2 and self._is_one_floor(a, b, way, gap) and self._is_unknown_between(a, b, way, gap):
                return b, gap
            if abs(b.z - a.z) <= self.step:
                break
        return a, 0

    def _is_one_floor(self, a: Node, b: Node, way: Column, gap: int) -> bool:
        rise, slopes = self.height[b] - self.height[a], [0.0]
        for end, sign in ((a, -1), (b, 1)):
            n = self.find(moved(end[:2], way, 3 * sign), end.z, self.step + 1)
            slopes.append(0.0 if n is None else sign * (self.height[n] - self.height[end]) / 3)
        return min(abs(rise - gap * slope) for slope in slopes) <= self.limits.max_step

    def _is_unknown_between(self, a: Node, b: Node, way: Column, gap: int) -> bool:
        for j in range(1, gap):
            c, level = moved(a[:2], way, j), self._between(a, b, j, gap)
            low = min(self.height[a], self.height[b])
            found = [(n, near) for near in (level, b.z) if (n := self.find(c, near, self.step + 1))]
            if not all(self._says_nothing(n, near, low) for n, near in found) or self.blocks(c, level) is not None:
                return False
            if self.seen_down_to(c, level + self.step + 1) is None or self.is_free_through(c, level - self.step - 1, level):
                return False
        return True

    def _says_nothing(self, n: Node, level: int, height: float) -> bool:
        """Whether a surface far below a floor hangs in the air, or was not seen from the floor's level."""
        runs = self.runs[n[:2]]
        i = next(i for i, run in enumerate(runs) if run.high == n.z)
        hangs = i > 0 and not runs[i - 1].occupied and runs[i - 1].high >= runs[i].low - 2
        is_seen = self.is_free_through(n[:2], n.z + 1, level)
        return (hangs or not is_seen) and self.height[n] < height - self.limits.max_step

    def _near(self, s: Node, k: int) -> Node | None:
        return self.find(moved(s[:2], SIDES[k % 4]), s.z, self.step)

    def _edge(self, s: Node, k: int) -> Node | None:
        """Where a step in a direction leads; a way that leads back is judged once, in the direction of x or y that grows."""
        n = self.near(s, k)
        if n is None:
            return None
        leads_back = self.near(n, k + 2) == s and k % 4 >= 2
        return n if (self._is_climbed(n, s, k - 2) if leads_back else self._is_climbed(s, n, k)) else None

    def _is_climbed(self, s: Node, n: Node, k: int) -> bool:
        apart = abs(self.height[n] - self.height[s])
        if apart < self.limits.max_step / 5:
            return True
        rise, back, onward = self.height[n] - self.height[s], self.near(s, k + 2), self.near(n, k)
        if back and onward:
            bends = rise - self.height[s] + self.height[back], rise - self.height[onward] + self.height[n]
            if max(map(abs, bends)) < self.limits.max_step / 5:
                return True
        (behind, off), (beyond, more) = self._at_edge(s, k + 2), self._at_edge(n, k)
        jump = abs(beyond - behind)
        return (max(jump, apart) if max(off, more) > self.limits.max_step / 2 else jump) <= self.limits.max_step

    def _at_edge(self, s: Node, k: int) -> tuple[float, float]:
        """Height of the plane through the ground from s on, at the edge before it, and how far that lies off s."""
        points: list[tuple[float, float, float]] = []
        row: Node | None = s
        for i in range(5):
            if row is None:
                break
            lanes = ((-1, self.near(row, k + 1)), (0, row), (1, self.near(row, k + 3)))
            points += [(i + 0.5, lane, self.height[n]) for lane, n in lanes if n is not None]
            row = self.near(row, k)
        u, v, h = np.array(points).T
        rows = np.vstack([np.column_stack([np.ones_like(u), u, v]), np.sqrt(0.02) * np.eye(3)[1:]])
        first, weight, plane = self.height[s], np.where(u < 1.0, 0.01, 1.0), np.zeros(3)
        for i in range(4):
            if i:
                weight = (1.0 + ((h - rows[:-2] @ plane) * 10 / self.limits.max_step) ** 2) ** -2
            weighted = rows.T * np.append(weight, [1.0, 1.0])
            plane = np.linalg.solve(weighted @ rows, weighted[:, :-2] @ h)
        if 2 * weight.sum() < h.size:
            return first, 0.0
        lowest, highest = h.min() - self.limits.max_slope / 2, h.max() + self.limits.max_slope / 2
        return float(np.clip(plane[0], lowest, highest)), abs(first - plane[0] - 0.5 * plane[1])

    def beside(self, s: Node, k: int) -> str:
        if self.edge(s, k):
            return GROUND
        n, c = self.near(s, k), moved(s[:2], SIDES[k])
        if n is not None and self.height[n] >= self.height[s]:
            return BLOCKED
        if n is not None:
            return DROP if self.voxels.get((*c, n.z + 1)) == FREE else UNKNOWN
        is_blocked = self.blocks(c, s.z) is not None
        if self._drops(s, k, self.limits.assumes_cliffs and not is_blocked, 1 if is_blocked else self.limits.look):
            return DROP
        if is_blocked:
            return BLOCKED
        return EDGE if self._drops(s, k, True, self.limits.look) else UNKNOWN

    def _rise(self, columns: int) -> int:
        return max(self.step, 1 + math.floor(columns * self.limits.max_slope))

    def _drops(self, s: Node, k: int, assumed: bool, look: int) -> bool:
        for j in range(1, look + 1):
            c, rise = moved(s[:2], SIDES[k], j), self._rise(j)
            n = self.find(c, s.z, rise)
            if n is not None:
                return self.height[s] - self.height[n] > max(self.limits.max_step, (j + 1) * self.limits.max_slope)
            if self.occupied(c, s.z - self.step, s.z + self.step) is not None:
                return False
            seen = self.seen_down_to(c, s.z)
            if seen is None:
                continue
            if (assumed and seen <= s.z) or seen < s.z - rise + (self.occupied(c, seen - 2, seen - 1) is not None):
                return True
        return False

    def classes(self, start: Node, is_too_steep: Callable[[Node], bool]) -> set[tuple[int, int, int, int]]:
        """(x, y, z, label) of the ground reached from a start, obstacles beside it, and frontiers."""
        self.label, self.seen, waiting = {}, {}, [start]
        while waiting:
            s = waiting.pop()
            if s in self.label:
                continue
            self.seen |= {(s, k): self.beside(s, k) for k in range(4)}
            self.label[s] = CLIFF if any(self.seen[s, k] == DROP for k in range(4)) else OBSTACLE if is_too_steep(s) else TRAVERSABLE
            if self.label[s] == TRAVERSABLE:
                waiting += [n for k in range(4) if (n := self.edge(s, k))]
        ground = [s for s, label in self.label.items() if label == TRAVERSABLE]
        steps = [n for s in ground for k in range(4) if self.seen[s, k] == BLOCKED and (n := self.near(s, k))]
        self.label |= dict.fromkeys(steps, OBSTACLE)
        ground = [s for s in ground if self.label[s] == TRAVERSABLE]
        found = {(*s, label) for s, label in self.label.items()}
        found |= {(*c, z, OBSTACLE) for s in ground for k in range(4) for c, z in self._obstacles(s, k)}
        return found | self._frontiers(ground)

    def _obstacles(self, s: Node, k: int) -> Iterator[tuple[Column, int]]:
        """Voxels of what blocks; the unknown two columns before what stands is a side of it from now on."""
        c, low, high = moved(s[:2], SIDES[k]), s.z + self.step + 1, s.z + self.clearance
        beyond = moved(s[:2], SIDES[k], self.limits.side)
        around = [beyond, *(moved(beyond, side) for side in SIDES)]
        if self.seen[s, k] in (UNKNOWN, EDGE) and any(self.occupied(a, low, high) is not None for a in around):
            self.seen[s, k] = BLOCKED
            yield c, s.z
        if self.near(s, k) is None:
            for j in range(1, math.ceil(self.limits.keep_off) + 1):
                c = moved(s[:2], SIDES[k], j)
                n = self.find(c, s.z, self._rise(j))
                if n is None and (blocking := self.blocks(c, s.z)) is not None:
                    top = self.top_near(c, s.z, self.step)
                    yield c, blocking if top is None else top
                    return
                if n in self.label:
                    return

    def _frontiers(self, ground: list[Node]) -> set[tuple[int, int, int, int]]:
        looks: dict[Column, dict[int, set[str]]] = {}
        for s in ground:
            for k in range(4):
                ahead = moved(s[:2], SIDES[k], 2)
                reach = [(1, ahead), *((2 if i == k else 1, moved(ahead, side)) for i, side in enumerate(SIDES))]
                others = [self.find(c, s.z, self.step + 1) for least, c in reach if self.limits.fill >= least]
                if self.seen[s, k] in (UNKNOWN, EDGE) and not any(n in self.label for n in others):
                    looks.setdefault(moved(s[:2], SIDES[k]), {}).setdefault(s.z, set()).add(self.seen[s, k])
        found = set()
        for c, levels in looks.items():
            kinds: set[str] = set()
            for z in sorted(levels):
                kinds |= levels[z]
                if not any(z < other <= z + self.step + 1 for other in levels):
                    found.add((*c, z, POTENTIAL_CLIFF if EDGE in kinds else FRONTIER))
                    kinds = set()
        return found
