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
from calib.chain.laws.law import Law, functions_of, may_need_constant
from calib.discovery.laws.frames import FrameBlocks
from calib.discovery.score import pose_numbers
from calib.views import FloatArray, Views

_LEAST_SPREAD = 1e-9


@dataclass(frozen=True)
class Found:
    """A law, and what it promises.

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


class Scan:
    """One linearisation and everything that can be asked of it."""

    def __init__(self, blocks: FrameBlocks, views: Views) -> None:
        self.blocks, self.views = blocks, views
        self.groups = _groups(blocks)
        t = blocks.shared
        information, gradient = blocks.base()
        root = _root(information)
        self._cross = blocks.information[:, :t, t:].transpose(0, 2, 1) @ root
        self._at = root.T @ gradient
        self._own = blocks.information[:, t:, t:]
        self._gradient = blocks.gradient[:, t:]
        self.values: dict[str, FloatArray] = {}
        self.covariates = [c for c in covariates_of(views) if self._varies(c)]
        self.number = float(np.log(pose_numbers(views)))
        self._pairs = float(np.log(len(self.groups) * max(len(self.covariates), 1)))
        self._forms = float(np.log(len(forms())))

    def _varies(self, covariate: Covariate) -> bool:
        value = covariate.of(self.blocks.state)
        if value.ndim > 1:
            return False
        self.values[covariate.name] = value
        known = value[np.isfinite(value)]
        return len(known) > 0.8 * len(value) and float(np.ptp(known)) > _LEAST_SPREAD

    def best(self, at_most: int) -> list[Found]:
        """The most promising laws, no two of the same site, covariates and form."""
        found = [f for form in forms() if form.covariates == 1 for f in self._singly(form)]
        found += [f for form in forms() if form.covariates == 2 for f in self._paired(form)]
        told: dict[tuple[str, str, str], Found] = {}
        for one in sorted(found, key=lambda f: -f.worth):
            along = "*".join(c.name for c in one.law.covariates)
            told.setdefault((one.law.site.name, along, one.law.form.key), one)
            if len(told) == at_most:
                break
        return list(told.values())

    def _singly(self, form: Form) -> Iterator[Found]:
        for covariate in self.covariates:
            value = self.values[covariate.name]
            if form.fits(covariate.name, value):
                yield from self._along(form, covariate)

    def _paired(self, form: Form) -> Iterator[Found]:
        """The best pair of covariates for each group of components."""
        known = [c for c in self.covariates if form.fits(c.name, self.values[c.name])]
        pairs = [(a, b) for k, a in enumerate(known) for b in known[k + 1 :]]
        if not pairs:
            return
        functions = np.stack([self._functions(form, pair, {}) for pair in pairs])
        ways = float(np.log(len(self.groups) * len(pairs))) + self._forms
        for group, gains in self._gains(functions, ""):
            best = int(np.argmax(gains))
            law = self._law(form, pairs[best], {}, group)
            yield self._found(law, float(gains[best]), ways)

    def _functions(
        self, form: Form, covariates: tuple[Covariate, ...], numbers: Numbers
    ) -> FloatArray:
        values = [self.values[c.name] for c in covariates]
        return functions_of(form, values, self._ranges(covariates), numbers)

    def _ranges(self, covariates: tuple[Covariate, ...]) -> tuple[Range, ...]:
        values = [self.values[c.name] for c in covariates]
        return tuple(Range(float(np.nanmin(v)), float(np.nanmax(v))) for v in values)

    def _found(self, law: Law, gain: float, ways: float) -> Found:
        shapes = sum(number.fitted for number in law.form.numbers)
        columns = len(law.form.functions) * len(law.components) + shapes
        worth = gain - columns * self.number - 2.0 * ways
        return Found(law, gain, columns + law.constant, ways, worth)

    def _along(self, form: Form, covariate: Covariate) -> Iterator[Found]:
        """The best numbers for each group of components."""
        along = (covariate,)
        tried = form.tried([self.values[covariate.name]], self._ranges(along))
        if not tried:
            return
        functions = np.stack([self._functions(form, along, numbers) for numbers in tried])
        ways = self._pairs + self._forms + float(np.log(len(tried)))
        swings = form.key == "periodic" and covariate.cyclic
        for group, gains in self._gains(functions, covariate.name if swings else ""):
            best = int(np.argmax(gains))
            law = self._law(form, along, tried[best], group)
            yield self._found(law, float(gains[best]), ways)

    def _law(
        self, form: Form, covariates: tuple[Covariate, ...], numbers: Numbers, group: _Group
    ) -> Law:
        members = [self.blocks.components[k] for k in group.members]
        law = Law(
            site=members[0].site,
            components=tuple(m.index for m in members),
            form=form,
            covariates=covariates,
            ranges=self._ranges(covariates),
            numbers=tuple(numbers.items()),
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


def _root(information: FloatArray) -> FloatArray:
    """(T, R) matrix whose product with its own transpose is the (pseudo-)inverse."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    value, vector = np.linalg.eigh(information * scale[:, None] * scale[None, :])
    kept = value > 1e-10 * max(float(value[-1]), 1e-300)
    return np.asarray(scale[:, None] * vector[:, kept] / np.sqrt(value[kept]))


def _gain(information: FloatArray, score: FloatArray) -> FloatArray:
    """(G,) of (G, E, E) and (G, E): what the columns gain, dependent directions left out."""
    diagonal = np.einsum("gee->ge", information)
    scale = np.where(diagonal > 1e-9, 1.0 / np.sqrt(np.maximum(diagonal, 1e-9)), 0.0)
    if information.shape[1] == 1:
        return np.asarray((score[:, 0] * scale[:, 0]) ** 2)
    value, vector = np.linalg.eigh(information * scale[:, :, None] * scale[:, None, :])
    along = np.einsum("gek,ge->gk", vector, score * scale)
    safe = np.where(value > 1e-5, value, np.inf)
    return np.asarray((along**2 / safe).sum(axis=1))
