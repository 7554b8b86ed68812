"""What each frame by itself says of the shared numbers, so that frames can be left out or added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.solver.accumulate import local_equations
from calib.solver.unknowns import Dependence
from calib.views import FloatArray


@dataclass(frozen=True)
class EachFrame:
    """Normal equations of N frames, in the flange's six numbers and the p shared ones.

    Corner noise has been divided by. The last of the p + 1 columns is the residual: what stands
    there are the scores, and in its own row the square sum.

    Attributes
    ----------
    own, cross, shared:
        (N, 6, 6), (N, 6, p + 1), (N, p + 1, p + 1).
    flange_error:
        (N, 6) where the flange stands now.
    """

    own: FloatArray
    cross: FloatArray
    shared: FloatArray
    flange_error: FloatArray

    def marginal(self, flange_information: FloatArray) -> FloatArray:
        """(N, p + 1, p + 1) once each flange is free, about its log with that (6, 6) information.

        Zero information leaves only what the pictures say whatever the robot does.
        """
        pull = self.flange_error @ flange_information
        cross = self.cross.copy()
        cross[:, :, -1] -= pull
        own = self.own + flange_information
        scale = 1.0 / np.sqrt(np.einsum("nii->ni", own))
        scaled = cross * scale[:, :, None]
        back = np.linalg.solve(own * scale[:, :, None] * scale[:, None, :], scaled)
        left = self.shared - np.swapaxes(scaled, 1, 2) @ back
        left[:, -1, -1] += np.sum(pull * self.flange_error, axis=1)
        return np.asarray(left)


def each_frame(
    found: Dependence, corners_px: FloatArray, weight: FloatArray, flange_error: FloatArray
) -> EachFrame:
    """Linearise frame by frame.

    Parameters
    ----------
    found:
        How the frames follow the shared numbers, the flange's errors put in.
    corners_px:
        (N, M, 2) observations.
    weight:
        (N, M) inverse variances of the corners; zero where not seen.
    flange_error:
        (N, 6) the errors that were put in.
    """
    state = found.state
    local = local_equations(
        state.optics,
        state.camera_from_board,
        state.points_m,
        corners_px,
        weight,
        found.active,
        found.modes,
    )
    n, q, p = found.local.shape
    mapping = np.zeros((n, q + 1, p + 1))
    mapping[:, :q, :p] = found.local
    mapping[:, -1, -1] = 1.0
    mapped = local.gram @ mapping
    own_t = np.swapaxes(found.own, 1, 2)
    followed = found.own.shape[1]
    return EachFrame(
        own=own_t @ local.gram[:, :followed, :followed] @ found.own,
        cross=own_t @ mapped[:, :followed],
        shared=np.swapaxes(mapping, 1, 2) @ mapped,
        flange_error=flange_error,
    )
