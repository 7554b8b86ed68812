"""From a corner in the board's frame to a pixel, with derivatives.

The one projection of the project: simulator, baseline fits, joint fit and discovery all call it.
Equation 1 of the paper with Brown's distortion (Brown 1966; the rational, thin-prism and tilted
forms as in OpenCV's `calib3d` documentation), an entrance pupil that moves with the field angle,
a plane-parallel window, and a rolling shutter. A pose is perturbed on the camera's side:
`camera_from_board <- (1 + increment) camera_from_board`, increment = (metres, radians).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from calib.chain.optics import COLUMN, OPTICS, WINDOW_INDEX
from calib.views import FloatArray

K = len(OPTICS)
NOTHING, BROWN, EVERYTHING = 0, 1, 2
"""Which derivatives a corner's walk gives: none; by the pose and the columns up to the thin prism;
by every column. The rare ones (tilt, pupil, window, sweep) cost more than all others together."""

FIRST_RARE, LAST_RARE = COLUMN["tilt_x_rad"], COLUMN["sweep_rz_rad"]
FIRST_SWEEP, HEIGHT, POSE_ROW = COLUMN["sweep_x_m"], COLUMN["height_px"], COLUMN["pose_row"]
ROW_STEPS, ROW_SETTLED_PX = 40, 1e-11
"""A board that moves by a tenth of the picture while it is read needs about a dozen steps."""

UNIT = np.eye(4)
N2 = WINDOW_INDEX * WINDOW_INDEX


@njit(cache=True, error_model="numpy")
def _axial_shift(o, x, y, z, out, derive):  # type: ignore[no-untyped-def]
    """Depth seen by the pinhole, and its derivatives by x, y, z, pupil and window into `out`."""
    rho2 = x * x + y * y
    out[:] = 0.0
    out[2] = 1.0
    if o[19] == 0.0 and o[20] == 0.0:
        if derive != EVERYTHING:
            return z
        rho2_z2 = rho2 + z * z
        cos = z / math.sqrt(rho2_z2)
        theta = math.atan2(math.sqrt(rho2), z)
        out[3] = theta * theta
        out[4] = -(1.0 - cos / math.sqrt(N2 - 1.0 + cos * cos))
        return z
    rho = math.sqrt(rho2)
    theta = math.atan2(rho, z)
    d2 = rho2 + z * z
    cos = z / math.sqrt(d2)
    root = math.sqrt(N2 - 1.0 + cos * cos)
    shift = o[19] * theta * theta - o[20] * (1.0 - cos / root)
    # d(theta) = (z drho - rho dz)/d2 ; d(cos/root)/dcos = (N2 - 1)/root^3
    slope = 2.0 * o[19] * theta - o[20] * (N2 - 1.0) / root**3 * math.sin(theta)
    if rho > 0.0:
        out[0] = slope * z / d2 * x / rho
        out[1] = slope * z / d2 * y / rho
    out[2] = 1.0 - slope * rho / d2
    out[3] = theta * theta
    out[4] = -(1.0 - cos / root)
    return z + shift


@njit(cache=True, error_model="numpy")
def _tilt_of(o, tilt):  # type: ignore[no-untyped-def]
    """Cosines and sines of a frame's sensor tilt into `tilt[0:4]`."""
    tilt[0], tilt[1] = math.cos(o[17]), math.sin(o[17])
    tilt[2], tilt[3] = math.cos(o[18]), math.sin(o[18])


@njit(cache=True, error_model="numpy")
def _tilted(tilt, xd, yd, j):  # type: ignore[no-untyped-def]
    """Point on the tilted sensor; its 2x2 derivative by (xd, yd) into `j[0:4]`.

    OpenCV's tilted-sensor homography, multiplied out.
    """
    cx, sx, cy, sy = tilt[0], tilt[1], tilt[2], tilt[3]
    w = sy * xd - cy * sx * yd + cy * cx
    a = cx * xd / w
    b = (cy * yd - sx * sy * xd) / w
    j[0] = (cx - a * sy) / w
    j[1] = a * cy * sx / w
    j[2] = -(sx * sy + b * sy) / w
    j[3] = (cy + b * cy * sx) / w
    return a, b


# One straight run of assignments: split, numba would pass every intermediate through arrays.
@njit(cache=True, error_model="numpy")
def _corner(o, tilt, pose, px, py, pz, uv, j_pose, j_optics, shift, jt, derive):  # type: ignore[no-untyped-def]  # noqa: PLR0915
    """One corner of a board at rest: pixel into `uv`; Jacobians by `derive` into (2, 6), (2, K).

    `tilt` is the frame's, from `_tilt_of`. The rare columns' derivatives need `EVERYTHING`.
    """
    x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
    y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
    z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
    zs = _axial_shift(o, x, y, z, shift, derive)
    a = x / zs
    b = y / zs
    r2 = a * a + b * b
    r4 = r2 * r2
    r6 = r4 * r2
    num = 1.0 + o[5] * r2 + o[6] * r4 + o[9] * r6
    den = 1.0 + o[10] * r2 + o[11] * r4 + o[12] * r6
    rad = num / den
    xd = a * rad + 2.0 * o[7] * a * b + o[8] * (r2 + 2.0 * a * a) + o[13] * r2 + o[14] * r4
    yd = b * rad + o[7] * (r2 + 2.0 * b * b) + 2.0 * o[8] * a * b + o[15] * r2 + o[16] * r4
    tilted = o[17] != 0.0 or o[18] != 0.0
    xt, yt = xd, yd
    jt[0], jt[1], jt[2], jt[3] = 1.0, 0.0, 0.0, 1.0
    if tilted:
        xt, yt = _tilted(tilt, xd, yd, jt)
    uv[0] = o[0] * xt + o[2] * yt + o[3]
    uv[1] = o[1] * yt + o[4]
    if derive == NOTHING:
        return
    # pixel by (xd, yd)
    ux = o[0] * jt[0] + o[2] * jt[2]
    uy = o[0] * jt[1] + o[2] * jt[3]
    vx = o[1] * jt[2]
    vy = o[1] * jt[3]
    # (xd, yd) by (a, b)
    num_r = o[5] + 2.0 * o[6] * r2 + 3.0 * o[9] * r4
    den_r = o[10] + 2.0 * o[11] * r2 + 3.0 * o[12] * r4
    rad_r = (num_r - rad * den_r) / den
    prism_x = o[13] + 2.0 * o[14] * r2
    prism_y = o[15] + 2.0 * o[16] * r2
    xa = rad + 2.0 * a * a * rad_r + 2.0 * o[7] * b + 6.0 * o[8] * a + 2.0 * a * prism_x
    xb = 2.0 * a * b * rad_r + 2.0 * o[7] * a + 2.0 * o[8] * b + 2.0 * b * prism_x
    ya = 2.0 * a * b * rad_r + 2.0 * o[7] * a + 2.0 * o[8] * b + 2.0 * a * prism_y
    yb = rad + 2.0 * b * b * rad_r + 6.0 * o[7] * b + 2.0 * o[8] * a + 2.0 * b * prism_y
    ua = ux * xa + uy * ya
    ub = ux * xb + uy * yb
    va = vx * xa + vy * ya
    vb = vx * xb + vy * yb
    # (a, b) by zs is -(a, b)/zs
    us = -(ua * a + ub * b) / zs
    vs = -(va * a + vb * b) / zs
    u_x = ua / zs + us * shift[0]
    u_y = ub / zs + us * shift[1]
    u_z = us * shift[2]
    v_x = va / zs + vs * shift[0]
    v_y = vb / zs + vs * shift[1]
    v_z = vs * shift[2]
    j_pose[0, 0], j_pose[0, 1], j_pose[0, 2] = u_x, u_y, u_z
    j_pose[1, 0], j_pose[1, 1], j_pose[1, 2] = v_x, v_y, v_z
    j_pose[0, 3] = -u_y * z + u_z * y
    j_pose[0, 4] = u_x * z - u_z * x
    j_pose[0, 5] = -u_x * y + u_y * x
    j_pose[1, 3] = -v_y * z + v_z * y
    j_pose[1, 4] = v_x * z - v_z * x
    j_pose[1, 5] = -v_x * y + v_y * x
    j_optics[:, :] = 0.0
    j_optics[0, 0] = xt
    j_optics[1, 1] = yt
    j_optics[0, 2] = yt
    j_optics[0, 3] = 1.0
    j_optics[1, 4] = 1.0
    for column, dx, dy in (
        (5, a * r2 / den, b * r2 / den),
        (6, a * r4 / den, b * r4 / den),
        (7, 2.0 * a * b, r2 + 2.0 * b * b),
        (8, r2 + 2.0 * a * a, 2.0 * a * b),
        (9, a * r6 / den, b * r6 / den),
        (10, -a * rad * r2 / den, -b * rad * r2 / den),
        (11, -a * rad * r4 / den, -b * rad * r4 / den),
        (12, -a * rad * r6 / den, -b * rad * r6 / den),
        (13, r2, 0.0),
        (14, r4, 0.0),
        (15, 0.0, r2),
        (16, 0.0, r4),
    ):
        j_optics[0, column] = ux * dx + uy * dy
        j_optics[1, column] = vx * dx + vy * dy
    if derive != EVERYTHING:
        return
    _tilt_derivative(o, tilt, xd, yd, xt, yt, j_optics)
    j_optics[0, 19] = us * shift[3]
    j_optics[1, 19] = vs * shift[3]
    j_optics[0, 20] = us * shift[4]
    j_optics[1, 20] = vs * shift[4]
    late = uv[1] / o[HEIGHT] - 0.5 - o[POSE_ROW]
    for k in range(6):
        j_optics[0, FIRST_SWEEP + k] = j_pose[0, k] * late
        j_optics[1, FIRST_SWEEP + k] = j_pose[1, k] * late


@njit(cache=True, error_model="numpy")
def _tilt_derivative(o, tilt, xd, yd, xt, yt, j_optics):  # type: ignore[no-untyped-def]
    cx, sx, cy, sy = tilt[0], tilt[1], tilt[2], tilt[3]
    w = sy * xd - cy * sx * yd + cy * cx
    by_x = -(cy * cx * yd + cy * sx)
    dx = -(sx * xd + xt * by_x) / w
    dy = -(cx * sy * xd + yt * by_x) / w
    j_optics[0, 17] = o[0] * dx + o[2] * dy
    j_optics[1, 17] = o[1] * dy
    by_y = cy * xd + sy * sx * yd - sy * cx
    dx = -xt * by_y / w
    dy = -(sy * yd + sx * cy * xd + yt * by_y) / w
    j_optics[0, 18] = o[0] * dx + o[2] * dy
    j_optics[1, 18] = o[1] * dy


@njit(cache=True, error_model="numpy")
def _swept(o, tilt, pose, px, py, pz, uv, j_pose, j_optics, shift, jt, derive):  # type: ignore[no-untyped-def]
    """`_corner` of a board that moves on: the corner as it is when its own row is read.

    `uv` holds where it is seen at rest. The row is found by stepping to where the corner is when
    the row before is read; the derivatives are those of the implicit equation. Within a frame the
    corner goes straight on.
    """
    x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
    y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
    z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
    tx, ty, tz, rx, ry, rz = o[21], o[22], o[23], o[24], o[25], o[26]
    mx, my, mz = tx + ry * z - rz * y, ty + rz * x - rx * z, tz + rx * y - ry * x
    late = 0.0
    for _ in range(ROW_STEPS):
        row = uv[1]
        late = row / o[HEIGHT] - 0.5 - o[POSE_ROW]
        xs, ys, zs = x + late * mx, y + late * my, z + late * mz
        _corner(o, tilt, UNIT, xs, ys, zs, uv, j_pose, j_optics, shift, jt, NOTHING)
        if abs(uv[1] - row) < ROW_SETTLED_PX:
            break
    if derive == NOTHING:
        return
    _corner(o, tilt, UNIT, xs, ys, zs, uv, j_pose, j_optics, shift, jt, derive)
    by_row = np.empty(2)
    for i in range(2):
        gx, gy, gz = j_pose[i, 0], j_pose[i, 1], j_pose[i, 2]
        by_row[i] = (gx * mx + gy * my + gz * mz) / o[HEIGHT]
        qx = gx + late * (gy * rz - gz * ry)
        qy = gy + late * (gz * rx - gx * rz)
        qz = gz + late * (gx * ry - gy * rx)
        j_pose[i, 0], j_pose[i, 1], j_pose[i, 2] = qx, qy, qz
        j_pose[i, 3], j_pose[i, 4], j_pose[i, 5] = y * qz - z * qy, z * qx - x * qz, x * qy - y * qx
        j_optics[i, 21], j_optics[i, 22], j_optics[i, 23] = late * gx, late * gy, late * gz
        j_optics[i, 24] = late * (y * gz - z * gy)
        j_optics[i, 25] = late * (z * gx - x * gz)
        j_optics[i, 26] = late * (x * gy - y * gx)
    # a corner seen lower is read later, and has moved on by then
    for j in (j_pose, j_optics):
        j[1] /= 1.0 - by_row[1]
        j[0] += by_row[0] * j[1]


@njit(cache=True, error_model="numpy")
def _has_sweep(o):  # type: ignore[no-untyped-def]
    """Whether the board moves while this frame's rows are read."""
    return np.any(o[FIRST_SWEEP : LAST_RARE + 1] != 0.0)


@njit(cache=True, error_model="numpy")
def _has_rare(o):  # type: ignore[no-untyped-def]
    """Whether a rare column is not zero in this frame."""
    return np.any(o[FIRST_RARE : LAST_RARE + 1] != 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _project_all(optics, poses, points, uv, j_pose, j_optics, derive):  # type: ignore[no-untyped-def]
    shift = np.zeros(5)
    tilt = np.zeros(4)
    jt = np.zeros(4)
    jp = np.zeros((2, 6))
    jo = np.zeros((2, K))
    for i in range(poses.shape[0]):
        o = optics[i]
        _tilt_of(o, tilt)
        need = EVERYTHING if derive else NOTHING
        sweeps = _has_sweep(o)
        for j in range(points.shape[0]):
            p = points[j]
            _corner(o, tilt, poses[i], p[0], p[1], p[2], uv[i, j], jp, jo, shift, jt, need)
            if sweeps:
                _swept(o, tilt, poses[i], p[0], p[1], p[2], uv[i, j], jp, jo, shift, jt, need)
            if derive:
                j_pose[i, j] = jp
                j_optics[i, j] = jo


def project(optics: FloatArray, camera_from_board: FloatArray, points_m: FloatArray) -> FloatArray:
    """Project M points in N frames.

    Parameters
    ----------
    optics:
        (N, K) columns of `OPTICS`.
    camera_from_board:
        (N, 4, 4).
    points_m:
        (M, 3) in the board's frame, metres.

    Returns
    -------
    (N, M, 2) pixels, (0, 0) at the centre of the top-left pixel.
    """
    n, m = len(camera_from_board), len(points_m)
    uv = np.empty((n, m, 2))
    none_pose, none_optics = np.empty((0, 0, 2, 6)), np.empty((0, 0, 2, K))
    _project_all(
        np.ascontiguousarray(optics),
        np.ascontiguousarray(camera_from_board),
        np.ascontiguousarray(points_m),
        uv,
        none_pose,
        none_optics,
        False,
    )
    return uv


def project_with_jacobians(
    optics: FloatArray, camera_from_board: FloatArray, points_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`project` with its derivatives.

    Returns
    -------
    (N, M, 2) pixels; (N, M, 2, 6) by the pose's increment on the camera's side (metres, then
    radians); (N, M, 2, K) by the optics. The derivative by a point in the board's frame is
    `j_pose[..., :3] @ R` with R the rotation of `camera_from_board`.
    """
    n, m = len(camera_from_board), len(points_m)
    uv = np.empty((n, m, 2))
    j_pose = np.empty((n, m, 2, 6))
    j_optics = np.empty((n, m, 2, K))
    _project_all(
        np.ascontiguousarray(optics),
        np.ascontiguousarray(camera_from_board),
        np.ascontiguousarray(points_m),
        uv,
        j_pose,
        j_optics,
        True,
    )
    return uv, j_pose, j_optics
