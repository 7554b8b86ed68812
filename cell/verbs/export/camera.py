"""One camera, the same at every distance or taken at one: what other programs' formats can say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calib.chain.optics import optics_row
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.calibration_source import DISTORTION


@dataclass(frozen=True)
class Camera:
    """A camera after the paper's Eq. 2 with distortion in OpenCV's terms.

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

    @property
    def optics(self) -> FloatArray:
        """(K,) as `calib.chain.projection.project` takes it."""
        return optics_row(
            alpha_px=self.alpha_px,
            beta_px=self.beta_px,
            u0_px=self.u0_px,
            v0_px=self.v0_px,
            **dict(zip(DISTORTION, self.distortion, strict=True)),
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
        """The shortest of these lengths that leaves out no coefficient, or None."""
        return next((n for n in lengths if not any(self.distortion[n:])), None)

    def coefficients(self, lengths: Sequence[int], tool: str) -> tuple[float, ...]:
        """As many distortion coefficients as `tool` takes, of the lengths it takes.

        Raises
        ------
        InputError
            One that is not zero would be left out.
        """
        length = self.enough(lengths)
        if length is not None:
            return self.distortion[:length]
        left = [n for n, v in zip(DISTORTION, self.distortion, strict=True) if v][-1]
        raise InputError(
            f"{tool} cannot say the distortion coefficient {left}: it takes"
            f" {', '.join(DISTORTION[: max(lengths)])}. Export to another format, such as opencv,"
            " or take the best fit with those: --refit"
        )
