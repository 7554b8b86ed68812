"""Mutations of a valid input: of its bytes, and of the words and numbers in it."""

from __future__ import annotations

import random
import re

_NUMBERS = (
    *(b"0", b"-1", b"1e-300", b"1e300", b"1e999", b"nan", b"NaN", b".inf", b"Infinity"),
    *(b"9" * 400, b"9" * 5000, b"18446744073709551616", b"1180591620717411303424", b"0x7f"),
)
_WORDS = (
    *(b"null", b"true", b"~", b"''", b"[]", b"{}", b"!!set 7", b"&a [*a]", b"*a", b"\0", b"\xff"),
    *(b"../../x", b"/dev/zero", b"[" * 200, b"{a: " * 100, b"- " * 200, b"\xe2\x80\xa8", b"<<: *a"),
)
_TOKEN = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_LARGEST = 200_000


def mutated(seed: bytes, rng: random.Random) -> bytes:
    """One to four mutations, one after the other."""
    data = seed
    for _ in range(rng.randint(1, 4)):
        data = rng.choice(_KINDS)(data, rng)[:_LARGEST]
    return data


def _flipped(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        if out:
            out[rng.randrange(len(out))] = rng.randrange(256)
    return bytes(out)


def _cut(data: bytes, rng: random.Random) -> bytes:
    first, second = sorted(rng.randint(0, len(data)) for _ in range(2))
    return data[:first] + data[second:] if rng.random() < 0.5 else data[:first]


def _repeated(data: bytes, rng: random.Random) -> bytes:
    first, second = sorted(rng.randint(0, len(data)) for _ in range(2))
    return data[:second] + data[first:second] * rng.choice((1, 2, 50)) + data[second:]


def _put(data: bytes, rng: random.Random) -> bytes:
    at = rng.randint(0, len(data))
    return data[:at] + rng.choice(_WORDS + _NUMBERS) + data[at:]


def _renumbered(data: bytes, rng: random.Random) -> bytes:
    numbers = list(_TOKEN.finditer(data[:20_000]))
    if not numbers:
        return _put(data, rng)
    chosen = rng.choice(numbers)
    return data[: chosen.start()] + rng.choice(_NUMBERS + _WORDS) + data[chosen.end() :]


def _line_moved(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    line = lines.pop(rng.randrange(len(lines)))
    lines.insert(rng.randint(0, len(lines)), rng.choice((line, b"  " + line, line.strip())))
    return b"\n".join(lines)


_KINDS = (_flipped, _cut, _repeated, _put, _renumbered, _renumbered, _line_moved)
