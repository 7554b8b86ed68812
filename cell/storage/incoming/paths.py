"""Paths that stand in a file: relative, inside the file's own folder, of plain files."""

from __future__ import annotations

import stat
from pathlib import Path, PureWindowsPath

from cell.errors import InputError

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISBLK, "a block device"),
    (stat.S_ISCHR, "a character device"),
)


def inside(folder: Path, given: str, where: str) -> Path:
    """The file or folder that a path in a file of `folder` means; it need not exist.

    Parameters
    ----------
    folder:
        Of the file that holds the path.
    given:
        The path as it stands there.
    where:
        Its place, for the message: file and key, or frame.

    Raises
    ------
    InputError
        It is absolute, leads out of the folder, also by a symbolic link, or is the folder itself.
    """
    if not given or "\0" in given or Path(given).is_absolute() or PureWindowsPath(given).drive:
        raise InputError(f"{where}: {given[:200]!r} is no relative path; paths count from {folder}")
    try:
        home = folder.resolve()
        target = (home / given).resolve()
    except (OSError, RuntimeError) as fault:
        raise InputError(f"{where}: {given[:200]!r} cannot be followed: {fault}") from None
    if target == home or not target.is_relative_to(home):
        raise InputError(
            f"{where}: {given[:200]!r} leads out of {folder} (to {target}). What a file names must"
            " stand in its own folder, symbolic links resolved: copy it there."
        )
    return folder / given


def plain_file(path: Path) -> bool:
    """Whether an ordinary file is there; False where nothing is.

    Raises
    ------
    InputError
        Something else is there (a folder, a named pipe, a device), or it cannot be looked at.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    except (OSError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read: {reason(fault)}") from None
    check_plain(path, mode)
    return True


def check_plain(path: Path, mode: int) -> None:
    """Raise `InputError` where `mode`, of `os.stat`, is not that of an ordinary file."""
    if not stat.S_ISREG(mode):
        kind = next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")
        raise InputError(f"{path}: is {kind}, not an ordinary file; only those are read")


def reason(fault: Exception) -> str:
    """Why the system refused a path."""
    return (fault.strerror if isinstance(fault, OSError) else None) or str(fault)
