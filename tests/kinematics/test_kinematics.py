"""Poses the makers document, and identities that hold for every arm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calib.chain.kinematics import MODELS, OutOfReach, UnknownArm, arm

UR_MODELS = [name for name in MODELS if name.startswith("ur")]
ZERO = np.zeros(6)


def random_joints(name, seed, count):
    limits = arm(name).limits_rad
    return np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (count, 6))


def test_irb140_zero_pose_is_abbs():
    """RWS 1.0 manual, robtarget of the zero joint target."""
    pose = arm("irb140").forward(ZERO)
    np.testing.assert_allclose(pose[:3, 3], [0.515, 0.0, 0.712], atol=1e-12)
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(quaternion, [np.sqrt(0.5), 0, np.sqrt(0.5), 0], atol=1e-12)


def test_irb140_pose_with_bent_wrist_is_abbs():
    """RobotStudio SDK, RsRobTarget: joint 5 at 30 degrees."""
    pose = arm("irb140").forward(np.radians([0, 0, 0, 0, 30, 0]))
    np.testing.assert_allclose(pose[:3, 3], [0.50629, 0.0, 0.67950], atol=5e-6)
    expected = Rotation.from_euler("y", 120, degrees=True).as_matrix()
    np.testing.assert_allclose(pose[:3, :3], expected, atol=1e-12)


@pytest.mark.parametrize("name", UR_MODELS)
def test_ur_stretched_out(name):
    """At zero the arm lies along -x, the flange faces -y, below the shoulder by d5."""
    d1, a2, a3, d4, d5, d6 = arm(name).dh[[0, 1, 2, 3, 4, 5], [1, 2, 2, 1, 1, 1]]
    pose = arm(name).forward(ZERO)
    np.testing.assert_allclose(pose[:3, 3], [a2 + a3, -d4 - d6, d1 - d5], atol=1e-12)
    np.testing.assert_allclose(pose[:3, 2], [0, -1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("joints", "position"),
    [
        (
            [-1.60070020, -1.72710020, -2.20299989, -0.80799991, 1.59510005, -0.03099996],
            [-0.17992591, -0.60686976, 0.23078910],
        ),
        (
            [1.32645023, 2.42600775, 5.95157290, 1.27409041, -0.54105217, 0.12217305],
            [0.39922988, 0.59688365, -0.66778190],
        ),
    ],
)
def test_ur10_position_of_the_makers_controller(joints, position):
    """Read from a simulated UR10; quoted by the maker's ROS 2 driver (ur_calibration)."""
    np.testing.assert_allclose(arm("ur10").forward(joints)[:3, 3], position, atol=2e-8)


@pytest.mark.parametrize("name", MODELS)
def test_forward_is_vectorised(name):
    joints = random_joints(name, 1, 12).reshape(3, 4, 6)
    poses = arm(name).forward(joints)
    assert poses.shape == (3, 4, 4, 4)
    np.testing.assert_allclose(poses[2, 1], arm(name).forward(joints[2, 1]), atol=1e-15)


@pytest.mark.parametrize("name", MODELS)
def test_dh_offset_adds_to_the_rows(name):
    joints = random_joints(name, 2, 5)
    offset = np.zeros((6, 5))
    offset[3, 0] = 0.01
    turned = joints + np.array([0, 0, 0, 0.01, 0, 0])
    np.testing.assert_allclose(
        arm(name).forward(joints, offset), arm(name).forward(turned), atol=1e-14
    )
    lift = np.zeros((6, 5))
    lift[0, 1] = 0.002
    raised = arm(name).forward(joints, lift)[:, :3, 3] - arm(name).forward(joints)[:, :3, 3]
    np.testing.assert_allclose(raised, np.tile([0, 0, 0.002], (5, 1)), atol=1e-14)


@pytest.mark.parametrize("name", MODELS)
def test_jacobian_is_the_derivative_of_forward(name):
    step = 1e-6
    for joints in random_joints(name, 3, 5):
        numeric = np.empty((6, 6))
        for j in range(6):
            ahead = arm(name).forward(joints + step * np.eye(6)[j])
            behind = arm(name).forward(joints - step * np.eye(6)[j])
            numeric[:3, j] = (ahead - behind)[:3, 3] / (2 * step)
            turn = Rotation.from_matrix(ahead[:3, :3] @ behind[:3, :3].T)
            numeric[3:, j] = turn.as_rotvec() / (2 * step)
        np.testing.assert_allclose(arm(name).jacobian(joints), numeric, atol=1e-8)


@pytest.mark.parametrize("name", MODELS)
def test_gravity_torque_is_the_gradient_of_potential_energy(name):
    robot, step = arm(name), 1e-5
    load_kg, load_com = 1.3, np.array([0.02, -0.03, 0.08])

    def energy(joints):
        frames = robot.frames(joints)
        com = [
            f[:3, :3] @ c + f[:3, 3] for f, c in zip(frames[1:], robot.masses.com_m, strict=True)
        ]
        load = frames[6, :3, :3] @ load_com + frames[6, :3, 3]
        heights = np.array([*(c[2] for c in com), load[2]])
        return 9.80665 * np.append(robot.masses.mass_kg, load_kg) @ heights

    for joints in random_joints(name, 4, 5):
        numeric = [
            (energy(joints + step * e) - energy(joints - step * e)) / (2 * step) for e in np.eye(6)
        ]
        torque = robot.gravity_torques(joints, load_kg, load_com)
        np.testing.assert_allclose(torque, numeric, atol=1e-6)
        assert abs(torque[0]) < 1e-9


def test_only_abbs_masses_are_estimated():
    estimated = {name for name in MODELS if not arm(name).masses.published}
    assert estimated == {name for name in MODELS if name.startswith("irb")}


@settings(max_examples=60, deadline=None)
@given(name=st.sampled_from(MODELS), seed=st.integers(0, 2**31))
def test_every_branch_reaches_the_pose_and_one_is_where_we_came_from(name, seed):
    robot = arm(name)
    joints = random_joints(name, seed, 1)[0]
    pose = robot.forward(joints)
    branches = robot.inverse_all(pose, joints)
    assert 1 <= len(branches) <= 8
    assert robot.within_limits(np.clip(branches, *robot.limits_rad.T)).all()
    assert np.abs(robot.forward(branches) - pose).max() < 1e-8
    assert np.abs(branches[0] - joints).max() < 1e-5
    assert np.abs(robot.forward(robot.inverse(pose, joints)) - pose).max() < 1e-8


@pytest.mark.parametrize("name", MODELS)
def test_branches_are_distinct_and_plenty_in_the_middle_of_the_workspace(name):
    robot = arm(name)
    abb = name.startswith("irb")
    start = [0.2, 0.3, -0.2, 0.4, 0.9, 0.1] if abb else [0.2, -1.3, 1.4, -1.2, -1.3, 0.3]
    branches = robot.inverse_all(robot.forward(np.array(start)))
    gaps = np.linalg.norm(branches[:, None] - branches[None], axis=2) + 9 * np.eye(len(branches))
    assert gaps.min() > 0.05
    assert len(branches) >= (2 if abb else 4)


def test_whole_turns_follow_the_joints_we_are_at():
    robot = arm("ur5e")
    wound_up = np.array([0.3, -1.2, 1.1, -1.4, -1.5, 2 * np.pi - 0.2])
    assert robot.within_limits(wound_up).all()
    np.testing.assert_allclose(
        robot.inverse(robot.forward(wound_up), wound_up), wound_up, atol=1e-8
    )


@pytest.mark.parametrize(
    ("name", "joints"),
    [
        ("ur5e", [0.4, -1.2, 1.3, -1.6, 0.0, 0.7]),
        ("irb140", [0.4, 0.2, -0.3, 0.5, 0.0, 0.7]),
    ],
)
def test_a_free_wrist_stays_where_it_is(name, joints):
    robot, here = arm(name), np.array(joints)
    np.testing.assert_allclose(robot.inverse(robot.forward(here), here), here, atol=1e-6)


@pytest.mark.parametrize("name", MODELS)
def test_out_of_reach_is_reported_with_the_place(name):
    far = np.eye(4)
    far[:3, 3] = [2.5, 0.0, 0.4]
    assert len(arm(name).inverse_all(far)) == 0
    with pytest.raises(OutOfReach, match=r"x=2\.500"):
        arm(name).inverse(far, ZERO)


def test_unknown_name_lists_the_known():
    with pytest.raises(UnknownArm, match="ur16e"):
        arm("kr6")
