"""How many views of which kind a plan has."""

from __future__ import annotations

from dataclasses import dataclass

_PARALLEL_SHARE = 0.25
FEWEST_FRAMES, MOST_FRAMES = 8, 200


@dataclass(frozen=True)
class PlanSize:
    """How many views of which kind.

    Attributes
    ----------
    parallel:
        Fronto-parallel views along the distances, for the scale factors.
    varied:
        Tilted views all over the image and the distances.
    seed:
        Of the spread of the tilted candidates.
    by_hand:
        Tilt the near views and leave the far ones flat, see `candidates.varied`.
    """

    parallel: int = 10
    varied: int = 30
    seed: int = 1
    by_hand: bool = False

    @classmethod
    def of(cls, frames: int, seed: int = 1) -> PlanSize:
        """A quarter parallel, the rest tilted."""
        parallel = round(_PARALLEL_SHARE * frames)
        return cls(parallel, frames - parallel, seed)

    @property
    def frames(self) -> int:
        """All views."""
        return self.parallel + self.varied
