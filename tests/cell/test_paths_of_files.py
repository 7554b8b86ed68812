"""Every path that stands in a file stays in the file's own folder, and is of an ordinary file."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from cell.errors import InputError
from cell.storage.files.plan_file import read_plan
from cell.storage.incoming import inside, plain_file, read_bytes
from cell.storage.recording import FrameRecord, RecordingWriter, read_recording
from cell.storage.recording.header import Header, read_header
from cell.verbs.importing.importer import Described, import_source
from cell.verbs.study.kinds import kind_of
from cell.verbs.study.kinds.kind import Task
from tests.cell.plans import CELL, PLAN
from tests.cell.recordings import HEADER, frame_line
from tests.study.studies import study

Folder = Callable[..., Path]
STRANGE = ("", ".", "a/..", "../x", "images/../../x", "/etc/passwd", "a\0b", "C:\\x", "C:x")


@pytest.mark.parametrize("given", STRANGE)
def test_a_path_leads_nowhere_else(tmp_path: Path, given: str) -> None:
    with pytest.raises(InputError, match="key: "):
        inside(tmp_path, given, "key")


def test_a_path_through_symbolic_links_is_judged_by_where_it_ends(tmp_path: Path) -> None:
    (tmp_path / "home" / "real").mkdir(parents=True)
    (tmp_path / "home" / "out").symlink_to(tmp_path)
    (tmp_path / "home" / "loop").symlink_to("loop")
    (tmp_path / "home" / "in").symlink_to("real")
    assert inside(tmp_path / "home", "in/a.png", "key") == tmp_path / "home" / "in" / "a.png"
    for given in ("out/x", "loop/x"):
        with pytest.raises(InputError, match="key: "):
            inside(tmp_path / "home", given, "key")


def test_what_is_no_ordinary_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "named pipe"), (Path("/dev/zero"), "character device"),
                       (tmp_path, "folder")):  # fmt: skip
        with pytest.raises(InputError, match=kind):
            read_bytes(path, 10)
        with pytest.raises(InputError, match=kind):
            plain_file(path)
    with pytest.raises(InputError, match="null"):
        read_bytes(tmp_path / "a\0b", 10)


@pytest.mark.parametrize("image", ["../../victim.png", "images/out/victim.png", "victim.png"])
def test_an_import_writes_only_into_its_own_folder(
    recording_folder: Folder, tmp_path: Path, image: str
) -> None:
    source = recording_folder(
        header=HEADER.replace("images: null", "images: images/"), frames=frame_line(0, image=image)
    )
    (source / "images").mkdir()
    (source / "images" / "out").symlink_to(tmp_path)
    for there in (tmp_path / "victim.png", tmp_path.parent / "victim.png"):
        there.write_text("a picture of somebody else")
    if image == "victim.png":
        (source / image).symlink_to(tmp_path / image)
    with pytest.raises(InputError, match=r"frame 0: image: .* leads out of"):
        import_source(source, tmp_path / "deep" / "down", Described())
    assert not (tmp_path / "deep").exists()
    assert (tmp_path / "victim.png").read_text() == "a picture of somebody else"


def test_a_picture_outside_is_a_rejected_frame_of_a_calibration(
    recording_folder: Folder, tmp_path: Path
) -> None:
    cv2.imwrite(str(tmp_path / "outside.png"), np.zeros((48, 64), np.uint8))
    folder = recording_folder(frames=frame_line(0, image="../outside.png"))
    recording = read_recording(folder)
    with pytest.raises(InputError, match="leads out of"):
        recording.image(recording.frames[0])


@pytest.mark.parametrize("images", ["/tmp/cell-test-elsewhere", "../elsewhere", ".", "a/../.."])
def test_the_pictures_folder_is_the_recordings_own(tmp_path: Path, images: str) -> None:
    (tmp_path / "head").mkdir()
    (tmp_path / "head" / "recording.yaml").write_text(HEADER.replace("null", f"'{images}'"))
    header = read_header(tmp_path / "head")
    with pytest.raises(InputError, match=r"recording.yaml: images: "):
        RecordingWriter.create(tmp_path / "r", header)
    assert not Path("/tmp/cell-test-elsewhere").exists()
    assert not (tmp_path / "elsewhere").exists()
    with pytest.raises(InputError, match=r"recording.yaml: images: "):
        RecordingWriter.resume(tmp_path / "head")
    assert (tmp_path / "head" / "recording.yaml").exists()


def test_going_on_moves_only_pictures_of_its_own(tmp_path: Path) -> None:
    header = _header(tmp_path)
    with RecordingWriter.create(tmp_path / "r", header) as writer:
        writer.append(FrameRecord(frame=0), np.zeros((4, 4), np.uint8))
    images = tmp_path / "r" / "images"
    (images / "holiday.png").write_text("a stranger's")
    (images / "00001.png").write_text("of a frame that was not logged")
    RecordingWriter.resume(tmp_path / "r")[0].close()
    assert sorted(path.name for path in images.iterdir()) == [
        "00000.png",
        "holiday.png",
        "unlogged",
    ]


def test_pictures_set_aside_are_never_overwritten(tmp_path: Path) -> None:
    header = _header(tmp_path)
    RecordingWriter.create(tmp_path / "r", header).close()
    images = tmp_path / "r" / "images"
    for text in ("first", "second", "third"):
        (images / "00001.png").write_text(text)
        (images / "000010.png").write_text(text)
        RecordingWriter.resume(tmp_path / "r")[0].close()
    kept = {path.name: path.read_text() for path in (images / "unlogged").iterdir()}
    assert sorted(kept.values()) == sorted(2 * ["first", "second", "third"])


def tasks_of(folder: Path, content: str) -> Sequence[Task]:
    asked = study(folder, content)
    return kind_of(asked).tasks(asked)


def _header(tmp_path: Path) -> Header:
    (tmp_path / "recording.yaml").write_text(HEADER.replace("null", "images/"))
    return read_header(tmp_path)


@pytest.mark.parametrize("cell", ["../bench.yaml", "/dev/null", "pipe", "folder", "out/bench.yaml"])
def test_a_plan_names_a_cell_of_its_own_folder(tmp_path: Path, cell: str) -> None:
    (tmp_path / "bench.yaml").write_text(CELL)
    (tmp_path / "plans" / "folder").mkdir(parents=True)
    os.mkfifo(tmp_path / "plans" / "pipe")
    (tmp_path / "plans" / "out").symlink_to(tmp_path)
    plan = tmp_path / "plans" / "plan.yaml"
    plan.write_text(PLAN.replace("bench.yaml", cell))
    with pytest.raises(InputError, match=r"relative path|leads out of|not an ordinary file"):
        read_plan(plan)


@pytest.mark.parametrize(
    "content",
    [
        "monte_carlo: {plan: ../small.plan.yaml, seeds: 1}\n",
        "recordings: {folders: ['../*']}\n",
        "recordings: {folders: ['/*']}\n",
        "recordings: {folders: ['out/*']}\n",
    ],
)
def test_a_study_names_what_is_below_it(tmp_path: Path, content: str) -> None:
    (tmp_path / "other" / "r").mkdir(parents=True)
    (tmp_path / "other" / "r" / "recording.yaml").write_text(HEADER)
    home = tmp_path / "home"
    home.mkdir()
    (home / "out").symlink_to(tmp_path / "other")
    with pytest.raises(InputError, match=r"relative path|leads out of"):
        tasks_of(home, content)
