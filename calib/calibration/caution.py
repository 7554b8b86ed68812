"""One thing that whoever uses a calibration must know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Part = Literal["camera", "hand_eye"]


@dataclass(frozen=True)
class Caution:
    """One thing that whoever uses the calibration must know.

    Attributes
    ----------
    what, where, remedy:
        As text: what is wrong, in which frames or files, what to do.
    undetermined:
        Parts of the answer that the data do not determine.
    """

    what: str
    where: str
    remedy: str
    undetermined: tuple[Part, ...] = ()
