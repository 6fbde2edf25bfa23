"""Errors name the invalid argument, the expected and the actual value; nothing ends the process."""

import numpy as np
import pytest
from conftest import constant
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import sidestep

CAR = sidestep.VehicleModel(2.0, 0.5)
GAME = sidestep.PursuitGame(CAR, CAR, 3.0)
MODEL = constant([0.2, 0.6, 0.2])
NOW = np.zeros((1, 2, 3)) + [[0, 0, 0], [9, 0, 3]]
FULL = np.full(3, 0.5)
SET = sidestep.ReachableSet([0, 0, 0], -FULL, FULL)
AVOIDANCE = '{"format":"sidestep-predictor/1","kind":"constant","features":[],"experiment":2,"classes":[0,1],'
AVOIDANCE += '"probabilities":[0.5,0.5]}'
ONCE = [sidestep.Trajectory(np.zeros((2, 2, 3)), [0.0])]
NAN, INF = float("nan"), float("inf")

REFUSED = [
    (lambda: sidestep.VehicleModel(0, 1), "speed_mps: expected a finite number > 0, found 0"),
    (lambda: sidestep.VehicleModel(1, NAN), "turn_rate_radps: expected a finite number > 0, found NaN"),
    (lambda: sidestep.PursuitGame(CAR, CAR, -1), "radius_m: expected a finite number > 0, found -1"),
    (lambda: sidestep.SceneParameters(steps=-1), "steps: expected at least 1, found -1"),
    (lambda: sidestep.SceneParameters(steps=10**6), "steps: expected a whole number from 1 to 3000"),
    (lambda: sidestep.value([1, 2], GAME), r"states: expected an array of shape \(…, 3\), found shape \(2,\)"),
    (lambda: sidestep.value([[1, 2, NAN]], GAME), r"states\[0, 2\]: expected a finite number, found NaN"),
    (lambda: sidestep.value([[[0, 0, 1]], [[0, INF, 1]]], GAME), r"states\[1, 0, 1\]: .*found inf"),
    (lambda: sidestep.value(np.zeros((2, 3), complex), GAME), r"states: .*float64.*found dtype complex128"),
    (lambda: sidestep.value(["a"], GAME), r"states: .*found dtype"),
    (lambda: sidestep.value([[1, 2, 3], [1]], GAME), "states: .*inhomogeneous"),
    (lambda: sidestep.value(None, GAME), "states: .*found dtype object"),
    (lambda: sidestep.value([1, 2, 3], GAME, threads=0), "threads: expected at least 1, found 0"),
    (
        lambda: sidestep.value([1, 2, 3], sidestep.PursuitGame(CAR, sidestep.VehicleModel(1, 1), 3)),
        r"game: expected .*same speed.*`solve\(game\)`",
    ),
    (lambda: sidestep.solve(GAME, -1), "horizon_s: expected a number > 0, or inf, found -1"),
    (lambda: sidestep.solve(GAME, NAN), "horizon_s: .*found NaN"),
    (lambda: sidestep.solve(GAME, 10**400), "horizon_s: expected a number > 0, or inf, found a whole number beyond"),
    (lambda: sidestep.solve(GAME, 1e300), "horizon_s: expected at most .* time steps of this grid, found 1e300"),
    (lambda: sidestep.relative_state([[1e308, 0, 0]], [[-1e308, 0, 0]]), r"pursuer\[0\]: expected a pose less than"),
    (lambda: sidestep.drive([0, 0, 0], 1, [0], 10**400), "step_s: expected a finite number > 0, found inf"),
    (lambda: sidestep.largest_clear([[1, 2]], 10**400), "margin_m: expected a finite number ≥ 0, found inf"),
    (lambda: sidestep.Predictor.constant([10**400, 0, 1], [0.1, 0.6, 0.3]), r"classes\[0\]: expected a whole number"),
    (lambda: sidestep.ShfrsSettings.paper(turn_rate_radps=10**400), "turn_rate_radps: expected a finite number > 0"),
    (lambda: sidestep.solve(GAME, method="fast"), "method: expected one of exact, polar, cartesian, found fast"),
    (lambda: sidestep.solve(GAME, accuracy="best"), "accuracy: expected one of draft, standard, fine, found best"),
    (lambda: sidestep.solve(GAME, 2.0, "exact"), "horizon_s: expected inf with method exact"),
    (lambda: sidestep.solve(GAME, threads=-2), "threads: expected at least 1, found -2"),
    (lambda: sidestep.solve(GAME).level_curves(NAN), "psi: expected a finite number, found NaN"),
    (lambda: sidestep.solve(GAME).level_curves(0, -3), "level: expected above -radius_m = -3, found -3"),
    (lambda: sidestep.solve(GAME).level_curves(0, flatness_m=0), "flatness_m: expected a number ≥"),
    (lambda: sidestep.solve(GAME).level_curves(0, spacing_m=NAN), "spacing_m: expected a number ≥"),
    (lambda: sidestep.bounds(np.zeros((0, 2, 3)), MODEL, [0], [1]), r"history: .*n ≥ 1, found shape \(0, 2, 3\)"),
    (lambda: sidestep.bounds(np.zeros((2, 3)), MODEL, [0], [1]), r"history: .*found shape \(2, 3\)"),
    (lambda: sidestep.bounds(NOW * 1e9, MODEL, [0], [1]), r"history\[0\]\.robot\.x: expected a number from"),
    (lambda: sidestep.bounds(NOW, MODEL, [], [1]), "epsilon: expected at least one set, found none"),
    (lambda: sidestep.bounds(NOW, MODEL, [0.2, 0.1], [1]), r"epsilon\[1\]: expected 0.2 rad/s or more"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], [1, 4]), r"k\[1\]: expected a whole number from 1 to 3, found 4"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], [-1]), r"k\[0\]: expected at least 1, found -1"),
    (lambda: sidestep.bounds(NOW, MODEL, [0]), "k: expected one of k, q and tau"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], [1], tau=0.1), "tau: expected none beside k"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], tau=0.1), "steps: expected the number of coming steps, with tau"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], tau=2, steps=3), r"tau: expected a number in \(0, 1\], found 2"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], [1] * 101), "steps: expected at most 100 steps, found 101"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], [1], rollout="mine"), "rollout: expected base or paper, found mine"),
    (lambda: sidestep.ActionModel([], len), "actions: expected at least one action, found none"),
    (lambda: sidestep.ActionModel([0.0], 5), "probabilities: expected a callable"),
    (
        lambda: sidestep.bounds(NOW, sidestep.ActionModel([-9.0], lambda _: [1.0]), [0], [1]),
        r"actions\[0\]: expected a turn rate from -0.5 to 0.5 rad/s, found -9",
    ),
    (lambda: sidestep.ReachableSet([0, 0], -FULL, FULL), r"start: expected an array of shape \(…, 3\)"),
    (lambda: sidestep.ReachableSet([[0, 0, 0]], -FULL, FULL), r"start: expected an array of shape \(3,\)"),
    (lambda: sidestep.ReachableSet([0, 0, 0], [], []), "lo: expected at least one step, found none"),
    (lambda: sidestep.ReachableSet([0, 0, 0], FULL, -FULL), r"lo\[0\]: expected at most hi\[0\] = -0.5, found 0.5"),
    (lambda: sidestep.ReachableSet([0, 0, 0], FULL, FULL[:2]), "hi: expected 3 entries, found 2 entries"),
    (lambda: sidestep.ReachableSet([0, 0, 0], -FULL, 99 * FULL), r"hi\[0\]: expected at most half a turn"),
    (lambda: sidestep.ReachableSet([0, 0, 0], -FULL, FULL, 1e9), "speed_mps: expected a speed"),
    (lambda: sidestep.ReachableSet([0, 0, 0], -FULL, FULL, step_s=0), "step_s: expected a finite number > 0"),
    (lambda: sidestep.ReachableSet([0, 0, 0], np.zeros(101), np.zeros(101)), "lo: expected at most 100 steps"),
    (lambda: SET.tube(accuracy_m=0), "accuracy_m: expected 10⁻⁶ to 1 m, found 0"),
    (lambda: SET.polygon(4), "step: expected 0 to 3, found 4"),
    (lambda: SET.polygon(-1), "step: expected at least 0, found -1"),
    (lambda: SET.contains([[0, 0, 1e300]], 2), r"states\[0\]\.psi: expected a number from -1000000 to 1000000"),
    (lambda: SET.contains([[0, 0, 0]], 9), "step: expected 0 to 3, found 9"),
    (lambda: SET.contains_drive(np.zeros((4, 3))), r"states: .*t ≤ 3, found shape \(4, 3\)"),
    (lambda: sidestep.reach([0, 0, 0], FULL, FULL), r"lo: expected an array of shape \(m, T\)"),
    (lambda: sidestep.reach([0, 0, 0], -FULL[None], FULL[None, :2]), r"hi: expected an array of shape \[1, 3\]"),
    (lambda: sidestep.reach([0, 0, 0], [[1.0]], [[0.0]]), r"set 0\.lo\[0\]: expected at most hi\[0\]"),
    (lambda: sidestep.features(NOW, []), "names: expected at least one feature, found none"),
    (lambda: sidestep.features(NOW, ["speed"]), r"names\[0\]: expected one of abs_dx.*found speed"),
    (lambda: MODEL.proba(np.zeros((2, 1))), r"rows: expected an array of shape \(n, 0\), found shape \(2, 1\)"),
    (lambda: sidestep.Trajectory(np.zeros((1, 2, 3)), []), r"states: .*n ≥ 2, found shape \(1, 2, 3\)"),
    (lambda: sidestep.Trajectory(np.zeros((3, 2, 3)), [0.0]), "states: expected 2 entries, found 3 entries"),
    (lambda: sidestep.simulate(0, 1), "participants: expected at least 1, found 0"),
    (lambda: sidestep.ShfrsSettings([0.0], []), "k: expected at least one step, found none"),
    (lambda: sidestep.ShfrsPredictor(MODEL, sidestep.ShfrsSettings([0.0], [9])), r"k\[0\]: .*1 to 3, found 9"),
    (lambda: sidestep.calibrate([], MODEL, sidestep.ShfrsSettings([0.0], [1])), "expected at least 29"),
    (lambda: sidestep.calibrate(ONCE, MODEL, sidestep.ShfrsSettings([0.0], [1]), p=1.5), "p: expected"),
    (lambda: sidestep.calibrate(ONCE, MODEL, sidestep.ShfrsSettings([0.0], [1]), windows="x"), "windows: expected"),
    (lambda: sidestep.VehicleModel(10**400, 0.5), "speed_mps: expected a finite number > 0, found inf"),
    (lambda: sidestep.VehicleModel(-(10**400), 0.5), "speed_mps: expected a finite number > 0, found -inf"),
    (lambda: sidestep.VehicleModel(-1e300, 0.5), "speed_mps: expected a finite number > 0, found -1e300"),
    (lambda: sidestep.value([1, 2, 3], GAME, threads=-(2**63) - 1), "threads: expected at least 1, found -"),
    (lambda: sidestep.SceneParameters(steps=2**64), "steps: expected a whole number from 1 to 3000"),
    (lambda: sidestep.bounds(NOW, MODEL, [0], [2**70]), r"k\[0\]: expected a whole number from 1 to 3"),
    (lambda: sidestep.simulate(1, 1, seed=-1), "seed: expected a whole number from 0 to 18446744073709551615, found -1"),
    (lambda: sidestep.simulate(1, 1, seed=2**64), "seed: .*found 18446744073709551616"),
    (lambda: sidestep.solve(GAME, progress=5), "progress: expected a callable, or None, found <class 'int'>"),
    (lambda: sidestep.Predictor.from_json(AVOIDANCE.replace("2", "9", 1)), r"predictor\.experiment: expected 1, .*found 9"),
    (lambda: SET.contains_drive(np.zeros((0, 3))), r"states: .*1 ≤ t ≤ 3, found shape \(0, 3\)"),
    (lambda: sidestep.ShfrsPredictor(MODEL).predict(NOW).contains(np.zeros((0, 3))), r"states: .*found shape \(0, 3\)"),
    (lambda: sidestep.value(np.ma.masked_equal([1.0, 2, 3], 2), GAME), "states: .*without masked entries, found some"),
]


@pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")
@pytest.mark.parametrize(("call", "complaint"), REFUSED, ids=[complaint for _, complaint in REFUSED])
def test_a_refusal_names_argument_expected_and_found(call, complaint):
    with pytest.raises(ValueError, match=complaint) as raised:
        call()
    assert "expected" in str(raised.value) and "found" in str(raised.value)


def test_a_model_of_avoidance_cannot_drive_a_prediction():
    text = MODEL.to_json().replace('"features"', '"experiment":2,"features"')
    with pytest.raises(ValueError, match="model: expected a model of the turn direction, found experiment 2"):
        sidestep.ShfrsPredictor(sidestep.Predictor.from_json(text))


def test_more_threads_than_a_machine_has_are_no_more_than_it_has():
    assert sidestep.value([5.0, 0.0, 1.0], GAME, threads=2**63) == sidestep.value([5.0, 0.0, 1.0], GAME)
    assert sidestep.value(np.ma.array([5.0, 0.0, 1.0], mask=False), GAME) == sidestep.value([5.0, 0.0, 1.0], GAME)


def test_other_types_are_type_errors():
    for call, argument in (
        (lambda: sidestep.VehicleModel("fast", 1), "speed_mps"),
        (lambda: sidestep.PursuitGame(CAR, 3, 3), "pursuer"),
        (lambda: sidestep.bounds(NOW, "model", [0], [1]), "model"),
        (lambda: sidestep.SidestepClassifier(None), "predictor: expected a Predictor, found NoneType"),
        (lambda: sidestep.value([1, 2, 3], GAME, threads=1.5), "threads"),
        (lambda: sidestep.simulate(1, 1, seed="a"), "seed"),
        (lambda: sidestep.calibrate([3], MODEL, sidestep.ShfrsSettings([0.0], [1])), "trajectories"),
    ):
        with pytest.raises(TypeError, match=argument):
            call()


ANY = arrays.arrays(
    st.sampled_from([np.float64, np.float32, np.int64, np.bool_, np.complex64, np.dtype("U3"), object]),
    arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=3),
)


@pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")
@settings(derandomize=True, max_examples=400, deadline=None)
@given(ANY)
def test_any_array_gives_an_answer_or_a_value_error(array):
    for call in (
        lambda: sidestep.value(array, GAME),
        lambda: sidestep.state(array, GAME),
        lambda: sidestep.relative_state(array, array),
        lambda: sidestep.bounds(array, MODEL, [0], [1]),
        lambda: sidestep.bounds(NOW, MODEL, array, [1]),
        lambda: sidestep.ReachableSet(array, -FULL, FULL),
        lambda: sidestep.ReachableSet([0, 0, 0], array, array),
        lambda: sidestep.reach([0, 0, 0], array, array),
        lambda: SET.contains(array, 2),
        lambda: SET.contains_drive(array),
        lambda: sidestep.features(array, ["v_h"]),
        lambda: MODEL.proba(array),
        lambda: sidestep.Trajectory(array, array),
        lambda: sidestep.ShfrsPredictor(MODEL).predict(array),
        lambda: sidestep.ActionModel(array, len),
    ):
        try:
            call()
        except ValueError as error:
            assert "expected" in str(error) and "found" in str(error)


@settings(derandomize=True, max_examples=300, deadline=None)
@pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")
@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_any_finite_state_has_a_value(state):
    value, gradient, turns, _ = sidestep.state(state, GAME)
    assert not np.isnan(value) and value == sidestep.value(state, GAME)
    assert not np.isnan(turns).any()
