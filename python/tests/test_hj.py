"""User-defined games on a grid, against hj_reachability, an analytic solution and each other."""

import os
import pickle
import re
import time

import numpy as np
import pytest

import sidestep


def double_integrator(states):
    return np.stack([states[..., 1], np.zeros(states.shape[:-1])], axis=-1)


def strip(states):
    return np.abs(states[..., 0]) - 0.5


PUSH = [[0.0], [1.0]]


@pytest.fixture(scope="module")
def plane():
    return sidestep.Grid([-3, -2], [3, 2], [61, 41])


@pytest.fixture(scope="module")
def solution(plane):
    """The states that can reach |x| ≤ 0.5 within a second, with |u| ≤ 1 m/s² against a wind of 0.3 m/s²."""
    wind, most = [[0.0], [0.3]], [[-1, 1]]
    times = np.linspace(0, 1, 5)
    return sidestep.hj_solve(plane, double_integrator, PUSH, wind, most, most, strip, times)


def test_a_grid_is_what_it_says():
    grid = sidestep.Grid([-1, 0], [1, 2 * np.pi], [5, 8], periodic=[1])
    x, psi = grid.axes
    np.testing.assert_allclose(x, np.linspace(-1, 1, 5))
    np.testing.assert_allclose(psi, np.linspace(0, 2 * np.pi, 8, endpoint=False))
    np.testing.assert_array_equal(grid.states, np.stack(np.meshgrid(x, psi, indexing="ij"), axis=-1))
    np.testing.assert_allclose(grid.spacing, [0.5, np.pi / 4])
    assert (grid.nodes, grid.periodic) == ([5, 8], [1]) and pickle.loads(pickle.dumps(grid)) == grid


def test_a_mask_of_axes_is_not_their_numbers():
    def grid(**ends):
        return sidestep.Grid([0, 0, 0], [1, 1, 1], [4, 5, 6], **ends)

    for name in ("periodic", "constant_ends"):
        for mask in ([False, True, True], (False, True, True), np.array([False, True, True]), list(np.array([0, 1, 1]) > 0)):
            assert getattr(grid(**{name: mask}), name) == [1, 2]
        for numbers in ([1, 2], np.array([2, 1]), [np.int32(1), 2]):
            assert getattr(grid(**{name: numbers}), name) == [1, 2]
        assert getattr(grid(**{name: [False] * 3}), name) == getattr(grid(**{name: []}), name) == []
    both = grid(periodic=[0], constant_ends=[False, True, False])
    assert (both.periodic, both.constant_ends) == ([0], [1]) and pickle.loads(pickle.dumps(both)) == both
    assert both != grid(periodic=[0]) and "constant_ends=[1]" in repr(both)


def peer():
    """hj_reachability, which emits a warning on import."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import hj_reachability
        import jax.numpy
    return hj_reachability, jax.numpy


def peer_grid(hj, grid):
    box = hj.sets.Box(lo=grid.lo, hi=grid.hi)
    periodic = tuple(grid.periodic) or None
    return hj.Grid.from_lattice_parameters_and_boundary_conditions(box, tuple(grid.nodes), periodic_dims=periodic)


def peer_values(hj, jnp, dynamics, grid, target, obstacle, horizon_s):
    """Reach-avoid tubes by hj_reachability: V is at most the target and at least the obstacle."""

    def limited(t, values):
        values = jnp.minimum(values, target)
        return values if obstacle is None else jnp.maximum(values, obstacle)

    settings = hj.SolverSettings.with_accuracy("very_high", value_postprocessor=limited)
    start = target if obstacle is None else np.maximum(target, obstacle)
    return np.asarray(hj.step(settings, dynamics, peer_grid(hj, grid), 0.0, start, -horizon_s, progress_bar=False))


def test_a_double_integrator_with_an_obstacle_as_hj_reachability_has_it(plane):
    hj, jnp = peer()

    class Dynamics(hj.ControlAndDisturbanceAffineDynamics):
        def __init__(self):
            box = hj.sets.Box(lo=jnp.array([-1.0]), hi=jnp.array([1.0]))
            super().__init__("min", "max", box, box)

        def open_loop_dynamics(self, state, time):
            return jnp.array([state[1], 0.0])

        def control_jacobian(self, state, time):
            return jnp.array([[0.0], [1.0]])

        def disturbance_jacobian(self, state, time):
            return jnp.array([[0.0], [0.3]])

    x = plane.states
    target = np.hypot(x[..., 0], x[..., 1]) - 0.5
    avoid = np.hypot(x[..., 0] - 1.2, x[..., 1] + 0.5) - 0.4
    theirs = peer_values(hj, jnp, Dynamics(), plane, target, -avoid, 1.0)
    ours = sidestep.hj_solve(
        plane, double_integrator, PUSH, [[0.0], [0.3]], [[-1, 1]], [[-1, 1]], target, 1.0, avoid=avoid
    ).values[-1]
    moved = np.abs(ours - target) > 0.1
    assert moved.mean() > 0.1
    # Both are WENO5 with local Lax-Friedrichs; dissipation and time steps differ, which kinks show most: by a tenth
    # of the spacing of 0.1.
    gap = np.abs(theirs - ours)
    assert gap.max() < 0.05 and gap.mean() < 0.002, (gap.max(), gap.mean())


def test_a_pursuit_as_hj_reachability_has_it():
    hj, jnp = peer()
    grid = sidestep.Grid([-6, -6, 0], [10, 6, 2 * np.pi], [33, 25, 24], periodic=[2])
    dynamics = hj.systems.Air3d(
        evader_speed=2.0, pursuer_speed=2.0, evader_max_turn_rate=0.5, pursuer_max_turn_rate=0.5
    )
    x, y, psi = np.moveaxis(grid.states, -1, 0)
    target = np.hypot(x, y) - 3.0
    theirs = peer_values(hj, jnp, dynamics, grid, target, None, 1.5)
    drift = np.stack([2 * np.cos(psi) - 2, 2 * np.sin(psi), 0 * psi], axis=-1)
    evader = np.stack([y, -x, 0 * x - 1], axis=-1)[..., None]
    turn = [[-0.5, 0.5]]
    ours = sidestep.hj_solve(grid, drift, [[0], [0], [1]], evader, turn, turn, target, 1.5).values[-1]
    gap = np.abs(theirs - ours)
    assert np.abs(ours - target).max() > 1
    # The spacing is 0.5 m.
    assert gap.max() < 0.15 and gap.mean() < 0.01, (gap.max(), gap.mean())


def test_an_obstacle_of_the_old_convention_still_is_one(plane):
    x = plane.states
    avoid = np.hypot(x[..., 0] - 1.2, x[..., 1] + 0.5) - 0.4

    def solved(**obstacle):
        return sidestep.hj_solve(plane, double_integrator, PUSH, None, [[-1, 1]], None, strip, 0.5, **obstacle).values

    with pytest.warns(FutureWarning, match="positive inside, unlike the target. Use avoid=-obstacle"):
        old = solved(obstacle=-avoid)
    np.testing.assert_array_equal(old, solved(avoid=avoid))
    assert (old >= -avoid.astype(np.float32)).all() and not np.array_equal(old, solved())


def test_an_obstacle_may_be_an_indicator(plane):
    """An indicator of ±10⁶ gives the same tube as a distance, except in cells beside the obstacle."""
    x = plane.states
    distance = np.hypot(x[..., 0] - 1.2, x[..., 1] + 0.5) - 0.4

    def inside(avoid):
        solution = sidestep.hj_solve(plane, double_integrator, PUSH, None, [[-1, 1]], None, strip, 1.0, avoid=avoid)
        assert solution.values.min() >= -0.5
        return solution.values[-1] <= 0

    expected, found = inside(distance), inside(np.where(distance < 0, -1e6, 1e6))
    assert (found <= expected).all() or (found & ~expected).sum() <= 5
    assert (found >= inside(distance - 0.4)).all()


def test_an_obstacle_that_leaves_little_of_v_warns(plane, recwarn):
    distance = np.hypot(plane.states[..., 0] - 1.2, plane.states[..., 1] + 0.5) - 0.4

    def solved(kind, avoid):
        sidestep.hj_solve(plane, double_integrator, PUSH, None, [[-1, 1]], None, strip, 0.1, avoid=avoid, kind=kind)

    for kind in ("tube", "set"):
        said = r"avoid: the obstacle keeps V at -0\.001 or more; .*as low as -0\.5.*an indicator at least as high as the target is deep, ±0\.5"
        with pytest.warns(UserWarning, match=said):
            solved(kind, np.where(distance < 0, -1e-3, 1e-3))
        recwarn.clear()
        for avoid in (None, distance, np.sign(distance), 1e9 * np.sign(distance)):
            solved(kind, avoid)
        assert not recwarn.list


def test_ends_of_a_grid(plane):
    """ẋ = -1: V(x, T) is l(x - T), with l = x beyond the end or constant there."""
    x = np.linspace(-1, 2, 61)
    for ends, lowest in (([], -1.5), ([0], -1.0)):
        grid = sidestep.Grid([-1], [2], [61], constant_ends=ends)
        solution = sidestep.hj_solve(grid, [-1.0], None, None, None, None, lambda x: x[..., 0], 0.5, kind="set")
        np.testing.assert_allclose(solution.values[-1], np.maximum(x - 0.5, lowest), atol=0.06)
        marked = solution.depends_on_outside()
        np.testing.assert_array_equal(marked[[0, 9, 11, 49, 51, 60]], [True, True, False, False, True, True])
        assert not solution.depends_on_outside(tau_s=0.0).any()


def test_states_outside_have_nan_on_request(solution):
    states = np.array([[0.9, 0.1], [3.0001, 0.0], [0.0, -2.5]])
    for found in (
        solution.value(states, outside="nan"),
        solution.gradient(states, outside="nan")[:, 1],
        solution.inputs(states, outside="nan")[0][:, 0],
        solution.time_to_reach(states),
    ):
        np.testing.assert_array_equal(np.isnan(found), [False, True, True])
    for call in (solution.value, solution.gradient, solution.inputs):
        with pytest.raises(ValueError, match=r"states\[1, 0\]: expected a number from -3 to 3.*found 3.0001"):
            call(states)
    with pytest.raises(ValueError, match=r"states\[1, 0\]: expected a number"):
        solution.time_to_reach(states, outside="raise")


def test_inputs_at_the_first_time_arrive():
    """A car that needs 3.5 to 5 s, although the horizon is 12 s."""
    grid = sidestep.Grid([-6, -6, 0], [6, 6, 2 * np.pi], [41, 41, 32], periodic=[2])

    def drift(states):
        return np.stack([np.cos(states[..., 2]), np.sin(states[..., 2]), 0 * states[..., 2]], axis=-1)

    solution = sidestep.hj_solve(
        grid, drift, [[0], [0], [1]], None, [[-1, 1]], None,
        lambda x: np.hypot(x[..., 0], x[..., 1]) - 0.5, np.linspace(0, 12, 49),
    )
    state = np.array([[-4.5, 0.5, 0.1], [1.0, 4.2, -np.pi / 2], [3.0, -3.0, np.pi]])
    needed = solution.time_to_reach(state)
    assert ((3.4 < needed) & (needed < 5.1)).all(), needed
    arrived = np.full(3, np.inf)
    for step in range(300):
        u, _ = solution.inputs(state, tau_s="first")
        state = state + 0.02 * (drift(state) + u * [0, 0, 1])
        there = np.hypot(state[:, 0], state[:, 1]) <= 0.5
        arrived = np.minimum(arrived, np.where(there, 0.02 * (step + 1), np.inf))
    assert (arrived < needed + 0.3).all(), (arrived, needed)


def test_straight_motion_is_known():
    """ẋ = 1, ẏ = 0: V is the least of the target along the way, at (x + s, y) for s from 0 to the horizon."""
    grid = sidestep.Grid([-2, -2], [2, 2], [81, 81])
    solution = sidestep.hj_solve(grid, [1.0, 0.0], None, None, None, None, strip, 1.0)
    x = np.linspace(-1.9, 0.9, 29)
    expected = np.maximum(np.maximum(-0.5 - x - 1, x - 0.5), -0.5)
    found = solution.value(np.stack([x, 0 * x], axis=-1))
    # Except at kinks, which a scheme smooths over a few cells of 0.05.
    assert np.abs(found - expected).max() < 0.03
    u, d = solution.inputs([[0.0, 0.0]])
    assert u.shape == d.shape == (1, 0)
    forward = sidestep.hj_solve(
        grid, [1.0, 0.0], None, None, None, None, strip, 1.0, direction="forward", kind="set"
    )
    # Everything has moved by 1 m.
    np.testing.assert_allclose(forward.value([[0.75, 0.0], [1.25, 0.0], [-0.5, 0.0]]), [-0.25, -0.25, 1.0], atol=0.03)


def test_values_gradients_and_inputs_belong_together(solution, plane, rng):
    assert solution.values.shape == (5, 61, 41) and solution.values.dtype == np.float32
    np.testing.assert_allclose(solution.times, [0, 0.25, 0.5, 0.75, 1])
    assert (solution.kind, solution.direction, solution.grid) == ("tube", "backward", plane)
    np.testing.assert_allclose(solution.value(plane.states), solution.values[-1], atol=1e-6)
    np.testing.assert_allclose(solution.value(plane.states, tau_s=0.25), solution.values[1], atol=1e-6)
    states = rng.uniform([-2.9, -1.9], [2.9, 1.9], (500, 2))
    between = 0.5 * (solution.value(states, tau_s=0.25) + solution.value(states, tau_s=0.5))
    np.testing.assert_allclose(solution.value(states, tau_s=0.375), between, atol=1e-9)
    gradient, step = solution.gradient(states), 1e-6
    for axis in range(2):
        move = step * np.eye(2)[axis]
        slope = (solution.value(states + move) - solution.value(states - move)) / (2 * step)
        assert (np.abs(slope - gradient[:, axis]) < 1e-3).mean() > 0.99
    u, d = solution.inputs(states)
    steep = np.abs(gradient[:, 1]) > 1e-6
    np.testing.assert_array_equal(u[steep, 0], -np.sign(gradient[steep, 1]))
    np.testing.assert_array_equal(d[steep, 0], np.sign(gradient[steep, 1]))
    many = rng.uniform([-2.9, -1.9], [2.9, 1.9], (3, 5000, 2))
    np.testing.assert_array_equal(solution.value(many, threads=1), solution.value(many))


def test_arrays_callables_and_constants_are_one(plane, solution):
    x = plane.states
    other = sidestep.hj_solve(
        plane,
        double_integrator(x),
        lambda x: np.zeros((*x.shape, 1)) + PUSH,
        np.asfortranarray(np.broadcast_to([[0.0], [0.3]], (61, 41, 2, 1))),
        np.array([[-1, 1]]),
        ((-1.0, 1.0),),
        np.abs(x[..., 0]) - 0.5,
        [0, 0.25, 0.5, 0.75, 1],
        threads=1,
    )
    np.testing.assert_array_equal(other.values, solution.values)


@pytest.mark.parametrize("dimensions", [1, 4])
def test_other_dimensions(dimensions):
    """Balls grow with the speed of the inputs, whatever the dimension: V = |x| − r − t outside."""
    nodes = 61 if dimensions == 1 else 17
    grid = sidestep.Grid([-3] * dimensions, [3] * dimensions, [nodes] * dimensions)
    each = [[-1, 1]] * dimensions
    solution = sidestep.hj_solve(
        grid, np.zeros(dimensions), np.eye(dimensions), None, each, None, lambda x: np.abs(x).max(axis=-1) - 1, 0.5
    )
    states = np.zeros((3, dimensions))
    states[:, 0] = [2.0, 2.25, -2.5]
    np.testing.assert_allclose(solution.value(states), [0.5, 0.75, 1.0], atol=0.05)


def test_a_solution_survives_its_file(solution, tmp_path, rng):
    path = tmp_path / "solution.npz"
    solution.save(path)
    with np.load(path) as arrays:
        np.testing.assert_array_equal(arrays["value"], solution.values)
        np.testing.assert_array_equal(arrays["axis0"], solution.grid.axes[0])
    loaded = sidestep.Solution.load(path)
    states = rng.uniform([-2.9, -1.9], [2.9, 1.9], (50, 2))
    np.testing.assert_array_equal(loaded.value(states, tau_s=0.3), solution.value(states, tau_s=0.3))
    assert (loaded.grid, loaded.steps, loaded.residual) == (solution.grid, solution.steps, solution.residual)
    with pytest.raises(ValueError, match="solution: expected one that hj_solve returned: a file keeps V, not the game"):
        loaded.inputs(states)
    whole = path.read_bytes()
    for broken in (b"", whole[:-30], whole.replace(b"sidestep-solution-npz/1", b"sidestep-solution-npz/2")):
        path.write_bytes(broken)
        with pytest.raises(ValueError, match="solution.*expected.*found"):
            sidestep.Solution.load(path)


def test_damage_of_a_file_is_noticed(solution, tmp_path, rng):
    path = tmp_path / "solution.npz"
    solution.save(path)
    whole = path.read_bytes()
    for at in rng.integers(100, len(whole) - 1000, 50):
        damaged = bytearray(whole)
        damaged[at] ^= 0x40
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="solution.*checksum.*found damaged bytes"):
            sidestep.Solution.load(path)
    path.write_bytes(whole + b"junk")
    with pytest.raises(ValueError, match=r"solution\.bytes: expected a whole NumPy archive.*bytes after its end"):
        sidestep.Solution.load(path)


def test_a_files_axes_and_instants_are_those_of_the_grid(solution, tmp_path):
    path = tmp_path / "solution.npz"
    solution.save(path)
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **arrays)
    assert sidestep.Solution.load(path).grid == solution.grid
    for name in ("tau", "axis0", "axis1"):
        values = arrays[name]
        wrong = {"0": np.full_like(values, np.nan), "0 ": values[::-1], "": values[:0]}
        for index, other in wrong.items():
            np.savez(path, **{**arrays, name: other})
            where = rf"solution\.{name}\[{index.strip()}\]: .*as meta says" if index else rf"solution\.{name}: expected \d+"
            with pytest.raises(ValueError, match=where):
                sidestep.Solution.load(path)
        np.savez(path, **{key: of for key, of in arrays.items() if key != name})
        with pytest.raises(ValueError, match=rf"solution\.{name}: expected an array of this name"):
            sidestep.Solution.load(path)


def test_nodes_that_rounding_joins_are_refused():
    for lo, hi, nodes in (([0], [5e-324], [5]), ([1e300], [1e300 * (1 + 1e-15)], [50]), ([1e6], [1e6 + 1e-8], [3])):
        with pytest.raises(ValueError, match=r"hi\[0\]: expected nodes at least .* apart, .*found"):
            sidestep.Grid(lo, hi, nodes)


def test_a_march_may_end_when_it_has_converged(plane):
    target = np.hypot(*np.moveaxis(plane.states, -1, 0)) - 0.5
    solution = sidestep.hj_solve(
        plane, double_integrator, PUSH, None, [[-1, 1]], None, target, 60.0, tolerance=1e-3
    )
    assert solution.times[0] < 30 and solution.residual < 2e-3 and solution.values.shape == (1, 61, 41)


def endless(**options):
    grid = sidestep.Grid([-3] * 3, [3] * 3, [61] * 3)
    return sidestep.hj_solve(grid, [1.0, 0, 0], None, None, None, None, lambda x: x[..., 0], 100.0, threads=1, **options)


def test_progress_may_end_it():
    def stop(done, residual):
        assert 0 <= done <= 1
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        endless(progress=stop)


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_ctrl_c_ends_it(ctrl_c):
    ctrl_c(0.5)
    start = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        endless()
    # A complete solve takes minutes.
    assert time.process_time() - start < 10


def test_what_a_callable_raises_passes(plane):
    def broken(states):
        raise LookupError("no")

    with pytest.raises(LookupError, match="no"):
        sidestep.hj_solve(plane, broken, None, None, None, None, lambda x: x[..., 0], 1.0)


REFUSED = [
    (lambda: sidestep.Grid([], [], []), r"lo: expected an array of shape \(D,\) with 1 ≤ D ≤ 4, found shape \(0,\)"),
    (lambda: sidestep.Grid([0, 0], [1], [3, 3]), "hi: expected 2 entries, as lo has, found 1"),
    (lambda: sidestep.Grid([0], [1], [3, 3]), "nodes: expected 1 entries, as lo has, found 2"),
    (lambda: sidestep.Grid([0, 1], [1, 1], [3, 3]), r"hi\[1\]: expected above the lower end 1, found 1"),
    (lambda: sidestep.Grid([0], [1], [2]), r"nodes\[0\]: expected at least 3, found 2"),
    (lambda: sidestep.Grid([0], [1], [3], periodic=[1]), r"periodic\[0\]: expected an axis, from 0 to 0, found 1"),
    (lambda: sidestep.Grid([0, 0], [1, 1], [3, 3], periodic=[True, 1]), "periodic: expected numbers of axes, or a boolean"),
    (lambda: sidestep.Grid([0, 0], [1, 1], [3, 3], periodic=[True]), "periodic: expected 2 booleans, .*found 1"),
    (lambda: sidestep.Grid([0], [1], [3], constant_ends=[-1]), r"constant_ends\[0\]: expected an axis, from 0 to 0, found -1"),
    (
        lambda: sidestep.Grid([0], [1], [3], periodic=[0], constant_ends=[0]),
        "constant_ends: expected axes with ends, found axis 0, which is periodic",
    ),
    (lambda: sidestep.Grid([0] * 4, [1] * 4, [10**6] * 4), "nodes: expected at most 268435456 in all"),
    (lambda: solve(f0=np.zeros(3)), r"f0: expected an array of shape \(5, 4, 2\) or \(2,\), found shape \(3,\)"),
    (lambda: solve(f0=[0.0, np.nan]), r"f0\[1\]: expected a finite number, found NaN"),
    (lambda: solve(f0=lambda x: x.astype(complex)), r"f0: .*found dtype complex128"),
    (lambda: solve(Gu=None), "Gu: expected a matrix for each node, with u_box, found None"),
    (lambda: solve(u_box=None), "u_box: expected the range of each input, with Gu, found None"),
    (lambda: solve(Gu=[[1.0, 0.0], [0.0, 1.0]]), r"Gu: expected an array of shape \(5, 4, 2, 1\) or \(2, 1\)"),
    (lambda: solve(u_box=[1.0, 2.0]), r"u_box: expected an array of shape \(m, 2\) with m ≥ 1, found shape \(2,\)"),
    (lambda: solve(u_box=[[1.0, -1.0]]), r"u_box\[0\]\[1\]: expected 1 or more, the lower end, found -1"),
    (lambda: solve(target=np.zeros((4, 5))), r"target: expected an array of shape \(5, 4\), found shape \(4, 5\)"),
    (lambda: solve(avoid=lambda x: x), r"avoid: expected an array of shape \(5, 4\), found shape \(5, 4, 2\)"),
    (
        lambda: solve(avoid=lambda x: x[..., 0] > 0.5),
        r"avoid: expected numbers, .*np\.where\(mask, -1\.0, 1\.0\), found booleans",
    ),
    (lambda: solve(target=np.ones((5, 4), bool)), r"target: .*np\.where\(mask, -1\.0, 1\.0\), found booleans"),
    (lambda: solve(avoid=lambda x: x[..., 0], obstacle=np.zeros((5, 4))), "obstacle: expected None together with avoid, found both"),
    (lambda: solve(avoid=lambda x: 0.5 - x[..., 0] - 1), "avoid: .*negative in the obstacle.*found one that covers all of the grid"),
    (lambda: solve(avoid=lambda x: x[..., 0] - 0.3), "avoid: .*negative in the obstacle.*found one that covers all of the target"),
    (lambda: solve(times=0.0), "times: expected a finite number > 0, found 0"),
    (lambda: solve(times=[0, 0.4, 1]), r"times\[1\]: expected 0.5: they rise from 0 in equal steps, found 0.4"),
    (lambda: solve(times=[0, -1]), r"times\[0\]: expected a last one > 0"),
    (lambda: solve(times=[1.0]), "times: expected a number, or at least two instants from 0 on, found 1"),
    (lambda: solve(tolerance=0.0), "tolerance: expected a finite number > 0, found 0"),
    (lambda: solve(tolerance=0.1, times=[0, 1]), "times: expected one number together with tolerance"),
    (lambda: solve(kind="reach"), "kind: expected one of tube, set, found reach"),
    (lambda: solve(direction="up"), "direction: expected one of backward, forward, found up"),
    (lambda: solve(scheme="weno7"), "scheme: expected one of weno5, eno3, eno2, upwind, found weno7"),
    (lambda: solve(cfl=2.0), "cfl: expected above 0 and at most 1, found 2"),
    (lambda: solve(threads=0), "threads: expected at least 1, found 0"),
    (lambda: solve().value([0.0, 0.0, 0.0]), r"states: expected an array of shape \(…, 2\), found shape \(3,\)"),
    (lambda: solve().value([[[0.5, 0.5]], [[0.5, 9.0]]]), r"states\[1, 0, 1\]: expected a number from 0 to 1.*found 9"),
    (lambda: solve().gradient([0.5, 0.5], tau_s=0.05), "tau_s: expected 0.1 s, since `times` was one number, found 0.05"),
    (lambda: solve().value([0.5, 9.0], outside="clip"), "outside: expected one of raise, nan, found clip"),
    (lambda: solve().inputs([0.5, 0.5], tau_s="last"), 'tau_s: expected a number, or "first", found last'),
    (lambda: solve().time_to_reach([0.5, 0.5]), "solution: expected several stored instants, found only the end"),
    (lambda: solve(kind="set").time_to_reach([0.5, 0.5]), "kind: expected a tube, .*found a set"),
    (lambda: solve().depends_on_outside(tau_s=1.0), "tau_s: expected a time from 0 to the horizon"),
    (lambda: solve(times=[0, 0.1]).inputs([0.5, 0.5], tau_s=1.0), "tau_s: expected a time from 0 to the horizon"),
]


def solve(**changes):
    grid = sidestep.Grid([0, 0], [1, 1], [5, 4])
    usual = {"f0": [1.0, 0.0], "Gu": PUSH, "Gd": None, "u_box": [[-1, 1]], "d_box": None, "times": 0.1}
    return sidestep.hj_solve(grid, **{**usual, "target": lambda x: x[..., 0], **changes})


@pytest.mark.parametrize(("call", "complaint"), REFUSED, ids=[complaint for _, complaint in REFUSED])
def test_a_refusal_names_argument_expected_and_found(call, complaint):
    with pytest.raises(ValueError, match=complaint) as raised:
        call()
    assert "expected" in str(raised.value) and "found" in str(raised.value)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: solve(direction=3), "direction: expected a string, found 3"),
        (lambda: solve(kind=None), "kind: expected a string, found None"),
        (lambda: solve(scheme=b"weno5"), "scheme: expected a string, found b'weno5'"),
        (lambda: solve().value([0.5, 0.5], outside=0), "outside: expected a string, found 0"),
        (lambda: solve(avoid=lambda x, y: x), "avoid: expected a callable of one argument, .*found .*missing 1 required"),
        (lambda: solve(f0=lambda: 0), "f0: expected a callable of one argument, .*found .*takes 0 positional"),
    ],
)
def test_other_types_are_named_too(call, complaint):
    with pytest.raises(TypeError) as raised:
        call()
    # Without the notes that Python 3.11 and later add.
    assert re.search(complaint, str(raised.value))


def test_what_a_callable_raises_is_passed_on():
    with pytest.raises(TypeError, match=r"^unsupported operand"):
        solve(avoid=lambda x: x + None)
