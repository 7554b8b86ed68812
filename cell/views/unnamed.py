"""Physics without a name in a technician's words: what moves, with what, and where to look."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from calib.chain.covariates import COVARIATES, DERIVED

_PLACES = {
    "arm": "the arm: base bolts, joints, gears, cables and hoses that pull",
    "mount": "what holds the camera (or the board) on the flange",
    "board": "the board and what it stands on",
    "lens": "the lens and its focus, and the camera's settings",
    "sensor": "the camera: its settings, its housing, its sensor",
}

_SITES = {
    "principal_point": "picture's middle (principal point)",
    "mounted_pose": "place of what is mounted on the flange",
    "fixed_pose": "place of what stands fixed in the cell",
    "flange_pose": "flange",
    "k1": "lens's first distortion term (k1)",
}

_DOES = {
    "linear": "moves in proportion to {}",
    "quadratic": "follows {} along a parabola",
    "product": "follows the product of {}",
    "periodic": "swings to and fro with {}",
    "saturating": "follows {} and levels off",
    "relaxation": "starts displaced and settles with {}",
    "step": "jumps at one value of {}",
    "play": "lies to one side or the other, by the side of {}",
    "field": "is displaced smoothly over the {}",
}

_CAUSES = (
    (r"gain|exposure", "the camera's automatic gain and exposure: fix both, and light evenly"),
    (r"temperature|^time$", "what warms up or creeps: camera, bracket, arm, clamps"),
    (r"^order$|^frame", "what was done between the frames there: a knock, a setting, a restart"),
    (r"gravity", "what can hang, tilt or rattle: the bracket's screws, the lens in its barrel"),
    (r"distance|focus|blur", "the focus drive, and whether it ends where it should"),
    (r"moment", "the bolts of the base and what it stands on"),
    (r"approach|velocity", "play and friction in that joint's gear"),
    (r"joint|load", "that joint's gear and brake, and the cables and hoses that pass it"),
    (r"position|reach|workspace", "what bends or binds as the arm reaches out"),
    (r"dwell|settl", "how long the arm rests before a picture is taken"),
    (r"clamp|force|pressure|torque", "fixture and clamps: what they bend when they close"),
    (r"^image", "window, filter and lens: dirt, a dent, a drop"),
    (r"^board", "the board's surface: a bump, a fold, a loose foil"),
    (r"=", "what is different at that station"),
)


def sentence(left: Mapping[str, Any]) -> str:
    """Say what of the machine does what.

    Parameters
    ----------
    left:
        An entry of `unexplained_all` in diagnosis.json.
    """
    if left["site"] == "frames":
        return f"{str(left['where']).capitalize()}."
    law = left.get("law") or {}
    along = law.get("covariates") or [left["covariate"]]
    words = " and ".join(_in_words(str(name)) for name in along)
    does = _DOES.get(str(law.get("form")), "follows {}").format(words)
    where = left.get("where")
    place = "" if where in (None, "", "all of it") else f", {where}"
    return f"The {_site(str(left['site']))} {does}{place}; no known effect accounts for it."


def look_at(left: Mapping[str, Any]) -> str:
    """Say what to look at on the machine, by where it is and by what it follows."""
    if left["site"] == "frames":
        return (
            "Look at these frames' pictures (someone in the light, a board half seen), and at what"
            " the arm and the camera did then."
        )
    along = (left.get("law") or {}).get("covariates") or [left["covariate"]]
    causes = [words for name in along for at, words in _CAUSES if re.search(at, str(name))][:1]
    causes = causes or [f"what changes with {str(left['covariate']).replace('_', ' ')}"]
    return f"Look at {_PLACES.get(left['link'], left['link'])}; and at {causes[0]}."


def _in_words(covariate: str) -> str:
    """A known covariate in words; a key of the log as it stands there."""
    known = {each.name for each in (*COVARIATES, *DERIVED)}
    return covariate.replace("_", " ") if covariate in known else covariate


def _site(name: str) -> str:
    return _SITES.get(name, name.replace("_", " "))
