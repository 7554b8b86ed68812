"""Fields of shifts over the image and over the board, tested corner by corner.

What a free pose absorbs and what the noise of the print could be are projected out, so that a
dent in the image or a bump on the board stands out wherever it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain.effect import Link, Present
from calib.chain.projection import project_with_jacobians
from calib.discovery.score import Score, extended
from calib.distributions import f_tail
from calib.solver.joint import JointFit
from calib.solver.unknowns import Dependence
from calib.views import FloatArray, Views

_ORDER = 6
_FINE_ORDER = 12
"""Fine enough for a dent a tenth of the picture wide; too many modes for a first alarm."""
IMAGE_FIELD = "image_field"
BOARD_HEIGHT = "board_height"


@dataclass(frozen=True)
class FieldScore:
    """A tested field: over what, and where it is largest."""

    site: str
    link: Link
    covariate: str
    score: Score
    where: str


def cosine_modes(x: FloatArray, y: FloatArray, order: int) -> FloatArray:
    """(..., order^2 - 1) two-dimensional cosines of x and y in 0..1, without the constant."""
    waves = [
        np.cos(np.pi * i * x) * np.cos(np.pi * j * y)
        for i in range(order)
        for j in range(order)
        if i + j > 0
    ]
    return np.stack(waves, axis=-1)


@dataclass(frozen=True)
class _Fields:
    """(N, M, 2, F) columns of both fields, the board's modes, and predicted pixels."""

    image: FloatArray
    height: FloatArray
    board_modes: FloatArray
    pixels: FloatArray
    base: FloatArray


def _fields(found: Dependence, views: Views, order: int) -> _Fields:
    state = found.state
    pixels, j_pose, j_optics = project_with_jacobians(
        state.optics, state.camera_from_board, state.points_m
    )
    base = _base_columns(found, j_pose, j_optics, state.camera_from_board)
    u, v = pixels[..., 0] / views.width_px, pixels[..., 1] / views.height_px
    modes = cosine_modes(np.clip(u, 0, 1), np.clip(v, 0, 1), order)
    corners = views.board.corners_m
    extent = np.maximum(corners.max(axis=0), 1e-9)
    board = cosine_modes(corners[:, 0] / extent[0], corners[:, 1] / extent[1], _ORDER)
    j_point = np.einsum("nmck,nkl->nmcl", j_pose[..., :3], state.camera_from_board[:, :3, :3])
    zero = np.zeros_like(modes)
    shifts = np.concatenate(
        [np.stack([modes, zero], axis=2), np.stack([zero, modes], axis=2)], axis=3
    )
    heights = j_point[..., 2:3] * board[None, :, None, :]
    return _Fields(shifts, heights, board, pixels, base)


def field_scores(fit: JointFit, views: Views) -> list[FieldScore]:
    """Test a field of pixel shifts over the image, and of heights over the board."""
    fields = _fields(fit.dependence, views, _ORDER)
    test = _Test(fit, fields.base)
    image = test.of(fields.image, fields.pixels)
    height = test.of_board(fields.height, fields.board_modes, views)
    return [
        FieldScore(IMAGE_FIELD, "lens", "image place", *image),
        FieldScore(BOARD_HEIGHT, "board", "board place", *height),
    ]


def frame_scores(fit: JointFit, views: Views, site: str) -> FloatArray:
    """(N, R) what every frame by itself asks of a field, in directions that are independent."""
    fields = _fields(fit.dependence, views, _ORDER)
    columns = fields.image if site == IMAGE_FIELD else fields.height
    return _Test(fit, fields.base).frame_scores(columns)


def picture_score(fit: JointFit, views: Views, present: Present, site: str) -> Score:
    """What an effect would gain in the pictures alone, once a field is allowed for.

    Parameters
    ----------
    fit:
        A fit without the effect.
    present:
        The effect; its shapes and settings are taken, its amounts are not.
    site:
        `IMAGE_FIELD` or `BOARD_HEIGHT`.
    """
    blank = np.where([p.role == "amount" for p in present.effect.parameters], 0.0, present.values)
    _, found, _, first = extended(fit, views, (replace(present, values=blank),))
    fields = _fields(found, views, _FINE_ORDER)
    known, columns = fields.base[..., : 6 + first], fields.base[..., 6 + first :]
    field = fields.image if site == IMAGE_FIELD else fields.height
    return _Test(fit, np.concatenate([known, field], axis=3)).score(columns)


def _base_columns(
    found: Dependence, j_pose: FloatArray, j_optics: FloatArray, pose: FloatArray
) -> FloatArray:
    """(N, M, 2, 6 + p): every frame's own pose, and what is fitted."""
    a = len(found.active)
    shared = np.einsum("nmcq,nqp->nmcp", j_optics[..., list(found.active)], found.local[:, :a])
    shared += np.einsum("nmcq,nqp->nmcp", j_pose, found.local[:, a : a + 6])
    if len(found.modes):
        j_point = np.einsum("nmck,nkl->nmcl", j_pose[..., :3], pose[:, :3, :3])
        moved = np.einsum("nmcl,bml->nmcb", j_point, found.modes)
        shared += np.einsum("nmcb,nbp->nmcp", moved, found.local[:, a + 6 :])
    return np.concatenate([j_pose, shared], axis=3)


def _orthonormal(columns: FloatArray) -> FloatArray:
    """Basis of what the columns span, nearly dependent ones left out."""
    if columns.shape[1] == 0:
        return columns
    u, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, size > 1e-7 * size[0]])


class _Test:
    """Projection onto what a free pose for each frame and the fitted numbers cannot absorb."""

    def __init__(self, fit: JointFit, base: FloatArray) -> None:
        self.weight = np.sqrt(fit.weight) / fit.noise.corner_px
        n, m = self.weight.shape
        scale = np.repeat(self.weight[:, :, None], 2, axis=2).reshape(n, 2 * m)
        rows = base.reshape(n, 2 * m, -1) * scale[:, :, None]
        self.scale = scale
        self.q, _ = np.linalg.qr(rows[:, :, :6])
        shared = self._without_pose(rows[:, :, 6:]).reshape(n * 2 * m, -1)
        size = np.linalg.norm(shared, axis=0)
        self.shared_q = _orthonormal(shared[:, size > 0.0] / size[size > 0.0])
        residual = np.nan_to_num(fit.residual_px).reshape(n, 2 * m) * scale
        self.residual = self._clean(residual[:, :, None])[:, 0]

    def _without_pose(self, columns: FloatArray) -> FloatArray:
        return columns - self.q @ (np.swapaxes(self.q, 1, 2) @ columns)

    def _clean(self, columns: FloatArray) -> FloatArray:
        flat = self._without_pose(columns).reshape(-1, columns.shape[2])
        return np.asarray(flat - self.shared_q @ (self.shared_q.T @ flat))

    def score(self, columns: FloatArray) -> Score:
        """Test a group of (N, M, 2, F) columns."""
        n, _ = self.weight.shape
        u, s, vt = self._directions(columns)
        along = u.T @ self.residual
        gain, rank = float(along @ along), len(s)
        freedom = max(2 * int((self.weight > 0).sum()) - 6 * n - rank, 4)
        noise = max((float(self.residual @ self.residual) - gain) / freedom, 1e-12)
        p = f_tail(gain / noise / rank, rank, freedom)
        step = vt.T @ (along / s)
        return Score(gain / noise, rank, p, step)

    def frame_scores(self, columns: FloatArray) -> FloatArray:
        """(N, R) of each frame for the directions of a group of (N, M, 2, F) columns."""
        n, m = self.weight.shape
        u, _, _ = self._directions(columns)
        by_frame, residual = u.reshape(n, 2 * m, -1), self.residual.reshape(n, 2 * m)
        return np.asarray(np.einsum("nmr,nm->nr", by_frame, residual, optimize=True))

    def _directions(self, columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What of the columns nothing else can absorb: (2NM, R), (R,) sizes, (R, F)."""
        n, m = self.weight.shape
        rows = columns.reshape(n, 2 * m, -1) * self.scale[:, :, None]
        u, s, vt = np.linalg.svd(self._clean(rows), full_matrices=False)
        kept = s > 1e-6 * s[0]
        return u[:, kept], s[kept], vt[kept]

    def of(self, columns: FloatArray, pixels: FloatArray) -> tuple[Score, str]:
        """Score a field over the image; where it is largest."""
        score = self.score(columns)
        size = np.linalg.norm(columns @ score.step, axis=2)
        at = np.unravel_index(int(np.argmax(size * (self.weight > 0))), size.shape)
        u, v = pixels[at]
        return score, f"around ({u:.0f}, {v:.0f}) px"

    def of_board(self, columns: FloatArray, modes: FloatArray, views: Views) -> tuple[Score, str]:
        """Score a height field over the board, print noise allowed for; where it is largest."""
        score = self.score(columns)
        height = modes @ score.step
        row, col = divmod(int(np.argmax(np.abs(height - np.median(height)))), views.board.cols)
        return score, f"around row {row}, column {col}"
