"""The questions of `cell init`, in order: what an option has answered already is not asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from calib.mount import Mount
from cell.errors import InputError
from cell.storage.files.board_option import parse_board
from cell.verbs.init.answers import Answers, CameraDriver, Focus, RobotDriver

Given = Mapping[str, Any]


def _always(_given: Given) -> bool:
    return True


def _real_arm(given: Given) -> bool:
    return bool(given["robot"] != "sim")


def _simulated_arm(given: Given) -> bool:
    return not _real_arm(given)


def _real_camera(given: Given) -> bool:
    return bool(given["camera"] != "sim")


def _no_reason(given: Given) -> bool:
    return _real_arm(given) and "no_workspace_because" not in given


def _choice(option: str, choices: tuple[str, ...]) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in choices:
            raise InputError(f"{option} {text}: must be one of {', '.join(choices)}")
        return text

    return read


def _numbers(option: str, count: int, separator: str = ",") -> Callable[[str], tuple[float, ...]]:
    def read(text: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in text.split(separator))
        except ValueError:
            found = ()
        if len(found) != count:
            noun = "a number" if count == 1 else f"{count} numbers separated by `{separator}`"
            raise InputError(f"{option} {text}: must be {noun}")
        return found

    return read


def _number(option: str) -> Callable[[str], float]:
    read = _numbers(option, 1)
    return lambda text: read(text)[0]


def _size(text: str) -> tuple[int, int]:
    width, height = _numbers("--size", 2, "x")(text.lower())
    return int(width), int(height)


def _boxes(text: str) -> dict[str, tuple[float, ...]]:
    """`NAME:x,y,z,x,y,z; NAME:...`, or `none`."""
    if text.strip().lower() == "none":
        return {}
    read = _numbers("--keep-out", 6)
    named = [part.strip().partition(":") for part in text.split(";") if part.strip()]
    if not named or not all(colon and name for name, colon, _ in named):
        raise InputError(f"--keep-out {text}: must be NAME:x,y,z,x,y,z, or none")
    return {name: read(corners) for name, _, corners in named}


@dataclass(frozen=True)
class Question:
    """One answer that a cell file needs.

    Attributes
    ----------
    key, option:
        Field of `Answers`, and the option that gives it.
    prompt, usual:
        What is asked; the answer used where none is given, None where there is no safe one.
    read:
        From text to the field's value; raises `InputError`.
    when:
        Whether it is asked at all, by the answers before it.
    """

    key: str
    option: str
    prompt: str
    usual: str | None
    read: Callable[[str], Any] = str
    when: Callable[[Given], bool] = _always


_CORNERS = "x,y,z,x,y,z of two opposite corners in the robot base, metres"
QUESTIONS = (
    Question("robot", "--robot", "arm (sim, ur, abb)", "sim",
             _choice("--robot", get_args(RobotDriver))),
    Question("model", "--model", "the arm's model, such as ur5e or irb140", None, str, _real_arm),
    Question("model", "--model", "the arm's model", "ur5e", str, _simulated_arm),
    Question("robot_address", "--robot-address", "address of its controller", None, str, _real_arm),
    Question("payload_kg", "--payload-kg", "mass of camera and bracket, kg", None,
             _number("--payload-kg"), _real_arm),
    Question("workspace", "--workspace", f"the box that the arm stays inside: {_CORNERS}", None,
             _numbers("--workspace", 6), _no_reason),
    Question("keep_out", "--keep-out",
             f"what it stays out of, NAME:{_CORNERS}; several separated by `;`, or none", None,
             _boxes, _real_arm),
    Question("camera", "--camera", "camera (sim, gige, genicam, robotiq)", "sim",
             _choice("--camera", get_args(CameraDriver))),
    Question("camera_address", "--camera-address", "its address (the .cti file for genicam)", None,
             str, _real_camera),
    Question("size_px", "--size", "size of its pictures", "2448x2048", _size),
    Question("pixel_size_um", "--pixel-size-um", "size of a pixel, micrometres", "3.45",
             _number("--pixel-size-um")),
    Question("focal_length_mm", "--focal-length-mm", "focal length of the lens, mm", "12",
             _number("--focal-length-mm")),
    Question("focus", "--focus", "focus (auto, manual, motorised, fixed)", "fixed",
             _choice("--focus", get_args(Focus))),
    Question("board", "--board", "board (ROWSxCOLSxSQUARE_M in inner corners, or charuco:...)",
             "7x10x0.025", lambda text: parse_board(text).model_dump()),
    Question("mount", "--mount", "mount (eye_in_hand, eye_to_hand)", "eye_in_hand",
             _choice("--mount", get_args(Mount))),
)  # fmt: skip
_UNASKED: Mapping[str, Callable[[str], Any]] = {
    "name": str,
    "no_workspace_because": str,
    "camera_at": _numbers("--camera-at", 6),
    "board_at": _numbers("--board-at", 6),
    "home_deg": _numbers("--home", 6),
    "distances_m": _numbers("--distances", 2),
}


def interview(options: Mapping[str, str], ask: Callable[[Question], str]) -> Answers:
    """Every answer: from the options where they give it, else by asking.

    Raises
    ------
    InputError
        An answer cannot be read.
    """
    given = {key: read(options[key]) for key, read in _UNASKED.items() if key in options}
    for question in QUESTIONS:
        if question.key in options or question.when(given):
            text = options[question.key] if question.key in options else ask(question)
            given[question.key] = question.read(text)
    return Answers(**given)
