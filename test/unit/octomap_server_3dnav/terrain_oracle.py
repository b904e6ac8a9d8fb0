"""The terrain classification once more, slowly and in plain Python: what docs/terrain.md says, a voxel at a time.

Without measured heights, from a start that is given. It shares no code with `terrain.classify` but its numbers (`Limits`).
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from octomap_server_3dnav.terrain.barriers import narrow_radii, turning_radii
from octomap_server_3dnav.terrain.classify import TerrainConfig
from octomap_server_3dnav.terrain.config import Limits

Column = tuple[int, int]
SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))
TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER, POTENTIAL_CLIFF = range(6)
FREE, OCCUPIED = 1, 2


class Node(NamedTuple):
    """A surface voxel."""

    x: int
    y: int
    z: int


# Columns of unknown floor, the levels from which they were looked at, and by which node, and whether that look passed over an edge.
Unknown = dict[Column, dict[int, dict[Node, bool]]]


class Run(NamedTuple):
    """Voxels of one column above each other that are all free or all occupied."""

    low: int
    high: int
    occupied: bool


def moved(c: Column, by: Column, times: int = 1) -> Column:
    return c[0] + times * by[0], c[1] + times * by[1]


def turned(k: int, by: int) -> Column:
    return SIDES[(k + by) % 4]


@dataclass
class Oracle:
    """The classes around `start` in a map of known voxels: (x, y, z) to FREE or OCCUPIED; all others are unknown."""

    voxels: dict[tuple[int, int, int], int]
    config: TerrainConfig
    resolution: float
    nodes: dict[Column, list[int]] = field(init=False)
    assumed: set[Node] = field(init=False)  # floor over holes and pits
    label: dict[Node, int] = field(init=False, default_factory=dict)
    narrow: set[Node] = field(init=False, default_factory=set)  # inflated, and wide enough to drive straight

    def __post_init__(self) -> None:
        self.limits = Limits.of(self.config, self.resolution, is_measured=False)
        self.step, self.clearance = self.limits.step, self.limits.clearance
        heights: dict[Column, list[int]] = {}
        for x, y, z in sorted(self.voxels):
            heights.setdefault((x, y), []).append(z)
        self.runs = {c: list(self._runs(c, levels)) for c, levels in heights.items()}
        self.nodes = {c: found for c in self.runs if (found := self._tops(c))}
        assumed = {Node(*c, z) for c, z in self._holes()}
        for c, z in [(s[:2], s.z) for s in assumed]:
            self.nodes.setdefault(c, []).append(z)
        self.nodes = {c: sorted(levels) for c, levels in self.nodes.items()}
        if self.config.hole_bridge_voxels:
            covered = {s: Node(*s[:2], self._covered(s)) for c, levels in self.nodes.items() for s in (Node(*c, z) for z in levels)}
            self.nodes = {c: [covered[Node(*c, z)].z for z in levels] for c, levels in self.nodes.items()}
            assumed = {floor for s, floor in covered.items() if s in assumed or floor != s}
        self.assumed = assumed

    # -- what is known of a column

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

    def drivable(self, columns: int) -> int:
        return max(self.step, 1 + math.floor(columns * self.limits.max_slope))

    # -- surfaces

    def _tops(self, c: Column) -> list[int]:
        runs, found = self.runs[c], []
        for i, run in enumerate(runs):
            if not run.occupied or self.occupied(c, run.high + 1, run.high + self.clearance) is not None:
                continue
            top_unseen = i + 1 == len(runs) or runs[i + 1].low > run.high + 1
            air_below = i > 0 and not runs[i - 1].occupied and runs[i - 1].high >= run.low - 2
            strips = i
            while strips and runs[strips - 1].occupied and runs[strips].low - runs[strips - 1].high <= 3:
                strips -= 1
            is_wall = run.high - runs[strips].low >= self.step
            if not (top_unseen and (air_below or is_wall)):
                found.append(run.high)
        return found

    def _holes(self) -> list[tuple[Column, int]]:
        found: dict[Column, list[tuple[int, int]]] = {}
        for c, levels in self.nodes.items():
            for z in levels:
                for way in SIDES[:2]:
                    for between, level, gap in self._over_hole(Node(*c, z), way):
                        found.setdefault(between, []).append((level, gap))
        return [(c, z) for c, bridges in found.items() for z in self._one_each(sorted(bridges))]

    def _over_hole(self, a: Node, way: Column) -> list[tuple[Column, int, int]]:
        c, found = (a.x, a.y), []
        for gap in range(2, self.config.hole_bridge_voxels + 2):
            if self.find(moved(c, way, gap - 1), a.z, self.step):
                break
            b = self.find(moved(c, way, gap), a.z, 2)
            if b is None or self._is_alone(a) or self._is_alone(b) or not self._one_floor(a, b, way, gap):
                continue
            bridge = [(moved(c, way, j), math.floor((a.z * (gap - j) + b.z * j) / gap + 0.5), gap) for j in range(1, gap)]
            if all(self._is_hole(between, level) and not self.find(between, b.z, self.step) for between, level, _ in bridge):
                found += bridge
        return found

    def _is_alone(self, s: Node) -> bool:
        beside = [(s.x + dx, s.y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
        return all(self.find(c, s.z, self.step) is None for c in beside)

    def _one_floor(self, a: Node, b: Node, way: Column, gap: int) -> bool:
        if abs(b.z - a.z) <= 1:
            return True
        sign = 1 if b.z > a.z else -1
        behind, ahead = self.find(moved(a[:2], way, -3), a.z, self.step), self.find(moved(a[:2], way, gap + 3), b.z, self.step)
        return (behind is not None and (a.z - behind.z) * sign >= 1) or (ahead is not None and (ahead.z - b.z) * sign >= 1)

    def _is_hole(self, c: Column, level: int) -> bool:
        if self.seen_down_to(c, level + self.step + 1) is None:
            return False
        seen = self.seen_down_to(c, level)
        solid = self.find(c, level, self.step) is not None or self.blocks(c, level) is not None
        return not solid and not (seen is not None and seen < level - self.step)

    def _one_each(self, bridges: list[tuple[int, int]]) -> Iterator[int]:
        groups: list[list[tuple[int, int]]] = []
        for level, gap in bridges:
            if groups and level - groups[-1][-1][0] <= self.step:
                groups[-1].append((level, gap))
            else:
                groups.append([(level, gap)])
        for group in groups:
            yield min(group, key=lambda bridge: (bridge[1], -bridge[0]))[0]

    def _rim(self, s: Node) -> dict[int, int]:
        """By direction the levels of the ground beside a surface that is higher than a step."""
        beside = {k: self.find(moved(s[:2], SIDES[k]), s.z, self.step) for k in range(4)}
        return {k: n.z for k, n in beside.items() if n is not None and n.z - s.z > self.limits.steps.voxels}

    def _covered(self, s: Node) -> int:
        """The level of floor over a pit of a column or two; else that of the surface itself."""
        rim, pairs = self._rim(s), []
        if len(rim) == 4:
            pairs, floor = [(rim[0], rim[2]), (rim[1], rim[3])], list(rim.values())
        elif len(rim) == 3:
            low = next(k for k in range(4) if k not in rim)
            back, left, right = ((low + k) % 4 for k in (2, 1, 3))
            other = self.find(moved(s[:2], SIDES[low]), s.z, self.step)
            beyond = self._rim(other) if other is not None else {}
            if set(beyond) == {low, left, right} and self.find(s[:2], other.z, self.step) == s:
                pairs = [(rim[back], beyond[low]), (rim[left], rim[right]), (beyond[left], beyond[right])]
                pairs += [(rim[left], beyond[left]), (rim[right], beyond[right])]
                floor = [rim[left], rim[right]]
        is_pit = pairs and all(abs(a - b) <= self.limits.steps.voxels for a, b in pairs)
        return math.floor(sum(floor) / len(floor) + 0.5) if is_pit else s.z

    # -- steps and slopes

    def near(self, s: Node, k: int) -> Node | None:
        return self.find(moved(s[:2], SIDES[k % 4]), s.z, self.step)

    def _patch(self, s: Node, k: int) -> float:
        heights, row = [], s
        for _ in range(2):
            heights += [n.z for n in (row, self.near(row, k + 1), self.near(row, k + 3)) if n is not None]
            after = self.near(row, k)
            if after is None:
                break
            row = after
        return sum(heights) / len(heights)

    def edge(self, s: Node, k: int) -> Node | None:
        """Where a step in a direction leads."""
        n = self.near(s, k)
        if n is None or n.z == s.z:
            return n
        return n if abs(self._patch(n, k) - self._patch(s, k + 2)) <= self.limits.steps.voxels else None

    def _corner(self, s: Node, k: int) -> Node | None:
        a, b = self.edge(s, k), self.edge(s, k + 1)
        if a is None or b is None:
            return None
        one, other = self.edge(a, k + 1), self.edge(b, k)
        return one if one == other else None

    def slope(self, s: Node) -> float:
        """Tangent of the steepest slope of the plane through what straight ways over steps reach."""
        points, reach = [(0, 0, 0)], self.limits.slope_reach
        for k in range(4):
            for go, length in ((self.edge, reach), (self._corner, round(reach / math.sqrt(2.0)))):
                node: Node | None = s
                for _ in range(length):
                    node = go(node, k) if node else None
                    if node:
                        points.append((node.x - s.x, node.y - s.y, node.z - s.z))
        n = len(points)
        mean = [sum(p[i] for p in points) / n for i in range(3)]
        xx, yy, xy, xz, yz = (sum((p[i] - mean[i]) * (p[j] - mean[j]) for p in points) for i, j in ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2)))
        xx, yy = xx + 0.5, yy + 0.5
        det = xx * yy - xy * xy
        return math.hypot((yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det)

    # -- what lies beside

    def falls(self, s: Node, beside: Column, way: Column, assumed: bool) -> bool:
        """Whether free space was seen below all ground that could be driven to, from a column on; or, `assumed`, where ground would be."""
        for j in range(1, self.limits.look + 1):
            c, limit = moved(beside, way, j), self.drivable(j)
            if self.find(c, s.z, limit) or self.occupied(c, s.z - self.step, s.z + self.step) is not None:
                return False
            seen = self.seen_down_to(c, s.z)
            if seen is None:
                continue
            on_ground = self.occupied(c, seen - 2, seen - 1) is not None
            if (assumed and seen <= s.z) or seen < s.z - limit or (on_ground and seen <= s.z - limit):
                return True
        return False

    def look(self, s: Node, k: int) -> str:
        c, way, aside, half = s[:2], SIDES[k], turned(k, 1), self.config.cliff_area_voxels
        if self.blocks(moved(c, way), s.z) is not None:
            return "obstacle"
        assumed = self.config.cliff_evidence == "assumed"
        if self.falls(s, c, way, assumed):
            return "drop"
        for offset in range(-half, half + 1):
            if any(self.find(moved(moved(c, aside, offset), way, j), s.z, self.drivable(j)) for j in (1, 2, 3)):
                return "unknown"
        around = (moved(c, aside, side * offset) for offset in range(1, half + 1) for side in (-1, 1))
        if any(self.falls(s, beside, way, assumed) for beside in around):
            return "drop"
        return "edge" if self.falls(s, c, way, True) else "unknown"

    def beside(self, s: Node, k: int) -> str:
        """What lies in a direction in which no step leads: "obstacle", "drop", "edge" or "unknown"."""
        n = self.near(s, k)
        if n is None:
            return self.look(s, k)
        if n.z > s.z:
            return "obstacle"
        top_seen = self.voxels.get((n.x, n.y, n.z + 1)) == FREE
        return ("drop" if top_seen else "unknown") if n.z < s.z else "obstacle"

    # -- the classes

    def classes(self, start: Node) -> set[tuple[int, int, int, int]]:
        """(x, y, z, class) of all surfaces, obstacles and frontiers around the start."""
        self._flood(start)
        for s in [s for s, label in self.label.items() if label == TRAVERSABLE]:
            for k in range(4):
                n = self.near(s, k)
                if n is not None and self.edge(s, k) is None and n.z > s.z:
                    self.label[n] = OBSTACLE
        (obstacles, beyond), before = self._barriers(), dict(self.label)
        barriers = (
            [(c, level) for c, _, level in obstacles],
            [(n[:2], n.z) for n in self._of(OBSTACLE)],
            [(n[:2], n.z) for n in [*self._of(CLIFF), *beyond]],
        )
        self._inflate(barriers, narrow_radii(self.config, self.limits))
        wide_enough, self.label = set(self._of(TRAVERSABLE)), before
        self._inflate(barriers, turning_radii(self.config, self.limits))
        self.narrow = wide_enough & set(self._of(INFLATION))
        unknown, gaps = self._looks()
        reached = self._reached_from(start)
        self._keep_off([*self._doubtful(unknown, reached), *self._doubtful(gaps, reached)], start)
        found = {(*s, label) for s, label in self.label.items()} | {(*c, z, OBSTACLE) for c, z, _ in obstacles}
        return found | {voxel for c, levels in unknown.items() for voxel in self._frontier_voxels(c, levels)}

    def _of(self, label: int) -> list[Node]:
        return [s for s, found in self.label.items() if found == label]

    def _flood(self, start: Node) -> None:
        waiting = [start]
        while waiting:
            s = waiting.pop()
            if s in self.label:
                continue
            edges = [self.edge(s, k) for k in range(4)]
            if any(self.beside(s, k) == "drop" for k in range(4) if edges[k] is None):
                self.label[s] = CLIFF
            elif self.slope(s) > self.limits.steepest[1] or self._may_be_side(s):
                self.label[s] = OBSTACLE
            else:
                self.label[s] = TRAVERSABLE
                waiting += [n for n in edges if n is not None]

    def _may_be_side(self, s: Node) -> bool:
        """Something stands within two columns, and nothing was seen right above assumed floor, or above a node where it was beside it."""
        if self._is_seen_above(s[:2], s.z):
            if s not in self.assumed or any(self.voxels.get((*s[:2], z)) == FREE for z in range(s.z + 1, s.z + self.step + 1)):
                return False
        elif not any(self._is_seen_above(moved(s[:2], SIDES[k]), s.z) for k in range(4) if self.near(s, k) is not None):
            return False
        return self._stands_within_two(s[:2], s.z)

    def _stands_within_two(self, c: Column, level: int) -> bool:
        around = [(c[0] + dx, c[1] + dy) for dx in range(-2, 3) for dy in range(-2, 3)]
        return any(self.occupied(b, level + self.step + 1, level + self.clearance) is not None for b in around)

    def _is_seen_above(self, c: Column, level: int) -> bool:
        return any(self.voxels.get((*c, z)) == FREE for z in range(level + self.step + 1, level + self.clearance + 1))

    def _barriers(self) -> tuple[set[tuple[Column, int, int]], set[Node]]:
        """Obstacles (column, voxel, level of the ground in front) beside traversable ground, and cliffs that the flood did not reach."""
        found, cliffs = set(), set()
        for s in self._of(TRAVERSABLE):
            found |= {(s[:2], z, s.z) for z in self._may_hang_over(s)}
            for k in range(4):
                is_unknown = self.edge(s, k) is None and self.beside(s, k) in ("unknown", "edge")
                if is_unknown and self._stands_around(moved(s[:2], SIDES[k], 2), s.z):
                    found.add((moved(s[:2], SIDES[k]), s.z, s.z))
                seen = self._barrier_along(s, SIDES[k]) if self.near(s, k) is None else None
                if isinstance(seen, Node):
                    cliffs.add(seen)
                elif seen is not None:
                    found.add((*seen, s.z))
        return found, cliffs

    def _may_hang_over(self, s: Node) -> list[int]:
        """The lowest voxel at the robot's height that is unknown between free space beside something that hangs."""
        for below, above in itertools.pairwise(self.runs.get(s[:2], [])):
            low, high = below.high + 1, above.low - 1
            is_between = low <= high and not below.occupied and not above.occupied
            if is_between and s.z + self.step < low and high <= s.z + self.clearance:
                if any(self._hangs(moved(s[:2], way), low - 1, high + 1) for way in SIDES):
                    return [low]
        return []

    def _hangs(self, c: Column, low: int, high: int) -> bool:
        """Something is there over free space, a voxel of which may be unknown."""
        for below, run in itertools.pairwise(self.runs.get(c, [])):
            if run.occupied and run.low <= high and run.high >= low and not below.occupied and below.high >= run.low - 2:
                return True
        return False

    def _barrier_along(self, s: Node, way: Column) -> tuple[Column, int] | Node | None:
        """What stands or hangs along a way, or the cliff at which ground beyond the unknown ends."""
        for j in range(1, self.limits.inflation + 1):
            c = moved(s[:2], way, j)
            n = self.find(c, s.z, self.drivable(j))
            if n is not None and n in self.label:
                return None
            if n is not None and any(self.edge(n, k) is None and self.beside(n, k) == "drop" for k in range(4)):
                return n
            voxel = self.blocks(c, s.z) if n is None else None
            if voxel is not None:
                floor = self.top_near(c, s.z, self.step)
                return c, voxel if floor is None else floor
        return None

    def _inflate(self, barriers: Iterable[list[tuple[Column, int]]], radii: Iterable[float]) -> None:
        for places, radius in zip(barriers, radii, strict=True):
            band = self.step + math.ceil(radius * self.limits.max_slope)
            for s in self._of(TRAVERSABLE):
                if any(abs(s.z - level) <= band and self._is_near(s, c, radius) for c, level in places):
                    self.label[s] = INFLATION

    def _is_near(self, s: Node, c: Column, radius: float) -> bool:
        dx, dy = abs(s.x - c[0]), abs(s.y - c[1])
        if self.config.inflation_shape == "square":
            return max(dx, dy) <= radius
        return dx * dx + dy * dy <= radius * radius + 1e-6

    def _doubtful(self, unknown: Unknown, reached: set[Node]) -> list[tuple[Column, int]]:
        """All unknown floor of places that no reached ground looks at, and assumed floor that does."""
        left, doubtful = {(*c, z) for c, levels in unknown.items() for z in levels}, []
        while left:
            place, waiting = set(), [left.pop()]
            while waiting:
                a = waiting.pop()
                place.add(a)
                beside = {b for b in left if abs(a[0] - b[0]) <= 2 and abs(a[1] - b[1]) <= 2 and abs(a[2] - b[2]) <= 3}
                left -= beside
                waiting += beside
            looking = {s for x, y, z in place for s in unknown[x, y][z]}
            if not looking & reached:
                doubtful += [((x, y), z) for x, y, z in place] + [(s[:2], s.z) for s in looking & self.assumed]
        return doubtful

    def _reached_from(self, start: Node) -> set[Node]:
        """Traversable ground connected with what is nearest to the start."""
        row = self._nearest_ground(start)[0]
        reached, waiting = set(row[:1]), row[:1]
        while waiting:
            s = waiting.pop()
            beside = {n for k in range(4) if (n := self.edge(s, k)) is not None and self.label.get(n) == TRAVERSABLE} - reached
            reached |= beside
            waiting += beside
        return reached

    def _keep_off(self, edges: list[tuple[Column, int]], start: Node) -> None:
        before = dict(self.label)
        self._inflate([edges], [turning_radii(self.config, self.limits).cliffs])
        row, steps = self._nearest_ground(start)
        if not row or steps > 2 * self.limits.inflation:
            self.label = before

    def _nearest_ground(self, start: Node) -> tuple[list[Node], int]:
        """Traversable nodes fewest steps over ground from the start, the first in the map first, as `min_traversable_voxels` is 1."""
        known, row, steps = {start}, [start], 0
        while row and not any(self.label[s] == TRAVERSABLE for s in row):
            beside = {n for s in row for k in range(4) if (n := self.edge(s, k)) is not None}
            row = [n for n in beside - known if self.label.get(n) == INFLATION or self.label.get(n) == TRAVERSABLE]
            known.update(row)
            steps += 1
        return sorted(s for s in row if self.label[s] == TRAVERSABLE), steps

    def _looks(self) -> tuple[Unknown, Unknown]:
        """Frontiers, and gaps near things."""
        frontiers: Unknown = {}
        gaps: Unknown = {}
        for s in [*self._of(TRAVERSABLE), *self._of(INFLATION)]:
            for k in range(4):
                what, c = "" if self.edge(s, k) else self.beside(s, k), moved(s[:2], SIDES[k])
                if what not in ("unknown", "edge") or self._stands_around(moved(c, SIDES[k]), s.z):
                    continue
                is_gap = any(self.find(b, s.z, self.step + 1) in self.label for b in self._around(moved(c, SIDES[k])))
                if is_gap and not self._stands_within_two(c, s.z):
                    continue
                looks = (gaps if is_gap else frontiers).setdefault(c, {}).setdefault(s.z, {})
                looks[s] = what == "edge"
        return frontiers, gaps

    def _frontier_voxels(self, c: Column, levels: dict[int, dict[Node, bool]]) -> Iterator[tuple[int, int, int, int]]:
        """One frontier voxel for levels of a column that steps part, the highest; a potential cliff when one of them is."""
        group: list[int] = []
        for z in sorted(levels):
            group.append(z)
            if not any(z < other <= z + self.step + 1 for other in levels):
                yield (*c, z, POTENTIAL_CLIFF if any(any(levels[g].values()) for g in group) else FRONTIER)
                group = []

    def _around(self, c: Column) -> list[Column]:
        return [moved(c, side) for side in ((0, 0), *SIDES)]

    def _stands_around(self, c: Column, level: int) -> bool:
        return any(self._stands_at(beside, level) for beside in self._around(c))

    def _stands_at(self, c: Column, level: int) -> bool:
        node = self.find(c, level, self.step + 1)
        is_closed = node is not None and self.label.get(node) == OBSTACLE
        return is_closed or self.occupied(c, level + self.step + 1, level + self.clearance) is not None
