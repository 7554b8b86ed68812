"""Whether what the program needs is installed on this machine."""

from __future__ import annotations

import importlib
import platform
from importlib.metadata import PackageNotFoundError, version

from cell.compiled import places, writable
from cell.storage.files.camera_file import GigeCamera
from cell.storage.files.cell_file import CellFile
from cell.verbs.doctor.finding import Finding
from cell.verbs.study.extra import MEND as STUDY_MEND
from cell.verbs.study.extra import PACKAGES as STUDY_PACKAGES
from drivers.aravis_network import receive_buffer_hint, receive_buffer_limit_bytes

_ALWAYS = (
    "numpy",
    "scipy",
    "numba",
    "opencv-python-headless",
    "pillow",
    "pydantic",
    "ruamel.yaml",
    "starlette",
    "uvicorn",
)
_OF_DRIVER = {
    "ur": ("ur-rtde", "pip install 'calibration-cell[ur]'"),
    "abb": ("abb-motion-program-exec", "pip install 'calibration-cell[abb]'"),
    "genicam": ("harvesters", "pip install 'calibration-cell[genicam]'"),
}
_ARAVIS_MEND = (
    "sudo apt-get install --no-install-recommends python3-gi gir1.2-aravis-0.8, and make the"
    " virtual environment with --system-site-packages"
)


def installed(cell: CellFile | None) -> list[Finding]:
    """Packages and limits; those that only other cells need are named and do not block."""
    python = Finding("Python", True, platform.python_version())
    needed = [_package(name, "pip install calibration-cell") for name in _ALWAYS]
    studies = [_package(name, STUDY_MEND, needed=False) for name in STUDY_PACKAGES]
    return [python, *needed, _compiled(), *_drivers(cell), *_gige(cell), *studies]


def _compiled() -> Finding:
    """A place for compiled code."""
    known = places()
    place = next((place for place in known if writable(place)), None)
    return Finding(
        "numba cache",
        place is not None,
        f"{' and '.join(map(str, known))} cannot be written" if place is None else str(place),
        "export NUMBA_CACHE_DIR=/path/you/may/write; without it all is compiled anew after a boot",
    )


def _package(name: str, mend: str, *, needed: bool = True) -> Finding:
    try:
        return Finding(name, True, version(name), needed=needed)
    except PackageNotFoundError:
        return Finding(name, False, "is not installed", mend, needed=needed)


def _drivers(cell: CellFile | None) -> list[Finding]:
    named = set() if cell is None else {cell.robot.driver, cell.camera.driver}
    return [
        _package(name, mend, needed=driver in named) for driver, (name, mend) in _OF_DRIVER.items()
    ]


def _gige(cell: CellFile | None) -> list[Finding]:
    needed = cell is not None and isinstance(cell.camera, GigeCamera)
    return [_aravis(needed), _socket_buffer(cell if needed else None)]


def _aravis(needed: bool) -> Finding:
    try:
        gi = importlib.import_module("gi")
        gi.require_version("Aravis", "0.8")
        importlib.import_module("gi.repository.Aravis")
    except (ImportError, ValueError) as missing:
        return Finding("Aravis (GigE Vision)", False, str(missing), _ARAVIS_MEND, needed=needed)
    return Finding("Aravis (GigE Vision)", True, f"PyGObject {gi.__version__}", needed=needed)


def _socket_buffer(cell: CellFile | None) -> Finding:
    limit = receive_buffer_limit_bytes()
    found = "unknown" if limit is None else f"{limit} bytes"
    hint = None if cell is None else receive_buffer_hint(cell.camera.width * cell.camera.height)
    return Finding("socket buffer limit", hint is None, found, hint or "", needed=False)
