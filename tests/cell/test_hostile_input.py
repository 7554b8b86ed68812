"""Input that nobody means well: an error in words and its status, at once and in little memory.

Each case is one of a kind; the campaign of `benchmarks/fuzz` varies them.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from cell.errors import InputError
from cell.storage.files.calibration_source import read_calibration
from cell.storage.files.cell_file import read_cell
from cell.storage.files.plan_file import read_plan
from cell.storage.incoming.arrays import read_arrays
from cell.storage.incoming.pictures import decode_picture, read_picture
from cell.storage.recording import read_recording
from cell.verbs.importing.pose_files import read_series
from cell.verbs.simulate import parse_effect
from tests.cell.plans import CELL, PLAN
from tests.cell.recordings import HEADER, frame_line

Folder = Callable[..., Path]
DEEP = 3000


@pytest.fixture(autouse=True)
def _little_memory(request: pytest.FixtureRequest) -> Iterator[None]:
    """Each reader gets by with half a gibibyte beyond what the libraries have mapped."""
    if "whole_program" in request.keywords:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 512 * 2**20, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def bomb(levels: int = 12) -> str:
    """Lists of ten of the list before: 10^12 words out of half a kilobyte."""
    lines = ["a0: &a0 [" + ", ".join(10 * ["x"]) + "]"]
    lines += [f"a{n}: &a{n} [" + ", ".join(10 * [f"*a{n - 1}"]) + "]" for n in range(1, levels)]
    return "\n".join(lines) + "\n"


YAML_INPUTS = {
    "anchors that multiply": (bomb(), "more than 2000000 values"),
    "an anchor in itself": ("notes: &a [*a]\n", "in itself|not a known key"),
    "deep lists": ("notes: " + "[" * DEEP + "]" * DEEP + "\n", "nested"),
    "deep mappings": ("notes: " + "{a: " * DEEP + "}" * DEEP + "\n", "nested"),
    "deep blocks": ("notes:\n" + "".join(" " * n + "-\n" for n in range(1, 900)), "nested"),
    "a number of 10 000 digits": ("notes: " + "9" * 10_000 + "\n", "digit|larger"),
    "a number of 400 digits": ("notes: " + "9" * 400 + "\n", "larger than"),
    "an infinite number": ("notes: .inf\n", "finite"),
    "no number": ("notes: [1, .nan]\n", "notes.1: must be a finite"),
    "a set of a scalar": ("notes: !!set 7\n", "YAML|set"),
    "an ordered map of a scalar": ("notes: !!omap 7\n", "YAML|omap"),
    "a date that is none": ("notes: 2026-13-45\n", "YAML|notes"),
    "a list for a key": ("? [a, b]\n: 1\n", "for a key|YAML"),
    "a mapping for a key": ("? {a: b}\n: 1\n", "for a key|YAML"),
    "a NUL": ('notes: "a\\0b"\n', "NUL"),
    "a raw control character": ("notes: \x01\n", "YAML"),
    "a tag of Python": ("notes: !!python/object/apply:os.system [ls]\n", "not a known key|YAML"),
    "an alias to nothing": ("notes: *nowhere\n", "YAML"),
}  # fmt: skip


@pytest.mark.parametrize("kind", YAML_INPUTS)
def test_strange_yaml(tmp_path: Path, recording_folder: Folder, kind: str) -> None:
    text, message = YAML_INPUTS[kind]
    (tmp_path / "bench.yaml").write_text(CELL)
    (tmp_path / "cell.yaml").write_text(CELL + text)
    (tmp_path / "plan.yaml").write_text(PLAN + text)
    with pytest.raises(InputError, match=message):
        read_cell(tmp_path / "cell.yaml")
    with pytest.raises(InputError, match=message):
        read_plan(tmp_path / "plan.yaml")
    if "Python" not in kind and "itself" not in kind:  # both are read as unknown keys, unharmed
        with pytest.raises(InputError, match=message):
            read_recording(recording_folder(header=HEADER + text))


VALUES = [
    ("cell", "rows: 4", "rows: 1000000", "board.rows: .*less than or equal to 1000"),
    ("cell", "rows: 4, cols: 5", "rows: 900, cols: 900", "has 810000 corners"),
    ("cell", "rows: 4", "rows: 4.5", "board.rows"),
    ("cell", "square_m: 0.03", "square_m: 1e-300", "board.square_m"),
    ("cell", "width: 640", "width: 70000", "camera.width"),
    ("cell", "width: 640, height: 480", "width: 60000, height: 60000", "too many; pictures have"),
    ("cell", "distances_m: [0.3, 0.6]", "distances_m: [0, 0.6]", "distances_m.0"),
    ("plan", "speed_m_s: 0.2", "speed_m_s: 1e-300", "speed_m_s: .*greater than or equal to 0.001"),
    ("plan", "speed_m_s: 0.2", "joint_speed_deg_s: 1e-9", "joint_speed_deg_s: .*greater than or"),
    ("plan", "speed_m_s: 0.2", "settle: {timeout_s: 1e17}", "settle.timeout_s"),
    ("plan", "{name: first, ", "{frame: 1180591620717411303424, ", "frame: .*larger|views.0.frame"),
    ("plan", "{name: first, ", "{focus_distance_m: 0, ", "views.0.focus_distance_m"),
]  # fmt: skip


@pytest.mark.parametrize(("file", "old", "new", "message"), VALUES)
def test_values_without_measure(
    tmp_path: Path, file: str, old: str, new: str, message: str
) -> None:
    files = {"cell": CELL, "plan": PLAN}
    assert old in files[file]
    files[file] = files[file].replace(old, new)
    (tmp_path / "bench.yaml").write_text(files["cell"])
    (tmp_path / "plan.yaml").write_text(files["plan"])
    with pytest.raises(InputError, match=message):
        read_plan(tmp_path / "plan.yaml")


FRAMES = {
    "a number beyond 64 bits": (frame_line(2**70), "frame must be a whole number from 0 to 2"),
    "a fraction of a frame": (frame_line(0).replace('"frame": 0', '"frame": 0.5'), "whole number"),
    "10 000 digits": ('{"frame": ' + "9" * 10_000 + "}\n" + frame_line(1), "is not a frame"),
    "deep": ('{"frame": 0, "x": ' + "[" * 90_000 + "\n" + frame_line(1), "is not a frame"),
    "deep, but whole": (
        '{"frame": 0, "x": ' + "[" * 300 + "]" * 300 + "}\n",
        "nested more than 64",
    ),
    "a line of megabytes": (
        '{"frame": 0, "x": "' + "x" * 2**21 + '"}\n' + frame_line(1),
        "has 2097173 characters",
    ),
    "no text": ("\xff\xfe" * 50 + "\n" + frame_line(1), "is not a frame"),
}


@pytest.mark.parametrize("kind", FRAMES)
def test_strange_frames(recording_folder: Folder, kind: str) -> None:
    text, message = FRAMES[kind]
    with pytest.raises(InputError, match=message):
        read_recording(recording_folder(frames=text))


CORNERS = {
    "a field without end": "0,0,0," + "1" * 200_000 + ",1\n",
    "a frame of 5000 digits": "9" * 5000 + ",0,0,1,1\n",
    "a frame beyond 64 bits": f"{2**70},0,0,1,1\n",
    "a NUL": "0,0,0,\0,1\n",
    "a quote without end": '0,0,0,"1,1\n0,0,1,1,1\n',
}


@pytest.mark.parametrize("kind", CORNERS)
def test_strange_corners(recording_folder: Folder, kind: str) -> None:
    folder = recording_folder(detections="frame,row,col,u_px,v_px\n" + CORNERS[kind])
    with pytest.raises(InputError, match=r"detections.csv:\d"):
        read_recording(folder).detections()


def test_corners_of_more_frames_than_memory_holds(recording_folder: Folder) -> None:
    rows = "".join(f"{frame},0,0,1,1\n" for frame in range(2000))
    header = HEADER.replace("rows: 2, cols: 3", "rows: 100, cols: 200")
    folder = recording_folder(header=header, detections=f"frame,row,col,u_px,v_px\n{rows}")
    with pytest.raises(InputError, match="more than 16777216 corners"):
        read_recording(folder).detections()


CALIBRATIONS = {
    "a list for a key": '{"schema": "cell.calibration/1", [1]: 2}',
    "deep": "[" * 100_000,
    "deep, but whole": '{"a": ' + "[" * DEEP + "]" * DEEP + "}",
    "10 000 digits": '{"schema": "cell.calibration/1", "x": ' + "9" * 10_000 + "}",
    "not a number": '{"schema": "cell.calibration/1", "x": NaN}',
    "anchors that multiply": bomb(),
    "empty": "",
    "bytes": "\xff\xfe\x00",
}


@pytest.mark.parametrize("kind", CALIBRATIONS)
def test_strange_calibrations(tmp_path: Path, kind: str) -> None:
    (tmp_path / "calibration.json").write_text(CALIBRATIONS[kind], encoding="latin-1")
    with pytest.raises(InputError, match=r"calibration.json"):
        read_calibration(tmp_path / "calibration.json")


POSES = {
    "p.yaml": [bomb(), "notes: &a [*a]\n", "- !!set 7\n", "[" * DEEP, "x: 2026-13-45\n"],
    "p.json": ["[" * DEEP, '{"a": ' + "9" * 10_000 + "}", "[" * 300 + "]" * 300],
    "p.csv": ["x,y\n" + "9" * 5000 + "\n", '"' * 99 + "\n", "1" * 200_000 + "\n"],
    "p.txt": ["\n".join(6 * ["9" * 5000]), "1e999 " * 7 + "\n", "\0\0\0\n"],
}


@pytest.mark.parametrize(("name", "text"), [(n, t) for n in POSES for t in POSES[n]])
def test_strange_poses(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=name):
        read_series(tmp_path / name)


def test_an_array_that_says_it_is_larger_than_its_file(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((4, 4)))
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(data.replace(b"(4, 4), }   ", b"(4, 400000),}"[:12]))
    with pytest.raises(InputError, match=r"a.npy"):
        read_arrays(tmp_path / "a.npy")


def test_an_archive_that_unpacks_to_gigabytes(tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(5):
            archive.writestr(f"{number}.npy", bytes(64 * 2**20))
    with pytest.raises(InputError, match="unpacks to 320 MiB"):
        read_arrays(tmp_path / "a.npz")


# -- pictures ------------------------------------------------------------------------------------


def png(width: int, height: int, depth: int = 1) -> bytes:
    """A PNG whose header says that size, its pixels all black."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        crc = zlib.crc32(kind + data).to_bytes(4, "big")
        return len(data).to_bytes(4, "big") + kind + data + crc

    head = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([depth, 0, 0, 0, 0])
    rows = zlib.compress(bytes(min((width * depth // 8 + 1) * height, 2**20)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


PICTURES = {
    "16384 x 16384 in one bit": (png(16384, 16384), "16384 x 16384 pixels are too many"),
    "over 2^30 pixels": (png(40_000, 40_000), "too many"),
    "over 2^31 on a side": (png(2**31 - 1, 2**31 - 1), "is not an image|too many"),
    "no size": (png(0, 7), "is not an image"),
    "OpenEXR": (b"\x76\x2f\x31\x01\x02\0\0\0" + bytes(200), r"is not an image \(PNG"),
    "Radiance": (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 9 +X 9\n" + bytes(400), "not an im"),
    "a PGM of gigabytes": (b"P5 60000 60000 255\n" + bytes(99), "too many"),
    "a PGM that ends early": (b"P5 600 600 255\n" + bytes(99), "is not an image"),
    "GIF": (b"GIF89a" + bytes(99), r"is not an image \(PNG"),
    "nothing": (b"", "is not an image"),
    "words": (b"this is no picture", "is not an image"),
}


@pytest.mark.parametrize("kind", PICTURES)
def test_strange_pictures(kind: str) -> None:
    data, message = PICTURES[kind]
    with pytest.raises(InputError, match=rf"a.png: .*{message}"):
        decode_picture(data, "a.png")


def test_a_picture_that_is_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.png")
    with pytest.raises(InputError, match="named pipe"):
        read_picture(tmp_path / "a.png")


# -- the program as a whole ----------------------------------------------------------------------

PROGRAM = "from cell.cli import main; main()"


def run(*words: str | Path, before: str = "", **more: object) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", f"{before}\n{PROGRAM}", *map(str, words)]
    return subprocess.run(command, timeout=120, check=False, **more)  # type: ignore[call-overload,no-any-return]


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    model = {"alpha_px": 900.0, "beta_px": 901.0, "u0_px": 320.0, "v0_px": 240.0}
    data = {
        "schema": "cell.calibration/1",
        "image_size_px": [640, 480],
        "solutions": {"zhang_mle": model},
    }
    (tmp_path / "calibration.json").write_text(json.dumps(data))
    return tmp_path / "calibration.json"


@pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 1, 2)])
def test_standard_streams_that_are_closed_from_the_start(
    calibration: Path, tmp_path: Path, closed: tuple[int, ...]
) -> None:
    out = tmp_path / "camera.yaml"
    words = ("export", calibration, "--format", "opencv", "-o", out)
    shell = " ".join(f"{n}>&-" if n else "0<&-" for n in closed)
    command = f'exec "$0" "$@" {shell}'
    done = subprocess.run(
        ["bash", "-c", command, sys.executable, "-c", PROGRAM, *map(str, words)],
        timeout=120, check=False, capture_output=True,
    )  # fmt: skip
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr
    assert out.read_text().startswith("%YAML")


def test_a_full_device_as_standard_output(calibration: Path, tmp_path: Path) -> None:
    words = ("export", calibration, "--format", "opencv")
    with Path("/dev/full").open("wb") as full:
        lost = run(*words, stdout=full, stderr=subprocess.PIPE)
        kept = run(*words, "-o", tmp_path / "a.yaml", stdout=full, stderr=subprocess.PIPE)
        silent = run(*words, "-o", tmp_path / "b.yaml", stdout=full, stderr=full)
    assert lost.returncode == 2
    assert b"standard output does not take the result (No space left" in lost.stderr
    assert (kept.returncode, silent.returncode) == (0, 0)
    assert b"could not be printed: No space left" in kept.stderr
    assert b"Traceback" not in lost.stderr + kept.stderr


def test_a_pipe_that_nobody_reads(calibration: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = run("export", calibration, "--format", "opencv", stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")


def test_an_error_that_nobody_foresaw_is_one_line_and_a_file(tmp_path: Path) -> None:
    broken = "import cell.cli.doctor, cell.cli.app\n"
    broken += "def no(*a, **k): raise ZeroDivisionError('deep inside')\n"
    broken += "cell.cli.app.app = no"
    done = run(
        "doctor", before=broken, capture_output=True, env={**os.environ, "TMPDIR": str(tmp_path)}
    )
    assert done.returncode == 1
    result = done.stderr.decode()
    assert "Traceback" not in result
    assert "an error in this program: ZeroDivisionError: deep inside" in result
    (kept,) = tmp_path.glob("cell-error-*.log")
    assert str(kept) in result
    assert "Traceback" in kept.read_text()
    assert len(result.splitlines()) == 1


def test_an_arm_that_nobody_knows(tmp_path: Path) -> None:
    from cell.devices.factory import simulated_devices
    from cell.storage.files.plan_file import read_plan as read

    configs = Path(__file__).parents[2] / "configs"
    cell = (configs / "ur3-robotiq.cell.yaml").read_text().replace("model: ur3,", "model: kr10,")
    assert "kr10" in cell
    (tmp_path / "ur3-robotiq.cell.yaml").write_text(cell)
    (tmp_path / "p.yaml").write_text((configs / "ur3-robotiq.plan.yaml").read_text())
    with pytest.raises(InputError, match=r"robot.model: .*kr10.* use one of ur3"):
        simulated_devices(read(tmp_path / "p.yaml"))


def test_a_recording_of_an_arm_that_nobody_knows_is_read_without_its_joints(
    recording_folder: Folder, caplog: pytest.LogCaptureFixture
) -> None:
    folder = recording_folder(header=HEADER.replace("ur5e", "kr10"))
    assert "kr10" in (folder / "recording.yaml").read_text()
    assert read_recording(folder).views().robot_model is None
    assert "robot.model kr10 is not known" in caplog.text


@pytest.mark.parametrize("value", ["nan", "1e999", "-inf", "9" * 400, "1/nan", "", "x"])
def test_an_effect_whose_value_is_no_number(value: str) -> None:
    with pytest.raises(InputError, match="is no number"):
        parse_effect(f"focus_breathing:k_px_m2={value}")
