"""The same poses written the way other tools write them: what `cell import` must read."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.rigid import inverse
from calib.views import FloatArray

Write = Callable[[Path, FloatArray], Path]


@dataclass(frozen=True)
class Layout:
    """A way to write poses, and what belongs to it.

    Attributes
    ----------
    write:
        Writes (N, 4, 4) base_from_flange into a folder; what `--poses` is given.
    picture:
        Name of picture `n` (from 0) out of the format's `n` and `t_ns`.
    stated:
        Options in the words of the command line.
    digits_mm:
        How finely the layout writes a position.
    """

    write: Write
    picture: str = "img_{n:02d}.png"
    stated: dict[str, Any] = field(default_factory=dict)
    digits_mm: float = 1e-3


def start_ns(n: int) -> int:
    """When picture `n` was taken: every four seconds, in nanoseconds since 1970."""
    return 1403636579763555584 + n * 4_000_000_000


def position(flange: FloatArray) -> FloatArray:
    """(N, 3) metres."""
    return flange[:, :3, 3]


def turn(flange: FloatArray) -> Rotation:
    """N rotations."""
    return Rotation.from_matrix(flange[:, :3, :3])


def table(
    *columns: FloatArray, separator: str = " ", head: str = "", first: str = "", start: int = 0
) -> str:
    """Columns as text; `first` is what stands first in every row, out of its number `n`."""
    rows = np.column_stack(columns)
    lines = [head] if head else []
    for number, row in enumerate(rows, start):
        cells = [first.format(n=number, t_ns=start_ns(number))] if first else []
        lines.append(separator.join([*cells, *(f"{value:.10g}" for value in row)]))
    return "\n".join(lines) + "\n"


def file(name: str, text: Callable[[FloatArray], str]) -> Write:
    """A layout of one file."""

    def write(folder: Path, flange: FloatArray) -> Path:
        path = folder / name
        path.write_text(text(flange), encoding="utf-8")
        return path

    return write


def folder(name: str, text: Callable[[FloatArray], str], start: int = 0) -> Write:
    """A layout of one file a pose, named by its number `n`."""

    def write(where: Path, flange: FloatArray) -> Path:
        inner = where / "poses"
        inner.mkdir()
        (inner / ".DS_Store").write_bytes(b"\0\1")
        for n, pose in enumerate(flange, start):
            (inner / name.format(n=n)).write_text(text(pose), encoding="utf-8")
        return inner

    return write


def _xyz(p: FloatArray) -> dict[str, float]:
    return dict(zip("xyz", p.tolist(), strict=True))


def _xyzw(q: FloatArray) -> dict[str, float]:
    return dict(zip("xyzw", q.tolist(), strict=True))


def quaternions(flange: FloatArray) -> FloatArray:
    """(N, 4) x y z w."""
    return turn(flange).as_quat()


def scalar_first(flange: FloatArray) -> FloatArray:
    """(N, 4) w x y z."""
    return turn(flange).as_quat(scalar_first=True)


def euler(order: str, *, degrees: bool = True) -> Callable[[FloatArray], FloatArray]:
    """(N, 3) angles about the axes of an order, as `Rotation.as_euler` takes it."""

    def angles(flange: FloatArray) -> FloatArray:
        return np.asarray(turn(flange).as_euler(order, degrees=degrees))

    return angles


def comma(text: str) -> str:
    """Decimal commas."""
    return text.replace(".", ",")


def _moveit(flange: FloatArray) -> str:
    lines = []
    for pose in flange:
        lines += ["-", "  effector_wrt_world:", *(f"    - {v:.12g}" for v in pose.ravel())]
        lines += ["  object_wrt_sensor:", *(f"    - {v:.12g}" for v in inverse(pose).ravel())]
    return "\n".join(lines) + "\n"


def _transform(pose: FloatArray, indent: str) -> str:
    q = Rotation.from_matrix(pose[:3, :3]).as_quat()
    p = ", ".join(f"{k}: {v:.9f}" for k, v in _xyz(pose[:3, 3]).items())
    r = ", ".join(f"{k}: {v:.9f}" for k, v in _xyzw(q).items())
    return f"{indent}translation: {{{p}}}\n{indent}rotation: {{{r}}}\n"


def _easy_handeye(flange: FloatArray) -> str:
    return "samples:\n" + "".join(
        f"- robot:\n{_transform(pose, '    ')}  tracking:\n{_transform(inverse(pose), '    ')}"
        for pose in flange
    )


def _storage(pose: FloatArray) -> str:
    scaled = pose * np.array([1, 1, 1, 1e3])[None] if len(pose) == 4 else pose
    scaled = scaled.copy()
    scaled[3, 3] = 1.0
    data = ", ".join(f"{value:.17g}" for value in scaled.ravel())
    return (
        "%YAML:1.0\n---\nPoseState: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n"
        f"   data: [ {data} ]\n"
    )


def _echo(flange: FloatArray) -> str:
    documents = []
    for n, pose in enumerate(flange):
        q = _xyzw(Rotation.from_matrix(pose[:3, :3]).as_quat())
        stamp = start_ns(n)
        documents.append(
            f"header:\n  seq: {n}\n  stamp: {{secs: {stamp // 10**9}, nsecs: {stamp % 10**9}}}\n"
            "  frame_id: base\npose:\n"
            f"  position: {json.dumps(_xyz(pose[:3, 3]))}\n  orientation: {json.dumps(q)}\n"
        )
    return "---\n".join(documents)


def _echo2(flange: FloatArray) -> str:
    """`ros2 topic echo` of a tf message."""
    documents = []
    for n, pose in enumerate(flange):
        q = _xyzw(Rotation.from_matrix(pose[:3, :3]).as_quat())
        stamp = start_ns(n)
        documents.append(
            "transforms:\n- header:\n    stamp:\n"
            f"      sec: {stamp // 10**9}\n      nanosec: {stamp % 10**9}\n"
            "    frame_id: base\n  child_frame_id: tool0\n  transform:\n"
            f"    translation: {json.dumps(_xyz(pose[:3, 3]))}\n    rotation: {json.dumps(q)}\n"
        )
    return "---\n".join(documents)


def _tf_echo(flange: FloatArray, words: str = "in Quaternion") -> str:
    out = []
    for n, (p, q) in enumerate(zip(position(flange), quaternions(flange), strict=True)):
        out.append(
            f"At time {start_ns(n) / 1e9:.3f}\n"
            f"- Translation: [{', '.join(f'{v:.6f}' for v in p)}]\n"
            f"- Rotation: {words} [{', '.join(f'{v:.6f}' for v in q)}]\n"
            "            in RPY (radian) [0.1, 0.2, 0.3]\n"
        )
    return "".join(out)


def _rapid(flange: FloatArray, line: str = "  CONST robtarget p{n}0:={target};") -> str:
    lines = ["MODULE cal"]
    for n, (p, q) in enumerate(zip(1e3 * position(flange), scalar_first(flange), strict=True), 1):
        place, turned = (",".join(f"{v:.6f}" for v in values) for values in (p, q))
        target = f"[[{place}],[{turned}],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]"
        lines.append(line.format(n=n, target=target))
    return "\n".join([*lines, "ENDMODULE"]) + "\n"


def _kuka(flange: FloatArray, line: str) -> str:
    rows = np.hstack([1e3 * position(flange), euler("ZYX")(flange)])
    lines = []
    for n, row in enumerate(rows, 1):
        inner = ",".join(f"{k} {v:.4f}" for k, v in zip("XYZABC", row, strict=True))
        lines.append(line.format(n=n, inner=inner))
    return "DEFDAT cal\n" + "\n".join(lines) + "\n"


def _urscript(flange: FloatArray) -> str:
    rows = np.hstack([position(flange), turn(flange).as_rotvec()])
    poses = [f"  movel(p[{', '.join(f'{v:.7f}' for v in row)}], a=0.5, v=0.1)" for row in rows]
    return "def calibrate():\n  set_payload(0.5)\n" + "\n".join(poses) + "\nend\n"


def _fanuc(flange: FloatArray) -> str:
    rows = np.hstack([1e3 * position(flange), euler("xyz")(flange)])
    blocks = []
    for n, (x, y, z, w, p, r) in enumerate(rows, 1):
        blocks.append(
            f"P[{n}]{{\n   GP1:\n\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
            f"\tX = {x:9.3f}  mm,\tY = {y:9.3f}  mm,\tZ = {z:9.3f}  mm,\n"
            f"\tW = {w:9.4f} deg,\tP = {p:9.4f} deg,\tR = {r:9.4f} deg\n}};\n"
        )
    return "/PROG CAL\n/POS\n" + "".join(blocks) + "/END\n"


def _assigned(flange: FloatArray, line: str, order: str) -> str:
    rows = np.hstack([1e3 * position(flange), euler(order)(flange)])
    return "".join(
        line.format(n=n, values=",".join(f"{v:.4f}" for v in row)) + "\n"
        for n, row in enumerate(rows, 1)
    )


def _archive(arrays: Callable[[FloatArray], dict[str, FloatArray]]) -> Write:
    def write(where: Path, flange: FloatArray) -> Path:
        path = where / "poses.npz"
        np.savez(path, **arrays(flange))  # type: ignore[arg-type]
        return path

    return write


def _array(where: Path, flange: FloatArray) -> Path:
    np.save(where / "poses.npy", flange)
    return where / "poses.npy"


def _quoted(flange: FloatArray) -> str:
    lines = ["image,position,orientation"]
    for n, (p, q) in enumerate(zip(position(flange), quaternions(flange), strict=True)):
        lines.append(f'img_{n:02d}.png,"{p.tolist()}","{q.tolist()}"')
    return "\n".join(lines) + "\n"


def _rtde(flange: FloatArray) -> str:
    head = ["timestamp", *(f"actual_q_{k}" for k in range(6))]
    head += [f"actual_TCP_pose_{k}" for k in range(6)] + [f"actual_TCP_speed_{k}" for k in range(6)]
    n = len(flange)
    joints = np.linspace(-1, 1, 6 * n).reshape(n, 6)
    pose = np.hstack([position(flange), turn(flange).as_rotvec()])
    return table(np.arange(n) * 0.5, joints, pose, np.zeros((n, 6)), head=" ".join(head))


def _joints_and_pose(pose: FloatArray) -> str:
    values = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_rotvec()]
    return json.dumps({"joints": [0.1, -1.2, 1.3, 0.2, 0.3, 0.4], "pose": values})


def _around(flange: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Four times about each picture's, none equal to it, and the pose that stood there."""
    times = [start_ns(n) + d for n in range(len(flange)) for d in (-8e6, -3e6, 2e6, 7e6)]
    return np.array(times), np.repeat(flange, 4, axis=0)


def _timed(flange: FloatArray, head: str, separator: str = ",") -> str:
    times, poses = _around(flange)
    rows = np.hstack([position(poses), quaternions(poses)])
    lines = [head] if head else []
    for t, row in zip(times, rows, strict=True):
        lines.append(separator.join([str(int(t)), *(f"{v:.9f}" for v in row)]))
    return "\n".join(lines) + "\n"


def _interpolated(flange: FloatArray) -> str:
    """A log of a moving arm, 20 ms apart, with the picture's time between two of its rows."""
    lines = []
    for n, pose in enumerate(flange):
        for ms in (-10, 10):
            moved = pose.copy()
            moved[:3, 3] += np.array([1e-3, -2e-3, 3e-3]) * ms / 10
            q = Rotation.from_matrix(pose[:3, :3]).as_quat()
            values = ",".join(f"{v:.9f}" for v in [*moved[:3, 3], *q])
            lines.append(f"{start_ns(n) + ms * 10**6},{values}")
    return "\n".join(lines) + "\n"


def _named(flange: FloatArray, unit: float, head: str, order: str, **how: Any) -> str:
    return table(unit * position(flange), euler(order)(flange), separator=",", head=head, **how)


def _elements(flange: FloatArray) -> str:
    head = ",".join(f"T{i}{j}" for i in range(3) for j in range(4))
    return table(flange[:, :3].reshape(-1, 12), separator=",", head=head)


def _pq(separator: str = " ", scale: float = 1.0) -> Callable[[FloatArray], str]:
    return lambda F: table(scale * position(F), quaternions(F), separator=separator)


def _pq_by(name: str, start: int = 0) -> Callable[[FloatArray], str]:
    return lambda F: table(position(F), quaternions(F), separator=",", first=name, start=start)


STAMPED = "{t_ns}.png"
LAYOUTS: dict[str, Layout] = {
    "MoveIt samples": Layout(file("samples.yaml", _moveit)),
    "easy_handeye samples": Layout(file("bench.samples", _easy_handeye)),
    "easy_handeye samples, YAML": Layout(file("samples.yaml", _easy_handeye)),
    "OpenCV FileStorage, a file a pose, mm": Layout(
        folder("pos{n:02d}.yaml", _storage, 1), "img{m:02d}.png"
    ),
    "a file a pose, matrix in text": Layout(folder("pose_{n}.txt", lambda m: table(m))),
    "a file a pose, JSON": Layout(folder("pose_{n}.json", lambda m: json.dumps(m.tolist()))),
    "a file a pose, joints beside poses": Layout(folder("{n:04d}.json", _joints_and_pose)),
    "index and six": Layout(
        file("p.csv", lambda F: table(position(F), turn(F).as_rotvec(), separator=",",
                                      first="{n}", start=1)), "{m}.png"),
    "index and six, by spaces": Layout(
        file("p.txt", lambda F: table(position(F), turn(F).as_rotvec(), first="{n}", start=1)),
        "{m}.png"),
    "time and six": Layout(
        file("p.txt", lambda F: table(1693910819.12 + 3.7 * np.arange(len(F)), position(F),
                                      turn(F).as_rotvec()).replace("e+09", "e9"))),
    "index and seven": Layout(file("p.csv", _pq_by("{n}"))),
    "image name and seven": Layout(file("p.csv", _pq_by("img_{n:02d}.png"))),
    "image path and seven": Layout(file("p.csv", _pq_by("/data/run/img_{n:02d}.png"))),
    "number that varies, camera's after it": Layout(
        file("p.csv", _pq_by("{n}")), "frame_{n:03d}_cam0.png"),
    "number that varies, size after it": Layout(file("p.csv", _pq_by("{n}")),
                                                "{n:04d}_1279x724.png"),
    "poses from one, pictures from zero": Layout(file("p.csv", _pq_by("{n}", 1)),
                                                 "frame{n:04d}.png"),
    "poses from zero, pictures from one": Layout(file("p.csv", _pq_by("{n}")), "{m:06d}.png"),
    "column named num, mm": Layout(file("p.csv", lambda F: _named(
        F, 1e3, "num,X,Y,Z,A,B,C", "ZYX", first="{n}"))),
    "column named program, mm": Layout(file("p.csv", lambda F: _named(
        F, 1e3, "program,X,Y,Z,A,B,C", "ZYX", first="25"))),
    "rostopic echo": Layout(file("echo.yaml", _echo), "frame{n:04d}.png"),
    "ros2 topic echo, tf": Layout(file("echo.txt", _echo2), "frame{n:04d}.png"),
    "rostopic echo -p": Layout(file("echo.csv", lambda F: table(
        position(F), quaternions(F), separator=",", first="{t_ns},{n},{t_ns},base",
        head="%time,field.header.seq,field.header.stamp,field.header.frame_id,"
             "field.pose.position.x,field.pose.position.y,field.pose.position.z,"
             "field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,"
             "field.pose.orientation.w")), "frame{n:04d}.png"),
    "tf_echo": Layout(file("tf.txt", _tf_echo), "frame{n:04d}.png", digits_mm=1e-3),
    "tf2_echo": Layout(file("tf.txt", lambda F: _tf_echo(F, "in Quaternion (xyzw)")),
                       "frame{n:04d}.png"),
    "timestamps around the pictures'": Layout(file("p.csv", lambda F: _timed(F, "")), STAMPED),
    "timestamps around the pictures', named": Layout(
        file("p.csv", lambda F: _timed(F, "timestamp,x,y,z,qx,qy,qz,qw")), STAMPED),
    "timestamps, EuRoC's first row": Layout(
        file("p.csv", lambda F: _timed(F, "#timestamp,p_x,p_y,p_z,q_x,q_y,q_z,q_w")), STAMPED),
    "timestamps around the pictures', rotation stated": Layout(
        file("p.csv", lambda F: _timed(F, "")), STAMPED, {"rotation": "quat_xyzw"}),
    "timestamps of a moving arm": Layout(file("p.csv", _interpolated), STAMPED),
    "RAPID robtargets": Layout(file("cal.mod", _rapid), "img{m:02d}.png"),
    "RAPID moves": Layout(
        file("cal.mod", lambda F: _rapid(F, "    MoveL {target},v100,fine,tool0;")),
        "img{m:02d}.png"),
    "KUKA E6POS": Layout(file("cal.dat", lambda F: _kuka(
        F, "DECL E6POS XP{n}={{{inner},S 2,T 35,E1 0.0}}")), "img{m:02d}.png"),
    "KUKA frames": Layout(file("frames.txt", lambda F: _kuka(F, "{{{inner}}}")),
                          "img{m:02d}.png"),
    "URScript": Layout(file("cal.script", _urscript)),
    "Fanuc listing": Layout(file("cal.ls", _fanuc), "img{m:02d}.png"),
    "Yaskawa positions": Layout(file("cal.txt", lambda F: _assigned(
        F, "P{n:05d}={values}", "xyz"))),
    "Mitsubishi positions": Layout(file("cal.prg", lambda F: _assigned(
        F, "P{n}=({values})(7,0)", "xyz"))),
    "decimal commas, named": Layout(file("p.csv", lambda F: comma(table(
        1e3 * position(F), euler("xyz")(F), separator=";", head="X;Y;Z;RX;RY;RZ")))),
    "decimal commas": Layout(file("p.csv", lambda F: comma(table(
        1e3 * position(F), euler("xyz")(F), separator=";")))),
    "decimal commas and tabs": Layout(file("p.txt", lambda F: comma(table(
        1e3 * position(F), euler("xyz")(F), separator="\t")))),
    "ROS, x y z w": Layout(file("p.txt", _pq())),
    "ABB, mm and w x y z": Layout(file("p.csv", lambda F: table(
        1e3 * position(F), scalar_first(F), separator=","))),
    "UR, rotation vector": Layout(file("p.txt", lambda F: table(
        position(F), turn(F).as_rotvec()))),
    "UR, rotation stated": Layout(file("p.txt", lambda F: table(
        position(F), turn(F).as_rotvec())), stated={"rotation": "rotvec"}),
    "rotation vector in degrees": Layout(file("p.csv", lambda F: table(
        1e3 * position(F), turn(F).as_rotvec(degrees=True), separator=";"))),
    "Fanuc, mm and w p r": Layout(file("p.csv", lambda F: _named(
        F, 1e3, "x,y,z,w,p,r", "xyz"))),
    "roll pitch yaw, radians": Layout(file("p.txt", lambda F: table(
        position(F), euler("xyz", degrees=False)(F)))),
    "KUKA, a b c": Layout(file("p.csv", lambda F: _named(F, 1e3, "X,Y,Z,A,B,C", "ZYX"))),
    "KUKA, nothing named": Layout(file("p.txt", lambda F: table(
        1e3 * position(F), euler("ZYX")(F)))),
    "Staubli": Layout(file("p.txt", lambda F: table(1e3 * position(F), euler("XYZ")(F)))),
    "Kawasaki": Layout(file("p.txt", lambda F: table(1e3 * position(F), euler("ZYZ")(F)))),
    "centimetres": Layout(file("p.txt", _pq(scale=1e2))),
    "inches": Layout(file("p.txt", _pq(scale=1 / 0.0254))),
    "TUM, time and x y z w": Layout(file("p.txt", lambda F: (
        "# stamp tx ty tz qx qy qz qw\n"
        + table(0.1 + np.arange(len(F)), position(F), quaternions(F))))),
    "columns by name, quaternion first": Layout(file("p.csv", lambda F: table(
        scalar_first(F), position(F), separator=",", head="image,qw,qx,qy,qz,tx,ty,tz",
        first="img_{n:02d}.png"))),
    "quaternion before position": Layout(file("p.txt", lambda F: table(
        scalar_first(F), position(F)))),
    "columns by name, joints among them": Layout(file("p.csv", lambda F: table(
        np.zeros((len(F), 6)), 1e3 * position(F), euler("xyz")(F), separator=",",
        head="j1,j2,j3,j4,j5,j6,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg"))),
    "names with units in brackets": Layout(file("p.csv", lambda F: _named(
        F, 1e3, "x [mm],y [mm],z [mm],roll [deg],pitch [deg],yaw [deg]", "xyz"))),
    "RTDE log": Layout(file("robot.csv", _rtde)),
    "a quoted cell of several numbers": Layout(file("p.csv", _quoted)),
    "elements of a matrix by name": Layout(file("p.csv", _elements)),
    "4x4, a row each line": Layout(file("p.txt", lambda F: "\n\n".join(table(m) for m in F))),
    "4x4, one line": Layout(file("p.txt", lambda F: table(F.reshape(-1, 16)))),
    "4x4, one line, by columns": Layout(file("p.txt", lambda F: table(
        F.swapaxes(1, 2).reshape(-1, 16)))),
    "3x4, one line after an index": Layout(file("p.txt", lambda F: table(
        F[:, :3].reshape(-1, 12), first="{n}"))),
    "4x4 in mm": Layout(file("p.txt", lambda F: table(
        (F * np.array([1, 1, 1, 1e3]) / np.array([[1], [1], [1], [1e3]])).reshape(-1, 16)))),
    "4x4 inverted": Layout(file("p.txt", lambda F: table(inverse(F).reshape(-1, 16)))),
    "3x4 under keys": Layout(file("p.json", lambda F: json.dumps(
        {f"img_{k:02d}.png": m[:3].tolist() for k, m in enumerate(F)}))),
    "ROS messages in JSON": Layout(file("p.json", lambda F: json.dumps(
        [{"position": _xyz(p), "orientation": _xyzw(q)}
         for p, q in zip(position(F), quaternions(F), strict=True)]))),
    "one JSON value a line": Layout(file("p.jsonl", lambda F: "".join(
        json.dumps({"id": k, "p": p.tolist(), "q": q.tolist()}) + "\n"
        for k, (p, q) in enumerate(zip(position(F), quaternions(F), strict=True))))),
    "translation and 3x3": Layout(file("p.yaml", lambda F: json.dumps(
        [{"id": k, "R": m[:3, :3].tolist(), "t": m[:3, 3].tolist()} for k, m in enumerate(F)]))),
    "rotation before position": Layout(file("p.json", lambda F: json.dumps(
        [{"file": f"img_{k:02d}.png", "q": q.tolist(), "t": p.tolist()}
         for k, (p, q) in enumerate(zip(position(F), scalar_first(F), strict=True))]))),
    "both sides of OpenCV's hand-eye, JSON": Layout(file("p.json", lambda F: json.dumps({
        "R_gripper2base": F[:, :3, :3].tolist(), "t_gripper2base": F[:, :3, 3:].tolist(),
        "R_target2cam": inverse(F)[:, :3, :3].tolist(),
        "t_target2cam": inverse(F)[:, :3, 3:].tolist()}))),
    "NumPy archive of matrices": Layout(_archive(lambda F: {"T_base_gripper": F})),
    "NumPy archive of R and t": Layout(_archive(lambda F: {
        "R_gripper2base": F[:, :3, :3], "t_gripper2base": 1e3 * F[:, :3, 3]})),
    "NumPy array": Layout(_array),
}  # fmt: skip


def picture_names(layout: Layout, count: int) -> list[str]:
    """The names of the layout's pictures."""
    return [layout.picture.format(n=n, m=n + 1, t_ns=start_ns(n)) for n in range(count)]
