"""A Universal Robots controller that speaks its own protocols on loopback.

Ports (those of the real controller): 30001 primary, 30003 script, 30004 RTDE, and 29999 dashboard
or, with PolyScope X, the robot API over HTTP (on the real one port 80, which an ordinary user may
not open).
Clients of the real robot hard-code them, so every simulated controller gets an address of its own,
127.0.0.2 and up (127.0.0.1 is left alone: ur-rtde skips its remote-control check there).
"""

from __future__ import annotations

import threading
import time

import numpy as np

from calib.chain.kinematics import ArmKinematics
from drivers.arm import Arm, Motion, MoveTarget
from drivers.errors import DeviceError, SafetyError
from drivers.ur.wire import RTDE_PORT, Value
from sim.peers.controller_faults import Reported, StopOrders, Stops
from sim.peers.events import Event
from sim.peers.listener import Listener
from sim.peers.ur.dashboard import DashboardServer
from sim.peers.ur.faults import URFaults
from sim.peers.ur.modes import Robot, Runtime, Safety
from sim.peers.ur.primary import PrimaryServer
from sim.peers.ur.program import ControlProgram
from sim.peers.ur.robot_api import RobotApiServer
from sim.peers.ur.rtde import RtdeServer
from sim.peers.ur.script import ScriptServer
from sim.peers.ur.variables import motion, status

DASHBOARD_PORT, PRIMARY_PORT, SCRIPT_PORT = 29999, 30001, 30003
UNLOCK_WAIT_S = 5.0
_POLYSCOPE_5, _POLYSCOPE_X = (5, 12, 6, 1102099), (10, 14, 0, 104)


class URController:
    """The controller of one simulated arm; a context manager that opens and closes its ports.

    Parameters
    ----------
    arm:
        The arm it moves, in process.
    address:
        A loopback address of its own.
    kinematics:
        Whose Denavit-Hartenberg parameters the primary port reports as the factory calibration;
        None to report none.
    robot_api_port:
        Runs PolyScope X and serves its robot API there; None for PolyScope 5 and the dashboard.
    robot_api_version:
        Of PolyScope X; see `sim.peers.ur.robot_api`.
    rate_hz:
        Cycle of the control loop and highest RTDE rate.
    payload_kg:
        Mass at the flange as it is set at the pendant.

    Attributes
    ----------
    tcp_offset, joint_limits_rad:
        As they are set at the pendant: flange_from_tcp as a six-vector, (6, 2) joint limits.
    faults:
        What goes wrong with it, on command.
    stop_orders:
        How orders to stop are taken.
    events:
        What reached the controller, and every halt of the arm.
    """

    def __init__(
        self,
        arm: Arm,
        address: str = "127.0.0.2",
        *,
        kinematics: ArmKinematics | None = None,
        robot_api_port: int | None = None,
        robot_api_version: str = "5.0.107",
        rate_hz: float = 125.0,
        payload_kg: float = 0.0,
    ) -> None:
        self.arm = arm
        self.address = address
        self.kinematics = kinematics
        self.rate_hz = rate_hz
        self.version = _POLYSCOPE_5 if robot_api_port is None else _POLYSCOPE_X
        self._robot_api = robot_api_port, robot_api_version
        self.tcp_offset: tuple[float, ...] = (0.0,) * 6
        self.payload_kg = payload_kg
        self.joint_limits_rad = np.full((6, 2), 2 * np.pi) * [-1.0, 1.0]
        self.payload_cog_m: tuple[float, ...] = (0.0,) * 3
        self.remote_control = True
        self.faults = URFaults()
        self.stop_orders = StopOrders(lambda: self.faults, arm, self.halt, self.note)
        self.registers: dict[str, int | float] = {}
        self.events: list[Event] = []
        self.robot_mode = Robot.RUNNING
        self.safety = Safety.NORMAL
        self.runtime = Runtime.STOPPED
        self._program: ControlProgram | None = None
        self._target: MoveTarget | None = None
        self._protective_stop_s = -UNLOCK_WAIT_S
        self._reported = Reported(arm.state, lambda: self.faults)
        self._lock = threading.RLock()
        self._stopping = threading.Event()
        self._ports: list[Listener | RobotApiServer] = []

    def __enter__(self) -> URController:
        self._stopping.clear()
        self._ports.clear()
        self.arm.connect()
        self._rtde = RtdeServer(self)
        scripts = ScriptServer(self)
        servers = {
            PRIMARY_PORT: PrimaryServer(self, scripts.serve).serve,
            SCRIPT_PORT: scripts.serve,
            RTDE_PORT: self._rtde.serve,
        }
        api_port, api_version = self._robot_api
        if api_port is None:
            servers[DASHBOARD_PORT] = DashboardServer(self).serve
        else:
            self._ports.append(RobotApiServer((self.address, api_port), self, api_version))
        for port, serve in servers.items():
            self._ports.append(Listener((self.address, port), serve))
        self._loop = threading.Thread(target=self._run, name="ur-controller", daemon=True)
        self._loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        self._loop.join(timeout=2.0)

    # ---- what a test orders ------------------------------------------------------------------

    def protective_stop(self) -> None:
        """Trip on a collision: the arm stops, the program is paused and stays loaded."""
        with self._lock:
            self.safety = Safety.PROTECTIVE_STOP
            self._protective_stop_s = self.now()
            if self.runtime is Runtime.PLAYING:
                self.runtime = Runtime.PAUSED
            self.halt("protective stop")

    def emergency_stop(self) -> None:
        """Somebody hits the red button: power off, program gone."""
        with self._lock:
            self.safety = Safety.EMERGENCY_STOP
            self.robot_mode = Robot.POWER_OFF
            self._end_program()
            self.halt("emergency stop")

    def drop(self) -> None:
        """Close every connection and keep accepting."""
        for port in self._ports:
            port.drop()

    def cut(self) -> None:
        """Pull the network cable: nothing passes in either direction, no socket is closed."""
        self.faults.cut()

    def kill(self) -> None:
        """The controller dies: ports closed, brakes fall in."""
        self._stopping.set()
        for port in self._ports:
            port.close()
        self.halt("controller killed")

    def wait_out_protective_stop(self) -> None:
        """The five seconds pass after which a protective stop may be unlocked."""
        self._protective_stop_s -= UNLOCK_WAIT_S

    def power(self, mode: Robot) -> None:
        """Switch the arm's power and brakes; without power nothing moves.

        As an order to stop it is taken as the faults have it.
        """
        with self._lock:
            if self.safety is not Safety.NORMAL:
                return
            if mode is not Robot.RUNNING and self.faults.stops is not Stops.OBEYED:
                self.stop_program("power or brakes off")
                return
            if mode is not Robot.RUNNING:
                self._end_program()
                self.halt("power or brakes off")
            self.robot_mode = mode

    def restore(self) -> None:
        """Cable in, button released, arm powered, in remote control, no program loaded."""
        with self._lock:
            self._end_program()
            self.halt("restored")
            self.faults = URFaults()
            self.remote_control = True
            self.safety, self.robot_mode = Safety.NORMAL, Robot.RUNNING

    # ---- what its ports order ----------------------------------------------------------------

    @property
    def model(self) -> str:
        """The arm's model as the dashboard names it: without the e of e-Series."""
        name = self.kinematics.name if self.kinematics is not None else "ur5"
        return name.upper().removesuffix("E")

    @staticmethod
    def now() -> float:
        """Host clock in seconds."""
        return time.monotonic()

    def note(self, what: str) -> None:
        """Remember that something arrived."""
        self.events.append(Event(self.now(), what))

    def load(self, source: str) -> None:
        """A program came in on a script port: it takes the place of the one that runs."""
        with self._lock:
            control = "def rtde_control():" in source
            if self.stop_orders.refused and not control:
                self.note("script refused")
                return
            self.stop_program("replaced by another program")
            if self.safety is not Safety.NORMAL or self.robot_mode is not Robot.RUNNING:
                return
            if control:
                self._program = ControlProgram(self, source)
                self.runtime = Runtime.PLAYING

    def play(self) -> bool:
        """Resume a paused program, with the motion that it was in."""
        with self._lock:
            if self.runtime is not Runtime.PAUSED or self.safety is not Safety.NORMAL:
                return False
            self.runtime = Runtime.PLAYING
            if self._target is not None:
                self.begin_move(self._target)
            return True

    def pause(self) -> bool:
        """Pause the program that runs, and its motion; return whether there was one."""
        with self._lock:
            if self.runtime is not Runtime.PLAYING:
                return False
            self.runtime = Runtime.PAUSED
            self.stop_orders.take("pause")
            return True

    def stop_program(self, why: str) -> None:
        """End the program and its motion, as far as the faults let it."""
        with self._lock:
            self._end_program()
            self.stop_orders.take(why)

    def stop_motion(self, why: str) -> None:
        """End the motion and not the program, as far as the faults let it."""
        self.stop_orders.take(why)

    def unlock_protective_stop(self) -> bool:
        """Release a protective stop, which the controller does after five seconds."""
        if self.now() - self._protective_stop_s < UNLOCK_WAIT_S:
            return False
        if self.safety is Safety.PROTECTIVE_STOP:
            self.safety = Safety.NORMAL
        return True

    def begin_move(self, target: MoveTarget) -> None:
        """Start a motion of the program; one that the arm cannot make ends the program."""
        self._target = target
        try:
            self.arm.start_move(target)
        except (SafetyError, DeviceError) as error:
            self.note(f"refused by the arm: {error}")
            self._end_program()

    def joints_rad(self) -> tuple[float, ...]:
        """Present joint angles."""
        return self.arm.state().joints_rad or (0.0,) * 6

    def halt(self, why: str) -> None:
        """Stop the arm, whatever the faults say."""
        if self.arm.state().motion is Motion.MOVING:
            self.note(f"halt: {why}")
        self.arm.stop()

    def at_rest(self) -> bool:
        """Whether the arm has come to rest."""
        if self.arm.state().motion is Motion.MOVING:
            return False
        if self.runtime is Runtime.PLAYING:
            self._target = None
        return True

    def steady(self) -> bool:
        """Whether the arm has been at rest for long enough to be called steady."""
        return self.arm.state().motion is Motion.STEADY

    def write_inputs(self, values: dict[str, Value]) -> None:
        """Take an input package from an RTDE client."""
        with self._lock:
            for name, value in values.items():
                if isinstance(value, int | float):
                    self.registers[name] = value
            commanded = any(name.startswith("input_int_register_") for name in values)
            if commanded and self._program is not None:
                self._program.kick()

    def read_outputs(self) -> dict[str, Value]:
        """Return every variable of this cycle, all of the same instant."""
        with self._lock:
            state = self._reported()
            return {
                **self.registers,
                "tcp_offset": self.tcp_offset,
                "payload": self.payload_kg,
                "payload_cog": self.payload_cog_m,
                **status(self.robot_mode, self.safety, self.runtime),
                **motion(state, self.tcp_offset, self.kinematics),
            }

    def _end_program(self) -> None:
        self._program = None
        self._target = None
        self.runtime = Runtime.STOPPED

    def _run(self) -> None:
        period_s = 1.0 / self.rate_hz
        due_s = self.now()
        while not self._stopping.is_set():
            self._cycle()
            due_s = max(due_s + period_s, self.now())
            time.sleep(max(0.0, due_s - self.now()))

    def _cycle(self) -> None:
        with self._lock:
            if self._program is not None and self.runtime is Runtime.PLAYING:
                self._program.tick()
            self._watch_client()
        if not self.faults.mute:
            self._rtde.publish(self.read_outputs())

    def _watch_client(self) -> None:
        program = self._program
        if program is not None and program.watchdog_expired() and not self.faults.watchdog_fails:
            self.note("watchdog")
            self.stop_program("watchdog")
