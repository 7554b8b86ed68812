"""Laws fitted in earnest: the shortest that the data support, and whether a name beats it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.chain.effect import Effect
from calib.chain.effects import catalogue
from calib.chain.laws.law import Law, present_law
from calib.discovery.candidates import Candidate
from calib.discovery.laws.frames import frame_blocks
from calib.discovery.laws.scan import Found, Scan
from calib.discovery.locate import Cell
from calib.discovery.score import Score
from calib.discovery.search import DEMAND, UNDECIDED, Search, Trial
from calib.distributions import chi2_tail
from calib.solver.joint import JointFit

_IN_EARNEST = 3
_PROMISES = -12.0
"""A scatter that a law explains looks like noise to the score test, which then falls short."""

_LEAST_GAIN = 18.0
_ABOUT_AS_GOOD = 3.0


@dataclass(frozen=True)
class Tried:
    """A law fitted next to what the model has."""

    candidate: Candidate
    trial: Trial
    found: Found


def promising(fit: JointFit, search: Search, at_most: int = _IN_EARNEST) -> list[Found]:
    """The laws worth a fit, the most promising first."""
    best = Scan(frame_blocks(fit, search.views), search.views).best(at_most)
    return [f for f in best if f.worth > _PROMISES and f.gain > _LEAST_GAIN]


def fitted(fit: JointFit, search: Search, laws: Sequence[Found]) -> list[Tried]:
    """Fit each law next to what a cell has; the best by the criterion first."""
    tried = []
    for found in laws:
        candidate = Candidate(present_law(found.law), float(np.exp(found.choices)))
        ((_, trial),) = search.earnest(fit, [candidate])
        tried.append(Tried(candidate, trial, found))
    return sorted(tried, key=lambda one: one.trial.criterion)


def demanded(search: Search) -> list[Tried]:
    """The law that the best cell so far demands most, and its rivals; none where none is."""
    fit = search.best.fit
    tried = fitted(fit, search, promising(fit, search))
    if not tried or search.best.criterion - tried[0].trial.criterion < DEMAND:
        return []
    near = [t for t in tried if t.trial.criterion < tried[0].trial.criterion + UNDECIDED]
    return shortest_first(near)


def shortest_first(tried: Sequence[Tried]) -> list[Tried]:
    """The laws with the one along fewest covariates in front, of those about as good as the best.

    The price of a choice is an average one: a covariate that resembles another is had for less.
    """
    best = min(t.trial.criterion for t in tried)
    about = [t for t in tried if t.trial.criterion < best + _ABOUT_AS_GOOD]
    front = min(about, key=lambda t: (len(t.found.law.covariates), t.trial.criterion))
    return [front, *(t for t in tried if t is not front)]


def law_leads(search: Search) -> bool:
    """Whether in the cell as it is a law promises more than any name does."""
    fit = search.best.fit
    laws = promising(fit, search, 1)
    return bool(laws) and laws[0].worth > search.promised(fit)


def begin_with_law(search: Search, least: float) -> Cell | None:
    """Take in the law that the plain cell demands, and names beside it; its cell.

    None where it gains less than `least` in -2 log likelihood, or is a name's own physics.
    """
    before = search.best
    best_first = demanded(search)
    if not best_first or any(
        along_its_own(effect, best_first[0].found.law) for effect in catalogue()
    ):
        return None
    cell = as_cell(best_first, before)
    if cell.score.gain < least:
        return None
    search.take_in(best_first[0].candidate, best_first[0].trial.fit)
    search.run()
    return cell


def along_its_own(effect: Effect, law: Law) -> bool:
    """Whether the law is along what the effect acts along: the same physics, in another form.

    No effect swings along what it is said to act along: one that does is other physics.
    """
    if law.form.key == "periodic":
        return False
    places = {(law.site.name, c.name.removeprefix("inverse_")) for c in law.covariates}
    places |= {(site, "distance") for site, along in places if along == "focus_distance"}
    return not places.isdisjoint(effect.acts_along)


def in_words(tried: Tried) -> str:
    """Form, site and covariates of a law."""
    law = tried.found.law
    along = " * ".join(covariate.name for covariate in law.covariates)
    return f"{law.form.name}: {law.site.name} along {along}"


def _rival(rival: Tried, best: Tried) -> str:
    behind = rival.trial.criterion - best.trial.criterion
    return f"{in_words(rival)} ({behind:.1f} behind)"


def as_cell(best_first: Sequence[Tried], before: Trial) -> Cell:
    """The law as what was found to be left: where it lives, and how sure that is."""
    tried, rivals = best_first[0], best_first[1:]
    law = tried.found.law
    gain = before.fit.minus_two_log - tried.trial.fit.minus_two_log
    p_value = chi2_tail(gain, tried.found.columns)
    covariate = "*".join(c.name for c in law.covariates)
    score = Score(gain, tried.found.columns, p_value, np.zeros(0))
    numbers = dict(law.numbers)
    where = f"from {numbers['at']:.4g} on" if "at" in numbers else "all of it"
    if law.form.key == "periodic":
        where = f"{numbers['cycles']:.4g} radians per {law.covariates[0].unit}"
    return Cell(
        site=law.site.name,
        link=law.site.link,
        covariate=covariate,
        score=score,
        tried=max(int(min(np.exp(tried.found.choices), 1e9)), 1),
        curve=None,
        where=where,
        law=tried.candidate.present,
        rivals=tuple(_rival(rival, tried) for rival in rivals),
    )
