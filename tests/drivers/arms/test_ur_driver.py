"""What the UR driver refuses before it moves, and what it sends the arm."""

import socket
import time
from contextlib import contextmanager

import numpy as np
import pytest
from benches import (
    PATIENT_UR,
    UR_FAR,
    UR_HOME,
    at_speed,
    quickly,
    truly_moving,
    ur_moving,
    ur_peer,
    wait_steady,
)
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import arm as kinematics_of
from drivers.arm import Motion
from drivers.errors import DeviceRefused, DeviceUnreachable
from drivers.ur import URArm, URSettings
from drivers.ur.kinematics_info import read_kinematics
from drivers.ur.pose import transform_of
from drivers.ur.wire import RTDE_PORT, Frame, encode, receive
from sim.peers.ur import Runtime


def test_local_mode_is_refused_with_the_remedy():
    with ur_peer() as (controller, _):
        controller.remote_control = False
        with pytest.raises(DeviceRefused, match="Remote Control"):
            URArm(controller.address).connect()


LOWER_REGISTERS = frozenset(
    f"input_{kind}_register_{i}" for kind in ("int", "double") for i in range(24)
)


def test_registers_held_by_a_fieldbus_are_reported_and_the_upper_ones_serve():
    with ur_peer() as (controller, _):
        controller.faults.reserved_inputs = LOWER_REGISTERS
        with pytest.raises(DeviceRefused, match="upper_registers"):
            URArm(controller.address).connect()
        arm = URArm(controller.address, URSettings(upper_registers=True))
        try:
            arm.connect()
            arm.start_move(quickly(UR_FAR))
            assert wait_steady(arm).joints_rad == pytest.approx(UR_FAR, abs=1e-6)
        finally:
            arm.close()


def test_registers_held_by_another_client_are_reported():
    with (
        ur_peer() as (controller, _),
        holding_registers(controller.address),
        pytest.raises(DeviceRefused, match="another client"),
    ):
        URArm(controller.address).connect()


@contextmanager
def holding_registers(address):
    with socket.create_connection((address, RTDE_PORT)) as link:
        link.sendall(encode(Frame.SETUP_INPUTS, b"input_int_register_0"))
        receive(link)
        yield


def test_the_peer_overlooks_what_a_client_writes_without_registers_of_its_own():
    with (
        ur_peer() as (controller, _),
        socket.create_connection((controller.address, RTDE_PORT)) as link,
    ):
        link.sendall(encode(Frame.DATA_PACKAGE, b"\x0b\x00\x00\x00\x00"))
        link.sendall(encode(Frame.GET_CONTROLLER_VERSION))
        assert receive(link)[0] == Frame.GET_CONTROLLER_VERSION


def test_a_program_that_is_not_ours_is_left_running():
    with ur_moving(**PATIENT_UR) as (_, controller, sim):
        with pytest.raises(DeviceRefused, match="program is running"):
            URArm(controller.address).connect()
        assert truly_moving(sim)
        assert controller.runtime is Runtime.PLAYING


def test_a_controller_too_old_for_the_tool_offset_is_refused():
    with ur_peer() as (controller, _):
        controller.faults.missing_outputs = frozenset({"tcp_offset"})
        with pytest.raises(DeviceRefused, match="tcp_offset"):
            URArm(controller.address).connect()


def test_nobody_there_is_reported_as_such():
    with pytest.raises(DeviceUnreachable, match="Check power, cable and address"):
        URArm("127.255.255.254").connect()


def test_every_reading_is_of_one_instant_even_on_the_way():
    forward = kinematics_of("ur5e").forward
    with ur_moving(**PATIENT_UR) as (arm, controller, _):
        controller.tcp_offset = (0.0, 0.05, 0.2, 0.4, 0.0, 0.0)
        for _ in range(50):
            state = arm.state()
            assert state.motion is Motion.MOVING
            expected = RigidTransform.from_matrix(forward(np.array(state.joints_rad)))
            off = state.base_from_flange.inv() * expected
            assert np.linalg.norm(off.translation) < 1e-9
            time.sleep(0.005)


def test_the_raw_packet_is_kept_for_the_log():
    with ur_moving(**PATIENT_UR) as (arm, controller, _):
        state = arm.state()
        offset, tcp = state.raw["tcp_offset"], state.raw["actual_TCP_pose"]
        assert offset == controller.tcp_offset
        back = state.base_from_flange * transform_of(offset)
        assert np.allclose(back.as_matrix(), transform_of(tcp).as_matrix())
        assert len(state.raw["kinematics"]["d_m"]) == 6
        assert state.raw["model"] == "UR5"


def test_the_pose_after_a_move_is_of_after_the_move():
    with ur_moving(**PATIENT_UR) as (arm, _, sim):
        arm.stop()
        wait_steady(arm)
        for goal in (UR_HOME, tuple(angle + 0.1 for angle in UR_HOME)):
            arm.start_move(quickly(goal))
            state = wait_steady(arm)
            off = state.base_from_flange.inv() * sim.state().base_from_flange
            assert np.linalg.norm(off.translation) < 1e-9


def test_the_factory_kinematics_are_read_and_put_the_flange_where_the_controller_does():
    with ur_peer() as (controller, _):
        found = read_kinematics(controller.address)
        assert found.calibration_status == "linearised"
        joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
        expected = kinematics_of("ur5e").forward(joints)[:, :3, 3]
        assert found.flange_positions_m(joints) == pytest.approx(expected, abs=1e-12)
        controller.kinematics = None
        assert read_kinematics(controller.address, timeout_s=0.3) is None


@pytest.mark.parametrize("reported", [True, False], ids=["kinematics reported", "not reported"])
def test_the_flange_never_exceeds_its_speed_in_a_joint_move(reported):
    with ur_peer() as (controller, sim):
        controller.kinematics = controller.kinematics if reported else None
        arm = URArm(controller.address)
        arm.connect()
        goal = (UR_HOME[0] + (0.2 if reported else 0.05), *UR_HOME[1:])
        arm.start_move(at_speed(goal, 0.05))
        speeds = []
        while arm.state().motion is Motion.MOVING:
            truth = sim.truth()
            jacobian = kinematics_of("ur5e").jacobian(truth.joints_rad)[:3]
            speeds.append(np.linalg.norm(jacobian @ truth.joint_velocity_rad_s))
            time.sleep(0.01)
        arm.close()
        assert max(speeds) <= 0.05 * 1.01
        assert max(speeds) > (0.045 if reported else 0.005)
