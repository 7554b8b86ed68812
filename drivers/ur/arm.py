"""A Universal Robots arm: CB3 from 3.12, e-Series from 5.5.1, PolyScope X from 10.11."""

from __future__ import annotations

import atexit
import logging
import time
from typing import Any

from drivers.arm import ArmState, Motion, MoveTarget
from drivers.errors import (
    ArmStopped,
    DeviceError,
    DeviceRefused,
    DeviceUnreachable,
    StopFailed,
)
from drivers.targets import check_ready, check_target
from drivers.untried import warn_untried
from drivers.ur.kinematics_info import KinematicsInfo, read_kinematics
from drivers.ur.motion import MoveOrder
from drivers.ur.panel import Panel
from drivers.ur.pose import base_from_flange, base_from_tcp, pose_of
from drivers.ur.reader import Packet, RtdeReader
from drivers.ur.runtime import Runtime
from drivers.ur.settings import URSettings
from drivers.ur.speed import leading_joint_speed_rad_s, tcp_speed_m_s
from drivers.ur.status import fault_in
from drivers.ur.supervisor import Supervisor
from drivers.ur.verdicts import at_rest
from drivers.ur.which_panel import panel_of

_log = logging.getLogger("cell.drivers")
_JOINT_LIMIT_RAD = 6.3
_UNLOCK_CONFIRM_S = 2.0
_PROGRAM_END_S = 1.0


class URArm:
    """Moves through ur-rtde in a process of its own; reads poses and stops by itself.

    Parameters
    ----------
    host:
        The controller's address.
    settings:
        See `URSettings`.
    """

    tried_on_hardware = False

    def __init__(self, host: str, settings: URSettings | None = None) -> None:
        self._host = host
        self._settings = settings or URSettings()
        self._reader = RtdeReader(
            host, rate_hz=self._settings.rate_hz, silence_s=self._settings.silence_s
        )
        self._supervisor: Supervisor | None = None
        self._panel: Panel | None = None
        self.identity: dict[str, str] = {}
        self.kinematics: KinematicsInfo | None = None

    def connect(self) -> None:
        """Open every link and start the control script; see `drivers.arm.Arm`.

        Refused, too, in local mode, where another client holds the registers, and for a PolyScope
        that is too old.
        """
        self.close()
        atexit.register(self.close)
        warn_untried(f"Universal Robots arm at {self._host}", "a simulated controller on loopback")
        try:
            self._identify()
            self._reader.connect()
            self._start()
        except BaseException:
            self.close()
            raise

    def state(self) -> ArmState:
        """The newest packet, the flange's pose freed of the tool offset; see `drivers.arm.Arm`.

        A link that was lost is tried again, so that a reading can show whether the arm stands.
        """
        packet = self._reader.newest()
        supervisor = self._connected()
        return ArmState(
            host_t_s=packet.host_t_s,
            controller_t_s=packet.number("timestamp"),
            joints_rad=packet.vector("actual_q"),
            joint_velocity_rad_s=packet.vector("actual_qd"),
            base_from_flange=base_from_flange(
                packet.vector("actual_TCP_pose"), packet.vector("tcp_offset")
            ),
            motion=_motion(supervisor, packet),
            fault=supervisor.why() or supervisor.stop_failed,
            raw=self._raw(packet),
        )

    def start_move(self, target: MoveTarget) -> None:
        """Begin a move; see `drivers.arm.Arm`. Joint targets go by moveJ, poses by moveL."""
        settings = self._settings
        check_target(
            target,
            max_joint_speed_rad_s=settings.max_joint_speed_rad_s,
            max_tcp_speed_m_s=settings.max_tcp_speed_m_s,
            joint_limits_rad=((-_JOINT_LIMIT_RAD, _JOINT_LIMIT_RAD),) * 6,
        )
        packet = self._reader.newest()
        supervisor = self._connected()
        check_ready(supervisor.why(), supervisor.busy or not at_rest(packet), self._named)
        supervisor.order(self._order(target, packet))

    def stop(self) -> None:
        """Stop on paths that do not pass through ur-rtde; see `drivers.ur.stop_paths`."""
        supervisor = self._supervisor
        if supervisor is not None and not supervisor.stop():
            raise StopFailed(
                self._named(
                    "no way to stop it took the order. The controller's "
                    "watchdog should have stopped the arm; make sure, at the emergency stop"
                )
            )

    def recover(self) -> None:
        """Release a protective stop, when the operator has cleared its cause.

        The interrupted program is stopped first, so that nothing drives on. Raises `DeviceRefused`
        with the controller's own words, for instance within five seconds of the stop.
        """
        supervisor = self._connected()
        self.stop()
        assert self._panel is not None
        self._panel.stop_program()
        refusal = self._panel.unlock_protective_stop()
        if refusal is not None:
            raise DeviceRefused(self._named(refusal))
        self._await_no_fault()
        supervisor.clear()
        supervisor.prepare()
        self._wait_ready(supervisor)

    def close(self) -> None:
        """See `drivers.arm.Arm`."""
        atexit.unregister(self.close)
        if self._supervisor is not None:
            self._supervisor.close()
            self._supervisor = None
        if self._panel is not None:
            self._panel.close()
            self._panel = None
        self._reader.close()

    def _identify(self) -> None:
        self._panel = panel_of(self._host, self._settings.robot_api_port)
        self.identity = self._panel.identity()
        if self._panel.in_local_mode():
            raise DeviceRefused(
                self._named(
                    "is in local mode, where it ignores programs from outside: switch to "
                    "Remote Control at the top right of the teach pendant"
                )
            )

    def _start(self) -> None:
        fault = fault_in(self._reader.newest())
        if fault is not None:
            raise ArmStopped(self._named(fault))
        self._await_no_program()
        self.kinematics = read_kinematics(self._host)
        if self.kinematics is None:
            _log.warning(
                self._named(
                    "reports no kinematics on port 30001, so joint moves are slowed down as if the "
                    "arm were stretched out"
                )
            )
        assert self._panel is not None
        self._supervisor = Supervisor(self._host, self._settings, self._reader, self._panel)
        self._supervisor.prepare()
        self._wait_ready(self._supervisor)

    def _wait_ready(self, supervisor: Supervisor) -> None:
        try:
            supervisor.wait_ready(self._settings.start_timeout_s)
        except DeviceError as error:
            raise self._explained(str(error)) from None

    def _explained(self, why: str) -> DeviceError:
        if "already in use" in why:
            return DeviceRefused(
                self._named(
                    "another client or a fieldbus holds the RTDE input registers. Disable "
                    "EtherNet/IP, PROFINET or MODBUS on the robot, close the other program, or set "
                    "upper_registers"
                )
            )
        if "remote control" in why:
            return DeviceRefused(self._named(why))
        if "No module named" in why:
            return DeviceRefused(self._named(f"{why}: pip install 'calibration-cell[ur]'"))
        return DeviceUnreachable(
            self._named(
                f"cannot start the control script: {why}. See whether the teach pendant shows an "
                "error or somebody stopped the program there; then try again"
            )
        )

    def _await_no_program(self) -> None:
        # ur-rtde would end a program that is not ours without asking
        deadline = time.monotonic() + _PROGRAM_END_S
        while self._reader.newest().number("runtime_state") != Runtime.STOPPED:
            if time.monotonic() > deadline:
                raise DeviceRefused(
                    self._named("a program is running on the robot, or paused: stop it first")
                )
            time.sleep(0.02)

    def _await_no_fault(self) -> None:
        deadline = time.monotonic() + _UNLOCK_CONFIRM_S
        while (fault := fault_in(self._reader.newest())) is not None:
            if time.monotonic() > deadline:
                raise DeviceRefused(self._named(f"does not leave its stop: {fault}"))
            time.sleep(0.02)

    def _order(self, target: MoveTarget, packet: Packet) -> MoveOrder:
        settings = self._settings
        if target.joints_rad is not None:
            speed = leading_joint_speed_rad_s(packet.vector("actual_q"), target, self.kinematics)
            return MoveOrder(
                "move_j", tuple(target.joints_rad), speed, settings.joint_acceleration_rad_s2
            )
        assert target.base_from_flange is not None
        offset = packet.vector("tcp_offset")
        begin = base_from_flange(packet.vector("actual_TCP_pose"), offset)
        goal = pose_of(base_from_tcp(target.base_from_flange, offset))
        speed = tcp_speed_m_s(begin, target, offset)
        return MoveOrder("move_l", goal, speed, settings.tcp_acceleration_m_s2)

    def _raw(self, packet: Packet) -> dict[str, Any]:
        raw: dict[str, Any] = {**packet.values, **self.identity}
        if self.kinematics is not None:
            raw["kinematics"] = vars(self.kinematics)
        return raw

    def _connected(self) -> Supervisor:
        if self._supervisor is None:
            raise DeviceUnreachable(self._named("not connected"))
        return self._supervisor

    def _named(self, what: str) -> str:
        return f"UR arm {self._host}: {what}"


def _motion(supervisor: Supervisor, packet: Packet) -> Motion:
    if supervisor.fault is not None:
        return Motion.STOPPED_BY_FAULT
    return Motion.MOVING if supervisor.busy or not at_rest(packet) else Motion.STEADY
