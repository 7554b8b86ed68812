"""A law without a name: a site of the chain follows covariates in some form.

It is an effect like those of the catalogue, made to measure at run time: evaluated, fitted,
simulated and predicted by the same chain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.covariates import Covariate, covariate_named
from calib.chain.effect import Effect, Parameter, Present
from calib.chain.empirical import INNER_JOINTS, UNNAMED, Site, site_named, span
from calib.chain.laws import form_of
from calib.chain.laws.form import Form, Numbers, Range
from calib.chain.state import ChainState
from calib.views import FloatArray

_CONSTANT = "constant_term"


@dataclass(frozen=True)
class Law:
    """Which numbers of which site follow what, in which form.

    Attributes
    ----------
    site, components:
        Where, and which of its numbers, all by the same functions.
    form, covariates:
        How, and along what.
    ranges:
        What was seen of each covariate.
    numbers:
        Shapes and settings of the form.
    constant:
        Whether a constant of its own goes with it.
    """

    site: Site
    components: tuple[int, ...]
    form: Form
    covariates: tuple[Covariate, ...]
    ranges: tuple[Range, ...]
    numbers: tuple[tuple[str, float], ...] = ()
    constant: bool = False

    @property
    def text(self) -> str:
        """Unique in a model, as it stands in files: form, site, components, covariates."""
        names = "+".join(self.site.components[k][0] for k in self.components)
        along = "*".join(covariate.name for covariate in self.covariates)
        return f"{self.form.key}:{self.site.name}.{names}/{along}"

    def functions(self, state: ChainState) -> FloatArray:
        """(N, B) of the form's functions; zero where a covariate is not known."""
        values = [covariate.of(state) for covariate in self.covariates]
        return functions_of(self.form, values, self.ranges, dict(self.numbers))

    def with_numbers(self, numbers: Numbers) -> Law:
        """The same law with other shapes and settings."""
        return replace(self, numbers=tuple(numbers.items()))


def functions_of(
    form: Form, values: Sequence[FloatArray], ranges: Sequence[Range], numbers: Numbers
) -> FloatArray:
    """(N, B) of a form's functions; zero in the rows in which a value is not known."""
    known = np.all([np.isfinite(value) for value in values], axis=0)
    safe = [np.where(known, value, seen.middle) for value, seen in zip(values, ranges, strict=True)]
    return np.asarray(form.of(safe, ranges, numbers) * known[:, None])


def seen(covariates: Sequence[Covariate], state: ChainState) -> tuple[Range, ...]:
    """The range of each covariate in these frames."""
    return tuple(Range(*span(covariate.of(state))) for covariate in covariates)


def present_law(law: Law) -> Present:
    """The law as an effect with all amounts zero."""
    effect = law_effect(law)
    return Present(effect, effect.values(_given(law)))


def _given(law: Law) -> dict[str, float]:
    ends: dict[str, float] = {}
    for k, seen_range in enumerate(law.ranges, start=1):
        ends |= {f"low_{k}": seen_range.low, f"high_{k}": seen_range.high}
    return {**dict(law.numbers), **ends}


def law_effect(law: Law) -> Effect:
    """The effect by which the law acts."""
    amounts = tuple(_amounts(law))
    numbers = tuple(_number_parameters(law))
    count = len(amounts)

    def act(values: FloatArray, state: ChainState) -> None:
        coefficients = values[:count].reshape(-1, len(law.components))
        if not coefficients.any():
            return
        names = (parameter.name for parameter in numbers)
        shaped = law.with_numbers(dict(zip(names, values[count:], strict=False)))
        functions = shaped.functions(state)
        if law.constant:
            functions = np.concatenate([functions, np.ones((len(functions), 1))], axis=1)
        moved = np.zeros((len(functions), len(law.site.components)))
        moved[:, list(law.components)] = functions @ coefficients
        law.site.shift(moved, state)

    along = " and ".join(c.name.replace("_", " ") for c in law.covariates)
    return Effect(
        name=UNNAMED,
        law=law.text,
        link=law.site.acts_in,
        looks_ahead=law.site.acts_in == "arm",
        physics=(
            f"Something that no known effect accounts for moves the"
            f" {law.site.name.replace('_', ' ')} with the {along}."
        ),
        equation=f"{law.site.name} = constant + {law.form.name}({along})",
        source="forms of one or two numbers, chosen by description length (Rissanen 1978)",
        parameters=(*amounts, *numbers, *_ends(law)),
        act=act,
        remedy="Find out what changes with it; until then the twin carries the law.",
        separable=False,
    )


def _amounts(law: Law) -> Iterator[Parameter]:
    scale = float(np.prod([max(r.width, 1e-9) for r in law.ranges]))
    if law.form.key == "product":
        scale = float(np.prod([max(abs(r.low), abs(r.high), 1e-9) for r in law.ranges]))
    unit_of = "*".join(covariate.unit for covariate in law.covariates)
    for name, power in law.form.functions:
        for k in law.components:
            component, unit, typical = law.site.components[k]
            per = "" if power == 0 else f"/{unit_of}" + (f"^{-power}" if power < -1 else "")
            size = typical * scale**power
            yield Parameter(f"{name}_{component}", f"{unit}{per}", size, -1e6 * size, 1e6 * size)
    if law.constant:
        for k in law.components:
            component, unit, typical = law.site.components[k]
            yield Parameter(f"{_CONSTANT}_{component}", unit, typical, -1e3, 1e3)


def _number_parameters(law: Law) -> Iterator[Parameter]:
    given = dict(law.numbers)
    width = law.ranges[0].width
    for number in law.form.numbers:
        if not number.fitted:
            yield Parameter(number.name, "1", given[number.name], -1e12, 1e12, role="setting")
        elif number.power < 0:
            usual = max(0.3 / width, 1e-3)
            yield Parameter(number.name, f"1/{law.covariates[0].unit}", usual, 0.0, 1e6, "shape")
        else:
            low = 0.02 * width if number.name == "constant" else law.ranges[0].low
            high = 3.0 * width if number.name == "constant" else law.ranges[0].high
            unit = law.covariates[0].unit
            yield Parameter(number.name, unit, 0.1 * width, low, high, role="shape")


def _ends(law: Law) -> Iterator[Parameter]:
    for k, (covariate, r) in enumerate(zip(law.covariates, law.ranges, strict=True), start=1):
        for name, value in (("low", r.low), ("high", r.high)):
            yield Parameter(f"{name}_{k}", covariate.unit, value, -1e12, 1e12, role="setting")


def law_of(present: Present) -> Law:
    """The law that an effect carries, with its numbers as they are fitted."""
    assert present.effect.law is not None
    return _law(present.effect.law, present.as_mapping())


def law_from(text: str, given: Mapping[str, float]) -> Present:
    """Return the law that a file states, with its values.

    Raises
    ------
    KeyError
        For an unknown form, site, component or number.
    """
    effect = law_effect(_law(text, given))
    return Present(effect, effect.values(given))


def _law(text: str, given: Mapping[str, float]) -> Law:
    key, _, rest = text.partition(":")
    where, _, along = rest.partition("/")
    site_name, _, names = where.partition(".")
    site, form = site_named(site_name), form_of(key)
    places = {name: k for k, (name, _, _) in enumerate(site.components)}
    covariates = tuple(covariate_named(name) for name in along.split("*"))
    ranges = tuple(
        Range(given.get(f"low_{k}", 0.0), given.get(f"high_{k}", 1.0))
        for k in range(1, len(covariates) + 1)
    )
    return Law(
        site=site,
        components=tuple(places[name] for name in names.split("+")),
        form=form,
        covariates=covariates,
        ranges=ranges,
        numbers=tuple((number.name, given[number.name]) for number in form.numbers),
        constant=any(name.startswith(_CONSTANT) for name in given),
    )


def may_need_constant(law: Law) -> bool:
    """Whether what the law adds in every frame is absorbed by nothing."""
    return law.form.own_constant and law.site.name in INNER_JOINTS
