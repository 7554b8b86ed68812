"""`cell simulate`: recordings made by the simulated cell, corners only or with pictures."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.spatial.transform import RigidTransform

from calib.chain.effect import Present
from calib.views import Views
from cell.devices.factory import simulated_devices
from cell.devices.log_mixups import MIXUPS, mix_up
from cell.devices.nominal_cell import nominal
from cell.devices.simulated_cell import (
    LOGGED_COLUMNS,
    home_of,
    log_of,
    present_effect,
    simulated_cell,
)
from cell.errors import BadAnswer, InputError
from cell.sequencer.session import header_of, record_plan
from cell.storage.files.cell_file import EffectFile, Simulation
from cell.storage.files.plan_file import Plan
from cell.storage.incoming.limits import MAGNITUDE
from cell.storage.recording import Corners, FrameRecord, PoseRecord, RecordingWriter, write_corners
from cell.storage.recording.corners import FILE_NAME as DETECTIONS
from cell.storage.recording.header import Capture
from sim.cell import SimulatedCell
from sim.synthesize import synthesize

_MIXUP_STREAM = 101
_COLUMNS = ("joints_rad", *LOGGED_COLUMNS)


def simulate_corners(plan: Plan, folder: Path, seed: int | None = None) -> int:
    """Write the recording that the plan's simulated cell would make; returns its frame count.

    Raises
    ------
    InputError
        The cell has no truth to simulate, or a recording is in the way.
    """
    views = simulated_views(plan, simulated_cell(plan.cell, home_of(plan), seed=seed))
    header = header_of(plan, simulated=True, images=False)
    header = header.model_copy(
        update={"robot": header.robot.model_copy(update={"model": views.robot_model})}
    )
    if views.moving:
        header = header.model_copy(update={"capture": Capture(mode="moving")})
    corners = Corners(dict(zip(views.frame.tolist(), views.corners_px, strict=True)))
    with RecordingWriter.create(folder, header) as writer:
        for index, view in enumerate(plan.file.views):
            more = {"view": view.name, "station": view.station, **(view.log or {})}
            writer.append(_record(views, index, more))
    write_corners(folder / DETECTIONS, corners, views.board)
    return len(views)


def simulate_pictures(plan: Plan, folder: Path, seed: int | None = None) -> int:
    """Run the plan on the simulated arm and camera; returns the number of frames it logged.

    Raises
    ------
    BadAnswer
        The run did not get through the plan.
    """
    result = record_plan(plan, folder, simulated_devices(plan, seed=seed), simulated=True)
    if result.reason:
        raise BadAnswer(f"{folder}: {result.finish.text}: {result.reason}")
    return result.frames


def simulated_views(plan: Plan, cell: SimulatedCell) -> Views:
    """What the plan's simulated cell would record, without a file; raises `InputError`."""
    views = synthesize(cell, log_of(plan, cell))
    effects = plan.cell.simulation.effects if plan.cell.simulation else ()
    rng = cell.random(_MIXUP_STREAM)
    for effect in effects:
        if effect.name in MIXUPS:
            views = mix_up(views, effect, rng)
    return views


def _record(views: Views, index: int, more: Mapping[str, Any]) -> FrameRecord:
    values: dict[str, Any] = {"frame": int(views.frame[index]), "image": None}
    values |= {name: _logged(getattr(views, name)[index]) for name in _COLUMNS}
    if views.has_pose[index]:
        pose = RigidTransform.from_matrix(views.base_from_flange[index])
        values["base_from_flange"] = PoseRecord.of(pose)
    values |= {name: value for name, value in more.items() if value is not None}
    try:
        return FrameRecord.model_validate(values)
    except ValidationError as wrong:
        reported = "; ".join(
            f"{fault['loc'][0]}: {fault['msg'].lower()}" for fault in wrong.errors()
        )
        raise InputError(
            f"frame {values['frame']} of the simulated cell cannot be logged: {reported}. Does the"
            " board stand before the camera there? See `mount`, `mounted`, `fixed` and the noise"
        ) from None


def _logged(value: np.ndarray[Any, Any] | np.float64) -> Any:
    return np.asarray(value).tolist() if np.isfinite(value).all() else None


def with_effects(plan: Plan, effects: tuple[str, ...]) -> Plan:
    """The plan with these effects (``NAME:key=value,...``) in place of its cell's own.

    Raises
    ------
    InputError
        An effect, a law or a parameter is unknown, or a value is no number.
    """
    if not effects:
        return plan
    truth = nominal(plan.cell).simulation
    assert truth is not None
    parsed = tuple(parse_effect(text) for text in effects)
    for effect in parsed:
        if effect.name not in MIXUPS:
            _require_amount(present_effect(effect, "--effect"), given=effect.parameters)
    return with_truth(plan, truth.model_copy(update={"effects": parsed}))


def _require_amount(effect: Present, given: Collection[str]) -> None:
    """Refuse an effect without any amount: the simulation would be that without it.

    A zero that was given is meant: it takes the cell's own effects away.
    """
    parameters = [p for p in effect.effect.parameters if p.role == "amount"]
    if not effect.absent or any(p.name.startswith(tuple(given)) for p in parameters):
        return
    amounts = [f"{p.name}=NUMBER ({p.unit})" for p in parameters]
    raise InputError(
        f"--effect {effect.effect.name}: has no amount and would change nothing; say how large it"
        f" is: --effect {effect.effect.name}:{' or '.join(amounts[:6])}"
    )


def with_truth(plan: Plan, truth: Simulation) -> Plan:
    """The plan with another truth in its cell."""
    return replace(plan, cell=plan.cell.model_copy(update={"simulation": truth}))


def parse_effect(text: str) -> EffectFile:
    """Read ``NAME:key=value,...``; several values of one key are parted by ``/``."""
    name, _, rest = text.partition(":")
    law: str | None = None
    parameters: dict[str, float | tuple[float, ...]] = {}
    for pair in filter(None, rest.split(",")):
        key, equals, value = pair.partition("=")
        if not equals:
            raise InputError(f"--effect {text}: `{pair}` is no key=value")
        if key == "law":
            law = value
        else:
            parameters[key] = _numbers(text, pair, value)
    return EffectFile(name=name, law=law, parameters=parameters)


def _numbers(text: str, pair: str, value: str) -> float | tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in value.split("/"))
    except ValueError:
        numbers = ()
    if not (numbers and all(abs(number) <= MAGNITUDE for number in numbers)):
        raise InputError(f"--effect {text[:200]}: the value of `{pair[:80]}` is no number")
    return numbers if len(numbers) > 1 else numbers[0]
