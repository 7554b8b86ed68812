"""Forward selection: the effect that the data demand most, then the next, until none is left.

Grouped likelihood-ratio tests with a Bayesian price, data counted as six numbers a frame. Score
tests rank the catalogue; the best few are fitted in earnest, noise levels and all, and compared
by their likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.effect import Present
from calib.chain.empirical import UNNAMED
from calib.discovery.candidates import Candidate, candidates, finer, joined
from calib.discovery.fields import picture_score
from calib.discovery.score import Score, bic, score_effects
from calib.discovery.sparse import pick
from calib.discovery.start import Fitter
from calib.solver.joint import JointFit
from calib.views import Views

DEMAND = 8.0
"""An effect must lower the Bayesian criterion by this much to be named."""

_MORE_OF_IT = 2.0
"""Further amounts of an effect that is named must lower it by this much to be freed as well."""

UNDECIDED = 6.0
"""Rivals within this much of the best cannot be distinguished by these data."""

_FITTED_IN_EARNEST = 6
_MOST_EFFECTS = 6

_EXCHANGE = 2.0
"""Another effect must lower the criterion by so much to take the place of one that is there."""

_EXCHANGED_AGAINST = 3

_BETTER = 1.0
"""What a fit from another start must lower the criterion by to be another optimum."""

_TIED, _MOST_TIED = 0.5, 2
"""Shapes of one effect that promise as much as the best are fitted in earnest, so many at most."""

_SCORE_FALLS_SHORT = 5.0
"""A fit in earnest has gained up to about this many times what its score test promised."""

_LIKE_A_CURVE = ("joint_periodic_error", "joint_compliance", "joint_backlash")

_BESIDE_SHARE = 0.05
"""Beside a field of shifts, or curves in its link, a name must gain this share of their gain."""

_POSE_SHARE = 0.15
"""The same for a name that only poses show, beside curves anywhere: they bend poses alike."""


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


def within_bounds(fit: JointFit, label: str) -> bool:
    """Whether every fitted amount of an effect is one that a sane cell can have.

    An amount that was pushed to the end of its range fits something else.
    """
    for present in fit.model.effects:
        if present.effect.label != label:
            continue
        for k in present.free:
            parameter, value = present.effect.parameters[k], present.values[k]
            if value != 0.0 and not parameter.low < value < parameter.high:
                return False
    return True


def blank(present: Present) -> Present:
    """The effect with its amounts at zero and its shapes and settings as they are."""
    roles = [p.role for p in present.effect.parameters]
    values = np.where([role == "amount" for role in roles], 0.0, present.values)
    return replace(present, values=values)


def criterion(fit: JointFit, views: Views) -> float:
    """-2 log likelihood and the price of the free numbers."""
    return -bic(-fit.minus_two_log, fit.parameters, views)


class Search:
    """Forward selection on one recording."""

    def __init__(self, start: JointFit, fitter: Fitter, branch_price: float = 0.0) -> None:
        self.branch_price = branch_price
        self.fitter, self.views = fitter, fitter.views
        self.choices: dict[str, float] = {}
        self.prices: dict[str, float] = {}
        self.rival_laws: dict[str, tuple[tuple[str, float], ...]] = {}
        self.best = Trial(start, criterion(start, fitter.views))
        self.steps: list[Step] = []

    def run(self) -> JointFit:
        """Take effects in until none is demanded, drop those not missed, exchange the mistaken."""
        for _ in range(_MOST_EFFECTS):
            while len(self.steps) < _MOST_EFFECTS and self._take():
                pass
            while self._drop():
                pass
            if not self._exchange():
                break
        self._begin_at_rest()
        return self.best.fit

    def _begin_at_rest(self) -> None:
        """Fit once more with no frame off at first, and keep what is better.

        A focus drive's play jumps where a frame is as far as the one before: one that an earlier
        fit has pushed to the wrong side does not come back by small steps.
        """
        fit = self.best.fit
        if not fit.model.effects:
            return
        rested = self._trial(self.fitter.fit(fit.model, fit.noise, None, fit.weight))
        if rested.criterion < self.best.criterion - _BETTER:
            self._settle(rested.fit)

    def ranked(self, fit: JointFit) -> list[tuple[Candidate, Score]]:
        """Score every candidate, the best shape of each effect only, best first."""
        coarse = list(candidates(fit.model, self.views))
        best = self._best_shapes(fit, coarse)
        fine = [shape for candidate, _ in best for shape in finer(candidate, self.views)]
        ranked = self._best_shapes(fit, fine)
        return sorted(ranked, key=lambda pair: -self._promise(*pair))

    def promised(self, fit: JointFit) -> float:
        """What the most promising name promises."""
        return max((self._promise(*pair) for pair in self.ranked(fit)), default=-np.inf)

    def _best_shapes(
        self, fit: JointFit, tried: Sequence[Candidate]
    ) -> list[tuple[Candidate, Score]]:
        scores = score_effects(fit, self.views, [c.present for c in tried])
        best: dict[str, tuple[Candidate, Score]] = {}
        for whole, all_amounts in zip(tried, scores, strict=True):
            candidate, score = self._picked(whole, all_amounts)
            label = candidate.effect.label
            if label not in best or self._promise(candidate, score) > self._promise(*best[label]):
                best[label] = (candidate, score)
        return list(best.values())

    def _picked(self, whole: Candidate, score: Score) -> tuple[Candidate, Score]:
        """The same effect with the amounts that the data ask for."""
        picked = pick(whole.present, score, self.views)
        choices = whole.choices * float(np.exp(picked.ways))
        found = replace(score, gain=picked.gain, columns=picked.columns)
        return Candidate(picked.present, choices), found

    def _promise(self, candidate: Candidate, score: Score) -> float:
        effects = self.best.fit.model.effects
        price = self._price(joined(effects, candidate.present), candidate) - self._price(effects)
        return bic(score.gain, score.columns, self.views) - price

    def _price(self, effects: Sequence[Present], picked: Candidate | None = None) -> float:
        """Price of picking the best among shapes, of fields, and once among branches of the arm."""
        choices = dict(self.choices)
        if picked is not None:
            choices[picked.effect.label] = self._choices(picked)
        price = 2.0 * sum(float(np.log(choices.get(p.effect.label, 1))) for p in effects)
        price += sum(self.prices.get(p.effect.label, 0.0) for p in effects)
        on_joints = any("joints_rad" in p.effect.needs for p in effects)
        return price + (self.branch_price if on_joints else 0.0)

    def _choices(self, picked: Candidate) -> float:
        """Among how many its effect was picked, with what was held back and is now picked too."""
        label = picked.effect.label
        there = any(p.effect.label == label for p in self.best.fit.model.effects)
        return picked.choices * (self.choices.get(label, 1.0) if there else 1.0)

    def _trial(self, fit: JointFit, picked: Candidate | None = None) -> Trial:
        price = self._price(fit.model.effects, picked)
        return Trial(fit, criterion(fit, self.views) + price)

    def earnest(self, fit: JointFit, picked: Sequence[Candidate]) -> list[tuple[Candidate, Trial]]:
        """Fit each candidate next to what the model has."""
        trials = []
        for candidate in picked:
            tried = self.fitter.with_effects(fit, joined(fit.model.effects, candidate.present))
            trials.append((candidate, self._trial(tried, candidate)))
        return sorted(trials, key=lambda pair: pair[1].criterion)

    def _contest(self, fit: JointFit) -> list[tuple[Candidate, Trial]]:
        """Fit the most promising, without those that cannot come near the best of them."""
        trials: list[tuple[Candidate, Trial]] = []
        reached = 0.0
        for candidate, score in self.ranked(fit)[:_FITTED_IN_EARNEST]:
            promise = self._promise(candidate, score)
            if promise <= 0.0 or _SCORE_FALLS_SHORT * promise < reached - UNDECIDED:
                break
            trials += self.earnest(fit, [candidate])
            reached = max(reached, self.best.criterion - trials[-1][1].criterion)
        return sorted(trials, key=lambda pair: pair[1].criterion)

    def _take(self) -> bool:
        fit = self.best.fit
        trials = self._contest(fit)
        present = {p.effect.label for p in fit.model.effects}
        for at, (candidate, trial) in enumerate(trials):
            demand = self.best.criterion - trial.criterion
            if candidate.effect.label in present:
                if demand < _MORE_OF_IT:
                    continue
                self.choices[candidate.effect.label] = self._choices(candidate)
                self._settle(trial.fit)
                return True
            if demand >= DEMAND and within_bounds(trial.fit, candidate.effect.label):
                candidate, trial = self._best_of_tied(fit, candidate, trial)
                demand = self.best.criterion - trial.criterion
                self._record(candidate, trial, demand, trials[at + 1 :])
                return True
        return False

    def _best_of_tied(
        self, fit: JointFit, candidate: Candidate, trial: Trial
    ) -> tuple[Candidate, Trial]:
        """The best of an effect's shapes that its score tests cannot distinguish.

        As long as a large effect is missing the arm's scatter seems so large that its poses say
        nothing: from which row on a rolling shutter's pose counts shows only in a fit.
        """
        alike = [c for c in candidates(fit.model, self.views) if c.effect == candidate.effect]
        if len(alike) == 1:
            return candidate, trial
        scores = score_effects(fit, self.views, [c.present for c in alike])
        picked = [self._picked(c, s) for c, s in zip(alike, scores, strict=True)]
        promise = [self._promise(*pair) for pair in picked]
        tied = [
            one
            for (one, _), worth in zip(picked, promise, strict=True)
            if worth > max(promise) - _TIED and not one.present.same_but_amounts(candidate.present)
        ]
        best = [(candidate, trial), *self.earnest(fit, tied[:_MOST_TIED])]
        return min(best, key=lambda pair: pair[1].criterion)

    def _record(
        self,
        candidate: Candidate,
        trial: Trial,
        demand: float,
        others: Sequence[tuple[Candidate, Trial]],
    ) -> None:
        rivals = tuple((c.present, t.criterion - trial.criterion) for c, t in others)
        self.steps.append(Step(candidate.present, trial, demand, rivals))
        self.choices[candidate.effect.label] = candidate.choices
        self._settle(trial.fit)

    def _exchange(self) -> bool:
        """Put another effect in the place of one that was taken before the rest was known.

        The first effect was picked while the others were still missing, and may have stood in
        for one of them; and the law of a name may have been picked in their company.
        """
        if len(self.steps) < 2:
            return False
        for step in list(self.steps):
            rest = tuple(
                p for p in self.best.fit.model.effects if p.effect.label != step.taken.effect.label
            )
            without = self.fitter.with_effects(self.best.fit, rest)
            base = self._trial(without)
            needed = (base.criterion - self.best.criterion) / _SCORE_FALLS_SHORT
            picked = [
                c
                for c, score in self.ranked(without)
                if c.effect.label != step.taken.effect.label and self._promise(c, score) > needed
            ][:_EXCHANGED_AGAINST]
            trials = self.earnest(without, picked)
            if not trials or trials[0][1].criterion > self.best.criterion - _EXCHANGE:
                continue
            candidate, trial = trials[0]
            self.steps.remove(step)
            self._record(candidate, trial, base.criterion - trial.criterion, trials[1:])
            return True
        return False

    def _settle(self, fit: JointFit) -> None:
        """Weigh the corners anew under the model taken, for the next contest."""
        self.best = self._trial(self.fitter.settled(fit))

    def force(self, effects: Sequence[Present]) -> JointFit:
        """Take exactly these effects, whatever the data say."""
        fit = self.fitter.with_effects(self.best.fit, effects)
        self._settle(fit)
        return self.best.fit

    def criterion_of(self, fit: JointFit) -> float:
        """The criterion of another fit to the same frames, at the price of what it has."""
        return self._trial(fit).criterion

    def go_on_from(self, fit: JointFit) -> None:
        """Go on from another fit of the same effects."""
        self._settle(fit)

    def go_on_without_others(self, fit: JointFit) -> None:
        """Go on from a fit of some of the effects; the others lose their names."""
        labels = {p.effect.label for p in fit.model.effects}
        self._settle(fit)
        self.steps = [s for s in self.steps if s.taken.effect.label in labels]

    def take_in(self, candidate: Candidate, fit: JointFit) -> None:
        """Go on from a fit with one more effect, which is no name."""
        self.choices[candidate.effect.label] = candidate.choices
        self._settle(fit)

    def put_in(self, present: Present, choices: int = 1, instead_of: Present | None = None) -> bool:
        """Put an effect in without a contest; False where it does not lower the criterion."""
        fit = self.best.fit
        others = [
            p for p in fit.model.effects if instead_of is None or not p.same_but_amounts(instead_of)
        ]
        tried = self.fitter.with_effects(fit, (*others, present))
        if self._trial(tried, Candidate(present, choices)).criterion > self.best.criterion:
            return False
        self.choices[present.effect.label] = choices
        self._settle(tried)
        return True

    def like_for_like(self) -> float:
        """The criterion with every effect at the same price, be it a name or a law.

        A law that was demanded at the price of all laws is beyond chance: beside a name it pays
        as that does, for the few that resemble it.
        """
        effects = self.best.fit.model.effects
        laws = [p.effect.label for p in effects if p.effect.name == UNNAMED]
        own = sum(2.0 * float(np.log(self.choices.get(label, 1.0))) for label in laws)
        return self.best.criterion - own + DEMAND * len(effects)

    def leave_out(self, present: Present) -> None:
        """Go on without an effect, whatever that costs."""
        _, without = self.missed(present)
        self._settle(without)
        self.steps = [s for s in self.steps if s.taken.effect != present.effect]

    def drop_beside_field(self, site: str, field_gain: float) -> None:
        """Drop what the pictures no longer ask for once a field of shifts is allowed for.

        What gains but a trifle of what the field gains may fit its edges, or the poses that it
        bends: no name rests on that.
        """
        demand = {step.taken.effect.label: step.demand for step in self.steps}
        for present in [p for p in self.best.fit.model.effects if p.free]:
            rest = tuple(p for p in self.best.fit.model.effects if p.effect != present.effect)
            without = self.fitter.with_effects(self.best.fit, rest)
            if present.effect.seen_without_robot:
                beside = picture_score(without, self.views, present, site)
                worth = bic(beside.gain, beside.columns, self.views)
            else:
                worth = demand.get(present.effect.label, np.inf)
            if worth < max(DEMAND, _BESIDE_SHARE * field_gain):
                self._settle(without)
                self.steps = [s for s in self.steps if s.taken.effect != present.effect]

    def drop_on_joints(self, joints: set[str]) -> None:
        """Hold what is reported of joints that follow anything by a curve without a name.

        A kink, or a cable's drag, is soaked up by a wave, a sag or a play, and a remainder: where
        there is a remainder, it was none of them. A wave loses its name for it, and so does a sag
        or a play that is left without an amount.
        """
        for present in self.best.fit.model.effects:
            if present.effect.name not in _LIKE_A_CURVE:
                continue
            names = {k: present.effect.parameters[k].name for k in present.free}
            held = {k for k, name in names.items() if f"joint_{name.rsplit('_', 1)[1]}" in joints}
            if not held:
                continue
            rest = tuple(p for p in self.best.fit.model.effects if p.effect != present.effect)
            if present.effect.name != "joint_periodic_error" and len(held) < len(names):
                values = present.values.copy()
                values[list(held)] = 0.0
                rest = (*rest, replace(present, values=values, held=present.held | held))
            else:
                self.steps = [s for s in self.steps if s.taken.effect != present.effect]
            self._settle(self.fitter.with_effects(self.best.fit, rest))

    def drop_beside_curves(self) -> None:
        """Drop what gains but a trifle of what the unnamed curves gain.

        A curve leaves something of what it carries: no name rests on that. What the pictures show
        by themselves is held against curves in its own link only.
        """
        for present in self.best.fit.model.effects:
            unnamed = [p for p in self.best.fit.model.effects if p.effect.name == UNNAMED]
            curves = [p for p in unnamed if p.free]
            share = _POSE_SHARE
            if present.effect.seen_without_robot:
                share = _BESIDE_SHARE
                curves = [c for c in curves if c.effect.link == present.effect.link]
            if present.effect.name == UNNAMED or not curves:
                continue
            missed, without = self.missed(present)
            if missed < share * self._worth_without(without, curves):
                self._settle(without)
                self.steps = [s for s in self.steps if s.taken.effect != present.effect]

    def _worth_without(self, fit: JointFit, curves: Sequence[Present]) -> float:
        """What curves gain in a fit without the name beside them, which may share their work."""
        labels = {curve.effect.label for curve in curves}
        rest = [p for p in fit.model.effects if p.effect.label not in labels]
        bare = self.fitter.with_effects(fit, rest)
        return self._trial(bare).criterion - self._trial(fit).criterion

    def missed(self, present: Present) -> tuple[float, JointFit]:
        """By how much the criterion rises without an effect, and the fit without it."""
        rest = tuple(p for p in self.best.fit.model.effects if p.effect != present.effect)
        without = self.fitter.with_effects(self.best.fit, rest)
        return self._trial(without).criterion - self.best.criterion, without

    def drop_undemanded(self, labels: set[str]) -> dict[str, float]:
        """Drop those laws that would not be taken now; what the others gain in -2 log likelihood.

        They were demanded beside others that are gone: a law that took the place of a name, which
        had stood beside a second one.
        """
        gains: dict[str, float] = {}
        for present in self.best.fit.model.effects:
            if present.effect.label not in labels:
                continue
            missed, without = self.missed(present)
            if missed < DEMAND:
                self._settle(without)
            else:
                gains[present.effect.label] = without.minus_two_log - self.best.fit.minus_two_log
        return gains

    def _drop(self) -> bool:
        """Drop the effect that the others have made needless, if there is one."""
        fit = self.best.fit
        effects = fit.model.effects
        if len(effects) < 2:
            return False
        for index in range(len(effects)):
            rest = effects[:index] + effects[index + 1 :]
            tried = self.fitter.with_effects(fit, rest)
            if self._trial(tried).criterion < self.best.criterion + DEMAND:
                self._settle(tried)
                self.steps = [s for s in self.steps if s.taken.effect != effects[index].effect]
                return True
        return False
