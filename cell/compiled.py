"""Where numba keeps compiled code, and a word before the wait while it is made.

The first use on a machine compiles; later ones load what was kept beside the code or, where that
folder is read-only, in the user's cache. Where neither can be written numba would refuse to start,
so a folder for temporary files serves.

numba compiles a function anew when its own file has changed, and not when the file of one that it
calls has. After an upgrade the old physics would go on inside of what was kept: so everything kept
is forgotten when any file with compiled code is another one than before.

numba gives every signature of a function a numbered file and keeps the numbers in an index. Two
processes that compile different signatures at once take the same number: the index of the one then
points to the machine code of the other. So they write in turn, and what is forgotten goes whole,
index and machine code.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

VARIABLE = "NUMBA_CACHE_DIR"
VERBS = (
    "run", "bootstrap", "plan", "simulate", "calibrate", "diagnose", "verify", "study", "compare",
    "import",
)  # fmt: skip
"""Those that may use compiled code."""

_CODE = Path(__file__).parents[1] / "calib"
_ROOMS = (_CODE, _CODE.with_name("sim"))
_MARK = "calibration-cell.kernels"
_LOCK = "calibration-cell.lock"
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
    helps = {"-h", "--help"} & set(arguments)
    if helps or not any(word in VERBS for word in arguments):
        return
    write_in_turn()
    if not _kept():
        announce_first_compilation()


def announce_first_compilation() -> None:
    """Say once why it takes so long, when numba begins to compile and not before."""
    from numba.core import event as numba_event

    event: Any = numba_event  # without types

    class Announcer(numba_event.Listener):
        def on_start(self, _event: object) -> None:
            event.unregister("numba:compile", self)
            sys.stderr.write(
                "first use here: compiling for this processor, once, some twenty seconds\n"
            )
            sys.stderr.flush()

        def on_end(self, _event: object) -> None:
            """Nothing to say."""

    event.register("numba:compile", Announcer())


def forget_stale() -> None:
    """Forget what was compiled from other files than those that are here now."""
    files = (path for room in _ROOMS for path in sorted(room.rglob("*.py")))
    code = {path: text for path in files if b"njit" in (text := path.read_bytes())}
    now = hashlib.sha256(b"".join(code.values())).hexdigest()
    changed = max(path.stat().st_mtime for path in code)
    for folder in _folders():
        mark = folder / _MARK
        with contextlib.suppress(OSError):
            if _says(mark, now):
                continue
            folder.mkdir(parents=True, exist_ok=True)
            with _alone_in(folder):
                if not _says(mark, now):
                    _forget(folder, code, changed if not mark.is_file() else None)
                    mark.write_text(now, encoding="ascii")


def _says(mark: Path, now: str) -> bool:
    return mark.is_file() and mark.read_text(encoding="ascii") == now


def _forget(folder: Path, code: Iterable[Path], older_than: float | None) -> None:
    """Remove what was compiled from these files, machine code first.

    Without a mark, tests or a program may have compiled what is here now: only what is
    `older_than` the code goes then.
    """
    for path in code:
        for index in folder.rglob(f"{path.stem}.*.nbi"):
            if older_than is None or index.stat().st_mtime < older_than:
                for machine_code in index.parent.glob(f"{index.stem}.*.nbc"):
                    machine_code.unlink(missing_ok=True)
                index.unlink(missing_ok=True)


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until nobody else writes compiled code to the folder."""
    descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def write_in_turn() -> None:
    """Let numba read an index, take a number and write both files with nobody else at it."""
    from numba.core import caching

    files: Any = caching.IndexDataCacheFile
    save = files.save
    if save.__module__ == __name__:
        return

    def save_alone(self: Any, key: Any, data: Any) -> None:
        with _alone_in(Path(self._cache_path)):
            save(self, key, data)

    files.save = save_alone


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
