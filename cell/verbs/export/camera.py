"""One camera, the same at every distance or taken at one: what other programs' formats can say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calib.chain.optics import optics_row
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.calibration_source import DISTORTION

FISHEYE = ("k1", "k2", "k3", "k4")
"""Kannala and Brandt's terms, in the order of every tool that has them."""


@dataclass(frozen=True)
class Camera:
    """A camera after the paper's Eq. 2 with distortion in OpenCV's terms.

    With `wide` the image is equidistant, and k1 to k4 are those of OpenCV's `fisheye`.

    Attributes
    ----------
    image_size_px:
        (width, height) of the image, or None where nothing states.
    alpha_px, beta_px, u0_px, v0_px:
        Focal lengths and principal point, (0, 0) at the centre of the top-left pixel.
    distortion:
        (14,) `cell.storage.files.calibration_source.DISTORTION`.
    about:
        What it is and where it came from, one line, for a comment in the file.
    """

    image_size_px: tuple[int, int] | None
    alpha_px: float
    beta_px: float
    u0_px: float
    v0_px: float
    distortion: tuple[float, ...]
    about: str
    wide: bool = False

    @property
    def optics(self) -> FloatArray:
        """(K,) as `calib.chain.projection.project` takes it."""
        return optics_row(
            alpha_px=self.alpha_px,
            beta_px=self.beta_px,
            u0_px=self.u0_px,
            v0_px=self.v0_px,
            **dict(zip(DISTORTION, self.distortion, strict=True)),
            equidistant=float(self.wide),
        )

    def size_px(self, tool: str) -> tuple[int, int]:
        """(width, height); raises `InputError` where nothing states, naming the tool in need."""
        if self.image_size_px is None:
            raise InputError(
                f"the calibration does not state the image's size, which {tool} needs: say"
                " --image-size WIDTHxHEIGHT, or run cell calibrate anew"
            )
        return self.image_size_px

    def enough(self, lengths: Sequence[int]) -> int | None:
        """The shortest of these lengths that leaves out no coefficient, or None.

        Of a perspective image; an equidistant one has none of them, see `exact`.
        """
        return next((n for n in lengths if not any(self.distortion[n:])), None)

    def coefficients(self, lengths: Sequence[int], tool: str) -> tuple[float, ...]:
        """As many distortion coefficients as `tool` takes, of the lengths it takes.

        Raises
        ------
        InputError
            One that is not zero would be left out, or the image is not a perspective one.
        """
        if self.wide:
            raise InputError(
                f"{tool} has no equidistant image, which this wide lens makes. Export to another"
                " format, such as opencv, ros, kalibr or colmap, or take the best fit: --refit"
            )
        length = self.enough(lengths)
        if length is not None:
            return self.distortion[:length]
        left = [n for n, v in zip(DISTORTION, self.distortion, strict=True) if v][-1]
        raise InputError(
            f"{tool} cannot say the distortion coefficient {left}: it takes"
            f" {', '.join(DISTORTION[: max(lengths)])}. Export to another format, such as opencv,"
            " or take the best fit with those: --refit"
        )

    @property
    def is_kannala_brandt(self) -> bool:
        """Whether a wide lens has no coefficients but Kannala and Brandt's four."""
        others = (v for n, v in zip(DISTORTION, self.distortion, strict=True) if n not in FISHEYE)
        return self.wide and not any(others)

    def fisheye_coefficients(self, tool: str) -> tuple[float, ...]:
        """k1 to k4 of a wide lens; raises `InputError` where it has others that are not zero."""
        named = dict(zip(DISTORTION, self.distortion, strict=True))
        if not self.is_kannala_brandt:
            left = next(n for n, v in named.items() if v and n not in FISHEYE)
            raise InputError(
                f"{tool} cannot say the distortion coefficient {left} of a wide lens: it takes"
                f" {', '.join(FISHEYE)}. Take the best fit with those: --refit"
            )
        return tuple(named[name] for name in FISHEYE)
