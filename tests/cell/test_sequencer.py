from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cell.errors import (
    EXIT_BAD_ANSWER,
    EXIT_DEVICE,
    EXIT_INPUT,
    EXIT_OPERATOR,
    EXIT_SAFETY,
    InputError,
)
from cell.sequencer import checks
from cell.sequencer import sequencer as sequencer_module
from cell.sequencer.checks import Verdict
from cell.sequencer.clock import HostClock
from cell.sequencer.guard import Guard
from cell.sequencer.guide import Guide
from cell.sequencer.journal import Journal, read_journal
from cell.sequencer.progress import Progress
from cell.sequencer.requests import Requests
from cell.sequencer.sequencer import Devices, Sequencer
from cell.sequencer.states import Finish, RunResult, State, Status
from cell.sequencer.stop import StopRequest, signals_ask
from cell.sequencer.watcher import Checked, Watcher
from cell.storage.files.parts import Box
from cell.storage.files.plan_file import Plan, View, read_plan
from cell.storage.recording import Header, RecordingWriter, read_recording
from drivers.arm import ArmState, MoveTarget
from drivers.camera import Frame
from drivers.errors import DeviceUnreachable, FrameMissing, SafetyError, StopFailed
from tests.cell.fakes import HOME, FakeArm, FakeCamera, FastClock
from tests.cell.plans import CELL, PLAN

NO_BOARD = "checks: {board: false}\n"


class Listener(Watcher):
    """Keeps what it is sent."""

    def __init__(self) -> None:
        self.statuses: list[Status] = []
        self.frames: list[Checked] = []

    def status_changed(self, status: Status) -> None:
        self.statuses.append(status)

    def checked(self, checked: Checked) -> None:
        self.frames.append(checked)


class Bench:
    """A plan, fakes, and what a run of them left."""

    def __init__(
        self, folder: Path, plan: str = PLAN + NO_BOARD, *, real: bool = False, cell: str = CELL
    ) -> None:
        (folder / "bench.yaml").write_text(cell)
        (folder / "plan.yaml").write_text(plan)
        self.folder = folder / "run"
        self.clock = HostClock() if real else FastClock()
        self.arm = FakeArm(self.clock.now)
        self.camera = FakeCamera(self.clock.now)
        self.plan: Plan = read_plan(folder / "plan.yaml")
        self.stop = StopRequest()
        self.requests = Requests()
        self.watchers: list[Watcher] = [Listener()]

    def run(self, progress: Progress | None = None, guide: Guide | None = None) -> RunResult:
        header = {"schema": "cell.recording/1", "board": self.plan.cell.board.model_dump()}
        header["images"] = "images/"
        writer = RecordingWriter.create(self.folder, Header.model_validate(header))
        devices = Devices(self.arm, self.camera, self.clock)
        with writer:
            sequencer = Sequencer(
                self.plan,
                devices,
                writer,
                Journal(self.folder),
                progress=progress,
                stop=self.stop,
                requests=self.requests,
                watchers=self.watchers,
                guide=guide,
            )
            return sequencer.run()

    @property
    def statuses(self) -> list[Status]:
        (listener,) = self.watchers
        assert isinstance(listener, Listener)
        return listener.statuses

    def events(self) -> list[str]:
        return [event["event"] for event in read_journal(self.folder)]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@pytest.fixture
def real_bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path, PLAN.replace("0.2", "0.05") + NO_BOARD, real=True)
    with signals_ask(bench.stop):
        yield bench


def test_every_view_is_logged_with_the_pose_of_its_frame(bench: Bench) -> None:
    result = bench.run()
    assert (result.finish, result.frames, result.reason) == (Finish.COMPLETED, 4, "")
    recording = read_recording(bench.folder)
    assert [frame.frame for frame in recording.frames] == [0, 1, 2, 3]
    for frame, view in zip(recording.frames, bench.plan.file.views, strict=True):
        assert frame.joints_rad == pytest.approx(view.joints())
    assert recording.frames[2].approach_joints_rad == pytest.approx(
        bench.plan.file.views[1].joints()
    )
    assert [int(recording.image(frame)[0, 0]) for frame in recording.frames] == [2, 3, 4, 5]
    times = [frame.t_s for frame in recording.frames]
    assert times == sorted(times)
    assert bench.arm.calls[-1] == bench.camera.calls[-1] == "close"
    assert [status.state for status in bench.statuses][-1] is State.FINISHED
    assert bench.statuses[-3].left_s is not None


def test_a_picture_of_another_size_than_the_cell_file_says_ends_the_run(bench: Bench) -> None:
    bench.camera.size = (240, 320)
    result = bench.run()
    assert (result.finish, result.frames) == (Finish.BAD_INPUT, 0)
    assert "has 320x240 pixels, and the cell file says 640x480" in result.reason
    assert bench.arm.calls[-1] == "close"


def test_moves_stay_below_the_plans_speed(bench: Bench) -> None:
    kinematics_speeds = []
    start_move = bench.arm.start_move

    def watched(target):  # type: ignore[no-untyped-def]
        start_move(target)
        before = bench.arm.state().base_from_flange.translation
        bench.clock.sleep(0.01)
        after = bench.arm.state().base_from_flange.translation
        kinematics_speeds.append(np.linalg.norm(after - before) / 0.01)

    bench.arm.start_move = watched  # type: ignore[method-assign]
    bench.run()
    assert max(kinematics_speeds) < 0.2001
    assert max(kinematics_speeds) > 0.15


def test_a_camera_that_dies_stops_the_arm_first(bench: Bench) -> None:
    bench.camera.grabs = [None, *[DeviceUnreachable("camera at 10.0.0.2 does not answer")] * 2]
    order: list[str] = []
    bench.arm.stop, arm_stop = lambda: (order.append("arm stop"), arm_stop()), bench.arm.stop  # type: ignore
    bench.camera.close = lambda: order.append("camera close")  # type: ignore[method-assign]
    result = bench.run()
    assert order[-1] == "camera close"
    assert set(order[:-1]) == {"arm stop"}
    assert result.finish is Finish.DEVICE_FAILED
    assert result.finish.exit_status == EXIT_DEVICE
    assert "10.0.0.2" in result.reason
    assert "Afterwards the arm stands: readings confirm it" in result.reason
    assert len(read_recording(bench.folder).frames) == 1
    assert bench.events()[-1] == "stop"


def test_a_camera_that_comes_back_is_opened_once_with_the_arm_stopped(bench: Bench) -> None:
    bench.camera.grabs = [None, DeviceUnreachable("camera at 10.0.0.2 does not answer"), None]
    order: list[str] = []
    bench.arm.calls = bench.camera.calls = order
    result = bench.run()
    assert (result.finish, result.frames) == (Finish.COMPLETED, 4)
    lost = order.index("stop")
    assert order[lost - 1 : lost + 3] == ["grab", "stop", "connect", "grab"]
    assert order.count("connect") == 3
    assert order.count("move") == 4
    assert bench.events().count("camera lost") == 1


def test_a_camera_that_stays_away_ends_the_run(bench: Bench) -> None:
    bench.camera.grabs = [None, DeviceUnreachable("gone")]
    connect = bench.camera.connect

    def once() -> None:
        if "connect" in bench.camera.calls:
            raise DeviceUnreachable("camera at 10.0.0.2 stays away")
        connect()

    bench.camera.connect = once  # type: ignore[method-assign]
    result = bench.run()
    assert result.finish is Finish.DEVICE_FAILED
    assert "stays away" in result.reason
    assert len(read_recording(bench.folder).frames) == 1


def test_an_arm_that_is_lost_while_the_camera_works_is_not_taken_for_the_camera(
    bench: Bench,
) -> None:
    def gone(setting: object) -> None:
        def state() -> ArmState:
            raise DeviceUnreachable("arm at 10.0.0.1 does not answer")

        bench.arm.state = state  # type: ignore[method-assign]

    bench.camera.focus = gone  # type: ignore[method-assign,assignment]
    assert "10.0.0.1" in bench.run().reason
    assert bench.camera.calls.count("connect") == 1


def test_an_unforeseen_error_stops_the_arm_and_is_raised_again(bench: Bench) -> None:
    bench.camera.grabs = [ZeroDivisionError("a bug")]
    with pytest.raises(ZeroDivisionError):
        bench.run()
    assert "stop" in bench.arm.calls
    assert bench.events()[-1] == "stop"


def on_the_way(bench: Bench, act: Callable[[], None]) -> None:
    """Do something as soon as the arm is on its slow way to a view of the plan."""
    start_move = bench.arm.start_move

    def watched(target: MoveTarget) -> None:
        start_move(target)
        if bench.arm.calls.count("move") == 2:
            bench.arm.takes_s = 60.0
            act()

    bench.arm.start_move = watched  # type: ignore[method-assign]


def ran_through(bench: Bench) -> bool:
    """Whether the arm was stopped only after its last move, as the run ended."""
    calls = bench.arm.calls
    return calls.index("stop") > len(calls) - 1 - calls[::-1].index("move")


def test_a_failing_stop_is_the_loudest_error(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    on_the_way(bench, lambda: bench.stop.ask("the Stop button"))
    bench.arm.stop_error = StopFailed("link closed")
    result = bench.run()
    assert result.finish.exit_status == EXIT_SAFETY
    assert "PRESS THE EMERGENCY STOP" in capsys.readouterr().err
    assert "the Stop button" in result.reason
    assert "link closed" in result.reason
    assert bench.arm.calls.count("stop") > 10


def test_an_arm_that_had_stopped_by_itself_by_its_newest_reading_is_known_to_stand(
    bench: Bench,
) -> None:
    """Of a controller that reports no speeds: what came next is what it was, and yet not old."""
    state = bench.arm.state

    def without_speeds() -> ArmState:
        reading = state()
        if bench.arm.moving and bench.arm.share > 0.3:
            bench.arm.brakes_s = bench.clock.now()  # a guard was opened
            reading = state()
        stopped = "guard stop" if np.isfinite(bench.arm.brakes_s) else None
        return replace(reading, joint_velocity_rad_s=None, fault=stopped)

    bench.arm.state = without_speeds  # type: ignore[method-assign]
    result = bench.run()
    assert result.finish is Finish.DEVICE_FAILED, result.reason
    assert "guard stop" in result.reason


def test_a_run_that_took_every_view_is_not_done_while_the_arm_is_not_known_to_stand(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    def drive_on(status: Status) -> None:
        if status.done == status.total and "frame 3 logged" in (status.event or ""):
            bench.arm.start_move(MoveTarget(tuple(HOME + 0.4), joint_speed_rad_s=0.05))
            bench.arm.obeys_after_s = np.inf

    watcher = Watcher()
    watcher.status_changed = drive_on  # type: ignore[method-assign]
    bench.watchers = [watcher]
    result = bench.run()
    assert (result.finish.exit_status, result.frames) == (EXIT_SAFETY, 4)
    assert "THE ARM DOES NOT STOP" in capsys.readouterr().err
    assert "the run was over" in result.reason


@pytest.mark.parametrize("obeys", [True, False])
def test_an_arm_that_moves_again_after_a_confirmed_stop_is_stopped_again_and_that_is_told(
    obeys: bool, bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    def resume(status: Status) -> None:
        if status.state is State.STOPPING and "confirm" in (status.event or ""):
            bench.arm.start_move(MoveTarget(tuple(HOME + 0.4), joint_speed_rad_s=0.05))
            bench.arm.obeys_after_s = 0.0 if obeys else np.inf

    on_the_way(bench, lambda: bench.stop.ask("the Stop button"))
    watcher = Watcher()
    watcher.status_changed = resume  # type: ignore[method-assign]
    bench.watchers = [watcher]
    result = bench.run()
    assert result.finish.exit_status == EXIT_SAFETY
    assert "moved again after it had been stopped" in result.reason
    assert bench.arm.moving is not obeys
    assert ("PRESS THE EMERGENCY STOP" in capsys.readouterr().err) is not obeys
    events = bench.events()
    assert events.index("halt") < events.index("moved again") < events.index("stop")


def test_a_terminal_that_is_gone_does_not_end_the_run(bench: Bench) -> None:
    class Gone(Watcher):
        def status_changed(self, status: Status) -> None:
            raise BrokenPipeError

    bench.watchers = [Gone()]
    assert bench.run().finish is Finish.COMPLETED
    assert "listener failed" in bench.events()
    assert ran_through(bench)


@pytest.mark.parametrize("call", ["status_changed", "read", "checked"])
def test_a_watcher_that_fails_is_dropped_and_the_others_go_on(bench: Bench, call: str) -> None:
    def fail(seen: object) -> None:
        raise ZeroDivisionError("a bug of the page")

    failing, other = Watcher(), Listener()
    setattr(failing, call, fail)
    bench.watchers = [failing, other]
    assert bench.run().finish is Finish.COMPLETED
    assert len(other.frames) == 4
    assert other.statuses[-1].state is State.FINISHED
    assert bench.events().count("listener failed") == 1
    assert ran_through(bench)


def test_watchers_see_each_frame_with_its_line_in_the_recording(bench: Bench) -> None:
    bench.run()
    (listener,) = bench.watchers
    assert isinstance(listener, Listener)
    logged = read_recording(bench.folder).frames
    assert [frame.record for frame in listener.frames] == list(logged)


class WhenAt(Watcher):
    """Does something when the run comes to a state of a view."""

    def __init__(self, state: State, index: int, act: Callable[[], None]) -> None:
        self.when, self.act = (state, index), act

    def status_changed(self, status: Status) -> None:
        if (status.state, status.index) == self.when:
            self.act()


def test_a_pause_waits_at_the_end_of_the_move_with_the_arm_watched(bench: Bench) -> None:
    readings: list[bool] = []

    def paused() -> None:
        readings.append(bench.arm.moving)
        threading.Timer(0.05, bench.requests.go_on).start()

    bench.watchers = [
        WhenAt(State.MOVING, 1, bench.requests.pause),
        WhenAt(State.PAUSED, 1, paused),
        Listener(),
    ]
    assert bench.run().finish is Finish.COMPLETED
    assert readings[0] is False
    events = bench.events()
    assert events.index("pause") < events.index("go on")
    assert bench.arm.calls.count("move") == 4
    assert ran_through(bench)


def test_a_stop_is_heard_in_a_pause(bench: Bench) -> None:
    bench.requests.pause()
    bench.watchers = [WhenAt(State.PAUSED, 0, lambda: bench.stop.ask("the Stop button"))]
    result = bench.run()
    assert result.finish is Finish.STOPPED_BY_OPERATOR
    assert "stop" in bench.arm.calls
    assert "move" not in bench.arm.calls


def test_an_arm_that_faults_in_a_pause_ends_the_run(bench: Bench) -> None:
    bench.requests.pause()
    fault = partial(setattr, bench.arm, "fault", "protective stop")
    bench.watchers = [WhenAt(State.PAUSED, 0, fault)]
    assert bench.run().finish is Finish.DEVICE_FAILED


@pytest.mark.parametrize("state", [State.MOVING, State.SETTLING, State.FOCUSING, State.GRABBING])
def test_a_view_is_given_up_when_the_operator_asks(bench: Bench, state: State) -> None:
    bench.watchers = [WhenAt(state, 1, lambda: bench.requests.skip(1))]
    result = bench.run()
    assert result.finish is Finish.COMPLETED_WITH_LOSSES
    assert result.skipped == {1: "given up by the operator"}
    assert [frame.frame for frame in read_recording(bench.folder).frames] == [0, 2, 3]
    assert bench.events().count("skip") == 1


def test_giving_up_a_view_that_is_taken_gives_up_nothing(bench: Bench) -> None:
    bench.watchers = [WhenAt(State.SETTLING, 2, lambda: bench.requests.skip(1))]
    result = bench.run()
    assert (result.finish, result.skipped) == (Finish.COMPLETED, {})


def test_no_stop_is_ordered_from_an_arm_that_was_never_reached(bench: Bench) -> None:
    def unreachable() -> None:
        raise DeviceUnreachable("no robot at 10.0.0.1")

    bench.arm.connect = unreachable  # type: ignore[method-assign]
    bench.arm.stop_error = StopFailed("not connected")
    result = bench.run()
    assert result.finish is Finish.DEVICE_FAILED
    assert result.reason.startswith("no robot at 10.0.0.1. No motion was ordered")


def test_an_arm_that_stops_by_itself_ends_the_run(bench: Bench) -> None:
    bench.camera.focus = lambda setting: setattr(bench.arm, "fault", "protective stop")  # type: ignore
    result = bench.run()
    assert result.finish is Finish.DEVICE_FAILED
    assert "protective stop" in result.reason


NAMED = {signal.SIGINT: "Ctrl-C", signal.SIGQUIT: "Ctrl-\\", signal.SIGTSTP: "Ctrl-Z"}


@pytest.mark.parametrize(
    "number",
    [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP],
)
def test_a_signal_stops_a_moving_arm_within_100_ms(
    real_bench: Bench, number: signal.Signals
) -> None:
    sent: list[float] = []

    def send() -> None:
        while not real_bench.arm.moving:
            time.sleep(0.001)
        time.sleep(0.05)
        sent.append(time.monotonic())
        os.kill(os.getpid(), number)

    threading.Thread(target=send).start()
    result = real_bench.run()
    assert result.finish is Finish.STOPPED_BY_OPERATOR
    assert result.finish.exit_status == EXIT_OPERATOR
    assert real_bench.arm.stopped_s is not None
    assert real_bench.arm.stopped_s - sent[0] < 0.1
    assert result.reason == f"stopped by {NAMED.get(number, signal.Signals(number).name)}"


def test_the_operator_is_heard_while_the_camera_hangs(real_bench: Bench) -> None:
    hang = threading.Event()
    grab = real_bench.camera.grab
    real_bench.camera.grab = lambda timeout_s: (hang.wait(120), grab(timeout_s))[1]  # type: ignore
    threading.Timer(0.2, lambda: real_bench.stop.ask("the Stop button")).start()
    began_s = time.monotonic()
    result = real_bench.run()
    hang.set()
    assert result.finish is Finish.STOPPED_BY_OPERATOR
    assert time.monotonic() - began_s < 60.0  # and not when the camera is back


def test_a_lost_frame_is_taken_again_at_the_same_place(bench: Bench) -> None:
    bench.camera.grabs = [FrameMissing("incomplete"), None]
    result = bench.run()
    assert (result.finish, result.frames) == (Finish.COMPLETED, 4)
    assert bench.arm.calls.count("move") == 4
    assert bench.events().count("retry") == 1


def test_a_view_without_a_frame_is_skipped_with_its_reason(bench: Bench) -> None:
    bench.camera.grabs = [None] + [FrameMissing("incomplete")] * 3
    result = bench.run()
    assert result.finish is Finish.COMPLETED_WITH_LOSSES
    assert result.finish.exit_status == EXIT_BAD_ANSWER
    assert result.skipped == {1: "incomplete"}
    assert [frame.frame for frame in read_recording(bench.folder).frames] == [0, 2, 3]


def test_a_frame_older_than_the_standstill_is_refused(bench: Bench) -> None:
    bench.camera.lag_s = 5.0
    result = bench.run()
    assert "lies outside the time the arm stood still" in result.skipped[0]


def test_an_arm_that_reports_its_pose_seldom_is_waited_for(bench: Bench) -> None:
    bench.arm.reports_every_s = 0.2
    assert bench.run().finish is Finish.COMPLETED
    for frame in read_recording(bench.folder).frames:
        clocks = (frame.model_extra or {})["clocks"]
        assert abs(clocks["pose_host_s"] - clocks["frame_host_s"]) <= 0.2


def test_poses_that_do_not_agree_are_refused(bench: Bench) -> None:
    grab = bench.camera.grab

    def jolt(timeout_s: float) -> Frame:
        bench.arm.drift_rad += 1e-3
        return grab(timeout_s)

    bench.camera.grab = jolt  # type: ignore[method-assign]
    result = bench.run()
    assert "poses before and after the exposure differ by" in next(iter(result.skipped.values()))


def test_a_frame_that_fails_its_check_is_taken_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    verdicts = deque([Verdict("blurred"), Verdict(None), Verdict("blurred"), Verdict("dark")])
    monkeypatch.setattr(
        sequencer_module,
        "check_frame",
        lambda *args: verdicts.popleft() if verdicts else Verdict(None),
    )
    bench = Bench(tmp_path, PLAN + "retry: {attempts: 2}\n")
    result = bench.run()
    assert result.skipped == {0: "blurred"}
    assert [frame.frame for frame in read_recording(bench.folder).frames] == [1, 3, 2]
    reasons = [event["reason"] for event in read_journal(bench.folder) if event["event"] == "retry"]
    assert reasons == ["blurred", "dark"]


def test_a_board_that_is_nowhere_ends_the_run_early(tmp_path: Path) -> None:
    bench = Bench(tmp_path, PLAN + "retry: {attempts: 1, give_up_after: 2}\n")
    result = bench.run()
    assert result.finish is Finish.GIVEN_UP
    assert "board not found" in result.reason
    assert len(result.skipped) == 2


@pytest.mark.parametrize(
    ("view", "status", "message"),
    [
        ("{base_from_flange: {p_m: [2, 0, 0.5], q_xyzw: [0, 1, 0, 0]}}", EXIT_INPUT, "unreachable"),
        ("{joints_deg: [0, -90, 90, -90, -90, 400]}", EXIT_SAFETY, "joint 6 at 400.0° is outside"),
        ("{joints_deg: [0, 30, 0, -90, -90, 0]}", EXIT_SAFETY, "leave the workspace"),
        ("{joints_deg: [-45, -45, 30, -75, -90, 0]}", EXIT_SAFETY, "keep-out box `cabinet`"),
    ],
)
def test_a_plan_with_a_bad_view_is_refused_before_the_first_move(
    tmp_path: Path, view: str, status: int, message: str
) -> None:
    plan = PLAN + f"- {view}\n"
    bench = Bench(tmp_path, plan)
    result = bench.run()
    assert result.finish.exit_status == status
    assert message in result.reason
    assert "views.4 (view 4)" in result.reason
    assert "move" not in bench.arm.calls


WRIST = "joint_limits_deg: {joint_6: [-5, 5], joint_2: [-400, 400]}\n"


def test_a_narrowed_joint_is_held_in_every_view_and_the_others_keep_the_makers_range(
    tmp_path: Path,
) -> None:
    bench = Bench(tmp_path, cell=CELL + WRIST)
    result = bench.run()
    assert result.finish is Finish.SAFETY
    assert "views.3 (last): joint 6 at 10.0° is outside -5..5°" in result.reason
    assert "joint 2" not in result.reason
    assert "move" not in bench.arm.calls
    low, high = Guard.of(bench.plan).kinematics.limits_rad.T
    assert np.degrees(high[1]) == pytest.approx(360)
    assert np.degrees([low[5], high[5]]) == pytest.approx([-5, 5])


def test_a_view_given_as_a_pose_is_reached_within_the_narrowed_joints(tmp_path: Path) -> None:
    guard = Guard.of(Bench(tmp_path, cell=CELL + WRIST).plan)
    turned = HOME + np.array([0, 0, 0, 0, 0, 2 * np.pi])
    joints = guard.kinematics.inverse(guard.kinematics.forward(HOME), turned)
    assert joints == pytest.approx(HOME)


def test_an_arm_that_stands_outside_a_narrowed_joint_is_not_moved(tmp_path: Path) -> None:
    narrow = "joint_limits_deg: {joint_6: [-5, 15]}\n"
    bench = Bench(tmp_path, cell=CELL + narrow)
    bench.arm.start = bench.arm.end = HOME + np.radians([0, 0, 0, 0, 0, 60])
    result = bench.run()
    assert result.finish is Finish.SAFETY
    assert "where the arm stands: joint 6 at 60.0° is outside -5..15°. Drive" in result.reason
    assert "move" not in bench.arm.calls


class AsFarAs(Guide):
    """Two views beyond the plan's; notes what it has seen when asked."""

    def __init__(self, guard: Guard) -> None:
        self._guard, self.seen, self.seen_when_asked = guard, 0, []  # type: ignore[var-annotated]
        self.fault: Exception | None = None

    @property
    def guard(self) -> Guard:
        return self._guard

    def checked(self, checked: Checked) -> None:
        self.seen += 1

    def next_view(self) -> View | None:
        self.seen_when_asked.append(self.seen)
        if self.fault is not None:
            raise self.fault
        turn = 10.0 + self.seen
        return View(name="more", joints_deg=(0, -85, 90, -90, -90, turn)) if turn < 16 else None


def test_a_guide_adds_views_when_all_before_are_judged(bench: Bench) -> None:
    guide = AsFarAs(Guard.of(bench.plan))
    result = bench.run(guide=guide)
    assert (result.finish, result.frames) == (Finish.COMPLETED, 6)
    assert guide.seen_when_asked == [4, 5, 6]
    frames = read_recording(bench.folder).frames
    assert [frame.view for frame in frames[4:]] == ["more", "more"]
    assert np.degrees(frames[5].joints_rad or 0)[5] == pytest.approx(15)
    assert bench.events().count("decided") == 2
    assert isinstance(bench.watchers[0], Listener)
    assert bench.watchers[0].statuses[-1].total == 6


def test_a_guide_that_refuses_to_go_on_ends_the_run_stopped(bench: Bench) -> None:
    guide = AsFarAs(Guard.of(bench.plan))
    guide.fault = InputError("this cannot be the cell")
    result = bench.run(guide=guide)
    assert (result.finish, result.reason) == (Finish.BAD_INPUT, "this cannot be the cell")
    assert bench.arm.calls[-2:] == ["stop", "close"]


def test_every_move_passes_the_guides_own_guard(bench: Bench) -> None:
    box = Box(name="new", low_m=(-1, -1, -1), high_m=(1, 1, 1))
    cell = bench.plan.cell.model_copy(update={"keep_out": (box,)})
    result = bench.run(guide=AsFarAs(Guard(cell, 0.1, 0.5)))
    assert result.finish is Finish.SAFETY
    assert "keep-out box `new`" in result.reason
    assert "move" not in bench.arm.calls


def test_the_corners_of_a_board_on_the_flange_are_checked(bench: Bench) -> None:
    guard = Guard.of(bench.plan)
    flange = guard.kinematics.forward(HOME)
    carried = guard.cell.model_copy(update={"mount": "eye_to_hand"})
    reach = flange @ [0.15, 0.12, 0.05, 1.0]  # the board's far corner, squares included
    beside = Box(
        name="beside",
        low_m=tuple((reach[:3] - 0.01).tolist()),
        high_m=tuple((reach[:3] + 0.01).tolist()),
    )
    boxed = carried.model_copy(update={"keep_out": (beside,)})
    with pytest.raises(SafetyError, match="`beside`"):
        Guard(boxed, 0.1, 0.5).check_move(HOME, HOME, "here")
    in_hand = bench.plan.cell.model_copy(update={"keep_out": (beside,)})
    Guard(in_hand, 0.1, 0.5).check_move(HOME, HOME, "here")


def test_the_search_for_the_board_is_compiled_before_there_is_an_arm_to_watch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path, PLAN)
    calls: list[str] = []
    monkeypatch.setattr(checks, "make_ready", lambda: calls.extend(["ready", *bench.arm.calls]))
    bench.run()
    assert calls == ["ready"]
    assert bench.arm.calls
