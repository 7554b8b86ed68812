"""Locating: which constant of the chain is none, and what it follows.

For every site of the chain and every covariate, a score test of the site following the covariate
along a smooth curve. It needs no catalogue, so it finds what has no name. Time is also searched
for periods, and the image and the board for a field of shifts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain.covariates import CONSTANT, COVARIATES, Covariate
from calib.chain.effect import Link, Present
from calib.chain.empirical import (
    Curve,
    Site,
    present_curve,
    site_columns,
    span,
)
from calib.chain.model import evaluate
from calib.chain.state import ChainState
from calib.discovery.fields import BOARD_HEIGHT, IMAGE_FIELD, field_scores
from calib.discovery.score import Score, conditional, extended, group_score
from calib.solver.joint import JointFit, assemble, frame_errors
from calib.solver.unknowns import amounts, prior_information
from calib.views import FloatArray, Views

_PERIODS = 240
_LEAST_SPREAD = 1e-9


@dataclass(frozen=True)
class Cell:
    """One tested pair of site and covariate.

    Attributes
    ----------
    site, link, covariate:
        Where, and along what.
    score:
        Gain and p-value.
    tried:
        Among how many of its kind the best was picked (periods).
    curve:
        What to fit to carry it, or None for a field over image or board, or for a law.
    where:
        Range of the covariate in which the misfit is largest, as text.
    law:
        The law by which the site follows the covariate, where one was found.
    rivals:
        Other laws that the data do not rule out, as text.
    """

    site: str
    link: Link
    covariate: str
    score: Score
    tried: int
    curve: Curve | None
    where: str
    law: Present | None = None
    rivals: tuple[str, ...] = ()

    @property
    def is_field(self) -> bool:
        """Whether it is a field of shifts over the image or the board."""
        return self.site in (IMAGE_FIELD, BOARD_HEIGHT)

    @property
    def p_value(self) -> float:
        """P-value after the price of picking the best of its kind."""
        return min(1.0, self.score.p_value * self.tried)


def locate(fit: JointFit, views: Views, *, periods: bool = True) -> list[Cell]:
    """Test every site against every covariate; the most significant first.

    Without `periods` in time where a law that swings was looked for already.
    """
    state = evaluate(fit.model, views, **frame_errors(fit.own_error))
    probe = _Probe(fit, views, state)
    cells = [cell for covariate in COVARIATES for cell in probe.along(covariate)]
    if periods:
        cells += probe.periods()
    cells += [
        Cell(f.site, f.link, f.covariate, f.score, 1, None, f.where)
        for f in field_scores(fit, views)
    ]
    return sorted(cells, key=lambda cell: (cell.p_value, -cell.score.gain))


class _Probe:
    """One linearisation of every site, multiplied by whatever a covariate asks for."""

    def __init__(self, fit: JointFit, views: Views, state: ChainState) -> None:
        self.fit, self.views, self.state = fit, views, state
        # the base's pose along any covariate spans what the board's does: the same test twice
        self.sites = tuple(s for s in site_columns(views) if s.name != "base_pose")
        presents = [present_curve(Curve(s, CONSTANT, 0.0, 1.0), state) for s in self.sites]
        _, self.found, unknowns, self.base = extended(fit, views, presents)
        self.amount = amounts(fit.model, fit.unknowns)
        self.information = prior_information(fit.unknowns)
        first = len(fit.model.effects)
        self.owner = np.array([u.place[1] - first for u in unknowns[self.base :]])

    def _test(self, functions: FloatArray) -> list[Score]:
        """Scores of every site following the (N, B) functions."""
        columns = self.found.local[:, :, self.base :]
        n, q, e = columns.shape
        product = (columns[:, :, None, :] * functions[:, None, :, None]).reshape(n, q, -1)
        local = np.concatenate([self.found.local[:, :, : self.base], product], axis=2)
        found = replace(self.found, local=local)
        shift = self.fit.equations.corner_shift if self.fit.equations.corner_numbers else None
        free = np.zeros(local.shape[2] - self.base)
        information = np.pad(self.information, (0, len(free)))
        prior = (np.append(self.amount, free), information)
        equations, _ = assemble(
            found, self.views, self.fit.weight, self.fit.own_error, shift, prior
        )
        b = functions.shape[1]
        information, score = conditional(equations, self.fit, self.base + np.arange(b * e))
        owner = np.tile(self.owner, b)
        scores = []
        for index in range(len(self.sites)):
            mine = np.flatnonzero(owner == index)
            scores.append(group_score(information[np.ix_(mine, mine)], score[mine], self.views))
        return scores

    def along(self, covariate: Covariate) -> list[Cell]:
        """Every site along one covariate; none where it does not vary."""
        value = covariate.of(self.state)
        low, high = span(value)
        if high - low < _LEAST_SPREAD:
            return []
        curves = [Curve(site, covariate, low, high) for site in self.sites]
        functions = curves[0].functions(self.state)
        return [
            Cell(
                s.name, s.link, covariate.name, score, 1, curve, _where(curve, score, self.state, s)
            )
            for s, curve, score in zip(self.sites, curves, self._test(functions), strict=True)
        ]

    def periods(self) -> list[Cell]:
        """Every site swinging with time; the best period of each."""
        time = next(c for c in COVARIATES if c.name == "time")
        value = time.of(self.state)
        low, high = span(value)
        if high - low < 1.0:
            return []
        step = float(np.median(np.diff(np.sort(value[np.isfinite(value)]))))
        shortest, longest = max(0.5 * step, 0.2), 0.5 * (high - low)
        frequency = np.linspace(1.0 / longest, 1.0 / shortest, _PERIODS)
        best: dict[str, tuple[Curve, Score]] = {}
        for f in frequency:
            curves = [Curve(s, time, low, high, 1.0 / float(f)) for s in self.sites]
            for curve, score in zip(
                curves, self._test(curves[0].functions(self.state)), strict=True
            ):
                name = curve.site.name
                if name not in best or score.p_value < best[name][1].p_value:
                    best[name] = (curve, score)
        return [
            Cell(c.site.name, c.site.link, "time", s, _PERIODS, c, f"period {c.period:.3g} s")
            for c, s in best.values()
        ]


def _where(curve: Curve, score: Score, state: ChainState, site: Site) -> str:
    """Say in which range of the covariate the one-step curve departs most."""
    value = curve.covariate.of(state)
    if value.ndim == 2:
        return "all attitudes"
    functions = curve.functions(state)
    if len(score.step) != functions.shape[1] * len(site.components):
        return "everywhere"
    amount = functions @ score.step.reshape(functions.shape[1], -1)
    typical = np.array([t for _, _, t in site.components])
    size = np.linalg.norm((amount - np.median(amount, axis=0)) / typical, axis=1)
    high = value[np.isfinite(value) & (size >= 0.5 * size.max())]
    if len(high) == 0:
        return "everywhere"
    return f"{high.min():.3g} to {high.max():.3g} {curve.covariate.unit}"
