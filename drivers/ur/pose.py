"""Poses as Universal Robots writes them, and the flange behind the tool centre point."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation


def transform_of(pose: tuple[float, ...]) -> RigidTransform:
    """Return the transform of a six-vector: metres, then a rotation vector in radians."""
    return RigidTransform.from_components(pose[:3], Rotation.from_rotvec(pose[3:]))


def pose_of(transform: RigidTransform) -> tuple[float, ...]:
    """Return the six-vector of a transform: metres, then a rotation vector in radians."""
    return tuple(map(float, np.r_[transform.translation, transform.rotation.as_rotvec()]))


def base_from_flange(tcp_pose: tuple[float, ...], tcp_offset: tuple[float, ...]) -> RigidTransform:
    """Return the flange's pose, given base_from_tcp and flange_from_tcp as six-vectors."""
    return transform_of(tcp_pose) * transform_of(tcp_offset).inv()


def base_from_tcp(flange: RigidTransform, tcp_offset: tuple[float, ...]) -> RigidTransform:
    """Return the tool centre point's pose, given base_from_flange and flange_from_tcp."""
    return flange * transform_of(tcp_offset)
