"""Plan and cell files written so that people can read them: one view, one pose, one line."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from cell.errors import InputError
from cell.storage.atomic import write_atomically

_ONE_LINE = 4
"""Depth of nesting that still fits a line, with all its values being short."""


def yaml_text(data: Mapping[str, Any], *, comment: str = "") -> str:
    """YAML of plain data; mappings and lists of plain values stand on one line.

    Parameters
    ----------
    data:
        As from a file model's `as_mapping`.
    comment:
        Put above, without the `#`.
    """
    yaml = YAML(typ="rt")
    yaml.width = 4096
    yaml.representer.add_representer(type(None), _null)
    stream = io.StringIO()
    stream.writelines(f"# {line}\n" for line in comment.splitlines())
    yaml.dump(_styled(data), stream)
    return stream.getvalue()


def check_new(path: Path) -> None:
    """Raise `InputError` where a file of that name is there already."""
    if path.exists():
        raise InputError(f"{path}: is there already and is not overwritten; give another -o")


def write_new(path: Path, text: str) -> None:
    """Write a file that is not there yet; raises `InputError`."""
    write_atomically(path, text, replace=False)


def _null(representer: Any, value: None) -> Any:
    return representer.represent_scalar("tag:yaml.org,2002:null", "null")


def _styled(value: Any) -> Any:
    if isinstance(value, Mapping):
        mapping = CommentedMap({key: _styled(item) for key, item in value.items()})
        if all(_flat(item) for item in value.values()) and len(value) <= _ONE_LINE:
            mapping.fa.set_flow_style()
        return mapping
    if isinstance(value, Sequence) and not isinstance(value, str):
        items = CommentedSeq([_styled(item) for item in value])
        if all(not isinstance(item, Mapping | list) for item in value):
            items.fa.set_flow_style()
        for item in items:
            if isinstance(item, CommentedMap):
                item.fa.set_flow_style()
        return items
    return value


def _flat(value: Any) -> bool:
    if isinstance(value, Mapping):
        return False
    return not isinstance(value, list) or all(not isinstance(v, Mapping | list) for v in value)
