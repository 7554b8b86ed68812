"""Distance of two convex hulls of a few points each: the Gilbert-Johnson-Keerthi algorithm.

E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between
complex objects in three-dimensional space", IEEE Journal of Robotics and Automation 4(2), 1988.
The nearest point of a simplex is found by trying all its faces (at most 15), which needs no case
analysis and is exact enough for bodies of millimetres and metres.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_ITERATIONS = 40
_RELATIVE, _TOUCHING_M = 1e-9, 1e-9


@njit(cache=True, nogil=True, error_model="numpy")
def _farthest(points, along):  # type: ignore[no-untyped-def]
    best, at = -np.inf, 0
    for k in range(points.shape[0]):
        reach = points[k, 0] * along[0] + points[k, 1] * along[1] + points[k, 2] * along[2]
        if reach > best:
            best, at = reach, k
    return at


@njit(cache=True, nogil=True, error_model="numpy")
def _solved(matrix, right, n):  # type: ignore[no-untyped-def]
    """Solve the leading n x n system in place by elimination; False where it is singular.

    The matrix is one of scalar products of edges, so no pivoting is needed.
    """
    for i in range(n):
        if matrix[i, i] < 1e-18:
            return False
        for j in range(i + 1, n):
            share = matrix[j, i] / matrix[i, i]
            for k in range(i, n):
                matrix[j, k] -= share * matrix[i, k]
            right[j] -= share * right[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest_of_face(products, members, n, weights, matrix, right):  # type: ignore[no-untyped-def]
    """Weights of the point of a face's plane nearest to the origin; False where it is outside."""
    p = members[0]
    for i in range(n - 1):
        q = members[i + 1]
        right[i] = products[p, p] - products[q, p]
        for j in range(n - 1):
            r = members[j + 1]
            matrix[i, j] = products[q, r] - products[q, p] - products[p, r] + products[p, p]
    if not _solved(matrix, right, n - 1):
        return False
    weights[p] = 1.0
    for i in range(n - 1):
        weights[members[i + 1]] = right[i]
        weights[p] -= right[i]
    inside = True
    for i in range(n):
        inside = inside and weights[members[i]] >= 0.0
    return inside


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest_of_simplex(products, count, weights):  # type: ignore[no-untyped-def]
    """Write the weights of the point of the simplex nearest to the origin.

    `products` are the scalar products (4, 4) of its corners.
    """
    best = np.inf
    members = np.empty(4, np.int64)
    tried, matrix, right = np.empty(4), np.empty((3, 3)), np.empty(3)
    for face in range(1, 1 << count):
        n = 0
        for k in range(count):
            tried[k] = 0.0
            if face >> k & 1:
                members[n] = k
                n += 1
        if not _nearest_of_face(products, members, n, tried, matrix, right):
            continue
        square = 0.0
        for i in range(n):
            for j in range(n):
                p, q = members[i], members[j]
                square += tried[p] * tried[q] * products[p, q]
        if square < best:
            best = square
            for k in range(count):
                weights[k] = tried[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _without_idle(simplex, from_a, weights, count):  # type: ignore[no-untyped-def]
    """Drop the corners without weight; returns how many are left."""
    kept = 0
    for k in range(count):
        if weights[k] > 0.0:
            for i in range(3):
                simplex[kept, i], from_a[kept, i] = simplex[k, i], from_a[k, i]
            weights[kept] = weights[k]
            kept += 1
    return kept


@njit(cache=True, nogil=True, error_model="numpy")
def _weighted(points, weights, count, out):  # type: ignore[no-untyped-def]
    for i in range(3):
        out[i] = 0.0
        for k in range(count):
            out[i] += weights[k] * points[k, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_products(simplex, count, products):  # type: ignore[no-untyped-def]
    for p in range(count):
        for q in range(p + 1):
            dot = 0.0
            for i in range(3):
                dot += simplex[p, i] * simplex[q, i]
            products[p, q] = products[q, p] = dot


@njit(cache=True, nogil=True, error_model="numpy")
def hull_gap(a, b, place):  # type: ignore[no-untyped-def]
    """Distance between the convex hulls of two sets of points.

    Parameters
    ----------
    a, b:
        (N, 3), (M, 3) points in one frame, metres.
    place:
        (3,) written: the nearest point of a's hull; of a common point where they overlap.

    Returns
    -------
    float
        Metres; 0 where they touch or overlap.
    """
    simplex, from_a, products = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 4))
    weights, nearest, back = np.zeros(4), np.empty(3), np.empty(3)
    weights[0], count = 1.0, 1
    for i in range(3):
        from_a[0, i] = a[0, i]
        simplex[0, i] = nearest[i] = a[0, i] - b[0, i]
    for _ in range(_ITERATIONS):
        square = nearest[0] ** 2 + nearest[1] ** 2 + nearest[2] ** 2
        if square < _TOUCHING_M * _TOUCHING_M or count == 4:
            break
        for i in range(3):
            back[i] = -nearest[i]
        p, q = _farthest(a, back), _farthest(b, nearest)
        ahead = 0.0
        for i in range(3):
            simplex[count, i], from_a[count, i] = a[p, i] - b[q, i], a[p, i]
            ahead += nearest[i] * simplex[count, i]
        if square - ahead <= _RELATIVE * square:
            break
        count += 1
        _add_products(simplex, count, products)
        _nearest_of_simplex(products, count, weights)
        count = _without_idle(simplex, from_a, weights, count)
        _weighted(simplex, weights, count, nearest)
    _weighted(from_a, weights, count, place)
    square = nearest[0] ** 2 + nearest[1] ** 2 + nearest[2] ** 2
    return np.sqrt(square) if square > _TOUCHING_M * _TOUCHING_M else 0.0
