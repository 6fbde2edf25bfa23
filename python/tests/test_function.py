"""Value functions: solved, interrupted, evaluated, stored."""

import copy
import os
import pickle
import threading
import time

import numpy as np
import pytest
import shapely

import sidestep


@pytest.fixture(scope="module")
def solved(unequal):
    return sidestep.solve(unequal)


def test_the_solver_agrees_with_the_closed_form(paper, rng):
    states = rng.uniform([-9, -9, 0], [9, 9, 6], (4000, 3))
    exact = sidestep.solve(paper)
    assert exact.exact and exact.horizon_s == np.inf and exact.unsettled_m is None and exact.game == paper
    np.testing.assert_array_equal(exact.value(states), sidestep.value(states, paper))
    polar = sidestep.solve(paper, method="polar")
    assert not polar.exact
    assert np.quantile(np.abs(polar.value(states) - exact.value(states)), 0.99) < 0.06


def test_a_slower_pursuer_is_less_dangerous(paper):
    car = sidestep.VehicleModel(2.0, 0.5)
    slow = sidestep.solve(sidestep.PursuitGame(car, sidestep.VehicleModel(1.5, 0.5), 3.0))
    assert slow.value([6, 0.5, np.pi]) > sidestep.value([6, 0.5, np.pi], paper) + 0.1


def test_a_longer_game_is_more_dangerous(unequal, rng):
    states = rng.uniform([-4, -4, 0], [6, 4, 6], (500, 3))
    short, long = (sidestep.solve(unequal, horizon, accuracy="draft") for horizon in (0.5, 3.0))
    assert (short.horizon_s, long.horizon_s) == (0.5, 3.0)
    longer = long.value(states) - short.value(states)
    # Up to the errors of a draft, which are tenths of a metre near kinks.
    assert np.quantile(longer, 0.99) < 0.05 and longer.min() < -1


def test_state_and_gradient(solved, rng):
    states = rng.uniform([-6, -6, 0], [6, 6, 6], (300, 3))
    value, gradient, turns, inside = solved.state(states)
    np.testing.assert_array_equal(value, solved.value(states))
    np.testing.assert_array_equal(gradient, solved.gradient(states))
    assert inside.all() and not solved.state([1e4, 0, 0])[3]
    assert np.isin(np.abs(turns[:, 0]), [0, 0.5]).all() and np.isin(np.abs(turns[:, 1]), [0, 0.8]).all()


@pytest.mark.parametrize("level", [0.0, 1.0, -1.5])
def test_level_curves_are_where_v_is_the_level(paper, solved, level):
    for function, most in ((sidestep.solve(paper), 0.011), (solved, 0.12)):
        for psi in (0.7, np.pi):
            curves = function.level_curves(psi, level)
            assert curves
            for curve in curves:
                polygon = shapely.Polygon(curve)
                assert polygon.is_valid and polygon.exterior.is_ccw
                along = np.column_stack([curve, np.full(len(curve), psi)])
                assert np.abs(function.value(along) - level).max() < most
                inside = polygon.representative_point()
                assert function.value([inside.x, inside.y, psi]) < level


def test_level_curves_show_sets_that_are_smaller_than_a_cell(paper):
    function = sidestep.solve(paper, 2.0, "cartesian", accuracy="draft")
    for psi in (0.3, 1.0, 2.8):
        least = function.value([0, 0, psi])
        for above in (1e-3, 0.02, 0.1):
            level = max(least + above, -2.999)
            (curve,) = function.level_curves(psi, level, spacing_m=0.005)
            polygon = shapely.Polygon(curve)
            assert polygon.is_valid and polygon.exterior.is_ccw and polygon.contains(shapely.Point(0, 0))
            along = np.column_stack([curve, np.full(len(curve), psi)])
            assert np.abs(function.value(along) - level).max() < 0.02 + 0.1 * (level - least)


def test_a_function_survives_its_file_and_pickle(paper, solved, tmp_path, rng):
    states = rng.uniform([-6, -6, 0], [6, 6, 6], (300, 3))
    exact = sidestep.solve(paper)
    for function, most in ((exact, 0.0), (solved, 0.002)):
        path = tmp_path / "function.value"
        function.save(path)
        loaded = sidestep.ValueFunction.load(str(path))
        assert loaded.game == function.game
        assert np.abs(loaded.value(states) - function.value(states)).max() <= most
        assert pickle.loads(pickle.dumps(loaded)) == loaded
        # Neither pickle nor a copy rounds.
        assert pickle.loads(pickle.dumps(function)) == function
        assert copy.copy(function) == function and copy.deepcopy([function]) == [function]


def test_damage_of_a_file_is_noticed(paper, solved, tmp_path, rng):
    path = tmp_path / "function.value"
    for function in (sidestep.solve(paper), solved):
        function.save(path)
        whole = path.read_bytes()
        for at in rng.integers(0, len(whole), 200):
            damaged = bytearray(whole)
            damaged[at] ^= 0x40
            path.write_bytes(damaged)
            with pytest.raises(ValueError, match="value function"):
                sidestep.ValueFunction.load(path)
        path.write_bytes(whole + b"junk")
        with pytest.raises(ValueError, match="value function"):
            sidestep.ValueFunction.load(path)


@pytest.mark.skipif(os.name == "nt", reason="there are no such files there")
def test_files_without_an_end_are_refused():
    for load in (sidestep.ValueFunction.load, sidestep.Solution.load, sidestep.Predictor.load):
        with pytest.raises(ValueError, match="path: expected a file, found a device or a pipe, /dev/full"):
            load("/dev/full")


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_ctrl_c_ends_many_values(paper, solved, ctrl_c, rng):
    states = np.broadcast_to(rng.uniform([-6, -6, 0], [6, 6, 6], (1000, 3)), (10_000, 1000, 3)).reshape(-1, 3)
    for call in (lambda: sidestep.state(states, paper, threads=1), lambda: solved.state(states, threads=2)):
        ctrl_c(0.5)
        begin = time.process_time()
        with pytest.raises(KeyboardInterrupt):
            call()
        # CPU time does not depend on the load; a complete solve takes at least twice as much.
        assert time.process_time() - begin < 2


def test_what_is_read_again_is_the_same_or_rounded_once(solved, tmp_path):
    path = tmp_path / "function.value"
    solved.save(path)
    assert sidestep.ValueFunction.load(path) == solved
    solved.save(path, rounded=True)
    again = sidestep.ValueFunction.load(path)
    again.save(path, rounded=True)
    assert again != solved and sidestep.ValueFunction.load(path) == again


def test_a_grid_ends_where_it_says(paper, solved, unequal):
    assert sidestep.solve(paper).domain is None
    (name, (low, high)), = solved.domain.items()
    assert (name, low) == ("range", 0.0)
    assert solved.state([0.999 * high, 0, 1])[3] and not solved.state([1.001 * high, 0, 1])[3]
    grid = sidestep.solve(unequal, 0.5, "cartesian", accuracy="draft")
    ends = np.array([grid.domain["x"], grid.domain["y"]])
    middle = ends.mean(axis=1)
    for axis in range(2):
        for side in range(2):
            for scale, inside in ((0.999, True), (1.001, False)):
                state = np.append(middle, 1.0)
                state[axis] += scale * (ends[axis, side] - middle[axis])
                assert grid.state(state)[3] == inside


def test_a_faster_pursuer_depends_on_the_range():
    """As the documentation warns: the pursuer turns round beyond a grid that is too small, and comes back."""
    quick = sidestep.PursuitGame(sidestep.VehicleModel(2.0, 1.0), sidestep.VehicleModel(2.5, 0.4), 3.0)
    small, large = (sidestep.solve(quick, accuracy="draft", range_m=range_m) for range_m in (None, 240.0))
    assert large.domain == {"range": (0.0, 240.0)} and small.domain["range"][1] < 70
    state = [-50.0, 0.0, np.pi]
    assert small.state(state)[3] and small.unsettled_m < 0.01
    assert small.value(state) > 5 and large.value(state) < -0.5


def test_a_range_is_that_of_the_polar_method(paper, unequal):
    for call, complaint in (
        (lambda: sidestep.solve(paper, range_m=50.0), "range_m: expected None with the method exact, or .* polar, found 50"),
        (lambda: sidestep.solve(unequal, 1.0, "cartesian", range_m=50.0), "range_m: expected None with the method cartesian"),
        (lambda: sidestep.solve(unequal, range_m=2.0), "range_m: expected above the radius 3, found 2"),
    ):
        with pytest.raises(ValueError, match=complaint):
            call()


def test_what_is_no_function_is_refused(solved, tmp_path):
    path = tmp_path / "function.value"
    with pytest.raises(FileNotFoundError, match=r"function\.value"):
        sidestep.ValueFunction.load(path)
    with pytest.raises(IsADirectoryError):
        solved.save(tmp_path)
    solved.save(path)
    whole = path.read_bytes()
    newer = whole.replace(b"sidestep-value-function/1", b"sidestep-value-function/2")
    for broken, expected in ((b"", "found"), (b"no", ": expected a file of `ValueFunction.save`, found other bytes"), (whole[:-5], "bytes"), (newer, "expected sidestep-value-function/1")):
        path.write_bytes(broken)
        with pytest.raises(ValueError, match=f"value function.*{expected}"):
            sidestep.ValueFunction.load(path)


def test_progress_rises_and_may_end_the_solve(unequal):
    seen = []
    sidestep.solve(unequal, 1.0, progress=lambda done, residual: seen.append(done))
    assert seen and seen == sorted(seen) and all(0 <= done <= 1 for done in seen)

    def stop(done, residual):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        sidestep.solve(unequal, 20.0, progress=stop)


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_ctrl_c_ends_a_solve(unequal, ctrl_c):
    ctrl_c(0.3)
    start = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        sidestep.solve(unequal, 20.0, accuracy="fine", threads=1)
    # A complete solve takes much longer.
    assert time.process_time() - start < 3


def test_other_threads_run_while_it_solves(unequal):
    ticks, done = [], threading.Event()

    def count():
        while not done.wait(0.005):
            ticks.append(time.monotonic())

    counter = threading.Thread(target=count)
    counter.start()
    start = time.monotonic()
    sidestep.solve(unequal, 1.0)
    took = time.monotonic() - start
    done.set()
    counter.join()
    assert len(ticks) > 20 * took


def test_safety_levels_of_both_vehicles(unequal, unequal_scene):
    parameters, safety = unequal_scene
    assert safety.human.game == unequal
    assert (safety.robot.game.evader, safety.robot.game.pursuer) == (unequal.pursuer, unequal.evader)
    assert pickle.loads(pickle.dumps(unequal)) == unequal and {unequal: 1}[unequal] == 1
    assert pickle.loads(pickle.dumps(parameters)) == parameters
