"""The simulated controller against clients that we did not write: the wheel's other interfaces."""

import json
import subprocess
import sys

import pytest
from benches import UR_HOME, ur_peer

# in a process of their own: the wheel's constructors hold the interpreter lock, and so the peer
_ASK = """
import json, sys
from dashboard_client import DashboardClient
from rtde_receive import RTDEReceiveInterface

address = sys.argv[1]
receive = RTDEReceiveInterface(address, 125.0, [
    "timestamp", "actual_q", "actual_qd", "actual_TCP_pose", "robot_mode", "runtime_state",
    "safety_status_bits", "robot_status_bits"])
dashboard = DashboardClient(address)
dashboard.connect(2000)
try:
    dashboard.unlockProtectiveStop()
    unlocked = True
except RuntimeError:
    unlocked = False
print(json.dumps({
    "joints": receive.getActualQ(),
    "tcp": receive.getActualTCPPose(),
    "mode": receive.getRobotMode(),
    "safety": receive.getSafetyStatusBits(),
    "version": dashboard.polyscopeVersion(),
    "serial": dashboard.getSerialNumber(),
    "robotmode": dashboard.robotmode(),
    "safetystatus": dashboard.safetystatus(),
    "remote": dashboard.isInRemoteControl(),
    "running": dashboard.running(),
    "unlocked": unlocked,
}), flush=True)
import os
os._exit(0)
"""


def ask(address):
    command = [sys.executable, "-c", _ASK, address]
    output = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True).stdout
    return json.loads(output.splitlines()[-1])


def test_the_wheels_receive_and_dashboard_clients_read_the_peer_as_it_is():
    with ur_peer() as (controller, _):
        controller.tcp_offset = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
        controller.protective_stop()
        answers = ask(controller.address)
        expected = controller.read_outputs()
    assert answers["joints"] == pytest.approx(UR_HOME)
    assert answers["tcp"] == pytest.approx(expected["actual_TCP_pose"])
    assert answers["mode"] == 7
    assert answers["safety"] >> 2 & 1
    assert answers["version"].startswith("5.12")
    assert answers["serial"].isdigit()
    assert "RUNNING" in answers["robotmode"]
    assert "PROTECTIVE_STOP" in answers["safetystatus"]
    assert answers["remote"] is True
    assert answers["running"] is False
    assert answers["unlocked"] is False


_RECEIVE_ALL = """
import json, os, sys
from rtde_receive import RTDEReceiveInterface

receive = RTDEReceiveInterface(sys.argv[1])  # with every variable that it asks for by default
needs_an_index = {"getDigitalInState", "getDigitalOutState", "getOutputDoubleRegister",
                  "getOutputIntRegister"}
names = [name for name in dir(receive) if name.startswith("get") and name not in needs_an_index]
print(json.dumps({name: getattr(receive, name)() for name in names}), flush=True)
os._exit(0)
"""

_CONTROL = """
import json, os, sys
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface

receive = RTDEReceiveInterface(sys.argv[1])
control = RTDEControlInterface(sys.argv[1])
q, pose = receive.getActualQ(), receive.getActualTCPPose()
reported = {
    "q": q, "pose": pose,
    "forward": control.getForwardKinematics(q, [0.0] * 6),
    "forward now": control.getForwardKinematics(),
    "inverse": control.getInverseKinematics(pose, q),
    "inverse now": control.getInverseKinematics(pose),
    "reachable": control.getInverseKinematicsHasSolution(pose, q),
    "far": control.getInverseKinematicsHasSolution([9.0, 9.0, 9.0, 0.0, 0.0, 0.0], q),
    "pose allowed": control.isPoseWithinSafetyLimits(pose),
    "joints allowed": control.isJointsWithinSafetyLimits([9.0] * 6),
    "moveL to where it is": control.moveL(pose),
    "moveJ to where it is": control.moveJ(q),
    "moveL_FK": control.moveL_FK([*q[:5], q[5] + 0.05]),
    "payload": control.setPayload(1.5, [0.0, 0.0, 0.1]),
    "inverse of far": control.getInverseKinematics([9.0, 9.0, 9.0, 0.0, 0.0, 0.0], q),
    "runs after it": control.isProgramRunning(),
}
print(json.dumps(reported), flush=True)
os._exit(0)
"""

_DASHBOARD = """
import json, os, sys
from dashboard_client import DashboardClient

dashboard = DashboardClient(sys.argv[1])
dashboard.connect(2000)
reported = {"model": dashboard.getRobotModel(), "safetymode": dashboard.safetymode()}
for order in ("powerOff", "powerOn", "brakeRelease", "closePopup", "closeSafetyPopup", "stop"):
    getattr(dashboard, order)()  # raises where the answer is not the one that it waits for
    reported[order] = dashboard.robotmode()
dashboard.popup("hello")
dashboard.addToLog("hello")
dashboard.restartSafety()
dashboard.quit()
reported["quit"] = True
print(json.dumps(reported), flush=True)
os._exit(0)
"""


def answers_of(script, address):
    command = [sys.executable, "-c", script, address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_the_wheels_receive_client_gets_every_variable_that_it_asks_for_by_default():
    with ur_peer() as (controller, sim):
        reported = answers_of(_RECEIVE_ALL, controller.address)
        torques = controller.kinematics.gravity_torques(sim.truth().joints_rad)
    assert len(reported) > 40
    assert reported["getTargetQ"] == pytest.approx(UR_HOME)
    assert reported["getTargetMoment"] == pytest.approx(torques.tolist())
    assert reported["getSafetyMode"] == 1
    assert reported["getJointMode"] == [253] * 6
    assert sum(v * v for v in reported["getActualToolAccelerometer"]) == pytest.approx(9.80665**2)


def test_the_wheels_control_client_is_sent_kinematics_and_arrives_where_it_is():
    with ur_peer() as (controller, _):
        controller.tcp_offset = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        reported = answers_of(_CONTROL, controller.address)
        assert controller.payload_kg == 1.5
    for name in ("forward", "forward now"):
        assert reported[name] == pytest.approx(reported["pose"], abs=1e-9)
    for name in ("inverse", "inverse now"):
        assert reported[name] == pytest.approx(reported["q"], abs=1e-9)
    true = ("reachable", "pose allowed", "payload")
    moves = ("moveL to where it is", "moveJ to where it is", "moveL_FK")
    assert all(reported[name] for name in (*true, *moves)), reported
    assert not reported["far"]
    assert not reported["joints allowed"]
    # URScript's get_inverse_kin ends the program where there is no solution
    assert reported["inverse of far"] == []
    assert reported["runs after it"] is False


@pytest.mark.parametrize(("model", "named"), [("ur5e", "UR5"), ("ur10", "UR10"), ("ur3e", "UR3")])
def test_the_dashboard_names_the_arm_that_it_moves_and_knows_the_wheels_orders(model, named):
    with ur_peer(model) as (controller, _):
        reported = answers_of(_DASHBOARD, controller.address)
    assert reported["model"] == named
    assert "NORMAL" in reported["safetymode"]
    assert "POWER_OFF" in reported["powerOff"]
    assert "IDLE" in reported["powerOn"]
    assert "RUNNING" in reported["brakeRelease"]
    assert reported["quit"] is True
