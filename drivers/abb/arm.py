"""An ABB arm on an IRC5 (RobotWare 6) or an OmniCore (RobotWare 7) controller."""

from __future__ import annotations

import atexit

from drivers.abb.egm import EgmReader
from drivers.abb.readings import Reading, world_from_base
from drivers.abb.rws import named
from drivers.abb.settings import ABBSettings
from drivers.abb.status import fault_in
from drivers.abb.supervisor import Supervisor
from drivers.abb.transport import generation_of, resolved
from drivers.arm import ArmState, Motion, MoveTarget
from drivers.errors import ArmStopped, DeviceRefused, DeviceUnreachable, StopFailed
from drivers.targets import check_ready, check_target
from drivers.untried import warn_untried


class ABBArm:
    """Moves by motion programs through Robot Web Services; reads poses there and from EGM.

    Parameters
    ----------
    address:
        Such as ``192.168.125.1``; see `drivers.abb.transport.resolved`.
    settings:
        See `ABBSettings`.
    """

    tried_on_hardware = False

    def __init__(self, address: str, settings: ABBSettings | None = None) -> None:
        self._address = self._url = address
        self._settings = settings or ABBSettings()
        self._supervisor: Supervisor | None = None
        self._egm: EgmReader | None = None

    def connect(self) -> None:
        """Log in and begin to poll; see `drivers.arm.Arm`.

        Refused, too, without a password or with a wrong one, for a certificate that is not
        trusted, and where no task there watches the link. Stopped is also one that is not in
        automatic mode.
        """
        self.close()
        atexit.register(self.close)
        warn_untried(f"ABB arm at {self._address}", "a simulated controller on loopback")
        self._url = resolved(self._address, self._settings.certificate_sha256)
        generation = generation_of(self._url, self._settings.certificate_sha256)
        supervisor = Supervisor(self._url, self._settings, generation)
        try:
            self._open(supervisor)
        except BaseException:
            supervisor.close()
            self.close()
            raise

    def state(self) -> ArmState:
        """EGM's reading while a program runs and it comes, else RWS's; see `drivers.arm.Arm`."""
        supervisor = self._connected()
        reading = self._reading(supervisor)
        return ArmState(
            host_t_s=reading.host_t_s,
            controller_t_s=reading.controller_t_s,
            joints_rad=reading.joints_rad,
            joint_velocity_rad_s=None,
            base_from_flange=reading.base_from_flange,
            motion=_motion(supervisor),
            fault=supervisor.fault or supervisor.stop_failed,
            raw=reading.raw,
        )

    def start_move(self, target: MoveTarget) -> None:
        """Begin a move; see `drivers.arm.Arm` and `drivers.abb.program.build_program`."""
        settings = self._settings
        check_target(
            target,
            max_joint_speed_rad_s=settings.max_joint_speed_rad_s,
            max_tcp_speed_m_s=settings.max_tcp_speed_m_s,
            joint_limits_rad=settings.joint_limits_rad,
        )
        supervisor = self._connected()
        self._reading(supervisor)
        check_ready(supervisor.fault, supervisor.busy, self._named)
        supervisor.order(target)

    def stop(self) -> None:
        """Stop RAPID on two ways, or else the motors; see `drivers.abb.stopper`."""
        supervisor = self._supervisor
        failure = supervisor.stop() if supervisor is not None else None
        if failure is not None:
            raise StopFailed(
                self._named(f"the stop was not taken ({failure}). Press the emergency stop")
            )

    def close(self) -> None:
        """See `drivers.arm.Arm`."""
        atexit.unregister(self.close)
        if self._supervisor is not None:
            self._supervisor.close()
            self._supervisor = None
        if self._egm is not None:
            self._egm.close()
            self._egm = None

    def _open(self, supervisor: Supervisor) -> None:
        rws = supervisor.rws
        with named(self._url):
            fault = fault_in(rws)
            running = rws.get_execution_state().ctrlexecstate == "running"
            offset = world_from_base(rws)
        if fault is not None:
            raise ArmStopped(self._named(fault))
        if running:
            raise DeviceRefused(self._named("a RAPID program is running: stop it first"))
        if self._settings.egm_port is not None:
            self._egm = EgmReader(
                self._settings.egm_port,
                self._url,
                offset.inv(),
                self._settings.joint_limits_rad,
            )
        supervisor.start(offset)
        self._supervisor = supervisor

    def _reading(self, supervisor: Supervisor) -> Reading:
        # a stream that has ended with its program shows the last moment of the way
        streaming = self._egm is not None and supervisor.busy
        streamed = self._egm.fresh() if streaming and self._egm is not None else None
        if streamed is not None:
            return streamed
        if supervisor.newest is None or supervisor.silent_s > self._settings.silence_s:
            raise DeviceUnreachable(
                self._named(
                    f"no robot state for {supervisor.silent_s:.1f} s. The arm was ordered to stop, "
                    f"which nobody confirms{self._watched()}: look at it, and press the emergency "
                    "stop if it moves. "
                    "Check the network and the controller, then connect again"
                )
            )
        return supervisor.newest

    def _watched(self) -> str:
        limit_s = self._settings.link_watch_s
        return (
            ""
            if limit_s is None
            else f"; its controller stops it {limit_s:g} s after the last sign"
        )

    def _connected(self) -> Supervisor:
        if self._supervisor is None:
            raise DeviceUnreachable(self._named("not connected"))
        return self._supervisor

    def _named(self, what: str) -> str:
        return f"ABB arm {self._url}: {what}"


def _motion(supervisor: Supervisor) -> Motion:
    if supervisor.fault is not None:
        return Motion.STOPPED_BY_FAULT
    return Motion.MOVING if supervisor.busy else Motion.STEADY
