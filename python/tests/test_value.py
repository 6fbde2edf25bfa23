"""The closed form, against an independent one, play itself, and NumPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import sidestep

# Headings exceed a full turn here.
pytestmark = pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")


def plain_value(states, speed, rate, radius):
    """The formula of the reference, in NumPy: the larger of two sheets while the range closes."""
    x, y, psi = np.asarray(states).T
    rho = speed / rate
    x, y, psi = x / rho, y / rho, np.mod(psi, 2 * np.pi)
    reach = np.hypot(x, y)

    def sheet(x, y, psi):
        sin, cos = np.sin(psi / 2), np.cos(psi / 2)
        ahead = x * cos + y * sin
        a, b = x * sin - y * cos - 2 * cos, -ahead
        with np.errstate(invalid="ignore", divide="ignore"):
            u = np.arctan2(b, a) + np.arccos(np.minimum(2 / np.hypot(a, b), 1))
        most = np.pi - psi / 2
        straight = ahead * np.cos(u) + a * np.sin(u) - 2 * u
        same = np.hypot(x + np.sin(psi), y + 1 - np.cos(psi)) - 2 * most
        return np.where(a <= 2, ahead, np.where(u <= most, straight, same))

    nearest = np.minimum(reach, np.maximum(sheet(x, y, psi), sheet(x, -y, 2 * np.pi - psi)))
    opening = -x * np.sin(psi / 2) + y * np.cos(psi / 2) >= 0
    return rho * np.where(opening, reach, nearest) - radius


def test_it_is_the_formula_of_the_reference(paper, rng):
    states = rng.uniform([-30, -30, -7], [30, 30, 7], (200_000, 3))
    assert np.abs(sidestep.value(states, paper) - plain_value(states, 2.0, 0.5, 3.0)).max() < 1e-12


def test_spot_values_of_the_reference(paper):
    found = sidestep.value([[10, 0, np.pi], [30, 5, 3.5]], paper)
    np.testing.assert_allclose(found, [-2.14801, 17.17630], atol=5e-6)


def test_any_shape_order_and_fitting_type(paper, rng):
    states = rng.uniform(-20, 20, (6, 4, 3))
    expected = sidestep.value(states.reshape(-1, 3), paper)
    assert sidestep.value(states, paper).shape == (6, 4)
    np.testing.assert_array_equal(sidestep.value(states, paper).ravel(), expected)
    np.testing.assert_array_equal(sidestep.value(np.asfortranarray(states), paper).ravel(), expected)
    np.testing.assert_array_equal(sidestep.value(states[::-1, ::2], paper), sidestep.value(states, paper)[::-1, ::2])
    np.testing.assert_array_equal(sidestep.value(states.astype(">f8"), paper).ravel(), expected)
    single = sidestep.value(states.astype(np.float32), paper)
    np.testing.assert_array_equal(single, sidestep.value(states.astype(np.float32).astype(float), paper))
    assert sidestep.value([10, 0, 3], paper).shape == ()
    assert sidestep.value(np.zeros((0, 3)), paper).shape == (0,)
    assert sidestep.value(np.zeros((2, 0, 3)), paper).shape == (2, 0)
    misaligned = np.zeros(states.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(states.shape)
    misaligned[...] = states
    np.testing.assert_array_equal(sidestep.value(misaligned, paper).ravel(), expected)


def test_threads_do_not_change_a_bit(paper, rng):
    states = rng.uniform(-20, 20, (50_001, 3))
    one = sidestep.value(states, paper, threads=1)
    for threads in (2, 3, 1000):
        np.testing.assert_array_equal(sidestep.value(states, paper, threads=threads), one)
    for mine, other in zip(sidestep.state(states, paper, threads=1), sidestep.state(states, paper), strict=True):
        np.testing.assert_array_equal(mine, other)


def test_the_gradient_is_that_of_the_value(paper, rng):
    states = rng.uniform([-15, -15, 0], [15, 15, 6], (2000, 3))
    value, gradient, turns, inside = sidestep.state(states, paper)
    assert gradient.shape == (2000, 3) and turns.shape == (2000, 2) and inside.dtype == bool and inside.all()
    np.testing.assert_array_equal(value, sidestep.value(states, paper))
    assert np.isin(turns, [-0.5, 0.0, 0.5]).all() and (turns[:, 0] != 0).all()
    h = 1e-6
    for axis in range(3):
        moved = np.zeros(3)
        moved[axis] = h
        slope = (sidestep.value(states + moved, paper) - sidestep.value(states - moved, paper)) / (2 * h)
        # Where V has a kink between the two, the gradient is one-sided.
        assert (np.abs(slope - gradient[:, axis]) < 1e-5).mean() > 0.995


@pytest.mark.parametrize("begin", [[10, 1, np.pi], [6, -4, 2.0], [9, 5, -2.5]])
def test_optimal_play_ends_at_the_value(paper, begin):
    """Both follow their optimal turns in SciPy's integrator, in equal steps: the least range is V + R."""

    def motion(_, state):
        turn, other = sidestep.state(state, paper, threads=1)[2]
        x, y, psi = state
        return [-2 + 2 * np.cos(psi) + turn * y, 2 * np.sin(psi) - turn * x, other - turn]

    played = solve_ivp(motion, (0, 8), begin, max_step=0.005, rtol=1, atol=1)
    least = np.hypot(played.y[0], played.y[1]).min() - 3.0
    assert abs(least - float(sidestep.value(begin, paper))) < 0.02


def test_relative_states(rng):
    evader, pursuer = rng.uniform(-9, 9, (2, 40, 3))
    turned = np.exp(-1j * evader[:, 2])
    away = (pursuer[:, 0] - evader[:, 0] + 1j * (pursuer[:, 1] - evader[:, 1])) * turned
    heading = np.angle(np.exp(1j * (pursuer[:, 2] - evader[:, 2])))
    expected = np.stack([away.real, away.imag, heading], axis=-1)
    np.testing.assert_allclose(sidestep.relative_state(evader, pursuer), expected, atol=1e-12)
    with pytest.raises(ValueError, match=r"pursuer: expected an array of shape \[40, 3\] as evader"):
        sidestep.relative_state(evader, pursuer[:5])


def test_far_away_the_value_is_the_range(paper):
    for far in (1e150, 1e155, 1e200, 1e300):
        np.testing.assert_allclose(sidestep.value([[far, 0, 1], [0, -far, 2], [far, far, 3]], paper) / far, [1, 1, 2**0.5])
