"""Torques that gravity puts on the joints of an arm at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.views import FloatArray

STANDARD_GRAVITY_M_S2 = (0.0, 0.0, -9.80665)


@dataclass(frozen=True)
class LinkMasses:
    """What the six links weigh, and where.

    Attributes
    ----------
    mass_kg, com_m:
        (6,) masses and (6, 3) centres of mass, each in its own link's DH frame.
    published:
        False where the maker publishes no values and these are an estimate of ours.
    """

    mass_kg: FloatArray
    com_m: FloatArray
    published: bool


def gravity_torques(
    frames: FloatArray,
    masses: LinkMasses,
    payload_kg: float,
    payload_com_m: FloatArray | tuple[float, float, float],
    gravity_m_s2: FloatArray | tuple[float, float, float],
) -> FloatArray:
    """Holding torque of every joint: the gradient of the potential energy.

    Parameters
    ----------
    frames:
        (..., 7, 4, 4) base and link frames in the base frame.
    masses:
        Of the links.
    payload_kg, payload_com_m:
        What hangs on the flange: kilograms, and its centre of mass in the flange frame, metres.
    gravity_m_s2:
        (3,) gravity in the base frame; the default holds for an upright base.

    Returns
    -------
    FloatArray
        (..., 6) torques in Nm, positive along the joint's positive sense.
        Source: Siciliano et al., Robotics, equation 7.39 (g_i = -sum_j m_j g0^T J_P,j).
    """
    points, weight = _weights(frames, masses, payload_kg, payload_com_m, gravity_m_s2)
    # Joint j carries the links j, j+1, ... and the payload: sums from the tip inwards.
    force = _sums_from_tip(np.broadcast_to(weight, points.shape))
    moment = _sums_from_tip(np.cross(points, weight))
    axis, origin = frames[..., :6, :3, 2], frames[..., :6, :3, 3]
    about_joint = moment - np.cross(origin, force)
    return np.asarray(-(axis * about_joint).sum(axis=-1))


def base_moment(
    frames: FloatArray,
    masses: LinkMasses,
    payload_kg: float,
    payload_com_m: FloatArray | tuple[float, float, float] = (0.0, 0.0, 0.0),
    gravity_m_s2: FloatArray | tuple[float, float, float] = STANDARD_GRAVITY_M_S2,
) -> FloatArray:
    """Moment (..., 3) in Nm with which the arm's weight turns its base about the base's origin.

    Parameters are those of `gravity_torques`. Source: sum of r x m g over links and payload.
    """
    points, weight = _weights(frames, masses, payload_kg, payload_com_m, gravity_m_s2)
    return np.asarray(np.cross(points, weight).sum(axis=-2))


def _weights(
    frames: FloatArray,
    masses: LinkMasses,
    payload_kg: float,
    payload_com_m: FloatArray | tuple[float, float, float],
    gravity_m_s2: FloatArray | tuple[float, float, float],
) -> tuple[FloatArray, FloatArray]:
    """(..., 7, 3) centres of mass of links and payload in the base, (7, 3) their weights."""
    com = _in_base(frames[..., 1:, :, :], masses.com_m)
    load = _in_base(frames[..., 6:, :, :], np.asarray(payload_com_m, float)[None])
    points = np.concatenate([com, load], axis=-2)
    return points, np.append(masses.mass_kg, payload_kg)[:, None] * np.asarray(gravity_m_s2, float)


def _in_base(frames: FloatArray, points_m: FloatArray) -> FloatArray:
    turned = np.einsum("...ij,...j->...i", frames[..., :3, :3], points_m)
    return np.asarray(turned + frames[..., :3, 3])


def _sums_from_tip(of_bodies: FloatArray) -> FloatArray:
    sums = np.flip(np.cumsum(np.flip(of_bodies, axis=-2), axis=-2), axis=-2)
    return np.asarray(sums[..., :6, :])
