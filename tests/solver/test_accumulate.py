"""The loop over corners in blocks gives what a sum over single corners gives."""

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.optics import COLUMN, OPTICS, optics_row
from calib.chain.projection import project, project_with_jacobians
from calib.solver.accumulate import local_equations
from calib.views import Board

BOARD = Board("chessboard", rows=9, cols=15, square_m=0.01)
COMMON = ("alpha_px", "u0_px", "k1", "p2", "k4", "s2")
RARE = ("tilt_x_rad", "pupil_m_rad2", "sweep_y_m")


def _frames() -> tuple[np.ndarray, np.ndarray]:
    """A plain frame, one read while it moves behind a window and a tilted sensor, a plain one."""
    lens = {"alpha_px": 900.0, "beta_px": 910.0, "u0_px": 640.0, "v0_px": 480.0, "height_px": 960.0}
    plain = optics_row(**lens, skew_px=0.5, k1=-0.1, k2=0.03, p1=1e-3, k4=0.01, s1=1e-3, s4=-1e-3)
    moving = plain.copy()
    moved = {"tilt_x_rad": 0.01, "tilt_y_rad": -0.02, "pupil_m_rad2": 2e-3, "window_m": 1e-3,
             "sweep_y_m": 0.01, "sweep_rz_rad": 0.01, "pose_row": 0.1}  # fmt: skip
    for name, value in moved.items():
        moving[COLUMN[name]] = value
    random = np.random.default_rng(4)
    turn, at = random.normal(size=(3, 3)) * 0.3, np.array([-0.07, -0.04, 0.3])
    return np.array([plain, moving, plain]), rigid.compose(
        turn, at + random.normal(size=(3, 3)) / 50
    )


@pytest.mark.parametrize("names", [COMMON, (*COMMON, *RARE)])
@pytest.mark.parametrize("corners", [False, True])
def test_blocks_give_what_single_corners_give(names: tuple[str, ...], corners: bool) -> None:
    optics, poses = _frames()
    random = np.random.default_rng(5)
    points = BOARD.corners_m + random.normal(size=(BOARD.corner_count, 3)) * 1e-4
    seen, by_pose, by_optics = project_with_jacobians(optics, poses, points)
    assert np.abs(project(optics, poses, points) - seen).max() < 1e-9
    observed = seen + random.normal(size=seen.shape)
    weight = random.uniform(0.2, 1.0, seen.shape[:2]) * (random.uniform(size=seen.shape[:2]) > 0.3)
    observed[weight == 0.0] = np.nan
    weight[2, 64:] = 0.0
    modes = random.normal(size=(2, len(points), 3))
    active = tuple(OPTICS.index(name) for name in names)
    found = local_equations(optics, poses, points, observed, weight, active, modes, corners=corners)
    by_point = by_pose[..., :3] @ poses[:, None, :3, :3]
    left = np.where(weight[..., None] > 0.0, observed - seen, 0.0)
    columns = np.concatenate(
        [
            by_optics[..., active],
            by_pose,
            np.einsum("nmcx,bmx->nmcb", by_point, modes),
            left[..., None],
        ],
        axis=-1,
    )
    gram = np.einsum("nm,nmca,nmcb->nab", weight, columns, columns)
    size = np.sqrt(np.einsum("naa->na", gram))
    assert np.abs((found.gram - gram) / (size[:, :, None] * size[:, None, :])).max() < 1e-12
    assert np.allclose(found.residual_px[weight > 0.0], left[weight > 0.0], atol=1e-9)
    assert np.isnan(found.residual_px[weight == 0.0]).all()
    if corners:
        assert found.cross is not None
        assert found.own is not None
        shift = by_point[..., :2]
        cross = np.einsum("nm,nmca,nmcb->nmab", weight, shift, columns)
        assert np.allclose(found.cross, cross, rtol=1e-9, atol=1e-9 * np.abs(cross).max())
        own = np.einsum("nm,nmca,nmcb->nmab", weight, shift, shift)
        assert np.allclose(found.own, own, rtol=1e-9)
