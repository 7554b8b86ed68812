"""Where numba keeps compiled code, and a word before the wait while it is made.

The first use on a machine compiles; later ones load what was kept beside the code or, where that
folder is read-only, in the user's cache. Where neither can be written numba would refuse to start,
so a folder for temporary files serves.

numba compiles a function anew when its own file has changed, and not when the file of one that it
calls has. After an upgrade the old physics would go on inside of what was kept: so everything kept
is forgotten when any file with compiled code is another one than before.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
VERBS = ("run", "bootstrap", "plan", "simulate", "calibrate", "diagnose", "verify", "study")
"""Those that cannot do without compiled code."""

_CODE = Path(__file__).parents[1] / "calib"
_ROOMS = (_CODE, _CODE.with_name("sim"))
_MARK = "calibration-cell.kernels"
_KEPT = "accumulate._accumulate-*.nbi"


def places() -> list[Path]:
    """Where numba would keep compiled code, in the order in which it looks for a place."""
    given = os.environ.get(VARIABLE)
    return [Path(given)] if given else [_CODE, Path.home() / ".cache"]


def writable(place: Path) -> bool:
    """Whether a folder can be written, or made."""
    there = next(folder for folder in (place, *place.parents) if folder.exists())
    return there.is_dir() and os.access(there, os.W_OK)


def prepare(arguments: Sequence[str]) -> None:
    """See to a place for compiled code, and say so when this call will have to wait for it.

    To be called before anything compiled is imported; `arguments` are the command line's.
    """
    if VARIABLE not in os.environ and not any(writable(place) for place in places()):
        own = _own_folder()
        if own is not None:
            os.environ[VARIABLE] = str(own)
    forget_stale()
    asked = next((word for word in arguments if word in VERBS), None)
    helps = {"-h", "--help"} & set(arguments)
    if asked is not None and not helps and not _kept():
        sys.stderr.write(
            "first use here: compiling for this processor, once, some twenty seconds\n"
        )
        sys.stderr.flush()


def forget_stale() -> None:
    """Forget what was compiled from other files than those that are here now."""
    files = (path for room in _ROOMS for path in sorted(room.rglob("*.py")))
    code = {path: text for path in files if b"njit" in (text := path.read_bytes())}
    now = hashlib.sha256(b"".join(code.values())).hexdigest()
    changed = max(path.stat().st_mtime for path in code)
    for folder in _folders():
        mark = folder / _MARK
        with contextlib.suppress(OSError):
            marked = mark.is_file()
            if marked and mark.read_text(encoding="ascii") == now:
                continue
            folder.mkdir(parents=True, exist_ok=True)
            for kept in (k for path in code for k in folder.rglob(f"{path.stem}.*.nbi")):
                # without a mark, tests or a program may have compiled what is here now
                if marked or kept.stat().st_mtime < changed:
                    kept.unlink(missing_ok=True)
            mark.write_text(now, encoding="ascii")


def _kept() -> bool:
    return any(next(folder.rglob(_KEPT), None) is not None for folder in _folders())


def _folders() -> list[Path]:
    """Where numba keeps compiled code now: beside the code, if it can be written there."""
    if VARIABLE in os.environ:
        return [Path(os.environ[VARIABLE])]
    return list(_ROOMS) if writable(_CODE) else [Path.home() / ".cache" / "numba"]


def _own_folder() -> Path | None:
    """A folder that nobody else can write: what is kept there is run."""
    folder = Path(tempfile.gettempdir()) / f"calibration-cell-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    safe = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    return folder if safe and not found.st_mode & 0o077 else None
