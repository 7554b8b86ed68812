"""Every kind of input, those in files here: valid examples, and the reader that refuses others."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from benchmarks.fuzz.kind import Kind
from benchmarks.fuzz.page import page
from benchmarks.fuzz.wire import wire
from cell.errors import CellError
from cell.sequencer.journal import read_journal, skipped_views
from cell.storage.files.arm_description import adopt_description
from cell.storage.files.calibration_source import read_calibration
from cell.storage.files.cell_file import read_cell
from cell.storage.files.plan_file import read_plan
from cell.storage.files.study_file import read_study
from cell.storage.incoming.pictures import decode_picture
from cell.storage.recording import read_recording
from cell.verbs.importing.pose_files import flange_series, read_series
from cell.verbs.simulate import parse_effect
from drivers.jpeg import jpeg_size

CONFIGS = Path(__file__).parents[2] / "configs"
POSE = {"p_m": [0.5, 0.1, 0.4], "q_xyzw": [0.0, 1.0, 0.0, 0.0]}


def kinds() -> Iterator[Kind]:
    """All kinds."""
    yield from _files()
    yield from _poses()
    yield from _pictures()
    yield from wire()
    yield from page()


def _in(name: str, read: Callable[[Path], object]) -> Callable[[Path, bytes], object]:
    def reader(folder: Path, data: bytes) -> object:
        (folder / name).write_bytes(data)
        return read(folder / name)

    return reader


def _files() -> Iterator[Kind]:
    cell = (CONFIGS / "ur3-robotiq.cell.yaml").read_bytes()
    plan = b"\n".join((CONFIGS / "ur3-robotiq.plan.yaml").read_bytes().split(b"\n")[:16])
    study = b"schema: cell.study/1\nname: small\nmonte_carlo: {plan: p.yaml, seeds: 3}\n"
    yield Kind("cell file", (cell,), _in("c.cell.yaml", read_cell), slow=True)
    yield Kind("plan file", (plan,), _in("p.plan.yaml", lambda path: _plan(path, cell)), slow=True)
    yield Kind(
        "study file",
        (study,),
        _in("s.study.yaml", lambda path: _study(path, plan, cell)),
        slow=True,
    )
    header = (
        b"schema: cell.recording/1\nname: bench\nrobot: {model: ur5e}\n"
        b"camera: {model: c, width: 64, height: 48, focus: auto}\n"
        b"board: {type: chessboard, rows: 2, cols: 3, square_m: 0.025}\nimages: images/\n"
    )
    frames = b"".join(
        json.dumps({"frame": n, "image": f"images/{n:05d}.png", "t_s": 1.5 * n,
                    "base_from_flange": POSE, "joints_rad": [0.1] * 6}).encode() + b"\n"
        for n in range(4)
    )  # fmt: skip
    corners = b"frame,row,col,u_px,v_px\n" + b"".join(
        f"{n},{k // 3},{k % 3},{10 + 5 * k},{8 + k}\n".encode() for n in range(4) for k in range(6)
    )
    parts = {"recording.yaml": header, "frames.jsonl": frames, "detections.csv": corners}
    for name in parts:
        yield Kind(name, (parts[name],), _recording(parts, name), slow=True)
    journal = b"".join(
        json.dumps(event).encode() + b"\n"
        for event in ({"event": "start", "plan_sha256": "a"}, {"event": "skip", "view": 3})
    )
    yield Kind("journal", (journal,), _in("journal.jsonl", _journal))
    yield Kind("URDF", (_urdf(),), _in("arm.urdf", _described), slow=True)
    model = {"alpha_px": 900.0, "beta_px": 901.0, "u0_px": 320.0, "v0_px": 240.0}
    found = {"schema": "cell.calibration/1", "image_size_px": [640, 480],
             "solutions": {"zhang_mle": model}, "flange_from_camera": POSE}  # fmt: skip
    yield Kind("calibration.json", (json.dumps(found).encode(),), _in("c.json", read_calibration))
    yield Kind("effect on the command line", (b"focus_breathing:law=inverse_square,k_px_m2=3/4",),
               lambda _, data: parse_effect(data.decode("utf-8", "replace")))  # fmt: skip


def _urdf() -> bytes:
    joints = "".join(
        f'<joint name="j{n}" type="revolute"><parent link="l{n}"/><child link="l{n + 1}"/>'
        f'<origin xyz="0.1 0 0.2" rpy="0 {0.7 * (n % 2)} 0"/><axis xyz="0 {n % 2} {1 - n % 2}"/>'
        '<limit lower="-2.5" upper="2.5" velocity="2" effort="9"/></joint>\n'
        for n in range(6)
    )
    links = "".join(f'<link name="l{n}"/>\n' for n in range(7))
    return f'<robot name="own">\n{links}{joints}</robot>\n'.encode()


def _described(path: Path) -> object:
    return adopt_description("c.yaml: robot.urdf", path, "l0", "l6")


def _plan(path: Path, cell: bytes) -> object:
    (path.parent / "ur3-robotiq.cell.yaml").write_bytes(cell)
    return read_plan(path)


def _study(path: Path, plan: bytes, cell: bytes) -> object:
    (path.parent / "ur3-robotiq.cell.yaml").write_bytes(cell)
    (path.parent / "p.yaml").write_bytes(plan)
    return read_study(path)


def _recording(parts: dict[str, bytes], mutated: str) -> Callable[[Path, bytes], object]:
    def reader(folder: Path, data: bytes) -> object:
        for name, content in parts.items():
            (folder / name).write_bytes(data if name == mutated else content)
        recording = read_recording(folder)
        for frame in recording.frames:
            if frame.image is not None:
                try:
                    recording.picture(frame)
                except CellError:
                    continue  # one frame is rejected, the others are read
        return recording.views()

    return reader


def _journal(path: Path) -> object:
    return skipped_views(read_journal(path.parent))


def _poses() -> Iterator[Kind]:
    row = "0.1 -0.2 0.3 0.1 0.2 0.3 0.927362"
    examples = {
        "txt": "\n".join([row] * 4),
        "csv": "image,x,y,z,qx,qy,qz,qw\n" + "\n".join("1.png," + row.replace(" ", ",")
                                                        for _ in range(4)),
        "json": json.dumps([{"image": f"{n}.png", "position": [0.1, 0.2, 0.3],
                             "orientation": [0, 0, 0, 1]} for n in range(4)]),
        "yaml": "poses:\n" + "- {position: [0.1, 0.2, 0.3], orientation: [0, 0, 0, 1]}\n" * 4,
        "mod": "MODULE m\nCONST robtarget p10:=[[600,10,500],[0,0,1,0],[0,0,0,0],"
               "[9E9,9E9,9E9,9E9,9E9,9E9]];\nENDMODULE\n",
        "src": "DEF m()\nLIN {X 600.1,Y 10,Z 500,A 10,B 20,C 30}\nEND\n" * 2,
        "ls": "P[1]{\n GP1:\n X = 600.0 mm, Y = 1.0 mm, Z = 5.0 mm,\n"
              " W = 1.0 deg, P = 2.0 deg, R = 3.0 deg\n};\n",
        "script": "movel(p[0.1,0.2,0.3,0.1,0.2,0.3], a=1.2)\n" * 3,
        "log": "At time 1.5\n- Translation: [0.100, 0.200, 0.300]\n"
               "- Rotation: in Quaternion [0.000, 0.000, 0.000, 1.000]\n" * 3,
        "xml": cv2_storage(".xml"),
    }  # fmt: skip
    for suffix, text in examples.items():
        yield Kind(f"poses .{suffix}", (text.encode(),), _in(f"p.{suffix}", _series))
    poses = np.tile(np.eye(4), (4, 1, 1))
    for suffix, save in (("npy", np.save), ("npz", np.savez)):
        file = io.BytesIO()
        save(file, poses)
        yield Kind(f"poses .{suffix}", (file.getvalue(),), _in(f"p.{suffix}", _series))


def cv2_storage(suffix: str) -> str:
    """Four poses as OpenCV's file storage writes them."""
    storage = cv2.FileStorage(suffix, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for number in range(4):
        storage.write(f"pose_{number}", np.eye(4))
    return str(storage.releaseAndGetString())


def _series(path: Path) -> object:
    return flange_series(path, read_series(path))


def _pictures() -> Iterator[Kind]:
    grey = np.random.default_rng(0).integers(0, 255, (24, 32), dtype=np.uint8)
    for suffix in (".png", ".jpg", ".tif", ".bmp", ".pgm", ".webp"):
        data = cv2.imencode(suffix, grey)[1].tobytes()
        yield Kind(f"picture {suffix}", (data,), lambda _, data: decode_picture(data, "a"))
    jpeg = cv2.imencode(".jpg", grey)[1].tobytes()
    yield Kind("Robotiq JPEG's size", (jpeg,), lambda _, data: jpeg_size(data))
