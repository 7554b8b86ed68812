"""Every pixel of a message keeps its value and its depth."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from cell.errors import InputError
from cell.verbs.importing.bags.pictures import picture
from tests.cell.bags import T, header, image

RNG = np.random.default_rng(2)
GREY = RNG.integers(0, 256, (6, 8)).astype(np.uint8)
DEEP = RNG.integers(0, 65536, (6, 8)).astype(np.uint16)
COLOUR = RNG.integers(0, 256, (6, 8, 3)).astype(np.uint8)
DEEP_COLOUR = RNG.integers(0, 65536, (6, 8, 3)).astype(np.uint16)
ALPHA = np.concatenate([COLOUR, COLOUR[..., :1]], axis=2)


def _read(pixels: np.ndarray, encoding: str, **more: Any) -> np.ndarray:
    return np.asarray(picture(image(pixels, encoding, 0.0, **more), "here"))


@pytest.mark.parametrize(
    ("pixels", "encoding", "expected"),
    [
        (GREY, "mono8", GREY),
        (GREY, "8UC1", GREY),
        (DEEP, "mono16", DEEP),
        (DEEP, "16UC1", DEEP),
        (COLOUR, "bgr8", COLOUR),
        (COLOUR, "rgb8", COLOUR[..., ::-1]),
        (DEEP_COLOUR, "rgb16", DEEP_COLOUR[..., ::-1]),
        (ALPHA, "bgra8", COLOUR),
        (ALPHA, "rgba8", COLOUR[..., ::-1]),
    ],
)
def test_raw_pictures(pixels: np.ndarray, encoding: str, expected: np.ndarray) -> None:
    found = _read(pixels, encoding)
    assert found.dtype == expected.dtype
    assert np.array_equal(found, expected)


def test_the_other_byte_order_and_padded_lines() -> None:
    assert np.array_equal(_read(DEEP.byteswap(), "mono16", big=1), DEEP)
    padded = np.pad(GREY, ((0, 0), (0, 5)))
    message = image(padded, "mono8", 0.0, step=13)
    message.width = 8
    assert np.array_equal(picture(message, "here"), GREY)
    message.data = message.data[:-5]
    assert np.array_equal(picture(message, "here"), GREY)


@pytest.mark.parametrize("deep", [np.uint8, np.uint16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_bayer_mosaic_gets_its_colours(pattern: str, deep: type) -> None:
    """ROS names the first four pixels; OpenCV's names of old are one row and column on."""
    top = np.iinfo(deep).max
    value = {"r": top // 5, "g": top // 2, "b": top - 3}
    cell = np.array([value[letter] for letter in pattern], dtype=deep).reshape(2, 2)
    mosaic = np.tile(cell, (4, 4))
    encoding = f"bayer_{pattern}{8 * np.dtype(deep).itemsize}"
    expected = [value[letter] for letter in "bgr"]
    assert (_read(mosaic, encoding)[2:-2, 2:-2] == expected).all()
    packed = _compressed(mosaic, f"{encoding}; png compressed {encoding}")
    assert (packed[2:-2, 2:-2] == expected).all()
    assert packed.dtype == deep


def _compressed(pixels: np.ndarray, result: str, suffix: str = ".png") -> np.ndarray:
    data = cv2.imencode(suffix, pixels)[1].ravel()
    kind = T["sensor_msgs/msg/CompressedImage"]
    return np.asarray(picture(kind(header=header(0.0), format=result, data=data), "here"))


def test_a_compressed_picture_keeps_sixteen_bits() -> None:
    """rosbags-image 0.10.4 makes 3 of 1000."""
    deep = np.full((6, 8), 1000, np.uint16)
    assert np.array_equal(_compressed(deep, "mono16; png compressed "), deep)
    assert np.array_equal(_compressed(COLOUR, "bgr8; png compressed bgr8"), COLOUR)
    assert _compressed(COLOUR, "bgr8; jpeg compressed bgr8", ".jpg").shape == COLOUR.shape


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"encoding": "32FC1"}, "encoding '32FC1' is not known"),
        ({"step": 3}, "are no picture of 8 x 6 mono8 with lines of 3 bytes"),
        ({"height": 7}, "are no picture"),
        ({"height": 0}, "are no picture"),
        ({"width": 2**31, "height": 2**31}, "pixels are too many"),
    ],
)
def test_a_header_that_lies_is_refused(change: dict[str, Any], words: str) -> None:
    message = image(GREY, "mono8", 0.0)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(InputError, match=words):
        picture(message, "here")


def test_depth_is_no_picture_and_noise_is_none() -> None:
    with pytest.raises(InputError, match="is a depth picture"):
        _compressed(DEEP, "16UC1; compressedDepth png")
    kind = T["sensor_msgs/msg/CompressedImage"]
    message = kind(header=header(0.0), format="jpeg", data=np.arange(50, dtype=np.uint8))
    with pytest.raises(InputError, match="is not an image"):
        picture(message, "here")
