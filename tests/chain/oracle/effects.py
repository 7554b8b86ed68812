"""What each effect of the catalogue does, by other formulas: one function for each label.

A new effect needs one here. Signs (backlash, focus hysteresis), steps (slips) and bounds (spline
ends) have no derivative where they jump; all of them are decided by the log or by the distance,
so a frame away from the jump has all derivatives by the numbers that are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import autograd
import autograd.numpy as anp
import numpy as np

from calib.chain.kinematics import arm
from tests.chain.cells import ARM
from tests.chain.oracle import formulas
from tests.chain.oracle.formulas import Array
from tests.chain.oracle.scene import Oracle, Scene

Numbers = Mapping[str, Array]
ORACLES: dict[str, Oracle] = {}
STANDARD_GRAVITY = 9.80665


def _of(label: str) -> Callable[[Oracle], Oracle]:
    def put(oracle: Oracle) -> Oracle:
        ORACLES[label] = oracle
        return oracle

    return put


def _six(p: Numbers) -> Array:
    return anp.stack([p[k] for k in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")])


def _each_joint(p: Numbers, stem: str) -> Array:
    return anp.stack([p[f"{stem}_{joint}"] for joint in range(1, 7)])


def _scale_focal(scene: Scene, growth: Array) -> None:
    for name in ("alpha_px", "beta_px"):
        scene.optics[name] = scene.optics[name] * growth


def _add(scene: Scene, name: str, amount: Array) -> None:
    scene.optics[name] = scene.optics[name] + amount


def _warmth(p: Numbers, scene: Scene) -> Array:
    return 1.0 - anp.exp((p["start_s"] - scene.logged("t_s")) / p["tau_s"])


@_of("pose_time_lag")
def _(p: Numbers, scene: Scene) -> None:
    scene.joints = scene.joints + p["lag_s"] * scene.speed


@_of("joint_zero_offset")
def _(p: Numbers, scene: Scene) -> None:
    theta = anp.reshape(_each_joint(p, "offset_rad"), (6, 1))
    scene.dh = scene.dh + theta * np.array([[1.0, 0.0, 0.0, 0.0, 0.0]])


@_of("joint_backlash")
def _(p: Numbers, scene: Scene) -> None:
    from_below = scene.logged_joints > scene.views.approach_joints_rad[scene.frame]
    scene.joints = scene.joints + _each_joint(p, "play_rad") * np.where(from_below, 1.0, -1.0)


@_of("joint_compliance")
def _(p: Numbers, scene: Scene) -> None:
    weight = autograd.grad(_potential_energy)(scene.logged_joints, scene)
    scene.joints = scene.joints - _each_joint(p, "rad_per_Nm") * weight


@_of("base_compliance")
def _(p: Numbers, scene: Scene) -> None:
    """The moment as what the weights' energy loses by a small tilt of the base."""
    lost = autograd.grad(lambda tilt: _potential_energy(scene.logged_joints, scene, tilt))
    about_x, about_y = -lost(np.zeros(2))
    turn = anp.stack(
        [p["rad_per_Nm"] * about_x, (p["rad_per_Nm"] + p["rad_per_Nm_y_more"]) * about_y]
    )
    tilt = formulas.rigid(anp.concatenate([np.zeros(3), turn, np.zeros(1)]))
    scene.base = anp.dot(tilt, scene.base)


@_of("base_drift")
def _(p: Numbers, scene: Scene) -> None:
    scene.base = anp.dot(formulas.rigid(_warmth(p, scene) * _six(p)), scene.base)


def _potential_energy(joints: Array, scene: Scene, tilt: Array | None = None) -> Array:
    """Of links and payload; its gradient by the joints is the holding torque."""
    base = (
        anp.eye(4)
        if tilt is None
        else formulas.rigid(anp.concatenate([np.zeros(3), tilt, np.zeros(1)]))
    )
    energy, frame, masses = 0.0, base, arm(ARM).masses
    for link in range(6):
        frame = anp.dot(frame, formulas.flange(joints[link : link + 1], scene.nominal_dh[[link]]))
        centre = anp.dot(frame[2, :3], masses.com_m[link]) + frame[2, 3]
        energy = energy + masses.mass_kg[link] * STANDARD_GRAVITY * centre
    return energy + (scene.views.payload_kg or 0.0) * STANDARD_GRAVITY * frame[2, 3]


@_of("joint_periodic_error")
def _(p: Numbers, scene: Scene) -> None:
    phase = p["cycles_per_turn"] * scene.logged_joints
    swing = _each_joint(p, "sin_rad") * np.sin(phase) + _each_joint(p, "cos_rad") * np.cos(phase)
    scene.joints = scene.joints + swing


@_of("link_geometry")
def _(p: Numbers, scene: Scene) -> None:
    for name, value in p.items():
        column = {"d": 1, "a": 2, "t": 3}[name[0]]
        joint = next(int(letter) for letter in name if letter.isdigit())
        scene.dh = scene.dh + value * np.outer(np.eye(6)[joint - 1], np.eye(5)[column])


@_of("mount_flex")
def _(p: Numbers, scene: Scene) -> None:
    down = scene.down_in(scene.flange)
    lever = [p["rad_per_g_lever_x"], p["rad_per_g_lever_y"], p["rad_per_g"]]
    bend = anp.dot(formulas.cross_matrix(lever), down) + p["rad_per_g_turn"] * down
    turn = formulas.rigid(anp.concatenate([anp.zeros(3), bend]))
    scene.mounted = anp.dot(turn, scene.mounted)


@_of("mount_slip")
def _(p: Numbers, scene: Scene) -> None:
    if scene.logged("frame") >= p["at_frame"]:
        scene.mounted = anp.dot(scene.mounted, formulas.rigid(_six(p)))


@_of("thermal_mount_drift")
def _(p: Numbers, scene: Scene) -> None:
    scene.mounted = anp.dot(scene.mounted, formulas.rigid(_warmth(p, scene) * _six(p)))


@_of("thermal_mount_drift:temperature")
def _(p: Numbers, scene: Scene) -> None:
    warmer = scene.logged("temperature_c") - p["at_temperature_c"]
    growth = warmer * anp.stack([p[f"{axis}_m_per_K"] for axis in "xyz"])
    scene.mounted = anp.dot(formulas.rigid(anp.concatenate([growth, np.zeros(3)])), scene.mounted)


@_of("mount_play")
def _(p: Numbers, scene: Scene) -> None:
    down = scene.down_in(scene.flange)
    turned = anp.arctan2(down[1], down[0]) - p["towards_rad"]
    beyond = (0.5 * np.pi - anp.abs(anp.arctan2(anp.sin(turned), anp.cos(turned)))) / p[
        "unseen_rad"
    ]
    stop = formulas.rigid(anp.clip(beyond, -1.0, 1.0) * _six(p))
    scene.mounted = anp.dot(scene.mounted, stop)


@_of("board_slip")
def _(p: Numbers, scene: Scene) -> None:
    if scene.logged("frame") >= p["at_frame"]:
        scene.fixed = anp.dot(scene.fixed, formulas.rigid(_six(p)))


@_of("thermal_board_growth")
def _(p: Numbers, scene: Scene) -> None:
    """The board as large as it was, nearer along the ray to its middle."""
    pose = scene.pose()
    middle = anp.dot(pose[:3, :3], anp.mean(scene.points, axis=0)) + pose[:3, 3]
    nearer = middle * (1.0 / (1.0 + p["relative"] * _warmth(p, scene)) - 1.0)
    moved = anp.dot(formulas.rigid(anp.concatenate([nearer, np.zeros(3)])), pose)
    if scene.views.mount == "eye_in_hand":
        scene.fixed = anp.dot(scene.camera, moved)
    else:
        scene.mounted = anp.dot(anp.linalg.inv(scene.flange), anp.dot(scene.fixed, moved))


@_of("board_scale")
def _(p: Numbers, scene: Scene) -> None:
    scene.points = scene.points + p["relative"] * scene.points


@_of("board_shear")
def _(p: Numbers, scene: Scene) -> None:
    one = p["shear"] * 0.0 + 1.0
    affine = anp.array(
        [[one, 0.0 * one, 0.0 * one], [p["shear"], one + p["aspect"], 0.0 * one], [0.0, 0.0, 1.0]]
    )
    scene.points = anp.dot(scene.points, affine)


@_of("board_warp")
def _(p: Numbers, scene: Scene) -> None:
    board = scene.views.board
    half = 0.5 * board.square_m * np.array([board.cols - 1, board.rows - 1])
    x, y = anp.transpose(scene.points[:, :2] / half - 1.0)
    bend = p["bend_x_m"] * (x + 1.0) * (x - 1.0) + p["bend_y_m"] * (y + 1.0) * (y - 1.0)
    height = bend + p["twist_m"] * x * y
    scene.points = scene.points + anp.outer(height, np.array([0.0, 0.0, 1.0]))


@_of("board_warp:free")
def _(p: Numbers, scene: Scene) -> None:
    board = scene.views.board
    size = board.square_m * np.array([board.cols - 1, board.rows - 1])
    x, y = anp.transpose(np.pi * scene.points[:, :2] / size)
    height = 0.0 * x
    for name, amount in p.items():
        _, i, j, _ = name.split("_")
        height = height + amount * anp.cos(int(i) * x) * anp.cos(int(j) * y)
    scene.points = scene.points + anp.outer(height, np.array([0.0, 0.0, 1.0]))


@_of("focus_breathing:inverse_square")
def _(p: Numbers, scene: Scene) -> None:
    _scale_focal(scene, 1.0 - p["k_px_m2"] / (scene.focused**2 * scene.optics["alpha_px"]))


@_of("focus_breathing:thin_lens")
def _(p: Numbers, scene: Scene) -> None:
    _scale_focal(scene, 1.0 / (1.0 - p["f_m"] / scene.focused))


@_of("focus_breathing:free")
def _(p: Numbers, scene: Scene) -> None:
    near, far = 1.0 / p["near_m"], 1.0 / p["far_m"]
    height = anp.stack([*(p[f"node_{k}"] for k in range(1, 6)), 0.0 * near])
    at = (near - 1.0 / scene.focused) / (near - far)
    _scale_focal(scene, 1.0 + _natural_spline(height, at))


def _natural_spline(height: Array, at: Array) -> Array:
    """Through equidistant heights from 0 to 1, by its second derivatives; straight beyond."""
    count = len(height) - 1
    h = 1.0 / count
    rows = np.eye(count + 1)
    for k in range(1, count):
        rows[k, k - 1 : k + 2] = np.array([1.0, 4.0, 1.0]) * h / 6.0
    second = np.zeros((count + 1, count + 1))
    for k in range(1, count):
        second[k, k - 1 : k + 2] = np.array([1.0, -2.0, 1.0]) / h
    bend = anp.dot(np.linalg.solve(rows, second), height)
    if bool(at < 0.0):
        slope = (height[1] - height[0]) / h - h * (2.0 * bend[0] + bend[1]) / 6.0
        return height[0] + slope * at
    if bool(at > 1.0):
        slope = (height[-1] - height[-2]) / h + h * (bend[-2] + 2.0 * bend[-1]) / 6.0
        return height[-1] + slope * (at - 1.0)
    k = sum(bool(at > node * h) for node in range(1, count))
    left, right = (k + 1) - at / h, at / h - k
    straight = left * height[k] + right * height[k + 1]
    return straight + h * h / 6.0 * ((left**3 - left) * bend[k] + (right**3 - right) * bend[k + 1])


@_of("focus_hysteresis")
def _(p: Numbers, scene: Scene) -> None:
    _scale_focal(scene, 1.0 + p["relative"] * _side(p, scene))


def _side(p: Numbers, scene: Scene) -> float:
    """Plus one where the lens came from nearer, minus one where from farther."""
    if scene.logged("frame") == p["first_frame"]:
        before = p["first_came_from_m"]
    elif scene.views.mount == "eye_in_hand":
        approach = formulas.flange(scene.views.approach_joints_rad[scene.frame], scene.nominal_dh)
        before = scene.depth(scene.pose(approach))
    else:
        before = scene.focused_before()
    return float(np.sign(formulas.plain(scene.focused) - formulas.plain(before)))


@_of("thermal_focal_drift")
def _(p: Numbers, scene: Scene) -> None:
    _scale_focal(scene, 1.0 + p["relative"] * _warmth(p, scene))


@_of("optics_step")
def _(p: Numbers, scene: Scene) -> None:
    if scene.logged("frame") >= p["at_frame"]:
        _scale_focal(scene, 1.0 + p["relative"])
        _add(scene, "u0_px", p["u_px"])
        _add(scene, "v0_px", p["v_px"])


@_of("decentering")
def _(p: Numbers, scene: Scene) -> None:
    _add(scene, "p1", p["p1"])
    _add(scene, "p2", p["p2"])


@_of("higher_order_radial")
def _(p: Numbers, scene: Scene) -> None:
    _add(scene, "k3", p["k3"])


@_of("distance_dependent_distortion")
def _(p: Numbers, scene: Scene) -> None:
    _add(scene, "k1", p["slope_m"] / scene.focused)


@_of("entrance_pupil_shift")
def _(p: Numbers, scene: Scene) -> None:
    _add(scene, "pupil_m_rad2", p["pupil_m_rad2"])


@_of("protective_window")
def _(p: Numbers, scene: Scene) -> None:
    _add(scene, "window_m", p["thickness_m"])


@_of("lens_sag")
def _(p: Numbers, scene: Scene) -> None:
    down = scene.down_in(scene.camera)
    _add(scene, "u0_px", p["px_per_g"] * down[0])
    _add(scene, "v0_px", p["px_per_g"] * down[1])


@_of("thermal_image_drift")
def _(p: Numbers, scene: Scene) -> None:
    for axis in "uv":
        _add(scene, f"{axis}0_px", p[f"{axis}_px"] * _warmth(p, scene))


@_of("thermal_focal_drift:temperature")
def _(p: Numbers, scene: Scene) -> None:
    warmer = scene.logged("temperature_c") - p["at_temperature_c"]
    _scale_focal(scene, 1.0 + p["relative_per_K"] * warmer)


@_of("sensor_tilt")
def _(p: Numbers, scene: Scene) -> None:
    _add(scene, "tilt_x_rad", p["tilt_x_rad"])
    _add(scene, "tilt_y_rad", p["tilt_y_rad"])


@_of("exposure_bias")
def _(p: Numbers, scene: Scene) -> None:
    middle = anp.mean(scene.points, axis=0)
    pose, sidewards = scene.pose(), scene.points - middle
    farthest_m = anp.sqrt(anp.max(anp.sum(sidewards**2, axis=1)))
    farthest_px = scene.optics["alpha_px"] * farthest_m / scene.depth(pose)
    brighter = p["px_per_s"] * (scene.logged("exposure_s") - p["at_exposure_s"])
    gain_db = scene.views.extra["gain_db"][scene.frame]
    share = (brighter + p["px_per_dB"] * (gain_db - p["at_gain_dB"])) / farthest_px
    centre = formulas.swept_pixel(scene.optics, formulas.camera_coordinates(pose, middle))
    scene.found_at = lambda pixels: pixels + share * (pixels - centre)


@_of("rolling_shutter")
def _(p: Numbers, scene: Scene) -> None:
    speed = scene.board_speed()
    for k, name in enumerate(formulas.SWEEP):
        _add(scene, name, p["readout_s"] * speed[k])
    scene.optics["height_px"] = scene.views.height_px
    scene.optics["pose_row"] = p["pose_at_row"] - 0.5
