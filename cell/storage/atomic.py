"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from cell.errors import InputError
from cell.storage.incoming.paths import plain_file, reason


@contextmanager
def atomic_file(
    path: Path, *, replace: bool = True, newline: str | None = None
) -> Iterator[TextIO]:
    """A text file to write into, which stands at `path` only when all of it is on the disk.

    Whatever instant the process dies at, `path` is what it was before or the whole new file.

    Parameters
    ----------
    path:
        The file; its folder must exist.
    replace:
        Whether it takes the place of a file of that name.
    newline:
        As `open` takes it.

    Raises
    ------
    InputError
        It cannot be written; a file is there and is not to be replaced; something else than an
        ordinary file is there.
    """
    if plain_file(path) and not replace:
        raise InputError(f"{path}: is there already and is not overwritten; give another -o")
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            partial.unlink(missing_ok=True)  # of a process that died; or a link, never followed
            with partial.open("x", encoding="utf-8", newline=newline) as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            _put(partial, path, replace=replace)
        finally:
            partial.unlink(missing_ok=True)
    except FileExistsError:
        raise InputError(
            f"{path}: is there already and is not overwritten; give another -o"
        ) from None
    except (OSError, ValueError) as fault:
        raise InputError(f"{path}: cannot be written: {reason(fault)}; give another -o") from None


def write_atomically(path: Path, text: str, *, replace: bool = True) -> None:
    """Write a text file, whole or not at all; raises `InputError` as `atomic_file` does."""
    with atomic_file(path, replace=replace) as file:
        file.write(text)


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on the disk; raises `OSError`."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _put(partial: Path, path: Path, *, replace: bool) -> None:
    if replace:
        partial.replace(path)
    else:
        _link_new(partial, path)
    sync_folder(path.parent)


def _link_new(partial: Path, path: Path) -> None:
    """Refuse where a file is; a rename would take its place."""
    try:
        os.link(partial, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        if path.exists():
            raise FileExistsError from None
        partial.replace(path)
