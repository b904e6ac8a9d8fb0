"""Beams against moving boxes and posts, beside meshes of the same shapes in open3d."""

import numpy as np
import pytest
import trimesh

from pybullet_simulation.world import hits_and_incidence, raycasting_scene
from rigid_geometry import transform_from_rpy
from simulated_movers import MovingParts, Part, joined_parts

PARTS = (Part(True, (0.4, 0.2, 0.3), (0.0, 0.0, 0.0)), Part(False, (0.2, 0.2, 0.6), (0.0, 0.0, 0.0)))
POSES = np.array([[1.0, 0.5, 0.3, 0.7, 0.0], [-0.8, 1.0, 0.6, -0.4, 0.35]])


def parts_at(poses, parts=PARTS):
    return MovingParts.of([("", part) for part in parts], poses, 0.05)


def meshes():
    for part, (x, y, z, yaw, pitch) in zip(PARTS, POSES, strict=True):
        T = transform_from_rpy((x, y, z), (0.0, pitch, yaw))
        size = 2.0 * np.array(part.half)
        yield trimesh.creation.box(size, T) if part.is_box else trimesh.creation.cylinder(part.half[0], size[2], sections=720, transform=T)


def test_beams_meet_boxes_and_leaning_posts_where_they_meet_meshes_of_them():
    rng = np.random.default_rng(1)
    origins = rng.normal(size=(4000, 3))
    origins *= 4.0 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = np.array([0.1, 0.7, 0.4]) + rng.normal(0.0, 0.6, (4000, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = np.hstack([origins, directions]).astype(np.float32)
    mesh = trimesh.util.concatenate(list(meshes()))
    expected, cosines = hits_and_incidence(raycasting_scene(mesh.vertices, mesh.faces.astype(np.int32)), rays)
    found, at = parts_at(np.stack([POSES, POSES])).hits(rays, np.zeros(4000))
    both = np.isfinite(found) & np.isfinite(expected)
    assert both.sum() > 500 and (np.isfinite(found) != np.isfinite(expected)).mean() < 0.002
    assert np.quantile(np.abs(found[both] - expected[both]), 0.99) < 2e-3 and np.quantile(np.abs(at[both] - cosines[both]), 0.98) < 0.02


def test_each_beam_meets_a_part_where_it_is_at_the_beam_s_own_time():
    """A box that comes nearer by 1 m a tick, over two ticks, turning through half a circle."""
    poses = np.array([[[x, 0.0, 0.0, yaw, 0.0]] for x, yaw in ((5.0, 3.1), (4.0, 3.1), (3.0, 3.1))])
    times = np.array([0.0, 0.025, 0.05, 0.1])
    rays = np.tile(np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]], np.float32), (4, 1))
    two_ticks = joined_parts([parts_at(poses[:2], PARTS[:1]), parts_at(poses[1:], PARTS[:1])])
    hits, _ = two_ticks.hits(rays, times)
    assert hits == pytest.approx(np.array([5.0, 4.5, 4.0, 3.0]) - 0.4 / np.cos(3.1 - np.pi), abs=1e-5)


def test_beam_that_begins_in_a_part_does_not_see_it_and_nothing_is_seen_behind():
    ray = np.array([[1.0, 0.5, 0.3, 1.0, 0.0, 0.0], [3.0, 0.5, 0.3, 1.0, 0.0, 0.0]], np.float32)
    hits, _ = parts_at(np.stack([POSES, POSES])[:, :1], PARTS[:1]).hits(ray, np.zeros(2))
    assert np.isposinf(hits).all()
