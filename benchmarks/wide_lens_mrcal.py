"""mrcal's part of `wide_lens.py`, for the interpreter that has mrcal (2.5 and newer)."""

from __future__ import annotations

import json
import sys

import mrcal
import numpy as np

data = dict(np.load(sys.argv[1]))
SIZE = np.array([data["size"]], dtype=np.int32)
SPLINED = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=24_Ny=18_fov_x_deg=165"


def optimize(model, intrinsics, corners, poses, **free):
    """(N, M, 2) misses; intrinsics and poses are moved in place."""
    frames = len(corners)
    indices = np.zeros((frames, 3), dtype=np.int32)
    indices[:, 0], indices[:, 2] = np.arange(frames), -1
    weight = np.ones((*corners.shape[:3], 1))
    found = mrcal.optimize(
        intrinsics=intrinsics,
        rt_cam_ref=None,
        rt_ref_frame=poses,
        points=None,
        observations_board=np.ascontiguousarray(np.concatenate([corners, weight], axis=3)),
        indices_frame_camintrinsics_camextrinsics=indices,
        observations_point=None,
        indices_point_camintrinsics_camextrinsics=None,
        lensmodel=model,
        imagersizes=SIZE,
        calibration_object_spacing=float(data["square_m"]),
        do_optimize_calobject_warp=False,
        do_apply_outlier_rejection=False,
        **free,
    )
    return found["x"][: corners.size].reshape(frames, -1, 2)


def held_out(model, intrinsics):
    """(N, M, 2) misses of frames of which the pose alone is fitted."""
    locked = {
        "do_optimize_intrinsics_core": False,
        "do_optimize_intrinsics_distortions": False,
        "do_apply_regularization": False,
    }
    return optimize(model, intrinsics, data["test"], data["test_poses"].copy(), **locked)


def opencv8():
    core = data["core"].astype(float)
    intrinsics = np.concatenate([core, np.zeros(8)])[None]
    # near the angle over its tangent (Pade), which mrcal's own start from zero does not reach
    intrinsics[0, [4, 5, 9, 10]] = 7 / 9, 64 / 945, 10 / 9, 5 / 21
    poses = data["train_poses"].copy()
    optimize("LENSMODEL_OPENCV8", intrinsics, data["train"], poses, do_apply_regularization=False)
    return held_out("LENSMODEL_OPENCV8", intrinsics)


def splined():
    intrinsics, poses = data["core"].astype(float)[None], data["train_poses"].copy()
    first = "LENSMODEL_STEREOGRAPHIC"
    optimize(first, intrinsics, data["train"], poses, do_optimize_intrinsics_distortions=False)
    knots = np.zeros(mrcal.lensmodel_num_params(SPLINED) - 4)
    intrinsics = np.concatenate([intrinsics[0], knots])[None]
    optimize(SPLINED, intrinsics, data["train"], poses, do_optimize_intrinsics_core=False)
    return held_out(SPLINED, intrinsics)


print(json.dumps({"OPENCV8": opencv8().tolist(), "splined": splined().tolist()}))
