"""Forward selection: the effect that the data demand most, then the next, until none is left.

Grouped likelihood-ratio tests with a Bayesian price, data counted as six numbers a frame. Score
tests rank the catalogue; the best few are fitted in earnest, noise levels and all, and compared
by their likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.chain.effect import Present
from calib.discovery.candidates import Candidate, candidates, finer
from calib.discovery.fields import picture_score
from calib.discovery.score import Score, bic, score_effects
from calib.discovery.start import Fitter
from calib.solver.joint import JointFit
from calib.views import Views

DEMAND = 8.0
"""An effect must lower the Bayesian criterion by this much to be named."""

UNDECIDED = 6.0
"""Rivals within this much of the best cannot be told apart by these data."""

_FITTED_IN_EARNEST = 6
_MOST_EFFECTS = 6


@dataclass(frozen=True)
class Trial:
    """A model fitted in earnest, and its Bayesian criterion (lower is better)."""

    fit: JointFit
    criterion: float


@dataclass(frozen=True)
class Step:
    """One effect taken in: the trial with it, its rivals, what it lowered the criterion by."""

    taken: Present
    trial: Trial
    demand: float
    rivals: tuple[tuple[Present, float], ...]


def criterion(fit: JointFit, views: Views, choices: int = 1) -> float:
    """-2 log likelihood and the price of the free numbers, and of picking among shapes."""
    return -bic(-fit.minus_two_log, fit.parameters, views) + 2.0 * float(np.log(choices))


class Search:
    """Forward selection on one recording."""

    def __init__(self, start: JointFit, fitter: Fitter, branch_price: float = 0.0) -> None:
        self.branch_price = branch_price
        self.fitter, self.views = fitter, fitter.views
        self.best = Trial(start, criterion(start, fitter.views))
        self.steps: list[Step] = []

    def run(self) -> JointFit:
        """Take effects in until none is demanded; then drop those that are not missed."""
        while len(self.steps) < _MOST_EFFECTS and self._take():
            pass
        while self._drop():
            pass
        return self.best.fit

    def ranked(self, fit: JointFit) -> list[tuple[Candidate, Score]]:
        """Score every candidate, the best shape of each effect only, best first."""
        coarse = list(candidates(fit.model, self.views))
        best = self._best_shapes(fit, coarse)
        fine = [shape for candidate, _ in best for shape in finer(candidate, self.views)]
        ranked = self._best_shapes(fit, fine)
        return sorted(ranked, key=lambda pair: -self._promise(*pair))

    def _best_shapes(
        self, fit: JointFit, tried: Sequence[Candidate]
    ) -> list[tuple[Candidate, Score]]:
        scores = score_effects(fit, self.views, [c.present for c in tried])
        best: dict[str, tuple[Candidate, Score]] = {}
        for candidate, score in zip(tried, scores, strict=True):
            label = candidate.effect.label
            if label not in best or self._promise(candidate, score) > self._promise(*best[label]):
                best[label] = (candidate, score)
        return list(best.values())

    def _promise(self, candidate: Candidate, score: Score) -> float:
        return bic(score.gain, score.columns, self.views) - self._price(candidate)

    def _price(self, candidate: Candidate) -> float:
        """Price of picking the best among shapes, and among branches of the arm."""
        price = 2.0 * float(np.log(candidate.choices))
        on_joints = "joints_rad" in candidate.effect.needs
        return price + (self.branch_price if on_joints and not self._joints_paid() else 0.0)

    def _joints_paid(self) -> bool:
        """Whether an effect that is in the model has paid for the choice of branches."""
        return any("joints_rad" in step.taken.effect.needs for step in self.steps)

    def earnest(self, fit: JointFit, picked: Sequence[Candidate]) -> list[tuple[Candidate, Trial]]:
        """Fit each candidate next to what the model has."""
        trials = []
        for candidate in picked:
            tried = self.fitter.with_effects(fit, (*fit.model.effects, candidate.present))
            value = criterion(tried, self.views) + self._price(candidate)
            trials.append((candidate, Trial(tried, value)))
        return sorted(trials, key=lambda pair: pair[1].criterion)

    def _take(self) -> bool:
        fit = self.best.fit
        promising = [c for c, s in self.ranked(fit) if self._promise(c, s) > 0.0]
        trials = self.earnest(fit, promising[:_FITTED_IN_EARNEST])
        if not trials:
            return False
        candidate, trial = trials[0]
        demand = self.best.criterion - trial.criterion
        if demand < DEMAND:
            return False
        rivals = tuple((c.present, t.criterion - trial.criterion) for c, t in trials[1:])
        self.steps.append(Step(candidate.present, trial, demand, rivals))
        self._settle(trial.fit, candidate.choices)
        return True

    def _settle(self, fit: JointFit, choices: int = 1) -> None:
        """Weigh the corners anew under the model taken, for the next contest."""
        settled = self.fitter.settled(fit)
        self.best = Trial(settled, criterion(settled, self.views, choices))

    def force(self, effects: Sequence[Present]) -> JointFit:
        """Take exactly these effects, whatever the data say."""
        fit = self.fitter.with_effects(self.best.fit, effects)
        self._settle(fit)
        return self.best.fit

    def put_in(self, present: Present, choices: int = 1) -> bool:
        """Put an effect in without a contest; False where it does not lower the criterion."""
        fit = self.best.fit
        tried = self.fitter.with_effects(fit, (*fit.model.effects, present))
        value = criterion(tried, self.views, choices)
        if value > self.best.criterion:
            return False
        self._settle(tried, choices)
        return True

    def drop_beside_field(self, site: str) -> None:
        """Drop what the pictures no longer ask for once a field of shifts is allowed for."""
        for present in self.best.fit.model.effects:
            if not present.effect.seen_without_robot:
                continue
            rest = tuple(p for p in self.best.fit.model.effects if p.effect != present.effect)
            without = self.fitter.with_effects(self.best.fit, rest)
            beside = picture_score(without, self.views, present, site)
            if bic(beside.gain, beside.columns, self.views) < DEMAND:
                self._settle(without)
                self.steps = [s for s in self.steps if s.taken.effect != present.effect]

    def _drop(self) -> bool:
        """Drop the effect that the others have made needless, if there is one."""
        fit = self.best.fit
        effects = fit.model.effects
        if len(effects) < 2:
            return False
        for index in range(len(effects)):
            rest = effects[:index] + effects[index + 1 :]
            tried = self.fitter.with_effects(fit, rest)
            value = criterion(tried, self.views)
            if value < self.best.criterion + DEMAND:
                self._settle(tried)
                self.steps = [s for s in self.steps if s.taken.effect != effects[index].effect]
                return True
        return False
