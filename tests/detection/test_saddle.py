import numpy as np
import pytest

from calib.detection import saddle


def window(width, rng):
    """Pixels around a corner, in the kernel's own layout, with neighbours that mix in."""
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    pixels = np.zeros((x.size, 9))
    pixels[:, 0], pixels[:, 1] = x.ravel(), y.ravel()
    pixels[:, 2] = rng.uniform(0, 255, x.size)
    pixels[:, 3:5] = rng.uniform(-0.05, 0.05, (x.size, 2))
    pixels[:, 5] = rng.uniform(0.9, 1.0, x.size)
    pixels[:, 7:9] = rng.uniform(-0.05, 0.05, (x.size, 2))
    return pixels, np.array([14.7, 15.2, 0.2, 1.45, width, 70.0, 120.0])


@pytest.mark.parametrize("width", [0.35, 0.6, 1.2, 4.0])
def test_gradient_of_the_cost_is_that_of_finite_differences(width):
    rng = np.random.default_rng(1)
    pixels, p = window(width, rng)
    shape = np.array([0.0, 0.0, 0.0, 0.0, 2e-3, -1e-3])
    A, g = np.empty((7, 7)), np.empty(7)

    def cost(parameters):
        return saddle._normal_equations(parameters, pixels, len(pixels), shape, 14.5, 15.5, A, g)

    numeric = np.empty(7)
    for k in range(7):
        step = np.zeros(7)
        step[k] = 1e-4
        numeric[k] = (cost(p + step) - cost(p - step)) / 2e-4
    cost(p)
    # the box's and the curved arm's own change with the angle are left out of the derivative
    np.testing.assert_allclose(-2 * g, numeric, rtol=0.02, atol=0.01 * np.abs(numeric).max())


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.785])
def test_a_boxed_edge_is_the_average_over_the_pixel(angle):
    nx, ny = np.cos(angle), np.sin(angle)
    offsets = (np.arange(200) + 0.5) / 200 - 0.5
    ox, oy = np.meshgrid(offsets, offsets)
    for d in (-0.6, 0.1, 0.45):
        inside = [saddle._gaussian_edge(v, 0.2)[0] for v in (d + nx * ox + ny * oy).ravel()[::7]]
        assert saddle._boxed_edge(d, 0.2, nx, ny)[0] == pytest.approx(np.mean(inside), abs=3e-3)


def test_slanted_edges_follow_the_bivariate_normal():
    rng = np.random.default_rng(0)
    rho = 0.6
    noise = rng.multivariate_normal([0, 0], [[1, rho], [rho, 1]], 400_000)
    for z1, z2 in ((0.0, 0.0), (0.7, -0.4), (1.5, 1.0)):
        blurred = np.mean(np.sign(z1 + noise[:, 0]) * np.sign(z2 + noise[:, 1]))
        product = saddle._gaussian_edge(z1, 1.0)[0] * saddle._gaussian_edge(z2, 1.0)[0]
        assert product + saddle._slant(z1, z2, rho)[0] == pytest.approx(blurred, abs=6e-3)
