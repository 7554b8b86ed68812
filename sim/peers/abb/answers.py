"""Answers in the envelope of Robot Web Services 1.0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Answer:
    """Status and body of an HTTP answer; bytes are sent as they are, the rest as JSON."""

    status: int
    body: Any = b""
    kind: str | None = None
    """Content type, where it does not follow from the body."""
    headers: tuple[tuple[str, str], ...] = ()


def state(*entries: dict[str, Any]) -> Answer:
    """Return an answer with RWS's envelope."""
    return Answer(200, {"_links": {}, "_embedded": {"_state": list(entries)}})


def error(status: int, code: int, message: str) -> Answer:
    """Return an answer that refuses."""
    return Answer(status, {"_embedded": {"status": {"code": code, "msg": message}}})


DONE = Answer(204)
NOT_ALLOWED = error(403, -1073442809, "operation not allowed in this controller state")


def missing(what: str) -> Answer:
    """Return an answer for something that is not there."""
    return error(404, -1073445865, f"no such resource: {what}")
