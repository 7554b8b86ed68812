"""Every law that could be, judged from one fit: site, component, covariate, form and numbers.

The score of each is Rao's test on the marginal likelihood; its price is a description length:
amounts and fitted shapes at the Bayesian price of a number, and every choice among alternatives
(place, covariate, form, place of a step, order of a gear) at twice its logarithm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.covariates import Covariate, covariates_of
from calib.chain.laws import forms
from calib.chain.laws.form import Form, Numbers, Range
from calib.chain.laws.law import Law, may_need_constant
from calib.discovery.laws.frames import FrameBlocks, inverse_root
from calib.discovery.score import pose_numbers
from calib.views import BoolArray, FloatArray, Views

_LEAST_SPREAD = 1e-9
_NOTHING, _DEPENDENT = 1e-9, 1e-5
_KNOWN_SHARE = 0.8
"""Of the frames that must have a covariate."""


@dataclass(frozen=True)
class Found:
    """A law, and what it promises, with or without its own constant.

    Attributes
    ----------
    law:
        With the best of its numbers.
    gain:
        Drop of -2 log likelihood to be expected, noise levels unchanged.
    columns:
        Its amounts and fitted shapes.
    choices:
        Logarithm of how many laws it was picked among.
    worth:
        Gain less the price of both.
    """

    law: Law
    gain: float
    columns: int
    choices: float
    worth: float


@dataclass(frozen=True)
class _Group:
    """Components that follow the same functions."""

    site: str
    members: tuple[int, ...]


def _groups(blocks: FrameBlocks) -> list[_Group]:
    """Every component by itself; both of a principal point; three of a shift or a turn."""
    by_site: dict[str, list[int]] = {}
    for k, component in enumerate(blocks.components):
        by_site.setdefault(component.site.name, []).append(k)
    groups = [_Group(name, (k,)) for name, members in by_site.items() for k in members]
    for name, members in by_site.items():
        if len(members) == 2:
            groups.append(_Group(name, tuple(members)))
        if len(members) == 6:
            groups += [_Group(name, tuple(members[:3])), _Group(name, tuple(members[3:]))]
    return groups


@dataclass(frozen=True)
class _Try:
    """One form along its covariates, with its numbers."""

    covariates: tuple[Covariate, ...]
    numbers: Numbers


@dataclass(frozen=True)
class _Judged:
    """A try for a group of components, and what it promises."""

    form: Form
    tried: _Try
    group: _Group
    gain: float
    columns: int
    choices: float
    worth: float


@dataclass(frozen=True)
class _Known:
    """A covariate's values, zero where they are not known, which are, and their range."""

    value: FloatArray
    known: BoolArray
    seen: Range


class Scan:
    """One linearisation and everything that can be asked of it."""

    def __init__(self, blocks: FrameBlocks, views: Views) -> None:
        self.blocks, self.views = blocks, views
        self.groups = _groups(blocks)
        t = blocks.shared
        information, gradient = blocks.base()
        root = inverse_root(information)
        self._cross = blocks.information[:, :t, t:].transpose(0, 2, 1) @ root
        self._at = root.T @ gradient
        self._own = blocks.information[:, t:, t:]
        self._gradient = blocks.gradient[:, t:]
        self._values: dict[str, _Known] = {}
        self.covariates = [c for c in covariates_of(views) if self._varies(c)]
        self.number = float(np.log(pose_numbers(views)))
        self._pairs = float(np.log(len(self.groups) * max(len(self.covariates), 1)))
        self._forms = float(np.log(len(forms())))

    def _varies(self, covariate: Covariate) -> bool:
        value = covariate.of(self.blocks.state)
        if value.ndim > 1:
            return False
        known = np.isfinite(value)
        if known.sum() <= _KNOWN_SHARE * len(value) or np.ptp(value[known]) < _LEAST_SPREAD:
            return False
        seen = Range(float(value[known].min()), float(value[known].max()))
        safe = np.where(known, value, seen.middle)
        self._values[covariate.name] = _Known(safe, known, seen)
        return True

    def best(self, at_most: int) -> list[Found]:
        """The most promising laws, no two of the same site, covariates and form."""
        judged = [one for form in forms() for one in self._of_form(form)]
        reported: dict[tuple[str, str, str], _Judged] = {}
        for one in sorted(judged, key=lambda j: -j.worth):
            along = "*".join(c.name for c in one.tried.covariates)
            reported.setdefault((one.group.site, along, one.form.key), one)
            if len(reported) == at_most:
                break
        return [
            Found(self._law(one), one.gain, one.columns, one.choices, one.worth)
            for one in reported.values()
        ]

    def _of_form(self, form: Form) -> Iterator[_Judged]:
        fitting = [c for c in self.covariates if form.fits(c.name, self._values[c.name].value)]
        if form.covariates > 1:
            pairs = [(a, b) for k, a in enumerate(fitting) for b in fitting[k + 1 :]]
            yield from self._judged(form, [[_Try(pair, {}) for pair in pairs]], "")
            return
        tries = {c.name: self._tries(form, c) for c in fitting}
        around = [c.name for c in fitting if c.cyclic and form.key == "periodic"]
        for name in around:
            yield from self._judged(form, [tries[name]], name)
        yield from self._judged(form, [t for n, t in tries.items() if n not in around], "")

    def _tries(self, form: Form, covariate: Covariate) -> list[_Try]:
        known = self._values[covariate.name]
        value = np.where(known.known, known.value, np.nan)
        return [_Try((covariate,), n) for n in form.tried([value], [known.seen])]

    def _judged(self, form: Form, contests: list[list[_Try]], only: str) -> Iterator[_Judged]:
        """For every group of components (of one site, if given) the best try of each contest."""
        contests = [contest for contest in contests if contest]
        if not contests:
            return
        functions = np.stack([self._functions(form, t) for contest in contests for t in contest])
        ends = np.cumsum([len(contest) for contest in contests])
        for group, gains in self._gains(functions, only):
            for contest, part in zip(contests, np.split(gains, ends[:-1]), strict=True):
                best = int(np.argmax(part))
                yield self._found(form, contest, best, group, float(part[best]))

    def _functions(self, form: Form, one: _Try) -> FloatArray:
        known = [self._values[c.name] for c in one.covariates]
        every = np.all([k.known for k in known], axis=0)
        functions = form.of([k.value for k in known], [k.seen for k in known], one.numbers)
        return np.asarray(functions * every[:, None])

    def _found(
        self, form: Form, contest: list[_Try], best: int, group: _Group, gain: float
    ) -> _Judged:
        pairs = self._pairs if form.covariates == 1 else float(np.log(len(self.groups)))
        ways = pairs + self._forms + float(np.log(len(contest)))
        columns = len(form.functions) * len(group.members)
        columns += sum(number.fitted for number in form.numbers)
        worth = gain - columns * self.number - 2.0 * ways
        return _Judged(form, contest[best], group, gain, columns, ways, worth)

    def _law(self, one: _Judged) -> Law:
        members = [self.blocks.components[k] for k in one.group.members]
        along = one.tried.covariates
        law = Law(
            site=members[0].site,
            components=tuple(m.index for m in members),
            form=one.form,
            covariates=along,
            ranges=tuple(self._values[c.name].seen for c in along),
            numbers=tuple(one.tried.numbers.items()),
        )
        return replace(law, constant=may_need_constant(law))

    def _gains(self, functions: FloatArray, only: str) -> Iterator[tuple[_Group, FloatArray]]:
        """(G,) gains of G sets of (G, N, B) functions, for every group, or those of one site."""
        groups = [g for g in self.groups if only in ("", g.site)]
        if not groups:
            return
        needed = sorted({k for group in groups for k in group.members})
        where = {k: at for at, k in enumerate(needed)}
        information, score = self._whole(functions, needed)
        for group in groups:
            b = functions.shape[2]
            mine = [where[k] * b + j for k in group.members for j in range(b)]
            part = information[:, mine][:, :, mine]
            yield group, _gain(part, score[:, mine])

    def _whole(self, functions: FloatArray, needed: list[int]) -> tuple[FloatArray, FloatArray]:
        """(G, S B, S B) information and (G, S B) score of the S components following them."""
        g, _, b = functions.shape
        own = self._own[:, needed][:, :, needed]
        s, t = len(needed), self._cross.shape[2]
        cross = np.einsum("gnb,nst->gsbt", functions, self._cross[:, needed], optimize=True)
        flat = cross.reshape(g, s * b, t)
        pairs = functions[:, :, :, None] * functions[:, :, None, :]
        raw = np.einsum("gnbc,nsr->gsbrc", pairs, own, optimize=True).reshape(g, s * b, s * b)
        information = raw - flat @ np.swapaxes(flat, 1, 2)
        score = np.einsum("gnb,ns->gsb", functions, self._gradient[:, needed], optimize=True)
        return information, score.reshape(g, s * b) - flat @ self._at


def _gain(information: FloatArray, score: FloatArray) -> FloatArray:
    """(G,) of (G, E, E) and (G, E): what the columns gain, dependent directions left out."""
    diagonal = np.einsum("gee->ge", information)
    scale = np.where(diagonal > _NOTHING, 1.0 / np.sqrt(np.maximum(diagonal, _NOTHING)), 0.0)
    scaled = score * scale
    if information.shape[1] == 1:
        return np.asarray(scaled[:, 0] ** 2)
    normal = information * scale[:, :, None] * scale[:, None, :]
    normal += _DEPENDENT * np.eye(information.shape[1])
    solved = np.linalg.solve(normal, scaled[:, :, None])[:, :, 0]
    return np.asarray(np.einsum("ge,ge->g", scaled, solved))
