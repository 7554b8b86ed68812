"""Arms known by their URDF alone: forward, all branches, continuity, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.chain.kinematics import UnusableUrdf, arm, arm_from_urdf
from calib.chain.kinematics.chain_from_axes import Axis, chain_from_axes
from tests.kinematics.made_up_arms import OBLIQUE, OFFSET_WRIST, urdf


def made_up(rows, **more):
    return arm_from_urdf(urdf(rows, **more), "base_link", "tool0", "made-up")


def composed(rows, joints):
    """The flange by multiplying what the file says, joint by joint."""
    pose = np.eye(4)
    for (_, xyz, rpy, axis), angle in zip(rows, joints, strict=True):
        step, turn = np.eye(4), np.eye(4)
        step[:3, :3], step[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), xyz
        along = np.array(axis, float) / np.linalg.norm(axis)
        turn[:3, :3] = Rotation.from_rotvec(angle * along).as_matrix()
        pose = pose @ step @ turn
    tool = np.eye(4)
    tool[:3, :3], tool[:3, 3] = Rotation.from_euler("y", np.pi / 2).as_matrix(), [0, 0, 0.02]
    return pose @ tool


@pytest.mark.parametrize("rows", [OFFSET_WRIST, OBLIQUE])
def test_forward_is_what_the_file_says(rows):
    robot, rng = made_up(rows), np.random.default_rng(0)
    for joints in rng.uniform(-3, 3, (40, 6)):
        np.testing.assert_allclose(robot.forward(joints), composed(rows, joints), atol=1e-12)
        np.testing.assert_allclose(robot.frames(joints)[-1], robot.forward(joints), atol=1e-12)


@pytest.mark.parametrize("rows", [OFFSET_WRIST, OBLIQUE])
def test_the_jacobian_is_the_derivative(rows):
    robot, step = made_up(rows), 1e-6
    joints = np.array([0.3, -0.5, 0.9, 0.4, 1.0, -0.6])
    for j in range(6):
        ahead, behind = (robot.forward(joints + s * step * np.eye(6)[j]) for s in (1, -1))
        moved = (ahead - behind)[:3, 3] / (2 * step)
        np.testing.assert_allclose(robot.jacobian(joints)[:3, j], moved, atol=1e-8)


def test_a_ur_described_beside_its_base_link_is_the_controllers():
    """`base` turned by half a turn against `base_link`, as in the maker's descriptions."""
    known = arm("ur5e")
    poses = known.frames(np.zeros(6))
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    links, before = ['<robot name="ur"><link name="base_link"/><link name="base"/>'], half_turn
    links.append(
        '<joint name="to_base" type="fixed"><parent link="base_link"/><child link="base"/>'
        '<origin rpy="0 0 3.141592653589793"/></joint>'
    )
    parent, at = "base_link", np.eye(4)
    for k in range(6):
        step = np.linalg.solve(at, before @ poses[k])
        links.append(joint_text(f"l{k}", parent, step, "revolute"))
        parent, at = f"l{k}", before @ poses[k]
    links.append(joint_text("tool0", parent, np.linalg.solve(at, before @ poses[6]), "fixed"))
    robot = arm_from_urdf("".join(links) + "</robot>", "base", "tool0", "ur")
    for joints in np.random.default_rng(1).uniform(-3, 3, (20, 6)):
        np.testing.assert_allclose(robot.forward(joints), known.forward(joints), atol=1e-12)
    wrong = arm_from_urdf("".join(links) + "</robot>", "base_link", "tool0", "ur")
    assert np.abs(wrong.forward(np.zeros(6)) - known.forward(np.zeros(6))).max() > 1.0


def joint_text(name, parent, step, kind):
    xyz = " ".join(repr(float(v)) for v in step[:3, 3])
    rpy = " ".join(repr(float(v)) for v in Rotation.from_matrix(step[:3, :3]).as_euler("xyz"))
    limit = '<axis xyz="0 0 1"/><limit lower="-6.3" upper="6.3" velocity="3"/>'
    return (
        f'<link name="{name}"/><joint name="to_{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{xyz}" rpy="{rpy}"/>{limit}</joint>'
    )


def brute_force(robot, pose, starts):
    """Damped Newton from many starts, written without the product's own search."""
    found = []
    for q in starts:
        q = q.copy()
        for _ in range(60):
            now = robot.forward(q)
            turn = Rotation.from_matrix(pose[:3, :3] @ now[:3, :3].T).as_rotvec()
            error = np.concatenate([pose[:3, 3] - now[:3, 3], turn])
            if np.abs(error).max() < 1e-11:
                break
            jacobian = robot.jacobian(q)
            damped = jacobian @ jacobian.T + 1e-3 * min(error @ error, 0.1) * np.eye(6)
            q += np.clip(jacobian.T @ np.linalg.solve(damped, error), -0.6, 0.6)
        else:
            continue
        q = np.angle(np.exp(1j * q))
        if all(np.abs(np.angle(np.exp(1j * (q - other)))).max() > 1e-4 for other in found):
            found.append(q)
    return np.array(found).reshape(-1, 6)


@pytest.mark.parametrize("seed", range(4))
def test_no_branch_that_many_starts_find_is_missing(seed):
    robot, rng = made_up(OFFSET_WRIST, limit='lower="-3.15" upper="3.15" velocity="2"'), None
    rng = np.random.default_rng(seed)
    joints = rng.uniform(-2.5, 2.5, 6)
    if seed % 2:
        joints[4] = 0.0
    pose = robot.forward(joints)
    branches = robot.inverse_all(pose, joints)
    for q in brute_force(robot, pose, rng.uniform(-np.pi, np.pi, (120, 6))):
        gaps = np.abs(np.angle(np.exp(1j * (branches - q)))).max(axis=1)
        assert gaps.min() < 1e-3
    assert np.abs(branches[0] - joints).max() < 1e-5


@pytest.mark.parametrize("rows", [OFFSET_WRIST, OBLIQUE])
def test_a_path_of_the_flange_stays_on_its_branch(rows):
    robot = made_up(rows)
    here = np.array([0.3, -0.5, 0.9, 0.4, 1.0, -0.6])
    start = robot.forward(here)
    for share in np.linspace(0, 1, 15)[1:]:
        goal = start.copy()
        goal[:3, 3] += share * np.array([0.04, -0.05, 0.03])
        there = robot.inverse(goal, here)
        assert np.abs(there - here).max() < 0.1
        np.testing.assert_allclose(robot.forward(there), goal, atol=1e-8)
        here = there


def test_parallel_axes_have_no_distance_along_themselves_to_hide_in():
    """Axes askew by a tenth of a degree: beta says so, no row is metres long."""
    tilt = Rotation.from_euler("x", 0.1, degrees=True).apply([0, 1, 0])
    axes = [
        Axis(np.zeros(3), np.array([0.0, 0, 1])),
        Axis(np.array([0, 0, 0.3]), np.array([0.0, 1, 0])),
        Axis(np.array([0, 0.1, 0.8]), tilt),
        Axis(np.array([0.3, 0.1, 0.8]), np.array([1.0, 0, 0])),
    ]
    flange = np.eye(4)
    flange[:3, 3] = [0.6, 0.1, 0.8]
    rows, ends = chain_from_axes(axes, flange)
    assert np.abs(rows[:, 1:3]).max() < 1.0
    assert np.abs(rows[1, 1]) == 0.0
    assert np.degrees(np.hypot(rows[1, 3], rows[1, 4])) == pytest.approx(0.1, abs=1e-9)
    assert ends.shape == (2, 4, 4)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<robot", "is no XML"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "declares a document type"),
        (urdf(OFFSET_WRIST).replace('"tool0"', '"flange0"'), "has no link tool0; it has"),
        (urdf(OFFSET_WRIST[:5]), "has 5 turning joints between base_link and tool0"),
        (urdf(OFFSET_WRIST).replace('"revolute"', '"prismatic"', 1), "joint pan is prismatic"),
        (urdf(OFFSET_WRIST, limit='upper="1"'), "joint pan: needs limits"),
        (urdf(OFFSET_WRIST).replace('"0.0 0.0 0.265"', '"0 0 x"'), "is not three numbers"),
        (urdf(OFFSET_WRIST).replace("<axis", '<mimic joint="lift"/><axis', 1), "mimics another"),
        (urdf(OFFSET_WRIST, limit='lower="-inf" upper="1e999"'), "joint pan: needs limits"),
        (urdf(OFFSET_WRIST).replace('"0.0 0.0 0.265"', '"0 0 1e300"'), "three numbers within"),
        (urdf(OFFSET_WRIST).replace('<link name="lift_link">', '<link name="x">'), "not there"),
        (urdf(OFFSET_WRIST).replace('value="2.5"', 'value="heavy"', 1), "no number of kilograms"),
        (urdf(OFFSET_WRIST).replace('value="2.5"', 'value="1e999"', 1), "no number of kilograms"),
    ],
)
def test_what_is_no_arm_is_refused_by_name(text, says):
    with pytest.raises(UnusableUrdf, match=says):
        arm_from_urdf(text, "base_link", "tool0", "made-up")


@pytest.mark.parametrize("speed", ["1e999", "nan", "-1", "fast"])
def test_a_speed_that_no_joint_has_is_not_believed(speed):
    limit = f'lower="-3" upper="3" velocity="{speed}"'
    np.testing.assert_allclose(made_up(OFFSET_WRIST, limit=limit).max_speed_rad_s, 1.0)


def test_limits_speeds_and_masses_are_the_files():
    robot = made_up(OFFSET_WRIST)
    np.testing.assert_allclose(robot.limits_rad, [[-3.1, 3.1]] * 6)
    np.testing.assert_allclose(robot.max_speed_rad_s, 2.0)
    assert robot.masses.published
    np.testing.assert_allclose(robot.masses.mass_kg, 2.5)
    rng, step = np.random.default_rng(3), 1e-5
    joints = rng.uniform(-2, 2, 6)

    def energy(q):
        frames = robot.frames(q)
        com = [
            f[:3, :3] @ c + f[:3, 3] for f, c in zip(frames[1:], robot.masses.com_m, strict=True)
        ]
        return 9.80665 * 2.5 * sum(c[2] for c in com)

    numeric = [
        (energy(joints + step * e) - energy(joints - step * e)) / 2 / step for e in np.eye(6)
    ]
    np.testing.assert_allclose(robot.gravity_torques(joints), numeric, atol=1e-6)
