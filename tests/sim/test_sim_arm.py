"""The simulated arm moves as it was ordered, never faster, and stops when it must."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import arm
from drivers.arm import Motion, MoveTarget
from drivers.errors import ArmStopped, DeviceRefused, DeviceUnreachable, SafetyError, StopFailed
from sim.arm import ACCELERATION_RAD_S2, Repeatability, SimArm
from sim.clock import SimClock, WallClock
from sim.noise import PlacedNoise

HOME = np.array([0.2, -1.3, 1.4, -1.2, -1.3, 0.3])


def ready(name="ur5e", home=HOME, **more):
    clock = SimClock()
    robot = SimArm(arm(name), clock, home, **more)
    robot.connect()
    return robot, clock


def arrive(robot, clock, step_s=0.05, patience_s=300.0):
    states = [robot.state()]
    while states[-1].motion is Motion.MOVING:
        clock.sleep(step_s)
        states.append(robot.state())
        assert states[-1].host_t_s < patience_s
    return states


def test_it_arrives_and_says_so_from_its_own_state():
    robot, clock = ready()
    goal = np.add(HOME, [0.4, -0.2, 0.3, 0.1, 0.5, -0.6])
    robot.start_move(MoveTarget(joints_rad=tuple(goal)))
    assert robot.state().motion is Motion.MOVING
    last = arrive(robot, clock)[-1]
    assert last.motion is Motion.STEADY
    np.testing.assert_allclose(last.joints_rad, goal, atol=1e-12)
    np.testing.assert_array_equal(last.joint_velocity_rad_s, np.zeros(6))
    expected = arm("ur5e").forward(goal)
    np.testing.assert_allclose(last.base_from_flange.as_matrix(), expected, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    speed=st.floats(0.02, 0.25),
    joint_speed=st.floats(0.05, 3.0),
    name=st.sampled_from(["ur3", "ur5e", "irb140"]),
)
def test_no_bound_is_ever_exceeded(seed, speed, joint_speed, name):
    robot, clock = ready(name, np.zeros(6))
    limits = np.clip(arm(name).limits_rad, -1.5, 1.5)
    goal = np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1])
    robot.start_move(
        MoveTarget(joints_rad=tuple(goal), tcp_speed_m_s=speed, joint_speed_rad_s=joint_speed)
    )
    step = 0.02
    states = arrive(robot, clock, step, 2000.0)
    joints = np.array([s.joints_rad for s in states])
    speeds = np.array([s.joint_velocity_rad_s for s in states])
    flange = np.array([s.base_from_flange.translation for s in states])
    assert np.linalg.norm(np.diff(flange, axis=0), axis=1).max() <= speed * step * (1 + 1e-9)
    bound = np.minimum(joint_speed, arm(name).max_speed_rad_s)
    assert (np.abs(speeds) <= bound * (1 + 1e-9)).all()
    assert np.abs(np.diff(speeds, axis=0)).max() <= ACCELERATION_RAD_S2 * step * (1 + 1e-9)
    np.testing.assert_allclose(
        np.diff(joints, axis=0), (speeds[1:] + speeds[:-1]) / 2 * step, atol=5e-4
    )
    np.testing.assert_allclose(joints[-1], goal, atol=1e-9)


def test_pose_targets_take_the_nearest_branch():
    robot, clock = ready()
    wanted = np.add(HOME, [0.1, 0.05, -0.1, 0.1, 0.1, -0.1])
    pose = RigidTransform.from_matrix(arm("ur5e").forward(wanted))
    robot.start_move(MoveTarget(base_from_flange=pose))
    np.testing.assert_allclose(arrive(robot, clock)[-1].joints_rad, wanted, atol=1e-8)


def test_stop_brakes_at_once_and_stays_on_the_path():
    robot, clock = ready()
    goal = np.add(HOME, [0, 0, 0, 0, 0, 1.5])
    robot.start_move(MoveTarget(joints_rad=tuple(goal), tcp_speed_m_s=1, joint_speed_rad_s=1))
    clock.sleep(1.0)
    at_stop = robot.state()
    robot.stop()
    robot.stop()
    states = arrive(robot, clock, 0.01)
    travelled = np.array(states[-1].joints_rad) - at_stop.joints_rad
    assert 0 < travelled[5] < 0.2
    np.testing.assert_allclose(travelled[:5], 0, atol=1e-12)
    assert states[-1].host_t_s - at_stop.host_t_s < 0.5
    assert states[-1].motion is Motion.STEADY


@pytest.mark.parametrize(
    "target",
    [
        MoveTarget(joints_rad=(0, 0, 4.0, 0, 0, 0)),
        MoveTarget(base_from_flange=RigidTransform.from_translation([3.0, 0, 0])),
        MoveTarget(joints_rad=tuple(HOME + 0.1), tcp_speed_m_s=0.0),
    ],
    ids=["limits", "reach", "speed"],
)
def test_what_it_will_not_do_is_a_safety_error_and_nothing_moves(target):
    robot, clock = ready()
    with pytest.raises(SafetyError):
        robot.start_move(target)
    clock.sleep(5)
    np.testing.assert_array_equal(robot.state().joints_rad, HOME)


def test_a_target_is_joints_or_pose():
    robot, _ = ready()
    with pytest.raises(SafetyError, match="either"):
        robot.start_move(MoveTarget())


def test_a_second_move_waits_for_the_first():
    robot, _ = ready()
    robot.start_move(MoveTarget(joints_rad=tuple(HOME + 0.3)))
    with pytest.raises(DeviceRefused, match="still moving"):
        robot.start_move(MoveTarget(joints_rad=tuple(HOME)))


def test_a_protective_stop_halts_it_and_is_reported():
    robot, clock = ready()
    robot.faults.protective_stop_at_move = 1
    robot.start_move(MoveTarget(joints_rad=tuple(HOME + 0.5)))
    state = arrive(robot, clock)[-1]
    assert state.motion is Motion.STOPPED_BY_FAULT
    assert state.fault == "protective stop"
    clock.sleep(2)
    stands = robot.state().joints_rad
    clock.sleep(5)
    assert robot.state().joints_rad == stands
    assert 0 < stands[0] - HOME[0] < 0.5
    with pytest.raises(ArmStopped, match="protective stop"):
        robot.start_move(MoveTarget(joints_rad=tuple(HOME)))
    robot.clear_fault()
    robot.start_move(MoveTarget(joints_rad=tuple(HOME)))
    assert arrive(robot, clock)[-1].motion is Motion.STEADY


def test_a_dead_link_and_a_failing_stop_are_loud():
    robot, _ = ready()
    robot.faults.stop_fails = True
    with pytest.raises(StopFailed):
        robot.stop()
    robot.faults.stop_fails = False
    robot.faults.unreachable = True
    with pytest.raises(DeviceUnreachable):
        robot.state()
    with pytest.raises(StopFailed):
        robot.stop()


def test_without_connecting_nothing_answers():
    robot = SimArm(arm("ur5e"), SimClock(), HOME)
    with pytest.raises(DeviceUnreachable, match="connect"):
        robot.state()


def test_it_scatters_anew_with_every_move_as_much_as_asked():
    scatter = Repeatability(position_m=3e-5, rotation_rad=2e-5)
    robot, clock = ready(repeatability=scatter, noise=PlacedNoise(5, 0))
    errors = []
    for k in range(300):
        robot.start_move(MoveTarget(joints_rad=tuple(HOME + 0.01 * (k % 2 + 1))))
        arrive(robot, clock, 1.0, 1e4)
        errors.append(robot.truth().flange_error)
        assert (robot.truth().flange_error == errors[-1]).all()
    spread = np.std(errors, axis=0)
    np.testing.assert_allclose(spread[:3], 3e-5, rtol=0.2)
    np.testing.assert_allclose(spread[3:], 2e-5, rtol=0.2)


def test_where_the_last_move_came_from_is_known():
    robot, clock = ready()
    robot.start_move(MoveTarget(joints_rad=tuple(HOME + 0.1)))
    arrive(robot, clock)
    np.testing.assert_array_equal(robot.truth().approach_joints_rad, HOME)


def test_it_lives_in_real_time_too():
    robot = SimArm(arm("ur5e"), clock := WallClock(), HOME)
    robot.connect()
    robot.start_move(MoveTarget(joints_rad=tuple(HOME + 0.02), joint_speed_rad_s=1.0))
    started = clock.now()
    while robot.state().motion is Motion.MOVING:
        clock.sleep(0.01)
        assert clock.now() - started < 10
    assert clock.now() - started > 0.2
    robot.close()
    robot.close()


def test_a_push_turns_it_without_an_order_and_a_stop_holds_it_unless_its_brakes_slip():
    robot, clock = ready()
    by = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    robot.push(by, 0.2)
    np.testing.assert_allclose(arrive(robot, clock)[-1].joints_rad, HOME + by, atol=1e-12)
    robot.push(by, 0.05)
    clock.sleep(0.5)
    robot.stop()
    assert 0.1 < arrive(robot, clock)[-1].joints_rad[2] - HOME[2] < 0.15
    robot.faults.brakes_slip = True
    robot.push(by, 0.05)
    robot.stop()
    assert arrive(robot, clock)[-1].joints_rad[2] - HOME[2] > 0.19


def test_another_way_leads_to_the_same_place_and_another_speed_sooner():
    robot, clock = ready()
    robot.faults.bulge_rad = 0.1
    goal = np.add(HOME, [0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    robot.start_move(MoveTarget(joints_rad=tuple(goal)))
    way = np.array([state.joints_rad for state in arrive(robot, clock, 0.01)])
    assert np.abs(way[:, 2] - HOME[2]).max() == pytest.approx(0.1, abs=1e-3)
    np.testing.assert_allclose(way[-1], goal, atol=1e-12)
    began_s = clock.now()
    robot.faults.speed_factor = 2.0
    robot.start_move(MoveTarget(joints_rad=tuple(HOME), tcp_speed_m_s=5.0, joint_speed_rad_s=0.1))
    arrive(robot, clock, 0.01)
    assert clock.now() - began_s == pytest.approx(0.4 / 0.2, abs=0.5)
