"""What is asked of a plan, and how many views that takes."""

from __future__ import annotations

from dataclasses import dataclass

from cell.errors import InputError
from cell.storage.files.cell_file import CellFile
from cell.verbs.plan.candidate_pool import CandidatePool
from cell.verbs.plan.size import FEWEST_FRAMES, MOST_FRAMES, PlanSize

_USUAL_FRAMES = 40


@dataclass(frozen=True)
class Requirements:
    """As it stands on the command line; None where nothing was given.

    Attributes
    ----------
    frames, parallel, varied:
        How many views in all, and of either kind.
    alpha_sigma_px:
        Or: the fewest that promise one sigma of alpha no greater than this at any distance.
    seed, by_hand:
        See `PlanSize`.
    """

    frames: int | None = None
    parallel: int | None = None
    varied: int | None = None
    alpha_sigma_px: float | None = None
    seed: int = 1
    by_hand: bool = False

    def size_for(self, cell: CellFile) -> PlanSize:
        """How many views; raises `InputError` where they contradict or cannot be met."""
        counts = (self.frames, self.parallel, self.varied)
        if self.alpha_sigma_px is not None:
            if self.by_hand or any(count is not None for count in counts):
                raise InputError(
                    "--alpha-sigma-px says how many views by itself: leave --frames, --parallel,"
                    " --varied and --by-hand out"
                )
            return fewest(CandidatePool(cell, self.seed), self.alpha_sigma_px, self.seed)
        if all(count is not None for count in counts):
            raise InputError("give two of --frames, --parallel and --varied: they make the third")
        usual = PlanSize.of(self.frames or _USUAL_FRAMES)
        parallel, varied = self.parallel, self.varied
        if self.frames is not None:
            parallel = self.frames - varied if varied is not None else parallel
            varied = self.frames - parallel if parallel is not None else varied
        if min(parallel or 0, varied or 0) < 0:
            raise InputError("--frames is less than the --parallel or --varied among them")
        return PlanSize(
            usual.parallel if parallel is None else parallel,
            usual.varied if varied is None else varied,
            self.seed,
            self.by_hand,
        )

    def as_options(self) -> list[str]:
        """The options as they were given, seed always."""
        given = {
            "--frames": self.frames,
            "--parallel": self.parallel,
            "--varied": self.varied,
            "--alpha-sigma-px": self.alpha_sigma_px,
            "--seed": self.seed,
        }
        arguments = [f"{option} {value}" for option, value in given.items() if value is not None]
        return [*arguments, *(["--by-hand"] if self.by_hand else [])]


def fewest(pool: CandidatePool, alpha_sigma_px: float, seed: int) -> PlanSize:
    """The smallest plan that promises alpha so well, by bisection: more views never inform less.

    Parameters
    ----------
    pool:
        What there is to choose from.
    alpha_sigma_px:
        Not to be exceeded at any distance.
    seed:
        The pool's.

    Raises
    ------
    InputError
        Not even the most views would do.
    """

    def sigma_px(frames: int) -> float:
        return pool.alpha_sigma_px(pool.choose(PlanSize.of(frames, seed)))

    low, high = FEWEST_FRAMES - 1, FEWEST_FRAMES
    while (reached := sigma_px(high)) > alpha_sigma_px:
        if high == MOST_FRAMES:
            raise InputError(
                f"{MOST_FRAMES} views promise alpha to {reached:.2g} px and no better: give a"
                " larger --alpha-sigma-px, or --frames, and take that plan several times"
            )
        low, high = high, min(2 * high, MOST_FRAMES)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if sigma_px(middle) <= alpha_sigma_px else (middle, high)
    return PlanSize.of(high, seed)
