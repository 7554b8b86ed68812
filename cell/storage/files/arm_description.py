"""An arm known by its own description: a URDF beside a cell file or in a recording."""

from __future__ import annotations

import hashlib
from pathlib import Path

from calib.chain.kinematics import UnusableUrdf, adopt, arm_from_urdf
from cell.errors import InputError
from cell.storage.incoming import read_text

_MOST_BYTES = 1 << 24

COPY_NAME = "arm.urdf"
"""Name of the description's copy in a recording."""


def adopt_description(where: str, path: Path, base: str, flange: str) -> str:
    """Read a URDF and make its arm known; returns the name it is known by from now on.

    Parameters
    ----------
    where:
        File and key that name it, for messages.
    path, base, flange:
        The file, and its links that count as base and flange.

    Raises
    ------
    InputError
        There is no such file, or it describes no six-joint arm between these links.
    """
    text = read_text(path, _MOST_BYTES)
    known_by = hashlib.sha256(f"{base}\0{flange}\0{text}".encode()).hexdigest()[:8]
    name = f"{path.stem}@{known_by}"
    try:
        adopt(arm_from_urdf(text, base, flange, name))
    except UnusableUrdf as fault:
        raise InputError(f"{where}: {path} {fault}") from None
    return name
