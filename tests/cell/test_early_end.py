"""A run that ends before it has taken all views: when it may, and what it then leaves behind."""

from __future__ import annotations

import json
import re
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from typer.testing import CliRunner

from calib.calibration.running import fit_so_far
from calib.views import Board, Views
from cell.cli.app import app
from cell.devices.factory import simulated_devices
from cell.devices.simulated_cell import home_of, log_of, simulated_cell
from cell.errors import InputError
from cell.sequencer.journal import read_journal
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.sequencer.states import Finish, State, Status
from cell.sequencer.stop import StopRequest
from cell.sequencer.watcher import Watcher
from cell.storage.files.plan_file import Plan, Until, read_plan
from cell.storage.recording import read_recording
from cell.views.running_estimate.early_end import EarlyEnd
from cell.views.running_estimate.estimate import Estimate
from cell.views.running_estimate.process import RunningEstimate
from cell.views.running_estimate.view_kinds import Sights, lacking, planned_flange_poses
from sim.synthesize import synthesize
from tests.cell.fakes import FakeArm, FakeCamera, FastClock
from tests.cell.test_session import make_plan

CONFIGS = Path(__file__).parents[2] / "configs"
BOARD = Board("chessboard", 4, 5, 0.03)
DISTANCE_M = np.array([0.4, 0.6, 0.9])


def estimate(frames: int, sigma_px: float, alpha_px: float = 900.0, *lacks: str) -> Estimate:
    sigmas = np.array([sigma_px, sigma_px / 2, sigma_px / 2])
    return Estimate(frames, frames, "", DISTANCE_M, np.full(3, alpha_px), sigmas, lacks, None)


def reached(*estimates: Estimate) -> str:
    goal = EarlyEnd(Until(alpha_sigma_px=0.5, min_views=12))
    for one in estimates:
        goal.heed(one)
    return goal.reached()


def test_two_estimates_running_end_a_run() -> None:
    assert not reached(estimate(13, 0.4))
    reason = reached(estimate(13, 0.4), estimate(14, 0.38))
    assert reason == (
        "alpha is known to 0.38 px from 0.40 to 0.90 m after 14 frames; the plan asks for 0.5 px"
    )


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (estimate(10, 0.4), estimate(11, 0.4)),
        (estimate(13, 0.6), estimate(14, 0.4)),
        (estimate(13, 0.4), estimate(14, 0.6)),
        (estimate(13, 0.4), estimate(13, 0.4)),
        (estimate(13, 0.4), estimate(14, 0.4, 901.0)),
        (estimate(13, 0.4), estimate(14, 0.4, 900.0, "views at 0.40 to 0.57 m")),
        (estimate(13, 0.4), Estimate.none(14, "the views leave the focal length open")),
    ],
    ids=["few", "not before", "not now", "same frames", "unsteady", "not covered", "no fit"],
)
def test_a_small_sigma_alone_ends_nothing(first: Estimate, second: Estimate) -> None:
    assert not reached(first, second)


def sights(*views: tuple[float, float, float]) -> Sights:
    """Distance (m), and the tilt about the image's x and y axes (degrees), of each view."""
    poses = []
    for distance_m, about_x, about_y in views:
        turn = Rotation.from_rotvec(np.radians([about_x, about_y, 0.0]))
        middle = turn.apply(BOARD.corners_m.mean(axis=0))
        place = np.array([0.0, 0.0, distance_m]) - middle
        poses.append(RigidTransform.from_components(place, turn).as_matrix())
    return Sights.of(np.array(poses), BOARD)


PLANNED = [(d, x, y) for d in (0.4, 0.55, 0.75, 0.9) for x, y in ((0, 0), (25, 0), (0, -25))]


def test_distances_and_tilts_of_views_are_reported() -> None:
    seen = sights((0.5, 0, 0), (0.7, 20, 0), (0.9, 0, 30))
    np.testing.assert_allclose(seen.distance_m, [0.5, 0.7, 0.9])
    np.testing.assert_allclose(np.degrees(seen.tilt_rad), [0, 20, 30], atol=1e-6)
    assert (seen.tilted(0), seen.tilted(1)) == (1, 1)


@pytest.mark.parametrize(
    ("left_out", "words"),
    [
        (lambda d, x, y: d < 0.57, ("views at 0.40 to 0.57 m",)),
        (lambda d, x, y: d > 0.7, ("views at 0.73 to 0.90 m",)),
        (lambda d, x, y: x != 0, ("views of the board tipped up or down",)),
        (lambda d, x, y: y != 0, ("views of the board turned to the left or right",)),
        (lambda d, x, y: False, ()),
    ],
)
def test_what_the_plan_has_and_nobody_saw_is_named(left_out, words) -> None:  # type: ignore[no-untyped-def]
    planned = sights(*PLANNED)
    twice = [view for view in PLANNED for _ in range(2)]
    seen = sights(*[view for view in twice if not left_out(*view)])
    assert lacking(planned, seen) == words


def test_a_plan_is_not_asked_for_what_it_does_not_have() -> None:
    flat = sights((0.4, 0, 0), (0.9, 0, 0))
    assert lacking(flat, flat) == ()


def strided_plan(folder: Path, until: str = "") -> Path:
    """Every third view of the shipped plan, then the ones between."""
    cell = (CONFIGS / "ur3-robotiq.cell.yaml").read_text()
    # the shipped order keeps 5 mm between forearm and camera; this one passes nearer
    nearer = cell.replace("clearance_m: 0.005", "clearance_m: 0.002")
    (folder / "ur3-robotiq.cell.yaml").write_text(nearer)
    text = (CONFIGS / "ur3-robotiq.plan.yaml").read_text()
    head, *views = re.split(r"(?m)^(?=- )", text)
    ordered = [*views[0::3], *views[1::3][::-1], *views[2::3]]
    path = folder / "plan.yaml"
    path.write_text(head.replace("views:", f"{until}\nviews:") + "".join(ordered))
    return path


def corners_of_plan(plan: Plan, *, seed: int) -> Views:
    cell = simulated_cell(plan.cell, home_of(plan), seed=seed)
    return synthesize(cell, log_of(plan, cell))


def test_sigma_of_the_scale_factor_holds_what_it_promises(tmp_path: Path) -> None:
    plan = read_plan(strided_plan(tmp_path))
    views = corners_of_plan(plan, seed=3).take(np.arange(14))
    fit = fit_so_far(views, lens_moves=True)
    distance_m = np.array([0.36, 0.45, 0.6])
    alpha_px, sigma_px = fit.alpha_over(distance_m)
    true_px = 1370.8 - 0.756 / distance_m**2
    assert np.abs((alpha_px - true_px) / sigma_px).max() < 4.0
    assert 0.01 < sigma_px.max() < 2.0
    more = fit_so_far(corners_of_plan(plan, seed=3), lens_moves=True).alpha_over(distance_m)[1]
    assert (more < 0.9 * sigma_px).all()


def test_few_frames_do_not_pass_a_moving_lens_for_a_still_one(tmp_path: Path) -> None:
    plan = read_plan(strided_plan(tmp_path))
    views = corners_of_plan(plan, seed=3)
    far = views.take(np.argsort(-_depth_m(plan))[:7])
    near_m = np.array([0.34])
    still = fit_so_far(far, lens_moves=False)
    moving = fit_so_far(far, lens_moves=True)
    if still.joint.model.effects:
        pytest.fail("the far views alone demand a law now; choose others")
    assert moving.alpha_over(near_m)[1][0] > 2 * still.alpha_over(near_m)[1][0]


def _depth_m(plan: Plan) -> np.ndarray:
    layout = plan.cell.layout
    assert layout is not None
    mounted, fixed = (t.transform().as_matrix() for t in (layout.mounted, layout.fixed))
    poses = np.linalg.inv(planned_flange_poses(plan) @ mounted) @ fixed
    return Sights.of(poses, plan.cell.board.board()).distance_m


class Enough:
    """A goal that is reached once so many frames are logged, or from the start."""

    def __init__(self, after: int) -> None:
        self.left = after
        self.found: Future[None] = Future()
        self.found.set_result(None)

    def caught_up(self) -> Future[None]:
        return self.found

    def reached(self) -> str:
        self.left -= 1
        return "known well enough" if self.left < 0 else ""


def fakes() -> Devices:
    clock = FastClock()
    return Devices(FakeArm(clock.now), FakeCamera(clock.now), clock)


def test_a_reached_goal_ends_the_run_as_completed_and_says_why(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    result = record_plan(plan, tmp_path / "run", fakes(), goal=Enough(3))
    assert (result.finish, result.reason) == (Finish.COMPLETED, "")
    assert result.ended_early == "known well enough"
    assert 1 <= result.frames < 4
    events = read_journal(tmp_path / "run")
    assert events[-1]["finish"] == "completed"
    assert events[-1]["reason"] == "known well enough"
    (enough,) = [event for event in events if event["event"] == "enough"]
    assert enough["left"] == 4 - result.frames
    recording = read_recording(tmp_path / "run")
    assert recording.header.model_extra is not None
    assert recording.header.model_extra["ended_early"] == "known well enough"
    assert len(recording.frames) == result.frames

    whole = record_plan(plan, tmp_path / "run", fakes(), resume=True)
    assert (whole.frames, whole.ended_early) == (4, "")
    assert "ended_early" not in (read_recording(tmp_path / "run").header.model_extra or {})


def test_a_run_that_has_enough_does_not_move_again(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    record_plan(plan, tmp_path / "run", fakes(), goal=Enough(3))
    devices = fakes()
    result = record_plan(plan, tmp_path / "run", devices, resume=True, goal=Enough(0))
    assert (result.finish, result.ended_early) == (Finish.COMPLETED, "known well enough")
    assert isinstance(devices.arm, FakeArm)
    assert "move" not in devices.arm.calls


def test_until_needs_corners(tmp_path: Path) -> None:
    path = strided_plan(tmp_path, "until: {alpha_sigma_px: 0.5}\nchecks: {board: false}")
    with pytest.raises(InputError, match="until needs the board's corners"):
        read_plan(path)


class StopAfter(Watcher):
    def __init__(self, frames: int, stop: StopRequest) -> None:
        self.frames, self.stop = frames, stop

    def status_changed(self, status: Status) -> None:
        if status.done == self.frames and status.state is State.SETTLING:
            self.stop.ask("the test")


def test_a_run_gone_on_with_is_judged_by_the_pictures_of_before(tmp_path: Path) -> None:
    """Through the estimate's own process; `until` is no part of what a resumed run must share."""
    path = strided_plan(tmp_path)
    plan, stop = read_plan(path), StopRequest()
    stopped = record_plan(
        plan,
        tmp_path / "run",
        simulated_devices(plan),
        simulated=True,
        stop=stop,
        watchers=[StopAfter(15, stop)],
    )
    assert stopped.finish is Finish.STOPPED_BY_OPERATOR
    strided_plan(tmp_path, "until: {alpha_sigma_px: 2.0}")
    words = ["run", str(path), "--dry-run", "--record-only", "--json", "--resume"]
    result = CliRunner().invoke(app, [*words, "-o", str(tmp_path / "run")])
    assert result.exit_code == 0, result.output
    shown = json.loads(result.stdout)
    assert (shown["finish"], shown["frames"]) == ("completed", stopped.frames)
    assert shown["ended_early"].startswith("alpha is known to 0.")
    assert "ending early: alpha is known" in result.stderr


def test_an_estimate_that_dies_leaves_the_run_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plan = read_plan(strided_plan(tmp_path, "until: {alpha_sigma_px: 2.0}"))
    assert plan.file.until is not None
    goal = EarlyEnd(plan.file.until)
    with RunningEstimate(plan, None, goal) as running:
        running._process.kill()
        goal.caught_up().result(timeout=60)
        assert not goal.reached()
    assert "the run takes all its views" in caplog.text


def test_a_plan_for_an_arm_nobody_knows_is_refused_before_anything_starts(tmp_path: Path) -> None:
    path = strided_plan(tmp_path)
    cell = path.with_name("ur3-robotiq.cell.yaml")
    cell.write_text(cell.read_text().replace("model: ur3,", "model: ur99,"))
    with pytest.raises(InputError, match="ur99 is not known"):
        RunningEstimate(read_plan(path), None, None)
