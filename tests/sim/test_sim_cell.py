"""Arm and camera together: what the camera shows, logs, and refuses."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.model import evaluate
from calib.chain.optics import COLUMN
from drivers.arm import Motion, MoveTarget
from drivers.camera import FocusSetting
from drivers.errors import DeviceRefused, DeviceUnreachable, FrameMissing
from sim.arm import SETTLE_S, Repeatability
from sim.build import build
from sim.camera import optics_focused_at
from sim.clock import SimClock
from sim.log import Row, tour, views_of
from sim.presets import irb140_eosens, ur3_robotiq
from sim.synthesize import synthesize, true_corners

AUTO = FocusSetting("auto")


def ready(cell):
    clock = SimClock()
    arm, camera = build(cell, clock)
    arm.connect()
    camera.connect()
    return arm, camera, clock


def go(arm, clock, joints):
    arm.start_move(MoveTarget(joints_rad=tuple(joints), tcp_speed_m_s=0.25, joint_speed_rad_s=1))
    while arm.state().motion is Motion.MOVING:
        clock.sleep(0.05)


def small(cell, **camera):
    return replace(cell, camera=replace(cell.camera, **camera))


def straight_on(cell, distance_m, turn_rad=0.0):
    """Joints that put the camera in front of the board's middle, nearest to home."""
    middle = cell.board.corners_m.mean(axis=0)
    seen = rigid.compose(np.array([[0.0, 0.0, turn_rad]]), np.zeros((1, 3)))[0]
    seen[:3, 3] = [0, 0, distance_m] - seen[:3, :3] @ middle
    model = cell.model
    pose = model.base_from_fixed @ rigid.inverse(seen) @ rigid.inverse(model.flange_from_mounted)
    return cell.kinematics.inverse(pose, cell.home_rad)


def test_the_picture_shows_the_board_where_the_chain_puts_it():
    cell = ur3_robotiq()
    arm, camera, clock = ready(cell)
    go(arm, clock, straight_on(cell, 0.45, 0.1))
    camera.focus(AUTO)
    frame = camera.grab(1.0)
    assert frame.image.shape == (724, 1279)
    assert frame.image.dtype == np.uint8
    found, corners = cv2.findChessboardCornersSB(frame.image, (10, 7), flags=cv2.CALIB_CB_ACCURACY)
    assert found
    truth = arm.truth()
    views = views_of(cell, [Row(0.0, truth.joints_rad, np.zeros(6), truth.joints_rad, 0.01)])
    expected = true_corners(cell, views)[0]
    # OpenCV may count from the other end; which end is which the colours decide, not it
    corners = corners.reshape(-1, 2)
    misfit = min(np.abs(corners - expected).max(), np.abs(corners[::-1] - expected).max())
    # 0.03 mm of repeatability at 0.45 m is 0.1 px
    assert misfit < 0.6


def test_the_scatter_of_the_arm_is_in_the_picture_and_not_in_the_report():
    cell = replace(ur3_robotiq(), repeatability=Repeatability(2e-3, 0.0), seed=4)
    arm, camera, clock = ready(cell)
    pictures = []
    for _ in range(2):
        go(arm, clock, straight_on(cell, 0.5))
        pictures.append(camera.grab(1.0).image.astype(float))
        reported = arm.state().joints_rad
        go(arm, clock, cell.home_rad)
    np.testing.assert_allclose(reported, straight_on(cell, 0.5), atol=1e-12)
    assert np.abs(pictures[0] - pictures[1]).max() > 60


def test_a_run_repeats_to_the_last_bit_and_another_seed_does_not():
    def picture(seed):
        arm, camera, clock = ready(ur3_robotiq(seed))
        go(arm, clock, straight_on(ur3_robotiq(), 0.5))
        camera.focus(AUTO)
        return camera.grab(1.0).image

    first = picture(3)
    assert (picture(3) == first).all()
    assert (picture(4) != first).any()


def test_autofocus_follows_the_board_and_is_logged():
    cell = ur3_robotiq()
    arm, camera, clock = ready(cell)
    positions = []
    for distance in (0.36, 0.45, 0.55):
        go(arm, clock, straight_on(cell, distance))
        positions.append(camera.focus(AUTO))
        frame = camera.grab(1.0)
        assert frame.focus_position == positions[-1]
        assert frame.focus_distance_m == pytest.approx(distance, abs=1e-3)
    assert positions == sorted(positions)
    assert len(set(positions)) == 3


def sharpness(image):
    return cv2.Laplacian(image, cv2.CV_64F).var()


def test_defocus_shows_and_a_focus_step_means_a_distance():
    quiet = replace(ur3_robotiq().camera.sensor, full_well_e=None, read_noise_levels=0.0)
    cell = small(ur3_robotiq(), f_number=0.8, sensor=quiet)
    arm, camera, clock = ready(cell)
    go(arm, clock, straight_on(cell, 0.45))
    sharp_at = camera.focus(AUTO)
    sharp = sharpness(camera.grab(1.0).image)
    camera.focus(FocusSetting("position", 0.8 * sharp_at))
    blurred = camera.grab(1.0)
    assert sharpness(blurred.image) < 0.5 * sharp
    assert blurred.focus_distance_m < 0.3
    camera.focus(FocusSetting("position", sharp_at))
    assert sharpness(camera.grab(1.0).image) > 0.9 * sharp


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_a_held_focus_keeps_its_focal_length(mount):
    cell = ur3_robotiq()
    q = straight_on(cell, 0.5)
    if mount == "eye_to_hand":
        flange, model = cell.kinematics.forward(q), cell.model
        swapped = replace(
            model,
            flange_from_mounted=rigid.inverse(flange) @ model.base_from_fixed,
            base_from_fixed=flange @ model.flange_from_mounted,
        )
        cell = replace(cell, model=swapped, mount=mount)
    views = views_of(cell, [Row(0.0, q, np.zeros(6), q, 0.01)])
    state = evaluate(cell.model, views)
    alpha = optics_focused_at(cell.model, views, state, 0.2)[COLUMN["alpha_px"]]
    k = cell.model.effects[0].values[0]
    assert alpha == pytest.approx(1370.8 - k / 0.2**2, abs=1e-6)


def test_exposure_and_gain_are_set_and_bounded():
    _, camera, _ = ready(ur3_robotiq())
    before = camera.grab(1.0).image.mean()
    had = camera.configure(exposure_s=0.005, gain_db=2.0)
    assert had == {"exposure_s": 0.005, "gain_db": 2.0}
    frame = camera.grab(1.0)
    assert frame.image.mean() == pytest.approx(before * 0.005 / 0.0096 * 10 ** (2.0 / 20), rel=0.02)
    assert (frame.exposure_s, frame.gain_db) == (0.005, 2.0)
    with pytest.raises(DeviceRefused, match="exposure_s"):
        camera.configure(exposure_s=5.0)
    with pytest.raises(DeviceRefused, match="gain_db"):
        camera.configure(gain_db=-3.0)


def test_frames_carry_the_time_of_the_middle_of_their_exposure():
    _, camera, clock = ready(ur3_robotiq())
    camera.configure(exposure_s=0.4)
    clock.sleep(7.0)
    started = clock.now()
    frame = camera.grab(1.0)
    assert frame.host_t_s == pytest.approx(started + 0.2)
    assert frame.device_t_s == pytest.approx(7.2)
    assert clock.now() > frame.host_t_s + 0.2


@pytest.mark.parametrize("focus", ["manual", "fixed"])
def test_a_lens_without_a_drive_refuses_to_focus(focus):
    cell = small(ur3_robotiq(), focus=focus)
    _, camera, _ = ready(cell)
    assert camera.focus(FocusSetting("hold")) is None
    with pytest.raises(DeviceRefused, match=focus):
        camera.focus(AUTO)


def test_focus_steps_outside_the_drive_are_refused():
    _, camera, _ = ready(ur3_robotiq())
    with pytest.raises(DeviceRefused, match="focus position"):
        camera.focus(FocusSetting("position", 5000))


def test_lost_frames_and_a_dead_camera():
    _, camera, _ = ready(ur3_robotiq())
    camera.faults.lose_frames = 2
    for _ in range(2):
        with pytest.raises(FrameMissing):
            camera.grab(0.5)
    assert camera.grab(0.5).image.any()
    camera.faults.dead = True
    with pytest.raises(DeviceUnreachable):
        camera.grab(0.5)


def test_without_connecting_it_is_unreachable():
    _, camera = build(ur3_robotiq(), SimClock())
    with pytest.raises(DeviceUnreachable, match="connect"):
        camera.grab(1.0)


# -- corners without pictures ------------------------------------------------------------------


def rail(cell, distances, turn_rad=0.0):
    return np.array([straight_on(cell, d, turn_rad) for d in distances])


def test_a_tour_takes_the_time_that_the_arm_takes():
    cell = ur3_robotiq()
    joints = rail(cell, [0.4, 0.5, 0.45])
    views = tour(cell, joints, dwell_s=1.0, speed_m_s=0.25, joint_speed_rad_s=1)
    arm, _, clock = ready(cell)
    times = []
    for q in joints:
        arm.start_move(MoveTarget(joints_rad=tuple(q), tcp_speed_m_s=0.25, joint_speed_rad_s=1))
        while arm.state().motion is Motion.MOVING:
            clock.sleep(1e-3)
        clock.sleep(1.0)
        times.append(clock.now())
    np.testing.assert_allclose(views.t_s, times, atol=4e-3)
    assert views.t_s[0] > 1.0 + SETTLE_S
    np.testing.assert_array_equal(views.approach_joints_rad[1:], joints[:-1])


def test_corners_scatter_as_asked_and_only_so():
    cell = replace(irb140_eosens(), repeatability=Repeatability(), corner_sigma_px=0.2)
    views = tour(cell, rail(cell, [0.4, 0.5, 0.6, 0.7, 0.8]))
    made = synthesize(cell, views)
    misfit = made.corners_px - true_corners(cell, views)
    assert misfit.std() == pytest.approx(0.2, rel=0.1)
    np.testing.assert_array_equal(made.base_from_flange, views.base_from_flange)
    np.testing.assert_allclose(made.focus_distance_m, [0.4, 0.5, 0.6, 0.7, 0.8], atol=1e-3)


def test_the_arms_scatter_moves_whole_boards():
    cell = replace(irb140_eosens(), repeatability=Repeatability(1e-3, 0.0), corner_sigma_px=0.0)
    views = tour(cell, rail(cell, [0.6] * 6))
    misfit = synthesize(cell, views).corners_px - true_corners(cell, views)
    spread = misfit.mean(axis=1).std(axis=0)
    assert 3 < spread.min() < spread.max() < 20
    assert misfit.std(axis=1).max() < 2


def test_boards_that_are_cut_or_seen_from_behind_have_no_corners():
    cell = irb140_eosens()
    whole, turned = straight_on(cell, 0.5), straight_on(cell, 0.5)
    turned[0] += 0.35
    away = whole.copy()
    away[0] += np.pi
    made = synthesize(cell, tour(cell, np.array([whole, turned, away])))
    np.testing.assert_array_equal(made.seen.any(axis=1), [True, False, False])
    assert made.seen[0].all()


def test_charuco_corners_survive_one_by_one():
    cell = irb140_eosens()
    board = replace(cell.board, kind="charuco", marker_m=0.018, dictionary="DICT_5X5_100")
    cell = replace(cell, board=board)
    turned = straight_on(cell, 0.5)
    turned[0] += 0.12
    made = synthesize(cell, tour(cell, turned[None]))
    assert 0 < made.seen.sum() < made.seen.size


# -- the paper's cells -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cell", "distances"),
    [
        (irb140_eosens(), np.arange(0.35, 0.951, 0.05)),
        (ur3_robotiq(), np.arange(0.34, 0.561, 0.02)),
    ],
    ids=["irb140-eosens", "ur3-robotiq"],
)
def test_the_presets_reach_their_distances_and_see_the_board(cell, distances):
    assert cell.kinematics.within_limits(cell.home_rad)
    made = synthesize(cell, tour(cell, np.vstack([cell.home_rad, rail(cell, distances)])))
    assert made.seen.all()


def test_breathing_is_the_papers_law_at_its_nearest_view():
    cell = irb140_eosens()
    views = tour(cell, rail(cell, [0.35, 0.7]))
    state = evaluate(cell.model, views)
    alpha = state.optics[:, COLUMN["alpha_px"]]
    assert alpha[0] == pytest.approx(4289.8, abs=1.0)
    assert alpha[1] == pytest.approx(4755.8 * (1 - 0.0245), abs=0.5)


def zhang(cell, views):
    """Reprojection RMS, and camera positions in the board's frame minus the true ones."""
    points = [cell.board.corners_m.astype(np.float32)] * len(views)
    pixels = [frame.astype(np.float32) for frame in views.corners_px]
    rms, _, _, turns, shifts = cv2.calibrateCamera(
        points,
        pixels,
        (views.width_px, views.height_px),
        None,
        None,
        flags=cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    )
    seen = rigid.compose(np.array(turns)[:, :, 0], np.array(shifts)[:, :, 0])
    true = evaluate(cell.model, views).camera_from_board
    return rms, rigid.inverse(seen)[:, :3, 3] - rigid.inverse(true)[:, :3, 3]


def test_the_papers_finding_a_good_fit_and_cameras_in_the_wrong_place():
    cell = irb140_eosens()
    middle = np.array([*cell.board.corners_m.mean(axis=0), 1.0])
    joints = list(rail(cell, np.arange(0.36, 0.95, 0.05)))
    for distance, about in zip(
        np.linspace(0.45, 0.9, 16), np.linspace(0, 4 * np.pi, 16), strict=True
    ):
        tilt = 0.35 * np.array([[np.cos(about), np.sin(about), 0.0]])
        seen = rigid.compose(tilt, np.zeros((1, 3)))[0]
        seen[:3, 3] = [0, 0, distance] - seen[:3, :3] @ middle[:3]
        model = cell.model
        mounted = rigid.inverse(model.flange_from_mounted)
        pose = model.base_from_fixed @ rigid.inverse(seen) @ mounted
        joints.extend(cell.kinematics.inverse_all(pose, cell.home_rad)[:1])
    log = tour(cell, np.array(joints))

    breathing = synthesize(cell, log)
    breathing = breathing.take(breathing.seen.all(axis=1))
    assert len(breathing) > 20
    rms, error_m = zhang(cell, breathing)
    assert rms < 0.6
    assert np.abs(error_m).max() > 0.02
    assert error_m[:, 2].mean() > 0.005  # nearer to the board than they are, as in the paper

    rigid_lens = replace(cell, model=cell.model.with_effects(()))
    still = synthesize(rigid_lens, log)
    rms, error_m = zhang(rigid_lens, still.take(still.seen.all(axis=1)))
    assert rms < 0.08
    assert np.abs(error_m).max() < 0.001
