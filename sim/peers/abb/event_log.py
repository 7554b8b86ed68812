"""The controller's event log, newest entry first."""

from __future__ import annotations

import time
from typing import Any

_MOTION_PROGRAM = 80003


class EventLog:
    """Entries as RWS gives them."""

    def __init__(self) -> None:
        self._entries: list[dict[str, Any]] = []
        self.add(1, "System started")

    def add(self, kind: int, *arguments: str) -> None:
        """Write an entry; `kind` is 1 for information, 2 for a warning, 3 for an error."""
        number = len(self._entries) + 1
        self._entries.insert(
            0,
            {
                "_type": "elog-message-li",
                "_title": f"/rw/elog/0/{number}",
                "msgtype": str(kind),
                "code": str(_MOTION_PROGRAM),
                "tstamp": time.strftime("%Y-%m-%d T  %H:%M:%S"),
                "title": arguments[0],
                "desc": " ".join(arguments),
                "conseqs": "",
                "causes": "",
                "actions": "",
                "argc": str(len(arguments)),
                "argv": [{"type": "string", "value": text} for text in arguments],
            },
        )

    def entries(self) -> list[dict[str, Any]]:
        """Return a copy, newest first."""
        return list(self._entries)
