"""Every kind of input: valid examples, and the reader that must refuse what is none."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cell.errors import CellError
from cell.sequencer.journal import read_journal, skipped_views
from cell.storage.files.calibration_source import read_calibration
from cell.storage.files.cell_file import read_cell
from cell.storage.files.plan_file import read_plan
from cell.storage.files.study_file import read_study
from cell.storage.incoming.pictures import decode_picture
from cell.storage.recording import read_recording
from cell.verbs.importing.pose_files import flange_series, read_series
from cell.verbs.simulate import parse_effect
from drivers.abb.egm_message import EgmDecoder, NotBelieved
from drivers.errors import DeviceError, SafetyError
from drivers.genicam_pixels import decode as decode_pixels
from drivers.jpeg import jpeg_size
from drivers.ur.wire import Recipe, receive

CONFIGS = Path(__file__).parents[2] / "configs"
REFUSED = (CellError, SafetyError, DeviceError)
POSE = {"p_m": [0.5, 0.1, 0.4], "q_xyzw": [0.0, 1.0, 0.0, 0.0]}


@dataclass(frozen=True)
class Kind:
    """One kind of input.

    Attributes
    ----------
    name, examples, slow:
        What it is called; valid ones; whether a reader for people's files reads it.
    read:
        Reads an input, in a folder of its own; raises what is in `refused` for a bad one.
    """

    name: str
    examples: tuple[bytes, ...]
    read: Callable[[Path, bytes], object]
    refused: tuple[type[Exception], ...] = REFUSED
    slow: bool = False


def kinds() -> Iterator[Kind]:
    """All kinds."""
    yield from _files()
    yield from _poses()
    yield from _pictures()
    yield from _wire()


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
    model = {"alpha_px": 900.0, "beta_px": 901.0, "u0_px": 320.0, "v0_px": 240.0}
    found = {"schema": "cell.calibration/1", "image_size_px": [640, 480],
             "solutions": {"zhang_mle": model}, "flange_from_camera": POSE}  # fmt: skip
    yield Kind("calibration.json", (json.dumps(found).encode(),), _in("c.json", read_calibration))
    yield Kind("effect on the command line", (b"focus_breathing:law=inverse_square,k_px_m2=3/4",),
               lambda _, data: parse_effect(data.decode("utf-8", "replace")))  # fmt: skip


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
    }  # fmt: skip
    for suffix, text in examples.items():
        yield Kind(f"poses .{suffix}", (text.encode(),), _in(f"p.{suffix}", _series))


def _series(path: Path) -> object:
    return flange_series(path, read_series(path))


def _pictures() -> Iterator[Kind]:
    grey = np.random.default_rng(0).integers(0, 255, (24, 32), dtype=np.uint8)
    for suffix in (".png", ".jpg", ".tif", ".bmp", ".pgm", ".webp"):
        data = cv2.imencode(suffix, grey)[1].tobytes()
        yield Kind(f"picture {suffix}", (data,), lambda _, data: decode_picture(data, "a"))
    jpeg = cv2.imencode(".jpg", grey)[1].tobytes()
    yield Kind("Robotiq JPEG's size", (jpeg,), lambda _, data: jpeg_size(data))


def _wire() -> Iterator[Kind]:
    recipe = Recipe(["timestamp", "actual_q", "safety_mode"], ["DOUBLE", "VECTOR6D", "INT32"])
    package = recipe.pack({"timestamp": 1.0, "actual_q": (0.1,) * 6, "safety_mode": 1})
    yield Kind("RTDE package", (package,), lambda _, data: recipe.unpack(data),
               (*REFUSED, struct.error))  # fmt: skip
    frame = struct.pack(">HB", 3 + len(package), 85) + package
    yield Kind("RTDE frame", (frame,), lambda _, data: _received(data), (*REFUSED, OSError))
    decoder = EgmDecoder([(-3.2, 3.2)] * 6)
    yield Kind("EGM datagram", (_egm(),), lambda _, data: decoder.decode(data), (NotBelieved,))
    pixels = bytes(range(48)) * 4
    yield Kind("GenICam buffer", (pixels,),
               lambda _, data: decode_pixels(data, 8, len(data) // 16, "Mono16"),
               (*REFUSED, ValueError))  # fmt: skip


def _received(data: bytes) -> object:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.settimeout(0.5)
        theirs.sendall(data[:60_000])
        theirs.shutdown(socket.SHUT_WR)
        return receive(ours)


def _egm() -> bytes:
    from ABBRobotEGM._egm_protobuf import egm_pb2

    message = egm_pb2.EgmRobot()
    message.header.seqno, message.header.tm = 7, 1000
    message.header.mtype = egm_pb2.EgmHeader.MSGTYPE_DATA
    message.feedBack.joints.joints.extend([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    place = message.feedBack.cartesian
    place.pos.x, place.pos.y, place.pos.z = 500.0, 10.0, 600.0
    place.orient.u0, place.orient.u1, place.orient.u2, place.orient.u3 = 1.0, 0.0, 0.0, 0.0
    return bytes(message.SerializeToString())
