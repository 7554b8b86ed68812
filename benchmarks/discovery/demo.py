"""Physics that no catalogue has: concealed, found as a law, simulated again, and predicted.

    python -m benchmarks.discovery.demo [FOLDER]

The recording comes from the benchmark's own cell, which shares no line with the diagnosis. Ten of
its frames are shown to nobody: their corners are predicted from the robot's log alone.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from benchmarks.discovery.physics import present
from benchmarks.discovery.recordings import Concealed, conceal
from benchmarks.discovery.run import views_of
from benchmarks.discovery.world import CAMERAS
from calib.chain.model import CellModel, predict
from cell.devices.simulated_cell import home_of, simulated_cell
from cell.storage.files.board_file import board_file
from cell.storage.files.plan_file import read_plan
from cell.storage.recording import Corners, FrameRecord, PoseRecord, RecordingWriter, write_corners
from cell.storage.recording.corners import FILE_NAME as DETECTIONS
from cell.storage.recording.header import Header
from cell.storage.recording.recording import read_recording
from cell.verbs.diagnose.verb import Diagnosed, diagnose_into
from cell.verbs.simulate import simulated_views

NAME, PHYSICS, SIZE = "demo 1", "principal point follows gain", 1.5
_LOGGED = ("t_s", "temperature_c", "exposure_s", "gain_db", "dwell_s", "clamp_N", "focus_step")


def _frame(case: Concealed, row: int) -> FrameRecord:
    log = case.log
    values: dict[str, Any] = {
        "frame": row,
        "image": None,
        "joints_rad": log["joints"][row].tolist(),
    }
    values["base_from_flange"] = PoseRecord.of(RigidTransform.from_matrix(log["poses"][row]))
    return FrameRecord.model_validate(values | {name: float(log[name][row]) for name in _LOGGED})


def write(case: Concealed, folder: Path) -> Path:
    """Write what was seen as a recording; beside it the log of the frames to predict."""
    camera = CAMERAS[case.cell.camera]
    views = views_of(case, np.arange(len(case.ahead)))
    header = Header.model_validate(
        {
            "schema": "cell.recording/1",
            "name": "demo",
            "robot": {"model": case.cell.arm, "payload_kg": 0.9},
            "camera": {"width": int(camera["width"]), "height": int(camera["height"])},
            "board": board_file(views.board).model_dump(),
            "mount": views.mount,
            "simulated": True,
        }
    )
    seen = np.flatnonzero(~case.ahead)
    with RecordingWriter.create(folder, header) as writer:
        for row in seen:
            writer.append(_frame(case, int(row)))
    corners = {int(row): case.pixels[row] for row in seen}
    write_corners(folder / DETECTIONS, Corners(corners), views.board)
    ahead = folder.parent / "ahead.jsonl"
    lines = (_frame(case, int(row)).model_dump_json() for row in np.flatnonzero(case.ahead))
    ahead.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return ahead


def _missed_px(case: Concealed, done: Diagnosed, model: CellModel) -> float:
    log = done.found.log.take(np.isin(done.found.log.frame, np.flatnonzero(case.ahead)))
    miss = predict(model, log) - case.true_pixels[log.frame]
    return float(np.sqrt((miss**2).sum(axis=2).mean()))


def _simulated_again(case: Concealed, twin: Path) -> float:
    """RMS distance of what the twin's simulation shows from what was recorded, pixels."""
    plan = read_plan(twin)
    again = simulated_views(plan, simulated_cell(plan.cell, home_of(plan), seed=1))
    miss = again.corners_px - case.pixels[again.frame]
    return float(np.sqrt(np.nanmean((miss**2).sum(axis=2))))


def main() -> None:
    """Make the recording, diagnose it, and print what was found and what it is worth."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp(prefix="discovery-"))
    started = time.process_time()
    case = conceal(NAME, ((present(PHYSICS), SIZE),), background=False)
    ahead = write(case, folder / "recording")
    print(f"Concealed: {PHYSICS} (0.4 px a dB, times {SIZE:g}), an effect that no catalogue has.")
    done = diagnose_into(read_recording(folder / "recording"), folder / "diagnosis", predict=ahead)
    print(f"Verdict:   {done.mapping['verdict']}; names: "
          f"{', '.join(e.name for e in done.found.effects) or 'none'}.")  # fmt: skip
    for left in done.found.unexplained_all:
        print(f"Found:     {left.link}: the {left.site} follows {left.covariate}")
        if left.law is not None:
            print(f"           {left.law.equation}")
            for name, v in left.law.parameters.items():
                print(f"           {name} = {v.value:.4g} +- {1.96 * v.sigma:.2g} {v.unit} (95 %)")
    plain, twin = (_missed_px(case, done, f.model) for f in (done.found.plain, done.found.twin))
    print(f"Predicted: {int(case.ahead.sum())} frames that nobody fitted, {plain:.2f} px off by the"
          f" plain cell, {twin:.2f} px with the law.")  # fmt: skip
    again = _simulated_again(case, folder / "diagnosis" / "twin.yaml")
    print(f"Simulated: the twin's own recording lies {again:.2f} px from what was recorded,"
          " noise and the arm's scatter of both included.")  # fmt: skip
    report = folder / "diagnosis" / "report.html"
    print(f"Report:    {report} (the law over what it follows: “What nobody can name”)")
    print(f"           {time.process_time() - started:.0f} s of CPU")


if __name__ == "__main__":
    main()
