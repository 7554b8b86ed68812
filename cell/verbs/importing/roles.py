"""What a key's words say its numbers are of: the arm's flange, the board, or joint angles."""

from __future__ import annotations

import re

from cell.verbs.importing.raw import Role

_OTHER = re.compile(
    r"speed|veloc|force|torque|wrench|current|accel|twist|gain|sigma|covarian|intrinsic|"
    r"distor|dist_coeff|camera_matrix|_qdd?$|^qdd?$|home|limits?$|target_(?:tcp|q|pose)"
)
_JOINTS = re.compile(
    r"joint|(?:^|_)q(?:$|_(?!uat))|^[aj]$|axes|axis_?angles|configuration|(?:^|_)angles$"
)
_BOARD = re.compile(
    r"object|target|board|tracking|marker|aruco|apriltag|chess|pattern|wrt_sensor|"
    r"(?:^|_)tag|2cam|in_cam|cam(?:era)?_(?:t|from|pose|to)|^cam(?:era)?$|optical|extrinsic"
)
_FLANGE = re.compile(
    r"effector|robot|gripper|flange|tool|tcp|hand|eef?|(?:^|_)arm|base|world|tip|pose"
)


def role_of(key: str) -> Role:
    """What the words of a key say; `flange` where they say nothing else.

    Only the innermost key is asked first: `robot.joints` is of joints.
    """
    for level in reversed([part for part in re.split(r"[.\[\]#]+", key.lower()) if part]):
        if _OTHER.search(level):
            return "other"
        if _JOINTS.search(level):
            return "joints"
        if _BOARD.search(level):
            return "board"
        if _FLANGE.search(level):
            return "flange"
    return "flange"
