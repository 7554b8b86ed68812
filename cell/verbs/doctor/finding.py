"""One thing the doctor looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """What was looked at, what was found, how to mend it.

    Attributes
    ----------
    name:
        What was looked at.
    ready:
        Whether it is as it should be.
    needed:
        Whether this cell cannot run without it.
    found:
        What was found, as text.
    mend:
        What to do where it is not ready.
    """

    name: str
    ready: bool
    found: str
    mend: str = ""
    needed: bool = True

    @property
    def blocks(self) -> bool:
        """Whether it stands in the way."""
        return self.needed and not self.ready

    def line(self) -> str:
        """The finding as one line for people."""
        mark = "ok  " if self.ready else ("FAIL" if self.needed else "-   ")
        mend = f" -> {self.mend}" if self.mend and not self.ready else ""
        return f"{mark} {self.name}: {self.found}{mend}"
