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
