"""`twin.yaml`: the simulated cell with what was found, at the recorded poses."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.effect import Present
from calib.chain.optics import OPTICS
from calib.discovery.diagnosis import Diagnosis
from calib.views import FloatArray, Views
from cell.storage.files.cell_file import SCHEMA as CELL_SCHEMA
from cell.storage.files.parts import Pose
from cell.storage.files.plan_file import SCHEMA as PLAN_SCHEMA
from cell.storage.files.plan_file import PlanFile
from cell.storage.files.writing import yaml_text
from cell.storage.recording import Recording

_COMMENT = """\
The simulated twin of a recording: its cell with what the diagnosis found, at the logged poses.
`cell simulate` with this file makes a recording like it, effects and noise included."""

_VECTORS = ("joint_velocity_rad_s", "approach_joints_rad")
_SCALARS = ("t_s", "temperature_c", "focus_position", "focus_distance_m", "exposure_s")


def twin_text(found: Diagnosis, recording: Recording) -> str:
    """YAML of a plan whose inline cell is the twin."""
    plan = {
        "schema": PLAN_SCHEMA,
        "name": f"{recording.name}-twin",
        "cell": twin_cell(found, recording),
        "views": _views(found.views),
    }
    PlanFile.model_validate(plan)
    return yaml_text(plan, comment=_COMMENT)


def twin_cell(found: Diagnosis, recording: Recording) -> dict[str, Any]:
    header = recording.header.as_mapping()
    camera = header["camera"]
    views, model, noise = found.views, found.twin.model, found.twin.noise
    robot = {"driver": "sim", "model": views.robot_model, "payload_kg": views.payload_kg or 0.0}
    known = recording.header.robot
    if known.urdf is not None:
        urdf = str((recording.path / known.urdf).resolve())
        robot |= {"urdf": urdf, "base": known.base, "flange": known.flange}
    return {
        "schema": CELL_SCHEMA,
        "name": f"{recording.name}-twin",
        "robot": robot,
        "camera": {
            "driver": "sim",
            "model": camera.get("model"),
            "width": views.width_px,
            "height": views.height_px,
            "pixel_size_um": camera.get("pixel_size_um"),
            "focus": camera.get("focus"),
        },
        "board": header["board"],
        "mount": views.mount,
        "simulation": {
            "mounted": _pose(model.flange_from_mounted),
            "fixed": _pose(model.base_from_fixed),
            "optics": {
                name: float(value)
                for name, value in zip(OPTICS, model.optics, strict=True)
                if value != 0.0 and name != "height_px"
            },
            "effects": [_effect(present) for present in model.effects],
            "noise": {
                "corner_px": noise.corner_px,
                "arm_position_m": noise.flange_m,
                "arm_rotation_rad": noise.flange_rad,
            },
        },
    }


def _effect(present: Present) -> dict[str, Any]:
    effect = {"name": present.effect.name, "parameters": present.as_mapping()}
    return effect if present.effect.law is None else {**effect, "law": present.effect.law}


def _pose(matrix: FloatArray) -> dict[str, Any]:
    return Pose.of(RigidTransform.from_matrix(matrix)).model_dump(mode="json", exclude_none=True)


def _views(views: Views) -> list[dict[str, Any]]:
    reported = []
    for i in range(len(views)):
        view: dict[str, Any] = {"frame": int(views.frame[i])}
        view["base_from_flange"] = _pose(views.base_from_flange[i])
        if np.isfinite(views.joints_rad[i]).all():
            view["joints_rad"] = [float(v) for v in views.joints_rad[i]]
        for name in _VECTORS:
            vector = getattr(views, name)[i]
            if np.isfinite(vector).all():
                view[name] = [float(v) for v in vector]
        for name in _SCALARS:
            value = getattr(views, name)[i]
            if np.isfinite(value):
                view[name] = float(value)
        further = {k: float(v[i]) for k, v in views.extra.items() if np.isfinite(v[i])}
        labels = {k: str(v[i]) for k, v in views.labels.items() if v[i]}
        if further or labels:
            view["log"] = {**further, **labels}
        reported.append(view)
    return reported
