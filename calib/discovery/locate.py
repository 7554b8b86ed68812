"""Locating: which constant of the chain is none, and what it follows.

For every site of the chain and every covariate, a score test of the site following the covariate
along a smooth curve. It needs no catalogue, so it finds what has no name. Time is also searched
for periods, and the image and the board for a field of shifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.covariates import COVARIATES, Covariate
from calib.chain.effect import Link, Present
from calib.chain.empirical import Curve, Site, site_columns, span, wave
from calib.chain.model import evaluate
from calib.chain.state import ChainState
from calib.discovery.fields import BOARD_HEIGHT, IMAGE_FIELD, field_scores
from calib.discovery.laws.frames import frame_blocks, inverse_root
from calib.discovery.score import Score, group_score
from calib.solver.joint import JointFit, frame_errors
from calib.views import FloatArray, Views

_PERIODS = 240
_LEAST_SPREAD = 1e-9
_RIDGE = 1e-7


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
    state = evaluate(fit.model, views, errors=frame_errors(fit.own_error))
    probe = _Probe(fit, views, state)
    cells = [cell for covariate in COVARIATES for cell in probe.along(covariate)]
    if periods:
        cells += probe.periods()
    cells += [
        Cell(f.site, f.link, f.covariate, f.score, 1, None, f.where)
        for f in field_scores(fit, views)
    ]
    return sorted(cells, key=lambda cell: (cell.p_value, -cell.score.gain))


@dataclass(frozen=True)
class _Part:
    """What the frames say of a site: (N, D, D) information, (N, D, R) cross terms, (N, D) score.

    The cross terms are those with the fitted numbers, by the root of these numbers' covariance.
    """

    own: FloatArray
    cross: FloatArray
    gradient: FloatArray


class _Probe:
    """One linearisation of every site, multiplied by whatever a covariate asks for."""

    def __init__(self, fit: JointFit, views: Views, state: ChainState) -> None:
        self.views, self.state = views, state
        # the base's pose along any covariate spans what the board's does: the same test twice
        self.sites = tuple(s for s in site_columns(views) if s.name != "base_pose")
        blocks = frame_blocks(fit, views)
        t = blocks.shared
        information, gradient = blocks.base()
        root = inverse_root(information)
        self.at = root.T @ gradient
        self.parts: list[_Part] = []
        for site in self.sites:
            mine = [t + k for k, c in enumerate(blocks.components) if c.site.name == site.name]
            own = blocks.information[:, mine][:, :, mine]
            cross = np.einsum("nts,tr->nsr", blocks.information[:, :t, mine], root, optimize=True)
            self.parts.append(_Part(own, cross, blocks.gradient[:, mine]))

    def _asked(self, functions: FloatArray, part: _Part) -> tuple[FloatArray, FloatArray]:
        """(G, E, E) information and (G, E) score of a site following G sets of (G, N, B)."""
        g, _, b = functions.shape
        columns = b * part.own.shape[1]
        through = np.einsum("gnb,nsr->gbsr", functions, part.cross, optimize=True)
        through = through.reshape(g, columns, -1)
        pairs = functions[:, :, :, None] * functions[:, :, None, :]
        information = np.einsum("gnbc,nsu->gbscu", pairs, part.own, optimize=True)
        information = information.reshape(g, columns, columns)
        information -= through @ np.swapaxes(through, 1, 2)
        score = np.einsum("gnb,ns->gbs", functions, part.gradient, optimize=True)
        return information, score.reshape(g, columns) - through @ self.at

    def _score(self, functions: FloatArray, part: _Part) -> Score:
        """Score of a site following the (N, B) functions; its step in units of usual sizes."""
        information, score = self._asked(functions[None], part)
        return group_score(information[0], score[0], self.views)

    def _gains(self, functions: FloatArray, part: _Part) -> FloatArray:
        """(G,) about what each of the sets of functions would gain."""
        information, score = self._asked(functions, part)
        unit = 1.0 / np.sqrt(np.maximum(np.einsum("gee->ge", information), 1e-300))
        normal = information * unit[:, :, None] * unit[:, None, :] + _RIDGE * np.eye(unit.shape[1])
        along = score * unit
        solved = np.linalg.solve(normal, along[:, :, None])[:, :, 0]
        return np.asarray(np.sum(along * solved, axis=1))

    def along(self, covariate: Covariate) -> list[Cell]:
        """Every site along one covariate; none where it does not vary."""
        value = covariate.of(self.state)
        low, high = span(value)
        if high - low < _LEAST_SPREAD:
            return []
        curves = [Curve(site, covariate, low, high) for site in self.sites]
        functions = curves[0].functions(self.state)
        scores = [self._score(functions, part) for part in self.parts]
        return [
            Cell(
                s.name, s.link, covariate.name, score, 1, curve, _where(curve, score, self.state, s)
            )
            for s, curve, score in zip(self.sites, curves, scores, strict=True)
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
        swings = np.stack([wave(value, 1.0 / float(f)) for f in frequency])
        cells = []
        for site, part in zip(self.sites, self.parts, strict=True):
            best = int(np.argmax(self._gains(swings, part)))
            curve = Curve(site, time, low, high, 1.0 / float(frequency[best]))
            score = self._score(swings[best], part)
            where = f"period {curve.period:.3g} s"
            cells.append(Cell(site.name, site.link, "time", score, _PERIODS, curve, where))
        return cells


def _where(curve: Curve, score: Score, state: ChainState, site: Site) -> str:
    """Say in which range of the covariate the one-step curve departs most."""
    value = curve.covariate.of(state)
    if value.ndim == 2:
        return "all attitudes"
    functions = curve.functions(state)
    if len(score.step) != functions.shape[1] * len(site.components):
        return "everywhere"
    amount = functions @ score.step.reshape(functions.shape[1], -1)
    size = np.linalg.norm(amount - np.median(amount, axis=0), axis=1)
    high = value[np.isfinite(value) & (size >= 0.5 * size.max())]
    if len(high) == 0:
        return "everywhere"
    return f"{high.min():.3g} to {high.max():.3g} {curve.covariate.unit}"
