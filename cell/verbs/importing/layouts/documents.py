"""JSON and YAML: MoveIt and easy_handeye samples, ROS messages, lists and mappings of any tool.

MoveIt writes two transforms a sample, `effector_wrt_world` and `object_wrt_sensor`, of sixteen
numbers row by row; easy_handeye `robot` and `tracking`; `ros topic echo` one document a message.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cell.errors import InputError
from cell.storage.files.yaml_model import load_yaml_documents
from cell.storage.incoming import check_values, parse_json
from cell.verbs.importing.layouts.nested import series_in
from cell.verbs.importing.raw import Series


def read_json(path: Path, text: str) -> list[Series]:
    """One JSON value, or one a line; raises `InputError` where it is broken."""
    try:
        data = parse_json(text, str(path), finite=False)
    except InputError:
        lines = [line for line in text.splitlines() if line.strip()]
        if len(lines) < 2 or not lines[0].lstrip().startswith("{"):
            raise
        data = [parse_json(line, f"{path}:{n}", finite=False) for n, line in enumerate(lines, 1)]
    return series_in(path, data, _tool(data) or "JSON")


def read_yaml(path: Path, text: str) -> list[Series]:
    """One YAML document or several; raises `InputError` where they are broken."""
    documents = [d for d in load_yaml_documents(text, path) if d is not None]
    check_values(documents, str(path), finite=False)
    data = documents[0] if len(documents) == 1 else documents
    several = "ROS messages" if len(documents) > 1 else "YAML"
    return series_in(path, data, _tool(data) or several)


def _tool(data: Any) -> str | None:
    """The tool whose words the data uses."""
    if isinstance(data, dict):
        inner = next((v for v in data.values() if isinstance(v, list) and v), None)
        return _tool(inner)
    if isinstance(data, list) and data and isinstance(data[0], dict):
        keys = set(data[0])
        if {"effector_wrt_world", "object_wrt_sensor"} <= keys:
            return "MoveIt hand-eye samples"
        if {"robot", "tracking"} <= keys:
            return "easy_handeye samples"
    return None
