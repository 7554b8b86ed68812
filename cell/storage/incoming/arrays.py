"""NumPy's `.npz` and `.npy`, their sizes known before anything is allocated."""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import Any

from numpy.lib import format as npy
from numpy.typing import NDArray

from cell.errors import InputError
from cell.storage.incoming.limits import JSON_BYTES, MIB, VALUES
from cell.storage.incoming.text import read_bytes

_NAMES = 1000


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a file by their names; one array alone has none.

    Raises
    ------
    InputError
        It cannot be read, is broken, holds Python objects, or has too many numbers.
    """
    data = read_bytes(path, JSON_BYTES)
    try:
        if not zipfile.is_zipfile(io.BytesIO(data)):
            return {"": _array(data, str(path))}
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            unpacked = sum(member.file_size for member in members)
            if unpacked > JSON_BYTES or len(members) > _NAMES:
                raise InputError(
                    f"{path}: unpacks to {unpacked // MIB} MiB in {len(members)} arrays; at most"
                    f" {JSON_BYTES // MIB} MiB in {_NAMES} are read"
                )
            return {
                member.filename.removesuffix(".npy"): _array(
                    archive.read(member), f"{path}: {member.filename}"
                )
                for member in members
            }
    except InputError:
        raise
    except Exception as broken:  # neither zipfile nor NumPy says what a broken file makes it raise
        raise InputError(f"{path}: is no NumPy file: {str(broken)[:200]}") from None


def _array(data: bytes, where: str) -> NDArray[Any]:
    stream = io.BytesIO(data)
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(stream)
    values = math.prod(shape)
    if values > VALUES or values * dtype.itemsize > len(data):
        raise InputError(f"{where}: says it has {values} values, more than are in it or are read")
    stream.seek(0)
    array: NDArray[Any] = npy.read_array(stream, allow_pickle=False)
    return array
