"""What a fit's shared numbers are called in files, with their covariance."""

from __future__ import annotations

from calib.calibration.result import Covariance, Focus
from calib.chain.optics import COLUMN
from calib.paper.focus_law import Parameter
from calib.solver.joint import JointFit

FAR_NAMES = {
    "inverse_square": {"alpha_px": "alpha0_px", "beta_px": "beta0_px"},
    "thin_lens": {"alpha_px": "alpha_inf_px", "beta_px": "beta_inf_px"},
}
"""What alpha and beta far away are called among a focus law's numbers."""


def joint_covariance(joint: JointFit, law: str | None) -> Covariance:
    """Covariance of everything a joint fit freed.

    Where the focal length moves, alpha and beta are named as the law's own limits far away.
    """
    return Covariance(tuple(_name(u.name, law) for u in joint.unknowns), joint.covariance)


def _name(unknown: str, law: str | None) -> str:
    if unknown.startswith("focus_breathing"):
        return unknown.rpartition(".")[2]
    return FAR_NAMES.get(law or "", {}).get(unknown, unknown)


def joint_focus(joint: JointFit, law: str | None) -> Focus | None:
    """How the joint fit's focal length moves with distance; None where it stands still."""
    if law is None:
        return None
    parameters = {
        far: Parameter(float(joint.model.optics[COLUMN[plain]]), joint.sigma(plain), "px")
        for plain, far in FAR_NAMES[law].items()
    }
    (breathing,) = (e for e in joint.model.effects if e.effect.name == "focus_breathing")
    (bend,) = breathing.effect.parameters
    sigma = joint.sigma(f"{breathing.effect.label}.{bend.name}")
    parameters[bend.name] = Parameter(float(breathing.values[0]), sigma, bend.unit)
    return Focus(law, parameters)
