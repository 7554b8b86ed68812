"""What RTDE reports of the arm beyond joints and pose: table of types, and where values come from.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide", robot controller outputs. Names
that clients ask for by default are all here. What this arm has no physics for (temperatures,
voltages, tool inputs) is that of an arm at room temperature with nothing connected to it.
"""

from __future__ import annotations

import numpy as np

from calib.chain.kinematics import ArmKinematics
from calib.views import FloatArray
from drivers.arm import ArmState
from drivers.ur.pose import base_from_tcp, pose_of
from drivers.ur.wire import Value
from sim.peers.ur.modes import Robot, Runtime, Safety

_NAMES_BY_TYPE = {
    "DOUBLE": """
        timestamp actual_execution_time speed_scaling target_speed_fraction actual_momentum
        actual_main_voltage actual_robot_voltage actual_robot_current standard_analog_input0
        standard_analog_input1 standard_analog_output0 standard_analog_output1 payload
        tcp_force_scalar tool_analog_input0 tool_analog_input1 tool_output_current
        tool_temperature""",
    "VECTOR6D": """
        actual_q actual_qd target_q target_qd target_qdd target_current target_moment
        actual_current joint_control_output actual_TCP_pose target_TCP_pose actual_TCP_speed
        target_TCP_speed actual_TCP_force ft_raw_wrench joint_temperatures actual_joint_voltage
        payload_inertia tcp_offset""",
    "VECTOR3D": "actual_tool_accelerometer payload_cog elbow_position elbow_velocity",
    "UINT64": "actual_digital_input_bits actual_digital_output_bits",
    "UINT32": """
        safety_status_bits robot_status_bits runtime_state output_bit_registers0_to_31
        output_bit_registers32_to_63 tool_mode""",
    "INT32": "robot_mode safety_mode safety_status tool_output_voltage",
    "VECTOR6INT32": "joint_mode",
}
OUTPUT_TYPES = {name: kind for kind, names in _NAMES_BY_TYPE.items() for name in names.split()}

_JOINT_RUNNING, _JOINT_POWER_OFF = 253, 239
_SAFETY_MODES = {Safety.NORMAL: 1, Safety.PROTECTIVE_STOP: 3, Safety.EMERGENCY_STOP: 7}
_ROOM_C, _BUS_V = 25.0, 48.0
_NM_PER_A = 10.0  # of a joint's motor behind its gear, for a current from a torque
_GRAVITY_M_S2 = 9.80665


def status(robot: Robot, safety: Safety, runtime: Runtime) -> dict[str, Value]:
    """Modes and states of the controller."""
    powered, playing = robot is Robot.RUNNING, runtime is Runtime.PLAYING
    mode = _JOINT_RUNNING if powered else _JOINT_POWER_OFF
    return {
        "robot_mode": int(robot),
        "safety_mode": _SAFETY_MODES[safety],
        "safety_status": _SAFETY_MODES[safety],
        "safety_status_bits": int(safety),
        "runtime_state": int(runtime),
        "robot_status_bits": int(powered) | int(playing) << 1,
        "joint_mode": (mode,) * 6,
        "speed_scaling": 1.0,
        "target_speed_fraction": 1.0,
        "joint_temperatures": (_ROOM_C,) * 6,
        "tool_temperature": _ROOM_C,
        "actual_main_voltage": _BUS_V,
        "actual_robot_voltage": _BUS_V if powered else 0.0,
        "actual_joint_voltage": (_BUS_V if powered else 0.0,) * 6,
    }


def motion(
    state: ArmState, tcp_offset: tuple[float, ...], kinematics: ArmKinematics | None
) -> dict[str, Value]:
    """Joints, pose, and what follows from them."""
    joints = state.joints_rad or (0.0,) * 6
    speeds = state.joint_velocity_rad_s or (0.0,) * 6
    tcp = pose_of(base_from_tcp(state.base_from_flange, tcp_offset))
    down = state.base_from_flange.rotation.inv().apply([0.0, 0.0, _GRAVITY_M_S2])
    torques, velocity = _loads(np.array(joints), np.array(speeds), kinematics)
    currents = _tuple(torques / _NM_PER_A)
    return {
        "timestamp": state.host_t_s,
        "actual_q": joints,
        "actual_qd": speeds,
        "target_q": joints,
        "target_qd": speeds,
        "actual_TCP_pose": tcp,
        "target_TCP_pose": tcp,
        "actual_TCP_speed": velocity,
        "target_TCP_speed": velocity,
        "target_moment": _tuple(torques),
        "target_current": currents,
        "actual_current": currents,
        "joint_control_output": currents,
        "actual_robot_current": float(np.abs(torques).sum() / _NM_PER_A),
        "actual_tool_accelerometer": _tuple(down),
    }


def _loads(
    joints: FloatArray, speeds: FloatArray, kinematics: ArmKinematics | None
) -> tuple[FloatArray, tuple[float, ...]]:
    """Torques that hold the arm, Nm, and the flange's velocity: m/s, rad/s, in the base."""
    if kinematics is None:
        return np.zeros(6), (0.0,) * 6
    return kinematics.gravity_torques(joints), _tuple(kinematics.jacobian(joints) @ speeds)


def nothing(kind: str) -> Value:
    """Values for what this arm has not."""
    if kind == "VECTOR3D":
        return (0.0,) * 3
    return (0.0,) * 6 if kind == "VECTOR6D" else 0


def _tuple(values: FloatArray) -> tuple[float, ...]:
    return tuple(values.tolist())
