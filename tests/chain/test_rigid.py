"""Rigid transforms form a group, and the small increments are its tangent."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from calib.chain import rigid
from calib.views import FloatArray

INCREMENTS = arrays(
    np.float64, (3, 6), elements=st.floats(-1.7, 1.7, allow_nan=False, allow_subnormal=False)
)
SMALL = arrays(np.float64, (6,), elements=st.floats(-1e-4, 1e-4))


@given(INCREMENTS)
@settings(max_examples=60, deadline=None)
def test_vector_and_transform_are_each_other_s_inverse(increment: FloatArray) -> None:
    transform = rigid.from_vector(increment)
    assert np.allclose(rigid.to_vector(transform), increment, atol=1e-9)
    rotation = transform[:, :3, :3]
    assert np.allclose(rotation @ np.swapaxes(rotation, 1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(rotation), 1.0)


@given(INCREMENTS)
@settings(max_examples=60, deadline=None)
def test_products_and_inverses_stay_in_the_group(increment: FloatArray) -> None:
    a, b, c = rigid.from_vector(increment)
    assert np.allclose(a @ rigid.inverse(a), np.eye(4), atol=1e-12)
    assert np.allclose(rigid.inverse(a), np.linalg.inv(a), atol=1e-10)
    assert np.allclose(rigid.inverse(a @ b), rigid.inverse(b) @ rigid.inverse(a), atol=1e-12)
    again = rigid.from_vector(rigid.to_vector(a @ b @ c))
    assert np.allclose(again, a @ b @ c, atol=1e-9)


@given(INCREMENTS, SMALL)
@settings(max_examples=60, deadline=None)
def test_the_adjoint_carries_a_small_increment_to_the_other_side(
    increment: FloatArray, small: FloatArray
) -> None:
    transform = rigid.from_vector(increment[0])
    carried = rigid.adjoint(transform) @ small
    on_the_right = transform @ rigid.from_vector(small)
    on_the_left = rigid.from_vector(carried) @ transform
    assert np.abs(on_the_right - on_the_left).max() < 1e-7


@given(INCREMENTS)
@settings(max_examples=30, deadline=None)
def test_adjoints_multiply_as_their_transforms_do(increment: FloatArray) -> None:
    a, b, _ = rigid.from_vector(increment)
    assert np.allclose(rigid.adjoint(a @ b), rigid.adjoint(a) @ rigid.adjoint(b), atol=1e-9)


@given(INCREMENTS)
@settings(max_examples=30, deadline=None)
def test_skew_is_the_cross_product(increment: FloatArray) -> None:
    a, b = increment[0, :3], increment[0, 3:]
    assert np.allclose(rigid.skew(a) @ b, np.cross(a, b), atol=1e-12)
