"""A diagnosis as the content of `diagnosis.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from calib.discovery.diagnosis import Ambiguity, Diagnosis, FoundLaw, NamedEffect, Unexplained
from calib.discovery.start import UNKNOWN_POSE
from cell.storage.files.diagnosis_file import SCHEMA, DiagnosisFile
from cell.verbs.diagnose.separate import Separation


def as_mapping(
    found: Diagnosis,
    recording: str,
    separations: Sequence[Separation],
    notes: Sequence[str] = (),
    origin: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The content of `diagnosis.json`, checked against its model; `notes` go behind its own.

    `origin` is its `provenance`, where it is of a recording.
    """
    noise = found.twin.noise
    heard = noise.flange_m < UNKNOWN_POSE[0]
    content = {
        "schema": SCHEMA,
        "recording": recording,
        **(origin or {}),
        "verdict": found.verdict,
        "holdout": None if found.proof is None else vars(found.proof),
        "misfit": {"before": vars(found.split[0]), "after": vars(found.split[1])},
        "mismatch": [vars(m) for m in found.mismatch],
        "effects": [_effect(e) for e in found.effects],
        "ambiguous_with": [
            _ambiguity(pair, separation)
            for pair, separation in zip(found.ambiguous_with, separations, strict=True)
        ],
        "unexplained": None if found.unexplained is None else _unexplained(found.unexplained),
        "unexplained_all": [_unexplained(one) for one in found.unexplained_all],
        "noise": {
            "corner_px": noise.corner_px,
            "flange_m": noise.flange_m if heard else None,
            "flange_rad": noise.flange_rad if heard else None,
            "print_m": noise.print_m,
            "focal_relative": noise.focal,
        },
        "frames_used": [int(f) for f in found.views.frame],
        "frames_rejected": [vars(r) for r in found.rejected],
        "notes": [*found.notes, *notes],
    }
    return DiagnosisFile.model_validate(content).model_dump(mode="json", by_alias=True)


def _ambiguity(pair: Ambiguity, separation: Separation) -> dict[str, Any]:
    why = f"{pair.why}; {separation.why}"
    return {**vars(pair), "why": why, "separate_with": separation.file}


def _unexplained(one: Unexplained) -> dict[str, Any]:
    return {**vars(one), "law": None if one.law is None else _law(one.law)}


def _law(law: FoundLaw) -> dict[str, Any]:
    gain = law.holdout_gain_px
    return {
        **vars(law),
        "parameters": {name: vars(value) for name, value in law.parameters.items()},
        "holdout_gain_px": gain if math.isfinite(gain) else None,
    }


def _effect(effect: NamedEffect) -> dict[str, Any]:
    gain = effect.holdout_gain_px
    return {
        **vars(effect),
        "parameters": {name: vars(value) for name, value in effect.parameters.items()},
        "holdout_gain_px": gain if math.isfinite(gain) else None,
    }
