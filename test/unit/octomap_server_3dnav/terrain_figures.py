"""Side views of voxel grids as text, with the class of every surface in its place: the figures of docs/terrain.md.

One character a voxel, x to the right and z up, the same at every y; the layers above the first line are like it. # occupied, . free,
space unknown, R free and the robot stands on the voxel below. A surface is the letter of its class: T traversable, O obstacle, C cliff,
I inflation, F frontier, P potential cliff; small where nothing was hit there: floor assumed over a hole, or a frontier in free space.
"""

import numpy as np
from numpy.typing import NDArray
from terrain_worlds import FREE, OCCUPIED, RESOLUTION, UNKNOWN, pose

from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.terrain.classify import TerrainClass, TerrainConfig, classify
from robot_body import RobotBody

LETTERS = {"T": TerrainClass.TRAVERSABLE, "O": TerrainClass.OBSTACLE, "C": TerrainClass.CLIFF, "I": TerrainClass.INFLATION}
LETTER_OF = {of: letter for letter, of in LETTERS.items()} | {TerrainClass.FRONTIER: "F", TerrainClass.POTENTIAL_CLIFF: "P"}
STATES = {"#": OCCUPIED, ".": FREE, " ": UNKNOWN, "R": FREE, "F": UNKNOWN, "f": FREE, "P": UNKNOWN, "p": FREE}
STATES |= dict.fromkeys(LETTERS, OCCUPIED) | {letter.lower(): UNKNOWN for letter in LETTERS}
ROWS, ABOVE = 41, 24  # columns along y, and layers above what is drawn


def states_of(figure: list[str]) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """(nx, ROWS, nz) states of a figure, and where the robot stands in it."""
    width = max(map(len, figure))
    lines = [line.ljust(width) for line in figure]
    layers = np.array([[STATES[c] for c in line] for line in [lines[0]] * ABOVE + lines][::-1], dtype=np.uint8)
    height = next(k for k, line in enumerate(lines[::-1]) if "R" in line)
    x = (lines[::-1][height].index("R") + 0.5) * RESOLUTION
    return np.repeat(layers.T[:, None, :], ROWS, axis=1), pose(x, (ROWS + 1) / 2 * RESOLUTION, (height - 0.5) * RESOLUTION)


def classified(figure: list[str], config: TerrainConfig) -> list[str]:
    """The figure with the classes of its middle row as they are now."""
    states, T_map_base = states_of(figure)
    terrain = classify(ColumnRuns.from_dense(states, (0, 0, 0), RESOLUTION), T_map_base, config, RobotBody(), None)
    width, height = len(states), len(figure)
    drawn = [[{OCCUPIED: "#", FREE: ".", UNKNOWN: " "}[states[x, 0, z]] for x in range(width)] for z in range(height)]
    for i in np.flatnonzero(terrain.iy == ROWS // 2):
        x, z, letter = terrain.ix[i], terrain.z[i], LETTER_OF[TerrainClass(terrain.label[i])]
        if 0 <= x < width and 0 <= z < height:
            is_hit = states[x, 0, z] == OCCUPIED or (letter in "FP" and states[x, 0, z] == UNKNOWN)
            drawn[z][x] = letter if is_hit else letter.lower()
    robot = next((k, line.index("R")) for k, line in enumerate(figure[::-1]) if "R" in line)
    drawn[robot[0]][robot[1]] = "R"
    return ["".join(line).rstrip() for line in drawn[::-1]]


def classified_plan(figure: list[str], config: TerrainConfig) -> list[str]:
    """A view from above, x to the right and y up, with its classes: # a wall from floor to ceiling, all else level floor.

    Floor is T or I, small i where the robot fits straight, and - where a passage's middle line leads over that.
    """
    rows, width = figure[::-1], len(figure[0])
    states = np.full((width, len(rows), ABOVE), FREE, dtype=np.uint8)
    states[:, :, 0] = OCCUPIED
    for y, row in enumerate(rows):
        states[[x for x, c in enumerate(row) if c == "#"], y] = OCCUPIED
    y = next(k for k, row in enumerate(rows) if "R" in row)
    x = rows[y].index("R")
    here = pose((x + 0.5) * RESOLUTION, (y + 0.5) * RESOLUTION, RESOLUTION)
    terrain = navigable_terrain(ColumnRuns.from_dense(states, (0, 0, 0), RESOLUTION), here, TerrainSettings(terrain=config), None)
    drawn = [list(row) for row in rows]
    for i in np.flatnonzero((terrain.label == TerrainClass.TRAVERSABLE) | (terrain.label == TerrainClass.INFLATION)):
        drawn[terrain.iy[i]][terrain.ix[i]] = "i" if terrain.narrow[i] else LETTER_OF[TerrainClass(terrain.label[i])]
    for px, py in np.floor(np.concatenate([p.line for p in terrain.passages])[:, :2] / RESOLUTION).astype(int):
        drawn[py][px] = "-" if drawn[py][px] == "i" else drawn[py][px]
    drawn[y][x] = "R"
    return ["".join(line) for line in drawn[::-1]]
