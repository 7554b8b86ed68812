"""Writes docs/reference/: every verb, every key of the files, every name of the Python API.

``python tools/reference_pages.py`` writes them anew from the code; tests/docs keeps them in step.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import indent
from typing import Any

from pydantic import BaseModel
from typer.main import get_command

import calib
from cell.cli.app import app
from cell.storage.files.schemas import MODELS
from cell.storage.recording import FrameRecord, Header

FOLDER = Path(__file__).parents[1] / "docs" / "reference"
_MADE = "Made by `tools/reference_pages.py` from the code."


def _ending(schema: str) -> str:
    """What people write is YAML, what the program writes is JSON."""
    by_people = ("cell", "plan", "study")
    return ".yaml" if schema.partition(".")[0] in by_people else ".json"


_FILES: dict[str, type[BaseModel]] = {
    "recording.yaml": Header,
    "frames.jsonl": FrameRecord,
    **{name.replace(".schema.json", _ending(name)): model for name, model in MODELS.items()},
}


def pages() -> dict[str, str]:
    """File name to text."""
    return {"verbs.md": _verbs(), "files.md": _files(), "python.md": _python()}


def _verbs() -> str:
    parts = ["# Verbs", f"{_MADE} `cell VERB --help` says the same."]
    for name, verb in get_command(app).commands.items():  # type: ignore[attr-defined]
        parts += [f"## cell {name}", verb.help or "", f"    {_usage(name, verb)}"]
        rows = [
            f"| {_flags(p)} | {_cell(p.help or '')} | {_default(p)} |"
            for p in verb.params
            if p.name != "help"
        ]
        parts.append("\n".join(["| | does | default |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def _usage(name: str, verb: Any) -> str:
    given = [p for p in verb.params if p.param_type_name == "argument"]
    names = [(p.name.upper().strip("_"), p.required) for p in given]
    usage = [word if required else f"[{word}]" for word, required in names]
    return " ".join(["cell", name, *usage, "[OPTIONS]"])


def _flags(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return f"`{parameter.name.upper().strip('_')}`"
    return ", ".join(f"`{flag}`" for flag in (*parameter.opts, *parameter.secondary_opts))


def _default(parameter: Any) -> str:
    value = parameter.default
    if parameter.required:
        return "required"
    if callable(value) or value is None or value is False or value == "":
        return ""
    return f"`{getattr(value, 'value', value)}`"


def _files() -> str:
    parts = [
        "# Files, key by key",
        f"{_MADE} Lengths are metres, angles radians unless a key's name says another unit. The "
        "same as JSON Schema, for editors, stands in `cell/storage/schemas/`.",
    ]
    for name, model in _FILES.items():
        schema = model.model_json_schema(by_alias=True)
        parts += [f"## {name}", *_object(schema)]
        for part, of in schema.get("$defs", {}).items():
            if "properties" in of:
                parts += [f"### {name}: {part}", *_object(of)]
    return "\n\n".join(parts) + "\n"


def _object(schema: Mapping[str, Any]) -> Iterator[str]:
    yield schema.get("description", "")
    required = schema.get("required", ())
    rows = [
        f"| `{key}` | {_cell(_type(of))} | {_key_default(key, of, required)}"
        f" | {_cell(of.get('description', ''))} |"
        for key, of in schema["properties"].items()
    ]
    yield "\n".join(["| key | is | default | meaning |", "|---|---|---|---|", *rows])


def _key_default(key: str, of: Mapping[str, Any], required: Any) -> str:
    if key in required:
        return "required"
    value = of.get("default")
    if value is None or isinstance(value, dict | list):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _type(of: Mapping[str, Any]) -> str:
    if "$ref" in of:
        return str(of["$ref"]).rpartition("/")[2]
    if "const" in of:
        return f"`{of['const']}`"
    if "enum" in of:
        return ", ".join(f"`{value}`" for value in of["enum"])
    options = of.get("anyOf") or of.get("oneOf")
    if options:
        return " or ".join(dict.fromkeys(_type(option) for option in options))
    return _plain_type(of)


def _plain_type(of: Mapping[str, Any]) -> str:
    kind = of.get("type", "anything")
    if kind == "array":
        items = of.get("prefixItems")
        if items:
            return f"{len(items)} × {_type(items[0])}"
        return f"list of {_type(of.get('items', {}))}"
    if kind == "object" and isinstance(of.get("additionalProperties"), Mapping):
        return f"names to {_type(of['additionalProperties'])}"
    return str(kind) + _bounds(of)


def _bounds(of: Mapping[str, Any]) -> str:
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    return "".join(f" {sign} {of[key]:g}" for key, sign in signs.items() if key in of)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _python() -> str:
    parts = [
        "# Python",
        f"{_MADE} `from calib import ...`; [ten lines](../python-api.md) to begin with. Shapes are "
        "in brackets: N views, M corners, K columns of optics.",
    ]
    for name in calib.__all__:
        found = getattr(calib, name)
        parts.append(f"## {name}")
        if not callable(found):
            parts.append(indent(", ".join(found), "    "))
            continue
        parts.append(indent(f"{name}{_signature(found)}", "    "))
        parts.append(_documented(found))
        if inspect.isclass(found):
            parts += _methods(found)
    return "\n\n".join(parts) + "\n"


def _signature(found: Any) -> str:
    if inspect.isclass(found) and issubclass(found, Exception):
        return ""
    names = [str(p).partition(":")[0] for p in inspect.signature(found).parameters.values()]
    return f"({', '.join(names)})"


def _documented(found: Any) -> str:
    return f"```text\n{inspect.getdoc(found) or ''}\n```"


def _methods(owner: Any) -> Iterator[str]:
    for name, method in vars(owner).items():
        plain = method.__func__ if isinstance(method, classmethod) else method
        if name.startswith("_") or not (inspect.isfunction(plain) or isinstance(plain, property)):
            continue
        shown = "" if isinstance(plain, property) else _signature(getattr(owner, name))
        yield f"### {owner.__name__}.{name}"
        yield indent(f"{name}{shown}", "    ")
        yield _documented(plain)


def write_all() -> None:
    """Write every page."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_all()
