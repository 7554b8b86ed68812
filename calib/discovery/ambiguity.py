"""What these data cannot distinguish, and what would."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from calib.chain.effect import Effect
from calib.discovery.diagnosis import Ambiguity
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.search import UNDECIDED, Search

_EXPERIMENTS = {
    frozenset({"protective_window", "entrance_pupil_shift"}): (
        "no plan of poses can: take the window off (or hold a known pane before the lens) and"
        " record once more"
    ),
    frozenset({"protective_window", "distance_dependent_distortion"}): (
        "take the window off and record once more; refocus at a fixed distance"
    ),
    frozenset({"entrance_pupil_shift", "distance_dependent_distortion"}): (
        "refocus at a fixed distance: distortion follows the focus, the pupil does not"
    ),
    frozenset({"decentering", "sensor_tilt"}): (
        "views with the board in the outermost corners of the image; poses alone hardly can"
    ),
    frozenset({"board_scale", "link_geometry"}): (
        "no plan of poses can: measure the board with a calliper, or use a certified scale bar"
    ),
    frozenset({"focus_breathing", "thermal_focal_drift"}): (
        "go through the distances twice, once outward and once back"
    ),
    frozenset({"pose_time_lag", "rolling_shutter"}): (
        "move once along the image's rows and once along its columns, at the same speed"
    ),
    frozenset({"mount_flex", "lens_sag"}): (
        "vary the distance at one attitude: sag shifts pixels, flex turns the view"
    ),
    frozenset({"mount_slip", "board_slip"}): (
        "repeat the first poses at the end, turned by 90 degrees about the optical axis"
    ),
    frozenset({"base_compliance", "joint_compliance"}): (
        "the same poses with joint 1 turned by 90 degrees: a pedestal tilts about its own axes; or"
        " a level on the base while the arm stretches out"
    ),
    frozenset({"optics_step", "mount_slip"}): (
        "repeat the first poses at the end, near and far: a lens that was touched scales the"
        " picture at every distance alike"
    ),
    frozenset({"exposure_bias", "focus_breathing"}): (
        "the same poses at two exposures: only the marks' bias changes with it"
    ),
    frozenset({"base_drift", "board_slip"}): (
        "repeat the first poses at the end and midway: a slip happens once, a drift goes on"
    ),
}
_AGAINST_A_LAW = "views in which what the law follows varies and what the effect follows stays"
_GENERAL = "more views in which the two differ: the plan of `separate_with`, if there is one"


def experiment(first: Effect, second: Effect) -> str:
    """What would distinguish the two, as text."""
    return _EXPERIMENTS.get(frozenset({first.name, second.name}), _GENERAL)


def ambiguous_mixups(mixups: Sequence[Mixup]) -> tuple[Ambiguity, ...]:
    """For every mix-up in the log, what would look the same in pictures and poses."""
    return tuple(
        Ambiguity(
            names=(mixup.name, other),
            why=f"pictures and poses are the same for {other}: the log alone cannot decide",
            experiment=mixup.apart,
        )
        for mixup in mixups
        for other in mixup.alike
    )


def _rival_laws(search: Search) -> Iterator[Ambiguity]:
    """For every name, the laws without a name that describe the data about as well."""
    for present in search.best.fit.model.effects:
        for law, behind in search.rival_laws.get(present.effect.label, ()):
            yield Ambiguity(
                names=(present.effect.name, law),
                why=(
                    f"a law without a name ({law}) is less likely by only {behind:.1f} in the"
                    f" Bayesian criterion (below {UNDECIDED:g} is undecided)"
                ),
                experiment=_AGAINST_A_LAW,
            )


def ambiguities(search: Search) -> tuple[Ambiguity, ...]:
    """For every effect taken in, the rivals that the data do not rule out, laws included."""
    found = []
    for step in search.steps:
        for rival, behind in step.rivals:
            if behind > UNDECIDED or rival.effect.name == step.taken.effect.name:
                continue
            found.append(
                Ambiguity(
                    names=(step.taken.effect.name, rival.effect.name),
                    why=(
                        f"{rival.effect.label} in place of {step.taken.effect.label} is less"
                        f" likely by only {behind:.1f} in the Bayesian criterion"
                        f" (below {UNDECIDED:g} is undecided)"
                    ),
                    experiment=experiment(step.taken.effect, rival.effect),
                )
            )
    return (*found, *_rival_laws(search))
