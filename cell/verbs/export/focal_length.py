"""Which focal lengths hold at a distance."""

from __future__ import annotations

from calib.paper.focus_law import law_scale_px
from cell.errors import InputError
from cell.storage.files.calibration_source import CalibrationSource, LawSource, SolutionSource


def moving_law(calibration: CalibrationSource, name: str) -> LawSource | None:
    """The law that a solution's focal length follows, or None where it is one for all distances.

    The joint fit has its own. The fixed-alpha fits hold the law of the scale factors. Zhang's
    have one focal length whatever the distance.
    """
    solution = calibration.solution(name)
    if solution.focus is not None:
        return solution.focus
    if name.startswith("zhang") or calibration.focus_law is None:
        return None
    return calibration.focus_law if calibration.focus_law.moves else None


def focal_lengths_px(
    calibration: CalibrationSource, name: str, distance_m: float
) -> tuple[float, float]:
    """Alpha and beta of a solution at a distance.

    Where the scale factors show a corner beyond which the focal length stands still (zone 2),
    zone 2's own values hold there; everywhere else the law's.

    Raises
    ------
    InputError
        The law gives no focal length there, or is unknown.
    """
    solution, law = calibration.solution(name), moving_law(calibration, name)
    if law is None:
        return solution.alpha_px, solution.beta_px
    zones = calibration.zones
    if zones is not None and zones.method == "change_point" and _inside(calibration, distance_m):
        return zones.alpha_px, zones.beta_px
    alpha = float(law_scale_px(law.law, law.values(), distance_m))
    beta = alpha * _beta_share(solution, law, distance_m)
    if not (alpha > 0 and beta > 0):
        raise InputError(f"--distance {distance_m:g}: the {law.law} law gives {alpha:.0f} px there")
    return alpha, beta


def _inside(calibration: CalibrationSource, distance_m: float) -> bool:
    zones = calibration.zones
    return zones is not None and zones.near_limit_m <= distance_m <= zones.far_limit_m


def _beta_share(solution: SolutionSource, law: LawSource, distance_m: float) -> float:
    """Beta over alpha at a distance."""
    values = law.values()
    if law.beta_parameters:
        beta = LawSource(law=law.law, parameters=law.beta_parameters).values()
        return float(
            law_scale_px(law.law, beta, distance_m) / law_scale_px(law.law, values, distance_m)
        )
    far = {"alpha0_px": "beta0_px", "alpha_inf_px": "beta_inf_px"}
    for alpha_name, beta_name in far.items():
        if alpha_name in law.parameters and beta_name in law.parameters:
            return law.parameters[beta_name].value / law.parameters[alpha_name].value
    return solution.beta_px / solution.alpha_px


def refusal(calibration: CalibrationSource, name: str, tool: str) -> str:
    """Why `tool` cannot say a focal length that moves, and which distances can be chosen."""
    law = moving_law(calibration, name)
    assert law is not None
    span = calibration.range_m
    why = f"the focal length follows the distance ({law.law}"
    choose = f"which {tool} cannot say. Choose one distance with --distance M"
    if span is None:
        return f"{why}), {choose}"
    near, far = (focal_lengths_px(calibration, name, d)[0] for d in span)
    return (
        f"{why}: {near:.1f} px at {span[0]:.3f} m, {far:.1f} px at {span[1]:.3f} m), {choose};"
        f" calibrated from {span[0]:.3f} to {span[1]:.3f} m{_zone_hint(calibration)}"
    )


def _zone_hint(calibration: CalibrationSource) -> str:
    zones = calibration.zones
    if zones is None or zones.near_limit_m >= zones.far_limit_m:
        return ""
    return (
        f". From {zones.near_limit_m:.3f} to {zones.far_limit_m:.3f} m it stands still, at"
        f" {zones.alpha_px:.1f} px"
    )
