"""From a corner in the board's frame to a pixel, with derivatives.

The one projection of the project: simulator, baseline fits, joint fit and discovery all call it.
Equation 1 of the paper with Brown's distortion (Brown 1966; the rational, thin-prism and tilted
forms as in OpenCV's `calib3d` documentation), an entrance pupil that moves with the field angle,
a plane-parallel window, and a rolling shutter. The ideal image that is then distorted is a
perspective or an equidistant one (`calib.chain.ideal`); the latter with four radial terms is
Kannala and Brandt's camera (2006), OpenCV's `fisheye`. A pose is perturbed on the camera's side:
`camera_from_board <- (1 + increment) camera_from_board`, increment = (metres, radians).
Corners go through in blocks (`calib.chain.rows`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from calib.chain.ideal import equidistant, perspective
from calib.chain.optics import COLUMN, WINDOW_INDEX
from calib.chain.rows import (
    BLOCK,
    JAC,
    LANES,
    LATE,
    OPTIC,
    PX,
    PY,
    PZ,
    ROW,
    RX,
    RY,
    RZ,
    S0,
    S1,
    S2,
    S3,
    S4,
    US,
    VS,
    WORK,
    XD,
    YD,
    ZS,
    A,
    B,
    G,
    H,
    K,
    S,
    U,
    V,
    X,
    Y,
    Z,
)
from calib.views import FloatArray

NOTHING, BROWN, EVERYTHING = 0, 1, 2
"""Which derivatives a block gives: none; by the pose and the columns up to the thin prism; by every
column. The rare ones (tilt, pupil, window, sweep) cost more than all others together."""

FIRST_RARE, LAST_RARE = COLUMN["tilt_x_rad"], COLUMN["sweep_rz_rad"]
FIRST_SWEEP, HEIGHT, POSE_ROW = COLUMN["sweep_x_m"], COLUMN["height_px"], COLUMN["pose_row"]
EQUIDISTANT = COLUMN["equidistant"]
ROW_STEPS, ROW_SETTLED_PX = 40, 1e-11
"""A board that moves by a tenth of the picture while it is read needs about a dozen steps."""

N2 = WINDOW_INDEX * WINDOW_INDEX


@njit(cache=True, error_model="numpy")
def _axial_shift(pupil, window, x, y, z):  # type: ignore[no-untyped-def]
    """Depth seen by the pinhole, and its derivatives by x, y, z, pupil and window."""
    rho = math.sqrt(x * x + y * y)
    theta = math.atan2(rho, z)
    d2 = x * x + y * y + z * z
    cos = z / math.sqrt(d2)
    root = math.sqrt(N2 - 1.0 + cos * cos)
    by_window = -(1.0 - cos / root)
    # d(theta) = (z drho - rho dz)/d2 ; d(cos/root)/dcos = (N2 - 1)/root^3
    slope = 2.0 * pupil * theta - window * (N2 - 1.0) / root**3 * math.sin(theta)
    aside = slope * z / d2 / rho if rho > 0.0 else 0.0
    depth = z + pupil * theta * theta + window * by_window
    return depth, aside * x, aside * y, 1.0 - slope * rho / d2, theta * theta, by_window


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _place(pose, count, work):  # type: ignore[no-untyped-def]
    """The corners in the camera's frame."""
    r00, r01, r02, tx = pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3]
    r10, r11, r12, ty = pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3]
    r20, r21, r22, tz = pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3]
    for j in range(count):
        px, py, pz = work[PX + j], work[PY + j], work[PZ + j]
        work[X + j] = r00 * px + r01 * py + r02 * pz + tx
        work[Y + j] = r10 * px + r11 * py + r12 * pz + ty
        work[Z + j] = r20 * px + r21 * py + r22 * pz + tz


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _depth(o, count, work, derive):  # type: ignore[no-untyped-def]
    """The depth that the pinhole sees."""
    pupil, window = o[19], o[20]
    if pupil == 0.0 and window == 0.0 and derive != EVERYTHING:
        for j in range(count):
            work[ZS + j] = work[Z + j]
            work[S0 + j] = 0.0
            work[S1 + j] = 0.0
            work[S2 + j] = 1.0
        return
    for j in range(count):
        seen = _axial_shift(pupil, window, work[X + j], work[Y + j], work[Z + j])
        work[ZS + j], work[S0 + j], work[S1 + j], work[S2 + j], work[S3 + j], work[S4 + j] = seen


@njit(cache=True, error_model="numpy")
def _image(o, count, work, derive):  # type: ignore[no-untyped-def]
    """Where the ideal image has the corners in the camera's frame."""
    _depth(o, count, work, derive)
    if o[EQUIDISTANT] != 0.0:
        equidistant(count, work)
    else:
        perspective(count, work)


@njit(cache=True, error_model="numpy", inline="always")
def _tilted(cx, sx, cy, sy, xd, yd):  # type: ignore[no-untyped-def]
    """Point on the tilted sensor; one over its depth there.

    OpenCV's tilted-sensor homography, multiplied out.
    """
    per_w = 1.0 / (sy * xd - cy * sx * yd + cy * cx)
    return cx * xd * per_w, (cy * yd - sx * sy * xd) * per_w, per_w


@njit(cache=True, error_model="numpy", inline="always")
def _radial_terms(o):  # type: ignore[no-untyped-def]
    """The fourth radial term of an equidistant image; the rational ones of a perspective one."""
    if o[EQUIDISTANT] != 0.0:
        return o[10], 0.0, 0.0, 0.0
    return 0.0, o[10], o[11], o[12]


@njit(cache=True, error_model="numpy", inline="always")
def _distorted(a, b, k1, k2, p1, p2, k3, n4, k4, k5, k6, s1, s2, s3, s4):  # type: ignore[no-untyped-def]
    """A distorted point; its radial factor and the inverse of that one's denominator."""
    r2 = a * a + b * b
    r4 = r2 * r2
    r6 = r4 * r2
    per_den = 1.0 / (1.0 + k4 * r2 + k5 * r4 + k6 * r6)
    rad = (1.0 + k1 * r2 + k2 * r4 + k3 * r6 + n4 * r4 * r4) * per_den
    xd = a * rad + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a) + s1 * r2 + s2 * r4
    yd = b * rad + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b + s3 * r2 + s4 * r4
    return xd, yd, rad, per_den


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _see(o, count, work):  # type: ignore[no-untyped-def]
    """Pixels of corners in the camera's frame."""
    alpha, beta, skew, u0, v0 = o[0], o[1], o[2], o[3], o[4]
    k1, k2, p1, p2, k3 = o[5], o[6], o[7], o[8], o[9]
    n4, k4, k5, k6 = _radial_terms(o)
    s1, s2, s3, s4 = o[13], o[14], o[15], o[16]
    cx, sx, cy, sy = math.cos(o[17]), math.sin(o[17]), math.cos(o[18]), math.sin(o[18])
    for j in range(count):
        a, b = work[A + j], work[B + j]
        xd, yd, _, _ = _distorted(a, b, k1, k2, p1, p2, k3, n4, k4, k5, k6, s1, s2, s3, s4)
        xt, yt, _ = _tilted(cx, sx, cy, sy, xd, yd)
        work[U + j] = alpha * xt + skew * yt + u0
        work[V + j] = beta * yt + v0


# One straight run of assignments in one loop, so that all of it goes several corners at a time.
@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _differentiate(o, count, work, jac):  # type: ignore[no-untyped-def]  # noqa: PLR0915
    """Pixels, and their derivatives by the pose and by the columns up to the thin prism."""
    alpha, beta, skew, u0, v0 = o[0], o[1], o[2], o[3], o[4]
    k1, k2, p1, p2, k3 = o[5], o[6], o[7], o[8], o[9]
    n4, k4, k5, k6 = _radial_terms(o)
    s1, s2, s3, s4 = o[13], o[14], o[15], o[16]
    cx, sx, cy, sy = math.cos(o[17]), math.sin(o[17]), math.cos(o[18]), math.sin(o[18])
    wide = 1.0 if o[EQUIDISTANT] != 0.0 else 0.0
    rational = 1.0 - wide
    for j in range(count):
        x, y, z = work[X + j], work[Y + j], work[Z + j]
        a, b = work[A + j], work[B + j]
        xd, yd, rad, per_den = _distorted(a, b, k1, k2, p1, p2, k3, n4, k4, k5, k6, s1, s2, s3, s4)
        xt, yt, per_w = _tilted(cx, sx, cy, sy, xd, yd)
        work[U + j] = alpha * xt + skew * yt + u0
        work[V + j] = beta * yt + v0
        # pixel by (xd, yd)
        t10, t11 = -(sx * sy + yt * sy) * per_w, (cy + yt * cy * sx) * per_w
        ux = alpha * (cx - xt * sy) * per_w + skew * t10
        uy = alpha * xt * cy * sx * per_w + skew * t11
        vx, vy = beta * t10, beta * t11
        # (xd, yd) by (a, b)
        r2 = a * a + b * b
        r4 = r2 * r2
        num_r = k1 + 2.0 * k2 * r2 + 3.0 * k3 * r4 + 4.0 * n4 * r4 * r2
        den_r = k4 + 2.0 * k5 * r2 + 3.0 * k6 * r4
        rad_r = (num_r - rad * den_r) * per_den
        prism_x, prism_y = s1 + 2.0 * s2 * r2, s3 + 2.0 * s4 * r2
        cross = 2.0 * a * b * rad_r + 2.0 * p1 * a + 2.0 * p2 * b
        xa = rad + 2.0 * a * a * rad_r + 2.0 * p1 * b + 6.0 * p2 * a + 2.0 * a * prism_x
        xb = cross + 2.0 * b * prism_x
        ya = cross + 2.0 * a * prism_y
        yb = rad + 2.0 * b * b * rad_r + 6.0 * p1 * b + 2.0 * p2 * a + 2.0 * b * prism_y
        ua, ub = ux * xa + uy * ya, ux * xb + uy * yb
        va, vb = vx * xa + vy * ya, vx * xb + vy * yb
        # (a, b) = (x, y) g by x and y at this depth, and by the depth
        g, h, s = work[G + j], work[H + j], work[S + j]
        uo, vo = ua * x + ub * y, va * x + vb * y
        uh, vh, us, vs = uo * h, vo * h, uo * s, vo * s
        dx, dy, dz = work[S0 + j], work[S1 + j], work[S2 + j]
        u_x, u_y, u_z = ua * g + uh * x + us * dx, ub * g + uh * y + us * dy, us * dz
        v_x, v_y, v_z = va * g + vh * x + vs * dx, vb * g + vh * y + vs * dy, vs * dz
        work[US + j], work[VS + j], work[XD + j], work[YD + j] = us, vs, xd, yd
        for half, gx, gy, gz in ((0, u_x, u_y, u_z), (BLOCK, v_x, v_y, v_z)):
            at = half + j
            jac[at] = gx
            jac[ROW + at] = gy
            jac[2 * ROW + at] = gz
            jac[3 * ROW + at] = gz * y - gy * z
            jac[4 * ROW + at] = gx * z - gz * x
            jac[5 * ROW + at] = gy * x - gx * y
        for half, at_x, at_y in ((0, ux, uy), (BLOCK, vx, vy)):
            r6 = r4 * r2
            radial = (at_x * a + at_y * b) * per_den
            at = OPTIC + half + j
            jac[at + 5 * ROW] = radial * r2
            jac[at + 6 * ROW] = radial * r4
            jac[at + 7 * ROW] = at_x * 2.0 * a * b + at_y * (r2 + 2.0 * b * b)
            jac[at + 8 * ROW] = at_x * (r2 + 2.0 * a * a) + at_y * 2.0 * a * b
            jac[at + 9 * ROW] = radial * r6
            jac[at + 10 * ROW] = radial * (wide * r4 * r4 - rational * rad * r2)
            jac[at + 11 * ROW] = -rational * radial * rad * r4
            jac[at + 12 * ROW] = -rational * radial * rad * r6
            jac[at + 13 * ROW] = at_x * r2
            jac[at + 14 * ROW] = at_x * r4
            jac[at + 15 * ROW] = at_y * r2
            jac[at + 16 * ROW] = at_y * r4
        at = OPTIC + j
        jac[at] = xt
        jac[at + BLOCK] = 0.0
        jac[at + ROW] = 0.0
        jac[at + ROW + BLOCK] = yt
        jac[at + 2 * ROW] = yt
        jac[at + 2 * ROW + BLOCK] = 0.0
        jac[at + 3 * ROW] = 1.0
        jac[at + 3 * ROW + BLOCK] = 0.0
        jac[at + 4 * ROW] = 0.0
        jac[at + 4 * ROW + BLOCK] = 1.0


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _differentiate_rare(o, count, work, jac):  # type: ignore[no-untyped-def]
    """Derivatives by the sensor's tilt, pupil, window, and the sweep of a board at rest."""
    alpha, beta, skew = o[0], o[1], o[2]
    cx, sx, cy, sy = math.cos(o[17]), math.sin(o[17]), math.cos(o[18]), math.sin(o[18])
    per_height, late_at_top = 1.0 / o[HEIGHT], -0.5 - o[POSE_ROW]
    for j in range(count):
        xd, yd, at = work[XD + j], work[YD + j], OPTIC + j
        xt, yt = jac[at], jac[at + 2 * ROW]
        per_w = 1.0 / (sy * xd - cy * sx * yd + cy * cx)
        by_x = -(cy * cx * yd + cy * sx)
        dx = -(sx * xd + xt * by_x) * per_w
        dy = -(cx * sy * xd + yt * by_x) * per_w
        jac[at + 17 * ROW] = alpha * dx + skew * dy
        jac[at + 17 * ROW + BLOCK] = beta * dy
        by_y = cy * xd + sy * sx * yd - sy * cx
        dx = -xt * by_y * per_w
        dy = -(sy * yd + sx * cy * xd + yt * by_y) * per_w
        jac[at + 18 * ROW] = alpha * dx + skew * dy
        jac[at + 18 * ROW + BLOCK] = beta * dy
        jac[at + 19 * ROW] = work[US + j] * work[S3 + j]
        jac[at + 19 * ROW + BLOCK] = work[VS + j] * work[S3 + j]
        jac[at + 20 * ROW] = work[US + j] * work[S4 + j]
        jac[at + 20 * ROW + BLOCK] = work[VS + j] * work[S4 + j]
        work[LATE + j] = work[V + j] * per_height + late_at_top
    for k in range(6):
        for j in range(count):
            late = work[LATE + j]
            jac[OPTIC + (FIRST_SWEEP + k) * ROW + j] = jac[k * ROW + j] * late
            jac[OPTIC + (FIRST_SWEEP + k) * ROW + BLOCK + j] = jac[k * ROW + BLOCK + j] * late


@njit(cache=True, error_model="numpy")
def _follow_rows(o, count, work):  # type: ignore[no-untyped-def]
    """Corners of a board that moves on, as they are when their own rows are read.

    The rows are found by stepping to where the corners are when the rows before are read. Within a
    frame a corner goes straight on.
    """
    tx, ty, tz, rx, ry, rz = o[21], o[22], o[23], o[24], o[25], o[26]
    for j in range(count):
        work[RX + j], work[RY + j], work[RZ + j] = work[X + j], work[Y + j], work[Z + j]
    for _ in range(ROW_STEPS):
        moved_px = 0.0
        for j in range(count):
            x, y, z = work[RX + j], work[RY + j], work[RZ + j]
            late = work[V + j] / o[HEIGHT] - 0.5 - o[POSE_ROW]
            work[X + j] = x + late * (tx + ry * z - rz * y)
            work[Y + j] = y + late * (ty + rz * x - rx * z)
            work[Z + j] = z + late * (tz + rx * y - ry * x)
            work[LATE + j] = late
            work[PX + j] = work[V + j]
        _image(o, count, work, BROWN)
        _see(o, count, work)
        for j in range(count):
            moved_px = max(moved_px, abs(work[V + j] - work[PX + j]))
        if moved_px < ROW_SETTLED_PX:
            break


@njit(cache=True, error_model="numpy")
def _differentiate_moving(o, count, work, jac):  # type: ignore[no-untyped-def]
    """Derivatives of `_follow_rows`, from those at the moved corners: of an implicit equation."""
    tx, ty, tz, rx, ry, rz = o[21], o[22], o[23], o[24], o[25], o[26]
    sweep = OPTIC + FIRST_SWEEP * ROW
    by_row = np.empty(2)
    for j in range(count):
        x, y, z, late = work[RX + j], work[RY + j], work[RZ + j], work[LATE + j]
        mx, my, mz = tx + ry * z - rz * y, ty + rz * x - rx * z, tz + rx * y - ry * x
        for i in range(2):
            at = i * BLOCK + j
            gx, gy, gz = jac[at], jac[at + ROW], jac[at + 2 * ROW]
            by_row[i] = (gx * mx + gy * my + gz * mz) / o[HEIGHT]
            qx = gx + late * (gy * rz - gz * ry)
            qy = gy + late * (gz * rx - gx * rz)
            qz = gz + late * (gx * ry - gy * rx)
            jac[at], jac[at + ROW], jac[at + 2 * ROW] = qx, qy, qz
            jac[at + 3 * ROW] = y * qz - z * qy
            jac[at + 4 * ROW] = z * qx - x * qz
            jac[at + 5 * ROW] = x * qy - y * qx
            at += sweep
            jac[at], jac[at + ROW], jac[at + 2 * ROW] = late * gx, late * gy, late * gz
            jac[at + 3 * ROW] = late * (y * gz - z * gy)
            jac[at + 4 * ROW] = late * (z * gx - x * gz)
            jac[at + 5 * ROW] = late * (x * gy - y * gx)
        # a corner seen lower is read later, and has moved on by then
        for at in range(j, JAC, ROW):
            jac[at + BLOCK] /= 1.0 - by_row[1]
            jac[at] += by_row[0] * jac[at + BLOCK]


@njit(cache=True, error_model="numpy")
def _corners(o, pose, count, work, jac, derive):  # type: ignore[no-untyped-def]
    """Project the `count` points in `work`; pixels go there, derivatives by `derive` into `jac`.

    `count` must be a multiple of `LANES`. The rare columns' derivatives need `EVERYTHING`.
    """
    _place(pose, count, work)
    _image(o, count, work, derive)
    if np.any(o[FIRST_SWEEP : LAST_RARE + 1] != 0.0):
        _see(o, count, work)
        _follow_rows(o, count, work)
        if derive != NOTHING:
            _image(o, count, work, derive)
            _differentiate(o, count, work, jac)
            _differentiate_rare(o, count, work, jac)
            _differentiate_moving(o, count, work, jac)
    elif derive == NOTHING:
        _see(o, count, work)
    else:
        _differentiate(o, count, work, jac)
        if derive == EVERYTHING:
            _differentiate_rare(o, count, work, jac)


@njit(cache=True, error_model="numpy")
def _take(points, chosen, count, work):  # type: ignore[no-untyped-def]
    """Put points into a block; the last one fills it up to a multiple of `LANES`, returned."""
    full = (count + LANES - 1) // LANES * LANES
    for j in range(full):
        at = chosen[min(j, count - 1)]
        work[PX + j], work[PY + j], work[PZ + j] = points[at, 0], points[at, 1], points[at, 2]
    return full


@njit(cache=True, error_model="numpy")
def _has_rare(o):  # type: ignore[no-untyped-def]
    """Whether a rare column is not zero in this frame."""
    return np.any(o[FIRST_RARE : LAST_RARE + 1] != 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _project_all(optics, poses, points, uv, j_pose, j_optics, derive):  # type: ignore[no-untyped-def]
    work, jac = np.zeros(WORK), np.zeros(JAC)
    need = EVERYTHING if derive else NOTHING
    chosen = np.arange(points.shape[0])
    for i in range(poses.shape[0]):
        for first in range(0, points.shape[0], BLOCK):
            count = min(BLOCK, points.shape[0] - first)
            full = _take(points, chosen[first:], count, work)
            _corners(optics[i], poses[i], full, work, jac, need)
            for j in range(count):
                uv[i, first + j, 0], uv[i, first + j, 1] = work[U + j], work[V + j]
            if derive:
                for j in range(count):
                    for c in range(2):
                        for k in range(6):
                            j_pose[i, first + j, c, k] = jac[k * ROW + c * BLOCK + j]
                        for k in range(K):
                            j_optics[i, first + j, c, k] = jac[OPTIC + k * ROW + c * BLOCK + j]


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
