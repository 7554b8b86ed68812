"""A picture that says which scene it shows, readable through JPEG and through noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sim.peers.callable_camera import CallableCamera

WIDTH, HEIGHT = 640, 512
_BITS, _BLOCK = 16, 32


@dataclass
class Scene:
    """What stands before the camera; `number` changes, `delay_s` makes the picture come late."""

    number: int = 0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def picture(self, camera: CallableCamera) -> np.ndarray:
        image = self.rng.integers(40, 60, (HEIGHT, WIDTH), dtype=np.uint8)
        for bit in range(_BITS):
            if self.number >> bit & 1:
                image[:_BLOCK, bit * _BLOCK : (bit + 1) * _BLOCK] += 150
        return image


def number_in(image: np.ndarray) -> int:
    grey = image if image.ndim == 2 else image.mean(axis=2)
    blocks = [grey[4 : _BLOCK - 4, b * _BLOCK + 4 : (b + 1) * _BLOCK - 4] for b in range(_BITS)]
    return sum((block.mean() > 120) << bit for bit, block in enumerate(blocks))
