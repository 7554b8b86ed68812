"""ABB's units: millimetres, degrees and quaternions with the scalar first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation


def transform_of(mm: NDArray[np.float64], wxyz: NDArray[np.float64]) -> RigidTransform:
    """Return the transform of a position in millimetres and a quaternion, scalar first."""
    rotation = Rotation.from_quat(wxyz, scalar_first=True)
    return RigidTransform.from_components(np.asarray(mm) / 1000.0, rotation)


def millimetres(transform: RigidTransform) -> NDArray[np.float64]:
    """Return the translation in millimetres."""
    return np.asarray(transform.translation * 1000.0)


def scalar_first(transform: RigidTransform) -> NDArray[np.float64]:
    """Return the quaternion w, x, y, z, with w at least 0."""
    return np.asarray(transform.rotation.as_quat(canonical=True, scalar_first=True))
