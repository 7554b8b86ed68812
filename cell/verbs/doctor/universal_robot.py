"""Whether a Universal Robots arm would let itself be driven; only questions are asked."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from calib.chain.kinematics import ArmKinematics, UnknownArm, arm
from cell.sequencer.as_configured import limits_differ, payload_differs, tcp_differs
from cell.sequencer.same_arm import flange_difference, model_differs
from cell.storage.files.cell_file import JointLimits, UniversalRobot
from cell.verbs.doctor.finding import Finding
from cell.verbs.doctor.ports import CHECK_LINE, port
from drivers.errors import DeviceError
from drivers.ur.kinematics_info import read_kinematics
from drivers.ur.panel import Panel
from drivers.ur.pose import base_from_flange
from drivers.ur.reader import Packet, RtdeReader
from drivers.ur.which_panel import panel_of

_PORTS = {30003: "script", 30004: "RTDE"}
_LISTEN_S = 1.0
_SILENCE_S = 1.0  # nothing moves here, so a busy computer may miss a few packets
_LONGEST_TOOL_M = 1.0
_CLOCK_SLIP_S = 0.02


def universal_robot(robot: UniversalRobot, limits: JointLimits | None = None) -> list[Finding]:
    """Which PolyScope it is, ports, remote control, safety, power, settings and clock."""
    ports = [port(f"UR {name}", robot.address, number) for number, name in _PORTS.items()]
    _, rtde = ports
    findings = [*_panel(robot), *ports]
    if not rtde.ready:
        return findings
    return [*findings, *_limits(robot, limits), *_packets(robot)]


def _panel(robot: UniversalRobot) -> list[Finding]:
    try:
        panel = panel_of(robot.address, robot.robot_api_port)
    except DeviceError as silent:
        return [Finding("UR controller", False, str(silent), CHECK_LINE)]
    try:
        reported = panel.identity()
        kind = "dashboard server"
        if "robot_api" in reported:
            kind = f"PolyScope X, robot API {reported['robot_api']}"
        found = ", ".join(
            reported[key] for key in ("polyscope", "model", "serial") if key in reported
        )
        answers = Finding("UR controller", True, f"{kind}: {found or 'reports no version'}")
        return [answers, _model(robot.model or "", reported.get("model", "")), *_state(panel)]
    except DeviceError as silent:
        return [Finding("UR controller", False, str(silent), CHECK_LINE)]
    finally:
        panel.close()


def _model(named: str, model: str) -> Finding:
    return Finding(
        "UR model",
        not model_differs(named, model),
        f"{model or 'not reported'}; the cell file says {named or 'nothing'}",
        "write the model that is connected at robot.model, and plan anew",
    )


def _state(panel: Panel) -> list[Finding]:
    local, safety, mode = panel.in_local_mode(), panel.safety(), panel.robot_mode()
    return [
        Finding(
            "UR remote control",
            not local,
            "local: programs from outside are ignored" if local else "remote",
            "switch the pendant from Local to Remote (on PolyScope X in automatic mode, on the"
            " safety screen)",
        ),
        Finding(
            "UR safety",
            "NORMAL" in safety or "REDUCED" in safety,
            safety,
            "look why it stopped, then release it at the pendant",
        ),
        Finding(
            "UR mode",
            "RUNNING" in mode,
            mode,
            "power on and release the brakes at the pendant",
        ),
    ]


def _packets(robot: UniversalRobot) -> list[Finding]:
    reader = RtdeReader(robot.address, silence_s=_SILENCE_S)
    try:
        reader.connect()
        heard = _listen(reader)
    except DeviceError as fault:
        return [Finding("UR state", False, str(fault), CHECK_LINE)]
    finally:
        reader.close()
    return [*_same_arm(robot, heard[-1]), *_settings(robot, heard[-1]), _clock(heard)]


def _settings(robot: UniversalRobot, packet: Packet) -> list[Finding]:
    raw = packet.values
    findings = [_tool(packet)]
    for name, wrong in (
        ("UR tool centre point as in the cell file", tcp_differs(robot, raw)),
        ("UR payload as in the cell file", payload_differs(robot, raw)),
    ):
        findings += [Finding(name, False, what, "see there") for what in wrong]
    return findings


def _limits(robot: UniversalRobot, limits: JointLimits | None) -> list[Finding]:
    """Joint limits of the safety settings, where the controller reports them."""
    try:
        named = arm(robot.model or "")
        reported = read_kinematics(robot.address)
    except (UnknownArm, DeviceError):
        return []
    if reported is None or reported.joint_limits_rad is None:
        return []
    if limits is not None:
        named = replace(named, limits_rad=limits.narrowed(named.limits_rad))
    wrong = limits_differ(named, {"kinematics": vars(reported)})
    return [
        Finding(
            "UR joint limits", not wrong, "; ".join(wrong) or "as wide as the cell's", "see there"
        )
    ]


def _same_arm(robot: UniversalRobot, packet: Packet) -> list[Finding]:
    try:
        named = arm(robot.model or "")
    except UnknownArm:
        return []
    return [_same_flange(named, packet)]


def _same_flange(named: ArmKinematics, packet: Packet) -> Finding:
    reported = base_from_flange(packet.vector("actual_TCP_pose"), packet.vector("tcp_offset"))
    found = flange_difference(named, np.array(packet.vector("actual_q")), reported)
    return Finding(
        "UR kinematics",
        found.same,
        f"the reported flange is {found} from where the drawing of a {named.name} has it",
        "a factory calibration makes a few millimetres; this is another model: write it at"
        " robot.model, and plan anew",
    )


def _listen(reader: RtdeReader) -> list[Packet]:
    heard = [reader.newest()]
    while heard[-1].host_t_s - heard[0].host_t_s < _LISTEN_S:
        time.sleep(0.004)
        packet = reader.newest()
        if packet is not heard[-1]:
            heard.append(packet)
    return heard


def _tool(packet: Packet) -> Finding:
    offset = np.array(packet.vector("tcp_offset"))
    length_m = float(np.linalg.norm(offset[:3]))
    if not offset.any():
        return Finding("UR tool centre point", True, "none set: poses are the flange's")
    x, y, z = 1e3 * offset[:3]
    return Finding(
        "UR tool centre point",
        bool(length_m <= _LONGEST_TOOL_M),
        f"{x:.1f} {y:.1f} {z:.1f} mm from the flange; it is taken out of every pose",
        "a tool longer than a metre is a mistake of units: correct it at the pendant, Installation,"
        " TCP",
    )


def _clock(heard: list[Packet]) -> Finding:
    """How far the two clocks run apart while listening; what they are set to does not matter.

    Poses are paired with frames by this computer's clock at a packet's arrival, so what counts is
    how late packets come: the spread of arrival less the controller's own time.
    """
    host = np.array([packet.host_t_s for packet in heard])
    offset_s = host - np.array([packet.number("timestamp") for packet in heard])
    slip_s = float(np.percentile(offset_s, 95) - offset_s.min())
    return Finding(
        "UR clock",
        slip_s <= _CLOCK_SLIP_S,
        f"{offset_s.min():+.3f} s from this computer's, packets up to {1e3 * slip_s:.1f} ms late"
        f" in {host[-1] - host[0]:.1f} s",
        "take the load off this computer, or give robot and camera a network of their own; poses"
        " are reported late, which a run with `capture: moving` cannot bear",
        needed=False,
    )
