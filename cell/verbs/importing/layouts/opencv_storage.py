"""OpenCV FileStorage (`%YAML:1.0`, XML or JSON with `opencv-matrix` nodes)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2

from cell.verbs.importing.layouts.nested import series_in
from cell.verbs.importing.raw import Series

_MARKS = ("%YAML:1.0", "opencv-matrix", "<opencv_storage>")


def read(path: Path, text: str) -> list[Series]:
    """Every matrix in the storage, as nested data; raises `ValueError` where it is broken."""
    if not any(mark in text for mark in _MARKS):
        return []
    storage = cv2.FileStorage()
    try:
        storage.open(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        data = _content(storage.root())
    except cv2.error as fault:
        raise ValueError(f"is no whole OpenCV FileStorage: {fault.err}") from None
    finally:
        storage.release()
    return series_in(path, data, "OpenCV FileStorage")


def _content(node: Any) -> Any:
    if node.isMap():
        names = node.keys()
        if {"rows", "cols", "dt", "data"} <= set(names):
            return node.mat().tolist()
        return {name: _content(node.getNode(name)) for name in names}
    if node.isSeq():
        return [_content(node.at(k)) for k in range(node.size())]
    if node.isInt():
        return int(node.real())
    return node.string() if node.isString() else node.real()
