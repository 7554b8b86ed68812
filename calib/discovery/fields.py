"""Fields of shifts over the image and over the board, tested corner by corner.

What a free pose absorbs and what the noise of the print could be are projected out, so that a
dent in the image or a bump on the board stands out wherever it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from calib.chain.effect import Link
from calib.chain.projection import project_with_jacobians
from calib.discovery.score import Score
from calib.solver.joint import JointFit
from calib.solver.unknowns import Dependence
from calib.views import FloatArray, Views

_ORDER = 6


@dataclass(frozen=True)
class FieldScore:
    """A tested field: over what, and where it is largest."""

    site: str
    link: Link
    covariate: str
    score: Score
    where: str


def cosine_modes(x: FloatArray, y: FloatArray, order: int = _ORDER) -> FloatArray:
    """(..., order^2 - 1) two-dimensional cosines of x and y in 0..1, without the constant."""
    waves = [
        np.cos(np.pi * i * x) * np.cos(np.pi * j * y)
        for i in range(order)
        for j in range(order)
        if i + j > 0
    ]
    return np.stack(waves, axis=-1)


def field_scores(fit: JointFit, views: Views) -> list[FieldScore]:
    """Test a field of pixel shifts over the image, and of heights and shifts over the board."""
    found = fit.dependence
    state = found.state
    pixels, j_pose, j_optics = project_with_jacobians(
        state.optics, state.camera_from_board, state.points_m
    )
    base = _base_columns(found, j_pose, j_optics, state.camera_from_board)
    weight = np.sqrt(fit.weight) / fit.noise.corner_px
    u, v = pixels[..., 0] / views.width_px, pixels[..., 1] / views.height_px
    image = cosine_modes(np.clip(u, 0, 1), np.clip(v, 0, 1))
    corners = views.board.corners_m
    extent = np.maximum(corners.max(axis=0), 1e-9)
    board = cosine_modes(corners[:, 0] / extent[0], corners[:, 1] / extent[1])
    j_point = np.einsum("nmck,nkl->nmcl", j_pose[..., :3], state.camera_from_board[:, :3, :3])
    zero = np.zeros_like(image)
    shifts = np.concatenate(
        [np.stack([image, zero], axis=2), np.stack([zero, image], axis=2)], axis=3
    )
    heights = j_point[..., 2:3] * board[None, :, None, :]
    test = _Test(fit, base, weight)
    return [
        FieldScore("image_field", "lens", "image place", *test.of(shifts, pixels, views)),
        FieldScore("board_height", "board", "board place", *test.of_board(heights, board, views)),
    ]


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


class _Test:
    """Projection onto what a free pose for each frame and the fitted numbers cannot absorb."""

    def __init__(self, fit: JointFit, base: FloatArray, weight: FloatArray) -> None:
        self.fit, self.weight = fit, weight
        n, m = weight.shape
        scale = np.repeat(weight[:, :, None], 2, axis=2).reshape(n, 2 * m)
        rows = base.reshape(n, 2 * m, -1) * scale[:, :, None]
        self.scale = scale
        self.q, _ = np.linalg.qr(rows[:, :, :6])
        shared = self._without_pose(rows[:, :, 6:])
        self.shared_q, _ = np.linalg.qr(shared.reshape(n * 2 * m, -1))
        residual = np.nan_to_num(fit.residual_px).reshape(n, 2 * m) * scale
        self.residual = self._clean(residual[:, :, None])[:, 0]

    def _without_pose(self, columns: FloatArray) -> FloatArray:
        return columns - self.q @ (np.swapaxes(self.q, 1, 2) @ columns)

    def _clean(self, columns: FloatArray) -> FloatArray:
        flat = self._without_pose(columns).reshape(-1, columns.shape[2])
        return np.asarray(flat - self.shared_q @ (self.shared_q.T @ flat))

    def _score(self, columns: FloatArray) -> Score:
        n, m = self.weight.shape
        rows = columns.reshape(n, 2 * m, -1) * self.scale[:, :, None]
        flat = self._clean(rows)
        u, s, vt = np.linalg.svd(flat, full_matrices=False)
        kept = s > 1e-6 * s[0]
        along = u[:, kept].T @ self.residual
        gain, rank = float(along @ along), int(kept.sum())
        freedom = max(2 * int((self.weight > 0).sum()) - 6 * n - rank, 4)
        noise = max((float(self.residual @ self.residual) - gain) / freedom, 1e-12)
        p = float(f_distribution.sf(gain / noise / rank, rank, freedom))
        step = vt[kept].T @ (along / s[kept])
        return Score(gain / noise, rank, p, step)

    def of(self, columns: FloatArray, pixels: FloatArray, views: Views) -> tuple[Score, str]:
        """Score a field over the image; where it is largest."""
        score = self._score(columns)
        size = np.linalg.norm(columns @ score.step, axis=2)
        at = np.unravel_index(int(np.argmax(size * (self.weight > 0))), size.shape)
        u, v = pixels[at]
        return score, f"around ({u:.0f}, {v:.0f}) px"

    def of_board(self, columns: FloatArray, modes: FloatArray, views: Views) -> tuple[Score, str]:
        """Score a height field over the board, print noise allowed for; where it is largest."""
        score = self._score(columns)
        height = modes @ score.step
        row, col = divmod(int(np.argmax(np.abs(height - np.median(height)))), views.board.cols)
        return score, f"around row {row}, column {col}"
