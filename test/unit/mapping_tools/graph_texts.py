"""Pose graphs as text, made here: once around a circle that rises and falls, with loops across."""

import gtsam
import numpy as np

from rigid_geometry import inverse, quat_xyzw_from_transform, rpy_from_rotation, transform_from_rpy

INFORMATION = np.diag([100.0, 200.0, 300.0, 1000.0, 2000.0, 4000.0])
"""Translation first, as files have it."""


def circle(count=24):
    """Poses once around a circle of 20 m that rises and falls."""
    angles = 2 * np.pi * np.arange(count) / count
    return [transform_from_rpy((10 * np.cos(a), 10 * np.sin(a), np.sin(2 * a)), (0.1 * np.sin(a), 0.0, a)) for a in angles]


def numbers(values):
    return " ".join(repr(float(v)) for v in values)


def upper(information=INFORMATION):
    return numbers(information[np.triu_indices(6)])


def quat_text(T):
    return f"{numbers(T[:3, 3])} {numbers(quat_xyzw_from_transform(T))}"


def rpy_text(T):
    return f"{numbers(T[:3, 3])} {numbers(rpy_from_rotation(T[:3, :3]))}"


def edge(i, j, T, toro=False):
    return f"EDGE3 {i} {j} {rpy_text(T)} {upper()}" if toro else f"EDGE_SE3:QUAT {i} {j} {quat_text(T)} {upper()}"


def noisy(T, rng, sigma=0.01):
    return T @ np.asarray(gtsam.Pose3.Expmap(rng.normal(0.0, sigma, 6)).matrix())


def edges_of(poses, ids=None, toro=False, seed=1):
    """Lines of odometry around the circle and of a few loops across, measured with noise."""
    rng, ids = np.random.default_rng(seed), list(range(len(poses))) if ids is None else ids
    pairs = [(k - 1, k) for k in range(1, len(poses))] + [(0, len(poses) - 1), (0, 12), (3, 15), (6, 18), (9, 21)]
    return [edge(ids[i], ids[j], noisy(inverse(poses[i]) @ poses[j], rng), toro) for i, j in pairs]
