"""YAML files read into pydantic models, with file, line and column of every error."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from cell.errors import InputError
from cell.storage.incoming import check_text, check_values, read_text
from cell.storage.incoming.limits import YAML_BYTES

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[int | str, ...]


def read_model(path: Path, model: type[Model], *, schema: str) -> Model:
    """Read a YAML file as `model`.

    Parameters
    ----------
    path:
        The file.
    model:
        The pydantic model it must fit.
    schema:
        What its `schema:` key must say, such as ``cell.plan/1``.

    Raises
    ------
    InputError
        The file cannot be read or does not fit; the message lists all errors, one a line, as
        ``file:line:column: key.path: message (got value)``.
    """
    data = read_mapping(path)
    check_schema(path, data, schema)
    return parse_model(path, data, model)


def parse_model(path: Path, data: CommentedMap, model: type[Model]) -> Model:
    """Fit already read YAML to `model`; errors as in `read_model`."""
    try:
        return model.model_validate(data)
    except ValidationError as invalid:
        known = sorted(_field_names(model))
        reported = sorted(_placed_error(path, data, error, known) for error in invalid.errors())
        raise InputError("\n".join(dict.fromkeys(line for _, line in reported))) from None


def read_mapping(path: Path) -> CommentedMap:
    """Read a YAML file whose top level is a mapping, keeping line and column of every key."""
    text = read_text(path, YAML_BYTES)
    check_text(text, path)
    with _input_errors(path):
        data = YAML(typ="rt", pure=True).load(text)
    if not isinstance(data, CommentedMap):
        found = "is empty" if data is None else f"holds a {type(data).__name__}"
        raise InputError(f"{path}: {found}, expected `key: value` lines at its top level")

    def place(location: Location) -> str:
        line, column = position_of(data, location)
        return f"{path}:{line}:{column}: {'.'.join(str(part) for part in location)}"

    check_values(data, place)
    return data


def load_yaml_documents(text: str, path: Path) -> list[Any]:
    """The YAML documents of a text, in plain values; raises `InputError`."""
    with _input_errors(path):
        return list(YAML(typ="safe", pure=True).load_all(text))


@contextmanager
def _input_errors(path: Path) -> Iterator[None]:
    """Turn whatever the YAML reader raises into `InputError`."""
    try:
        yield
    except InputError:
        raise
    except YAMLError as broken:
        raise InputError(_yaml_fault(path, broken)) from None
    except RecursionError:
        raise InputError(f"{path}: is nested too deeply") from None
    except Exception as broken:  # a tag on what it does not fit: the reader's errors have no bound
        reported = str(broken).partition("\n")[0][:200] or type(broken).__name__
        raise InputError(f"{path}: cannot be read as YAML: {reported}") from None


def check_schema(path: Path, data: CommentedMap, schema: str) -> None:
    """Refuse a file of another kind or from a newer version of this program."""
    found = data.get("schema")
    line, column = position_of(data, ("schema",))
    where = f"{path}:{line}:{column}: schema"
    if found is None:
        raise InputError(f"{path}:1:1: schema: is missing; the first line must be `{schema}`")
    if found == schema:
        return
    kind, _, version = schema.partition("/")
    found_kind, _, found_version = str(found).partition("/")
    if found_kind != kind:
        raise InputError(f"{where}: expected {schema} (got {found}); is this the right file?")
    if found_version.isdecimal() and int(found_version) > int(version):
        raise InputError(
            f"{where}: {found} was written by a newer version of this program, which reads"
            f" {kind} up to {version}. Update this program."
        )
    raise InputError(f"{where}: expected {schema} (got {found})")


def plain(value: Any) -> Any:
    """The same value in plain dicts, lists and scalars, without YAML's line numbers."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    for kind in (bool, int, float, str):
        if isinstance(value, kind):
            return kind(value)
    return value


def _yaml_fault(path: Path, broken: YAMLError) -> str:
    mark = getattr(broken, "problem_mark", None)
    place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
    problem = getattr(broken, "problem", None) or str(broken).splitlines()[0]
    return f"{place}: is not valid YAML: {problem}"


def _placed_error(
    path: Path, data: CommentedMap, error: ErrorDetails, known: list[str]
) -> tuple[tuple[int, int], str]:
    """Where an error stands, and its line for the operator."""
    location = _real_location(data, error["loc"], missing=error["type"] == "missing")
    line, column = position_of(data, location)
    name = ".".join(str(part) for part in location) or "(whole file)"
    return (line, column), f"{path}:{line}:{column}: {name}: {_message(error, known)}"


def _message(error: ErrorDetails, known: list[str]) -> str:
    kind, key = error["type"], str(error["loc"][-1]) if error["loc"] else ""
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        close = difflib.get_close_matches(key, known, n=1)
        return "is not a known key" + (f"; did you mean `{close[0]}`?" if close else "")
    text = error["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    if isinstance(error["input"], Mapping) or (kind == "value_error" and not key):
        return text
    shown = repr(plain(error["input"]))
    return f"{text} (got {shown if len(shown) <= 60 else shown[:57] + '...'})"


def _real_location(data: Any, location: Location, *, missing: bool) -> Location:
    """Pydantic's location without the tags it puts in for the members of a union.

    Only a key that is missing (the last part) is not in the data either.
    """
    real: list[int | str] = []
    for depth, part in enumerate(location):
        inside = _has(data, part)
        if inside:
            data = data[part]
        if inside or (missing and depth == len(location) - 1):
            real.append(part)
    return tuple(real)


def position_of(data: Any, location: Location) -> tuple[int, int]:
    """One-based line and column of a key, or of the nearest enclosing one that exists."""
    line, column = data.lc.line, data.lc.col
    for part in location:
        if not _has(data, part):
            break
        known = getattr(getattr(data, "lc", None), "data", None) or {}
        if part in known:  # what a merge key brought in has no place of its own
            mapping = isinstance(data, CommentedMap)
            line, column = data.lc.key(part) if mapping else data.lc.item(part)
        data = data[part]
    return line + 1, column + 1


def _has(data: Any, part: int | str) -> bool:
    if isinstance(data, Mapping):
        return part in data
    return isinstance(data, list) and isinstance(part, int) and part < len(data)


def _field_names(model: type[BaseModel]) -> Iterator[str]:
    schema = model.model_json_schema()
    for definition in (schema, *schema.get("$defs", {}).values()):
        yield from definition.get("properties", {})
