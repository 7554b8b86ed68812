"""Distances of bodies: against independent optimisation, along moves, and of the arms' volumes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from calib.bodies import FIXED, Body, Scene, Shape, arm_bodies, box, capsule
from calib.bodies.gap import hull_gap
from calib.chain.kinematics import MODELS, arm


def distance_by_weights(a, b):
    """Least squares over convex weights, their sum held to one by a heavy row."""
    heavy = 1e3
    n, m = len(a), len(b)
    rows = np.vstack(
        [np.hstack([a.T, -b.T]), heavy * np.r_[np.ones(n), np.zeros(m)],
         heavy * np.r_[np.zeros(n), np.ones(m)]]
    )  # fmt: skip
    weights, _ = nnls(rows, np.array([0, 0, 0, heavy, heavy]))
    return float(np.linalg.norm(a.T @ weights[:n] - b.T @ weights[n:]))


@pytest.mark.parametrize("seed", range(40))
def test_the_distance_of_hulls_is_the_optimisers(seed):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(rng.integers(2, 12), 3)) * rng.uniform(0.02, 0.3, 3)
    b = rng.normal(size=(8, 3)) * rng.uniform(0.02, 0.3, 3) + rng.normal(size=3) * 0.6
    place = np.empty(3)
    assert hull_gap(a, b, place) == pytest.approx(distance_by_weights(a, b), abs=1e-5)


def test_boxes_and_capsules_have_the_distances_one_reads_off():
    place = np.empty(3)
    low = box([0, 0, 0], [1, 1, 1])
    assert hull_gap(low.points_m, box([1.25, 0, 0], [2, 1, 1]).points_m, place) == pytest.approx(
        0.25
    )
    assert place[0] == pytest.approx(1.0)
    assert hull_gap(low.points_m, box([0.9, 0.2, 0.2], [2, 1, 1]).points_m, place) == 0.0
    rod = capsule([2, 2, 0.5], [3, 3, 0.5], 0.1)
    assert hull_gap(low.points_m, rod.points_m, place) == pytest.approx(np.sqrt(2))


def posted(low, high, name="ur5e"):
    robot = arm(name)
    return Scene(robot, [*arm_bodies(robot)[0], Body("post", FIXED, (box(low, high),))], 0.01)


def test_a_post_between_two_free_poses_is_found():
    """The forearm's ends pass on either side; only what is between them meets the post."""
    scene = posted([-0.45, -0.25, 0.2], [-0.41, -0.21, 0.9])
    start, end = np.radians([-10.0, -60, 60, -90, -90, 0]), np.radians([70.0, -60, 60, -90, -90, 0])
    ends = [scene.at(joints).distance_m for joints in (start, end)]
    near = scene.along(start, end)
    assert min(ends) > 0.05
    assert near.distance_m <= 0.0
    assert 0.0 < near.share < 1.0
    assert near.second == "post"
    assert near.first in {"upper arm", "forearm", "wrist 1", "wrist 2", "wrist 3"}


@pytest.mark.parametrize("seed", range(12))
def test_long_steps_miss_nothing(seed):
    """Whether a move keeps its clearance, by long safe steps and by a tenth of a degree."""
    rng = np.random.default_rng(seed)
    scene = posted([-0.5, -0.3, 0.1], [-0.4, -0.2, 1.0])
    start, end = rng.uniform(-2, 2, (2, 6)) * [1, 0.5, 1, 1, 1, 1] + [0, -1, 0, 0, 0, 0]
    fine = np.linspace(0, 1, 2 + int(np.degrees(np.abs(end - start).max()) / 0.1))
    truth = min(scene.at(start + share * (end - start)).distance_m for share in fine)
    quick = scene.along(start, end, 0.02).distance_m
    if truth >= 0.02 + 2e-3:
        assert quick >= 0.02
    if truth < 0.02:
        assert quick < 0.02
    assert scene.along(start, end).distance_m == pytest.approx(max(truth, -1), abs=6e-3)


def test_the_folded_ur3_strikes_itself():
    """Two poses of a plan that was once shipped; meshes of the maker meet there."""
    scene = Scene(arm("ur3"), arm_bodies(arm("ur3"))[0])
    folded = np.radians([-2.0, -40.0, -158.0, 20.0, 60.0, 0.0])
    assert scene.at(folded).distance_m <= 0.0
    assert not arm("ur3").within_limits(folded)


@pytest.mark.parametrize("name", MODELS)
def test_every_known_arm_stands_free_of_itself(name):
    robot = arm(name)
    scene = Scene(robot, arm_bodies(robot)[0], 0.01)
    free = [0, 0, 0, 0, 30, 0] if name.startswith("irb") else [0, -90, 90, -90, -90, 0]
    assert scene.at(np.radians(free)).distance_m > 0.005


def test_what_a_flange_carries_is_held_against_the_forearm():
    robot = arm("ur5e")
    rod = Body("rod", 6, (capsule([0, 0, 0.05], [0, 0, 0.6], 0.02),), carried=True)
    scene = Scene(robot, [*arm_bodies(robot)[0], rod], 0.01)
    away, back = np.radians([[0, -90, 90, -90, -90, 0], [0, -90, 90, 110, -90, 0]])
    assert scene.at(away).distance_m > 0
    near = scene.along(away, back)
    assert near.distance_m <= 0.0
    assert "rod" in {near.first, near.second}


def test_a_shape_is_inside_its_ball():
    shape = Shape(np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.1, 0.3]]), 0.02)
    far = np.linalg.norm(shape.points_m - shape.middle_m, axis=1).max() + 0.02
    assert shape.around_m >= far - 1e-12
