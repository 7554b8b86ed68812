"""An ABB controller on loopback: Robot Web Services over HTTP, EGM feedback over UDP.

An IRC5 (RobotWare 6) speaks RWS 1.0, an OmniCore (RobotWare 7) RWS 2.0 over HTTPS.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace

from scipy.spatial.transform import RigidTransform

from drivers.arm import Arm, Motion, MoveTarget
from drivers.errors import DeviceError, SafetyError
from sim.peers.abb.cell_watch import CellWatch
from sim.peers.abb.egm import EgmSender
from sim.peers.abb.event_log import EventLog
from sim.peers.abb.http_server import RwsServer
from sim.peers.abb.motion_program import BadProgram, Wait, decode
from sim.peers.abb.panel import ABBFaults, PanelState
from sim.peers.abb.panel_services import RAMDISK
from sim.peers.controller_faults import Reported, StopOrders
from sim.peers.events import Event

PROGRAM_FILE = f"{RAMDISK}/motion_program.bin"
_POLL_S = 0.004
_SLOWEST = 0.01


class ABBController:
    """The controller of one simulated arm; a context manager that opens and closes its ports.

    Parameters
    ----------
    arm:
        The arm it moves, in process.
    address:
        A loopback address of its own.
    port:
        For HTTP; the real controller's is 80, which an ordinary user may not open.
    https:
        Speak HTTPS on that port, not HTTP; an OmniCore does anyway.
    omnicore:
        Speak RWS 2.0.
    egm_port:
        Where to send EGM feedback while a program runs; None for nowhere.

    Attributes
    ----------
    faults:
        What goes wrong with it, on command.
    reported:
        The arm's state as the controller reports it.
    stop_orders:
        How orders to stop are taken.
    world_from_base:
        Where the arm is mounted; work objects and EGM refer to the world.
    flange_from_active_tool:
        What RWS takes for the tool where a request names none.
    signals, rapid_data:
        Inputs and outputs by network, unit and name; persistent variables by task, module, name.
    watch:
        The background task that stops the motion when nobody vouches for it.
    events, request_times_s:
        Orders and halts of the arm; when each HTTP request came.
    """

    def __init__(
        self,
        arm: Arm,
        address: str = "127.0.0.1",
        port: int = 8610,
        egm_port: int | None = None,
        *,
        https: bool = False,
        omnicore: bool = False,
    ) -> None:
        self.arm = arm
        self.address = address
        self.port = port
        self._https, self._omnicore = https or omnicore, omnicore
        self.panel = PanelState()
        self.faults = ABBFaults()
        self.reported = Reported(arm.state, lambda: self.faults)
        self.stop_orders = StopOrders(lambda: self.faults, arm, self.halt, self.note)
        self.files: dict[str, bytes] = {}
        self.signals: dict[str, float] = {"Local/DRV_1/DRV1BRAKE": 1.0}
        self.rapid_data: dict[str, str] = {}
        self.log = EventLog()
        self.events: list[Event] = []
        self.request_times_s: list[float] = []
        self.running = False
        self.world_from_base = RigidTransform.identity()
        self.flange_from_active_tool = RigidTransform.identity()
        self.watch = CellWatch(self._stop_for_silence)
        self._egm = EgmSender(self, address, egm_port) if egm_port else None
        self._stop_rapid = threading.Event()
        self._program: threading.Thread | None = None
        self._lock = threading.RLock()

    def __enter__(self) -> ABBController:
        self.arm.connect()
        self._http = RwsServer(
            (self.address, self.port), self, https=self._https, omnicore=self._omnicore
        )
        self.watch.start()
        if self._egm is not None:
            self._egm.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    @property
    def url(self) -> str:
        """Base URL of Robot Web Services."""
        return f"{'https' if self._https else 'http'}://{self.address}:{self.port}"

    # ---- what a test orders ------------------------------------------------------------------

    def guard_stop(self) -> None:
        """Somebody opens the gate."""
        self._safety_stop("guardstop")

    def emergency_stop(self) -> None:
        """Somebody hits the red button."""
        self._safety_stop("emergencystop")

    def to_manual(self) -> None:
        """Somebody turns the key."""
        self.panel.mode = "MANR"
        self._safety_stop("guardstop")

    def kill(self) -> None:
        """The controller dies: ports closed, brakes on."""
        self.faults.mend_cable()
        self._http.close()
        self.watch.close()
        if self._egm is not None:
            self._egm.close()
        self.halt("controller killed")

    def drop(self) -> None:
        """Close every connection and keep accepting."""
        self._http.drop()

    def cut(self) -> None:
        """Pull the network cable."""
        self.faults.cut()

    def restore(self) -> None:
        """Cable in, guard closed, button released, key to automatic, motors on."""
        self.faults = ABBFaults()
        self.panel = PanelState()

    def _safety_stop(self, state: str) -> None:
        self.panel.controller = state
        self.halt(state)

    # ---- what its ports order ----------------------------------------------------------------

    def note(self, what: str) -> None:
        """Remember that something arrived."""
        self.events.append(Event(time.monotonic(), what))

    def start(self) -> None:
        """Start RAPID at the program pointer."""
        with self._lock:
            self.running = True
            self._stop_rapid.clear()
            self._program = threading.Thread(target=self._run, name="rapid", daemon=True)
            self._program.start()

    def stop(self, why: str) -> None:
        """Stop RAPID and the arm, as far as the faults let it."""
        self.stop_orders.take(why)

    def halt(self, why: str) -> None:
        """Stop RAPID and the arm, whatever the faults say."""
        with self._lock:
            self._stop_rapid.set()
            if self.arm.state().motion is Motion.MOVING:
                self.note(f"halt: {why}")
            self.arm.stop()
            program = self._program
        if program is not None:
            program.join(timeout=1.0)

    def _stop_for_silence(self, why: str) -> None:
        if not self.faults.watchdog_fails:
            self.stop(why)

    def _run(self) -> None:
        name = f"log-{time.time_ns()}.bin".replace("_", "-")
        self.log.add(1, "Motion Program Log File Opened", name)
        try:
            for command in decode(self.files.get(PROGRAM_FILE, b"")):
                self._execute(command)
        except (BadProgram, SafetyError, DeviceError, IndexError) as error:
            self.log.add(3, "Motion Program Failed", str(error), "", "", "")
        else:
            self.files[f"{RAMDISK}/{name}"] = b""
            self.log.add(1, "Motion Program Log File Closed", name)
        self.running = False

    def _in_base(self, target: MoveTarget) -> MoveTarget:
        if target.base_from_flange is None:
            return target
        pose = self.world_from_base.inv() * target.base_from_flange
        return replace(target, base_from_flange=pose)

    def _slowed(self, target: MoveTarget) -> MoveTarget:
        share = max(self.panel.speed_ratio / 100.0, _SLOWEST)
        return replace(
            target,
            tcp_speed_m_s=target.tcp_speed_m_s * share,
            joint_speed_rad_s=target.joint_speed_rad_s * share,
        )

    def _execute(self, command: MoveTarget | Wait) -> None:
        if isinstance(command, Wait):
            self._stop_rapid.wait(command.duration_s)
            return
        with self._lock:
            if self._stop_rapid.is_set():
                return
            self.arm.start_move(self._slowed(self._in_base(command)))
        while self.arm.state().motion is Motion.MOVING and not self._stop_rapid.is_set():
            time.sleep(_POLL_S)
