"""A smooth error of the arm over its joints, or over the workspace where joints are not known.

What a real arm has beside offsets, lengths, compliance and waves: no formula, but poses near to
each other err alike (a Gaussian process; Rasmussen, Williams 2006, section 2.2). Far from every
pose that was seen the field is nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Effect, Parameter, Present
from calib.chain.empirical import UNNAMED, site_named
from calib.chain.state import ChainState
from calib.views import FloatArray, Views

FIELD = "field:flange_pose"
_PLACES_AS_FAR_AS_A_RADIAN_M = 0.35
_SITE = site_named("flange_pose")
_COMPONENTS = tuple((name, unit) for name, unit, _ in _SITE.components)


def over(views: Views) -> str:
    """What the field is over: `joints`, or `workspace` where joints are not known."""
    return "joints" if np.isfinite(views.joints_rad).all() else "workspace"


def coordinates(views: Views, along: str) -> FloatArray:
    """(N, D) places of the frames, about one radian of motion a unit."""
    if along == "joints":
        return views.joints_rad
    pose = views.base_from_flange
    turned = pose[:, :3, :3].reshape(len(pose), 9) / np.sqrt(2.0)
    return np.concatenate([pose[:, :3, 3] / _PLACES_AS_FAR_AS_A_RADIAN_M, turned], axis=1)


def likeness(first: FloatArray, second: FloatArray, length_scale: float) -> FloatArray:
    """(N, M) correlation of the errors at two sets of places."""
    square = ((first[:, None] - second[None]) ** 2).sum(axis=2)
    return np.asarray(np.exp(-0.5 * square / length_scale**2))


SIGMAS = ("length_scale_sigma", "share_sigma", "rms_sigma_m", "rms_sigma_rad")
"""What is known of the field's uncertainty."""


def present_field(
    along: str,
    nodes: FloatArray,
    weights: FloatArray,
    length_scale: float,
    share: float,
    sigmas: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
) -> Present:
    """The field as an effect whose amounts are given and not fitted.

    Parameters
    ----------
    along:
        See `over`.
    nodes, weights:
        (K, D) places and (K, 6) weights there, metres and radians in the flange's frame.
    length_scale:
        Over which errors are alike, as `coordinates` has it.
    share:
        Of the scatter's variance that the field takes up.
    sigmas:
        One sigma of what `SIGMAS` names.
    """
    given = {"length_scale": length_scale, "share": share, **dict(zip(SIGMAS, sigmas, strict=True))}
    for k, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
        given |= {f"node_{k}_{d}": float(value) for d, value in enumerate(node)}
        given |= {
            f"weight_{k}_{name}": float(value)
            for (name, _), value in zip(_COMPONENTS, weight, strict=True)
        }
    return field_from(f"{FIELD}/{along}", given)


def field_from(text: str, given: Mapping[str, float]) -> Present:
    """Return the field that a file states; raises KeyError for a number that it cannot have."""
    along = text.partition("/")[2]
    count = 1 + max(int(name.split("_")[1]) for name in given if name.startswith("node_"))
    wide = 1 + max(int(name.split("_")[2]) for name in given if name.startswith("node_"))
    effect = _effect(text, along, count, wide)
    amounts = frozenset(k for k, p in enumerate(effect.parameters) if p.role == "amount")
    return Present(effect, effect.values(given), held=amounts)


def rms(present: Present) -> tuple[float, float]:
    """RMS of the field's weights' effect at its nodes, metres and radians."""
    nodes, weights, length_scale = _numbers(present.values, present.effect)
    field = likeness(nodes, nodes, length_scale) @ weights
    square = (field**2).mean(axis=0)
    return float(np.sqrt(square[:3].sum())), float(np.sqrt(square[3:].sum()))


def _numbers(values: FloatArray, effect: Effect) -> tuple[FloatArray, FloatArray, float]:
    roles = np.array([p.name.partition("_")[0] for p in effect.parameters])
    weights = values[roles == "weight"].reshape(-1, len(_COMPONENTS))
    nodes = values[roles == "node"].reshape(len(weights), -1)
    return nodes, weights, float(values[0])


def _effect(text: str, along: str, count: int, wide: int) -> Effect:
    def act(values: FloatArray, state: ChainState) -> None:
        nodes, weights, length_scale = _numbers(values, effect)
        places = np.nan_to_num(coordinates(state.views, along))
        _SITE.shift(likeness(places, nodes, length_scale) @ weights, state)

    effect = Effect(
        name=UNNAMED,
        law=text,
        link=_SITE.acts_in,
        physics=f"The arm errs smoothly over its {along}, in a way that no known effect describes.",
        equation="flange error = sum of weight_k exp(-|place - node_k|^2 / (2 length_scale^2))",
        source="Gaussian process regression (Rasmussen, Williams 2006, section 2.2)",
        parameters=(
            Parameter("length_scale", "rad", 0.5, 1e-3, 1e3, role="setting"),
            Parameter("share", "1", 0.5, 0.0, 1.0, role="setting"),
            *(
                Parameter(name, unit, 0.0, 0.0, 1e3, role="setting")
                for name, unit in zip(SIGMAS, ("rad", "1", "m", "rad"), strict=True)
            ),
            *(
                Parameter(f"node_{k}_{d}", "rad", 1.0, -1e3, 1e3, role="setting")
                for k in range(count)
                for d in range(wide)
            ),
            *(
                Parameter(f"weight_{k}_{name}", unit, 3e-4, -1.0, 1.0)
                for k in range(count)
                for name, unit in _COMPONENTS
            ),
        ),
        act=act,
        remedy=(
            "Have the arm calibrated where it is used; until then the twin corrects poses near"
            " those that were recorded."
        ),
        separable=False,
    )
    return effect
