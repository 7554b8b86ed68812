"""The evidence the report draws, out of the models a diagnosis ends with."""

from __future__ import annotations

import numpy as np

from calib.chain.model import CellModel
from calib.views import FloatArray, Views
from cell.views.report.data import Evidence
from cell.views.report.pose_errors import (
    PoseErrors,
    pose_errors,
    scale_at_robot_depth,
    without_constant_part,
)


def diagnosis_evidence(
    views: Views,
    mended: Views,
    before: CellModel,
    twin: CellModel,
    *,
    corner_px: float,
    flange_m: float,
) -> Evidence:
    """What each frame measured, before and after the effects that were found.

    Parameters
    ----------
    views, mended:
        The N frames of the report as they were logged, and those the diagnosis used, their
        the log mended; frames are matched by number.
    before, twin:
        The plain cell, and the one with all that was found.
    corner_px, flange_m:
        Noise levels of the twin: one sigma of a corner and of the flange, per axis.
    """
    plain, final = pose_errors(before, views), pose_errors(twin, mended)
    alpha, alpha_sigma = scale_at_robot_depth(plain, views, corner_px, flange_m)
    alone = _left_out(twin, mended)
    return Evidence(
        before_px=plain.residual_px,
        after_px=_aligned(final.residual_px, mended, views),
        shift_before_m=plain.shift_m,
        shift_after_m=_aligned(final.shift_m, mended, views),
        turn_before_rad=plain.turn_rad,
        turn_after_rad=_aligned(final.turn_rad, mended, views),
        shift_without_m={n: _aligned(e.shift_m, mended, views) for n, e in alone.items()},
        turn_without_rad={n: _aligned(e.turn_rad, mended, views) for n, e in alone.items()},
        cost_m={name: _cost_m(errors) for name, errors in alone.items()},
        alpha_px=alpha,
        alpha_sigma_px=alpha_sigma,
        board_offset_m=_offset(final, views),
        distance_m=plain.state.distance_m,
        gravity_in_camera=plain.state.gravity_in_camera(),
        joints_rad=_aligned(mended.joints_rad, mended, views),
    )


def _left_out(twin: CellModel, mended: Views) -> dict[str, PoseErrors]:
    """Per effect the errors of the twin without it, everything else as found."""
    return {
        left.effect.name: pose_errors(
            twin.with_effects(e for e in twin.effects if e is not left), mended
        )
        for left in twin.effects
    }


def _cost_m(found: PoseErrors) -> float:
    """RMS camera shift that is left when hand-eye and board poses are solved again, metres."""
    shift = without_constant_part(found)[:, :3]
    return float(np.sqrt(np.nanmean((shift**2).sum(axis=1))))


def _offset(final: PoseErrors, views: Views) -> FloatArray | None:
    offset = final.state.points_m - views.board.corners_m
    return offset if np.abs(offset).max() > 0 else None


def _aligned(values: FloatArray, mended: Views, views: Views) -> FloatArray:
    """Rows of the mended frames in the places those frames have in the report; NaN elsewhere."""
    out = np.full((len(views), *values.shape[1:]), np.nan)
    rows = {int(frame): row for row, frame in enumerate(mended.frame)}
    for place, frame in enumerate(views.frame):
        if int(frame) in rows:
            out[place] = values[rows[int(frame)]]
    return out
