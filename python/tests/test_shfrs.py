"""Predicted sets and their calibration."""

import os
import threading
import time

import numpy as np
import pytest
import shapely
from conftest import constant, driven
from scipy.stats import beta
from sklearn.linear_model import LogisticRegression

import sidestep

NOW = np.array([[[1, 2, 0.5], [9, 2, 3.0]]])


def test_areas_of_a_human_who_turns_right():
    found = sidestep.ShfrsPredictor(constant([0.6, 0.3, 0.1])).predict(NOW)
    # The reference areas of the library's own test.
    np.testing.assert_allclose(found.areas_m2, [1.22, 2.05, 2.60, 3.43, 5.33], atol=0.01)
    # The reachable area in 2 s is v²/6 · T³ · 2 ω = 16/3 m².
    np.testing.assert_allclose(found.shares_of_worst_case, found.areas_m2 / (16 / 3), rtol=1e-3)
    tubes = [shapely.Polygon(tube) for tube in found.tubes]
    assert all(tube.is_valid and tube.exterior.is_ccw for tube in tubes)
    np.testing.assert_allclose([tube.area for tube in tubes], found.areas_m2, rtol=1e-9)
    assert all(large.buffer(2e-3).contains(small) for small, large in zip(tubes, tubes[1:], strict=False))
    assert len(found) == 5 and found.step_polygons == [[]] * 5
    np.testing.assert_array_equal(found.margins_m, np.zeros(5))
    assert found.step_margins_m.shape == (5, 0)


def test_no_share_is_above_the_worst_case(rng):
    """A polygon may be larger than its set, here by 5e-5 of it; no set is larger than the worst case."""
    for _ in range(20):
        turn, accuracy = rng.uniform(0.2, 2.0), rng.uniform(1e-3, 5e-2)
        vehicle = sidestep.VehicleModel(rng.uniform(0.5, 3.0), turn)
        parameters = sidestep.SceneParameters(human=vehicle)
        settings = sidestep.ShfrsSettings([0.5 * turn, 2 * turn], [1] * 10, accuracy_m=accuracy)
        model = sidestep.ActionModel([-turn, 0.0, turn], lambda history: [0.2, 0.6, 0.2])
        smaller, all_of_it = sidestep.ShfrsPredictor(model, settings, parameters=parameters).predict(NOW).shares_of_worst_case
        assert smaller < all_of_it == 1


def test_what_a_prediction_holds(rng):
    settings = sidestep.ShfrsSettings([0.0, 0.3, 1.0], [2, 1, 1, 1], by_step=True)
    predictor = sidestep.ShfrsPredictor(constant([0.2, 0.6, 0.2]), settings)
    found = predictor.predict(NOW)
    lo, hi = sidestep.bounds(NOW, constant([0.2, 0.6, 0.2]), [0.0, 0.3, 1.0], [2, 1, 1, 1])
    np.testing.assert_array_equal((found.lo, found.hi), (lo, hi))
    np.testing.assert_array_equal(found.epsilon, [0.0, 0.3, 1.0])
    assert [len(steps) for steps in found.step_polygons] == [4, 4, 4]
    np.testing.assert_array_equal(found.step_polygons[1][3], found.sets[1].polygon(4))
    _, margin_m = found.sets[1].polygon(4, return_margin=True)
    assert found.step_margins_m.shape == (3, 4) and found.step_margins_m[1, 3] == margin_m
    straight, left = driven(NOW[0, 0], np.zeros(4))[1:], driven(NOW[0, 0], np.full(4, 0.25))[1:]
    np.testing.assert_array_equal(found.contains(straight), [True, True, True])
    np.testing.assert_array_equal(found.contains(left), [False, True, True])
    np.testing.assert_array_equal(found.contains(np.zeros((4, 3))), [False] * 3)
    # An older prediction does not change with later ones.
    before = [tube.copy() for tube in found.tubes]
    predictor.predict(NOW + [[[3, 0, 1], [0, 0, 0]]])
    assert all((old == new).all() for old, new in zip(before, found.tubes, strict=True))


def test_threads_may_share_a_predictor(people):
    predictor = sidestep.ShfrsPredictor(constant([0.2, 0.6, 0.2]))
    histories = [trial.states[:20] for trial in people[0]]
    expected = [predictor.predict(history).areas_m2 for history in histories]
    found = [None] * len(histories)

    def predict(i):
        found[i] = predictor.predict(histories[i]).areas_m2

    threads = [threading.Thread(target=predict, args=(i,)) for i in range(len(histories))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(found, expected)


def test_a_function_may_predict_within_its_prediction(people):
    """It neither deadlocks nor disturbs the outer prediction."""
    history, inner = people[0][0].states[:9], []

    def model(states):
        if not inner:
            inner.append(None)
            inner[0] = predictor.predict(history).areas_m2
        return [0.2, 0.6, 0.2]

    predictor = sidestep.ShfrsPredictor(sidestep.ActionModel([-0.5, 0.0, 0.5], model))
    np.testing.assert_array_equal(predictor.predict(history).areas_m2, inner[0])


def test_a_function_that_calls_itself_without_end_is_stopped(people):
    history = people[0][0].states[:3]

    def model(states):
        return sidestep.bounds(history, endless, [0.0], [1])

    endless = sidestep.ActionModel([-0.5, 0.0, 0.5], model)
    with pytest.raises(RecursionError):
        sidestep.bounds(history, endless, [0.0], [1])


def test_the_papers_settings():
    left, middle, right = (sidestep.ShfrsSettings.paper(figure) for figure in ("left", "middle", "right"))
    np.testing.assert_array_equal(left.epsilon, [0.0, 0.15, 0.25, 0.4, 1.0])
    np.testing.assert_array_equal(middle.epsilon, [0.2, 0.3, 0.35, 0.45, 1.0])
    assert (left.k, right.k) == ([2, 2] + [1] * 8, [2] + [1] * 9)
    assert (left.tau, left.steps, left.rollout) == (None, 10, "base")
    with pytest.raises(ValueError, match="figure: expected left, middle or right, found top"):
        sidestep.ShfrsSettings.paper("top")


def test_calibration_is_the_rank_that_it_says(people):
    trajectories = [trial for trials in people for trial in trials]
    model, settings = constant([0.2, 0.6, 0.2]), sidestep.ShfrsSettings([0.0], [1] * 8)
    found = sidestep.calibrate(trajectories, model, settings, p=0.8, delta=None, seed=5)
    n = len(trajectories)
    assert (len(found.scores), found.p, found.delta) == (n, 0.8, None)
    # Split conformal prediction: the ⌈(n + 1) p⌉-th score.
    assert found.epsilon == np.sort(found.scores)[int(np.ceil((n + 1) * 0.8)) - 1]
    assert f"{n} trajectories" in found.statement and "marginal" in found.statement
    np.testing.assert_array_equal(found.settings.epsilon, [found.epsilon, 1.0])
    sure = sidestep.calibrate(trajectories, model, settings, p=0.8, delta=0.1, seed=5)
    assert sure.epsilon >= found.epsilon
    with pytest.raises(ValueError, match=r"trajectories: expected at least 59 for p = 0\.95 and delta = 0\.05, found 36$"):
        sidestep.calibrate(trajectories, model, settings, p=0.95)


@pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")
def test_trajectories_of_other_vehicles_are_refused(people):
    """No ε gives sets that contain a drive which their vehicle cannot drive, so there would be no guarantee."""
    trajectories = [trial for trials in people for trial in trials]
    model, settings = constant([0.2, 0.6, 0.2]), sidestep.ShfrsSettings([0.0], [1] * 8)
    slower = sidestep.SceneParameters(human=sidestep.VehicleModel(1.0, 0.5))
    straighter = sidestep.SceneParameters(human=sidestep.VehicleModel(2.0, 0.1))
    for parameters, where in (
        (slower, r"trajectories\[0\]\.states\[1\]\.human\.x, y: expected a position 0\.2000 m away"),
        (sidestep.SceneParameters(step_s=0.1), r"trajectories\[0\]\.states\[1\]\.human\.x, y: expected"),
        (straighter, r"trajectories\[\d+\]\.states\[\d+\]\.human\.psi: expected"),
    ):
        with pytest.raises(ValueError, match=where):
            sidestep.calibrate(trajectories, model, settings, p=0.8, delta=None, parameters=parameters)
    rng = np.random.default_rng(5)
    jumping = sidestep.Trajectory(rng.uniform(-100, 100, (51, 2, 3)), rng.uniform(-9, 9, 50))
    with pytest.raises(ValueError, match=r"trajectories\[36\]\.states\[1\]\.human\.x, y"):
        sidestep.calibrate([*trajectories, jumping], model, settings, p=0.8, delta=None)
    lying = sidestep.Trajectory(trajectories[0].states, trajectories[0].turn_rates + 0.1)
    with pytest.raises(ValueError, match=r"trajectories\[0\]\.turn_rates\[0\]: expected .* rad/s, by which the human"):
        sidestep.calibrate([lying, *trajectories[1:]], model, settings, p=0.8, delta=None)
    # The robot's motion is not checked, and three decimals are enough.
    states = trajectories[0].states
    states[:, 1] = rng.uniform(-100, 100, (51, 3))
    rounded = sidestep.Trajectory(states.round(3), trajectories[0].turn_rates)
    found = sidestep.calibrate([rounded, *trajectories[1:]], model, settings, p=0.8, delta=None)
    assert len(found.scores) == 36


def test_calibrated_sets_hold_their_share():
    """New trajectories of the same population: the share inside F_1 is p, to four standard errors."""
    people = sidestep.simulate(60, 4, seed=11)
    model, settings = constant([0.2, 0.6, 0.2]), sidestep.ShfrsSettings([0.0], [1] * 8)
    half = [trials[0] for trials in people], [trial for trials in people for trial in trials[1:]]
    calibrated = sidestep.calibrate(half[0], model, settings, p=0.8, delta=None)
    predictor = sidestep.ShfrsPredictor(model, calibrated.settings)
    begins = np.random.default_rng(3).integers(0, 42, len(half[1]))
    inside = [
        predictor.predict(trial.states[: begin + 1]).contains(trial.states[begin + 1 : begin + 9, 0])[0]
        for trial, begin in zip(half[1], begins, strict=True)
    ]
    assert np.mean(inside) >= 0.8 - 4 * np.sqrt(0.8 * 0.2 * (1 / 60 + 1 / len(inside)))
    assert np.mean(inside) < 1


STRAIGHT = constant([0.0, 1.0, 0.0])
CROSSED = np.array([[[0.0, 0.0, 0.0], [2.0, -2.4, np.pi / 2]]])


def crossing(speed_mps):
    """The plan of a robot that drives up from its position in `CROSSED`, ten steps of 0.2 s."""
    y = -2.4 + speed_mps * 0.2 * np.arange(1, 11)
    return np.stack([np.full(10, 2.0), y, np.full(10, np.pi / 2)], axis=-1)


def test_a_plan_is_as_clear_as_it_is_from_drives(rng):
    """No drive of a set comes closer than the clearance; the only straight drive comes exactly as close."""
    predicted = sidestep.ShfrsPredictor(STRAIGHT, sidestep.ShfrsSettings([0.0, 0.25, 1.0], [1] * 10)).predict(CROSSED)
    plan, radius = crossing(1.2), 0.6
    clear = predicted.clear(plan, radius)
    assert clear.shape == (3, 10) and (np.diff(clear, axis=0) <= 0).all()
    time = np.linspace(0, 2, 2001)
    robot = np.stack([np.full(2001, 2.0), -2.4 + 1.2 * time], axis=-1)

    def apart(turn_rates):
        fine = driven(CROSSED[0, 0], np.repeat(turn_rates, 200), step_s=0.001)
        distance = np.hypot(*(fine[:, :2] - robot).T) - radius
        return np.array([distance[200 * i : 200 * i + 201].min() for i in range(10)])

    straight = apart(np.zeros(10))
    assert (clear[0] <= straight + 1e-9).all() and (clear[0] >= np.minimum(straight, 2) - 0.02 - 1e-9)[straight > 0].all()
    for lo, hi, bound in zip(predicted.lo, predicted.hi, clear, strict=True):
        for _ in range(40):
            rates = np.where(rng.random(10) < 0.5, rng.choice([0, 1], 10), rng.random(10)) * (hi - lo) + lo
            assert (apart(rates) >= bound - 1e-9).all()
    # A square of 0.6 m contains no more than the disc around its corners.
    square = predicted.clear(plan, 0.0, corners=[[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3]])
    assert (square >= predicted.clear(plan, 0.3 * np.sqrt(2)) - 0.02).all()
    assert (predicted.clear(crossing(0.0), radius)[2] > 0).all() and (clear[2] <= 0).any()


def test_an_online_predictor_is_the_library_state_by_state(people):
    names = ["distance", "turned_1", "dpsi"]
    trial = people[0][0]
    rows = sidestep.features(trial.states[:-1], names)
    model = sidestep.from_sklearn(LogisticRegression(max_iter=2000).fit(rows, np.sign(trial.turn_rates)), names)
    settings = sidestep.ShfrsSettings.paper()
    online = sidestep.OnlinePredictor(model, settings)
    whole = sidestep.ShfrsPredictor(model, settings)
    assert online.states_needed == 2 and len(online.history) == 0
    for i in range(6):
        assert online.push(trial.states[i])
    lo, hi = online.predict()
    predicted = whole.predict(trial.states[:6])
    np.testing.assert_array_equal(lo, predicted.lo)
    np.testing.assert_array_equal(hi, predicted.hi)
    np.testing.assert_array_equal(online.history, trial.states[4:6])
    ahead = trial.states[6:16, 1]
    np.testing.assert_array_equal(online.clear(ahead, 0.4), predicted.clear(ahead, 0.4))
    jump = trial.states[6] + [[5, 0, 0], [0, 0, 0]]
    assert not online.push(jump) and len(online.history) == 1
    for call, complaint in (
        (online.predict, "history: expected at least 2 states"),
        (lambda: online.clear(ahead, 0.4), "predict: expected a call since the latest state, found none"),
        (lambda: online.push(np.zeros((3, 2))), r"state: expected an array of shape \(2, 3\)"),
        (lambda: online.push([[1e9, 0, 0]] * 2), r"state\.human\.x: expected"),
        (lambda: sidestep.OnlinePredictor(model, accuracy_m=0.0), "accuracy_m: expected"),
    ):
        with pytest.raises(ValueError, match=complaint):
            call()
    online.reset()
    with pytest.raises(ValueError, match="history: expected at least one state, found none"):
        online.clear(ahead, 0.4)


def test_a_collision_bound_is_that_of_clopper_and_pearson(people):
    trajectories = [trial for trials in people for trial in trials]
    settings = sidestep.ShfrsSettings([0.0], [1] * 10)
    calibration = sidestep.calibrate(trajectories, STRAIGHT, settings, p=0.8, delta=0.1, seed=5)
    nested = sidestep.ShfrsSettings([0.0, 0.3, 1.0], [1] * 10)
    predicted = sidestep.ShfrsPredictor(STRAIGHT, nested).predict(CROSSED)
    n = len(calibration.scores)

    def outside(level):
        inside = int((calibration.scores <= level).sum())
        # The last set admits everything, and needs no share of δ.
        return 1 - beta.ppf(0.1 / 2, inside, n - inside + 1) if inside else 1.0

    for plan, radius in ((crossing(0.0), 0.6), (crossing(1.2), 0.6), (crossing(1.2), 0.3), (crossing(1.2), 5.0)):
        bound = calibration.collision(predicted, plan, radius)
        clear = predicted.clear(plan, radius).min(axis=1) > bound.margin_m
        if not clear.any():
            assert (bound.set, bound.at_most) == (None, 1.0)
            continue
        largest = int(np.flatnonzero(clear).max())
        expected = 0.0 if largest == 2 else outside([0.0, 0.3][largest])
        assert bound.set == largest and abs(bound.at_most - expected) < 1e-9
        assert "With confidence 0.9" in bound.statement and "no guarantee for a single scene" in bound.statement
    other = sidestep.ShfrsPredictor(STRAIGHT, sidestep.ShfrsSettings([0.0], [2] + [1] * 9)).predict(CROSSED)
    model = sidestep.ShfrsPredictor(constant([0.2, 0.6, 0.2]), nested).predict(CROSSED)
    paper = sidestep.ShfrsSettings([0.0, 0.3, 1.0], [1] * 10, rollout="paper")
    average = sidestep.calibrate(trajectories, STRAIGHT, settings, p=0.8, delta=None, seed=5)
    for call, complaint in (
        (lambda: calibration.collision(other, crossing(0.0), 0.6), r"prediction: .*actions \(k = 1 1 .*\), found k = 2 1 1"),
        (lambda: calibration.collision(model, crossing(0.0), 0.6), "prediction: .*model and parameters, found others"),
        (
            lambda: calibration.collision(sidestep.ShfrsPredictor(STRAIGHT, paper).predict(CROSSED), crossing(0.0), 0.6),
            "prediction: .*roll-outs, base, found others",
        ),
        (lambda: average.collision(predicted, crossing(0.0), 0.6), "delta: .*since the calibration has none, found None"),
        (lambda: calibration.collision(predicted, crossing(0.0), 0.6, delta=1.0), "delta: expected"),
    ):
        with pytest.raises(ValueError, match=complaint):
            call()
    assert average.collision(predicted, crossing(0.0), 0.6, delta=0.1).at_most == 0.0
    # The bound is fast for any δ; a bound of 1 is vacuous.
    bounds = [calibration.collision(predicted, crossing(1.2), 0.6, delta=d) for d in (0.1, 1e-100, 1e-200, 1e-300)]
    found = [bound.at_most for bound in bounds]
    assert found == sorted(found) and (found[0] < 1 or bounds[0].set is None)
    assert f"set={bounds[0].set})" in repr(bounds[0])


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_ctrl_c_ends_long_predictions(ctrl_c):
    many = sidestep.ShfrsPredictor(STRAIGHT, sidestep.ShfrsSettings(np.linspace(0, 1, 3000), [1] * 100))
    fine = sidestep.ShfrsSettings(np.linspace(0, 1, 20), [1] * 40, accuracy_m=1e-6, by_step=True)
    for predictor in (many, sidestep.ShfrsPredictor(STRAIGHT, fine)):
        ctrl_c(0.3)
        # CPU time, which does not depend on the load.
        begin = time.process_time()
        with pytest.raises(KeyboardInterrupt):
            predictor.predict(CROSSED)
        assert time.process_time() - begin < 2.5


def test_a_plan_that_is_none_is_refused():
    predicted = sidestep.ShfrsPredictor(STRAIGHT).predict(CROSSED)
    jump = crossing(0.5)
    jump[4:, 1] += 1.0
    for plan, options, complaint in (
        (crossing(0.5)[:5], {}, "plan: expected 10 steps, as predicted, found 5 steps"),
        (crossing(0.5)[:, :2], {}, r"plan: expected an array of shape \(…, 3\), found shape \(10, 2\)"),
        (crossing(0.5)[0], {}, r"plan: expected an array of shape \(n, 3\), found shape \(3,\)"),
        (crossing(0.5)[:0], {}, "plan: expected"),
        (crossing(0.5) * np.nan, {}, r"plan\[0, 0\]: expected a finite number, found NaN"),
        (jump, {}, r"plan\[4\]: expected at most 0.4 m after plan\[3\], as the limits allow, found 1.1"),
        (crossing(0.5) + [1, 0, 0], {}, r"plan\[0\]: expected at most 0.4 m after the present pose"),
        (crossing(0.5), {"most_speed_mps": 0.1}, r"plan\[0\]: expected at most 0.02"),
        (crossing(0.5), {"most_turn_rate_radps": -1.0}, "most_turn_rate_radps: expected a finite number > 0, found -1"),
        (crossing(0.5), {"radius_m": -1.0}, "radius_m: expected a length from 0 to 10000 m, found -1"),
        (crossing(0.5), {"radius_m": -1.0, "corners": [[0, 0]]}, "radius_m: expected a length"),
        (crossing(0.5), {"corners": np.zeros((0, 2))}, "corners: expected at least one, found none"),
        (crossing(0.5), {"corners": [0.0, 1.0]}, r"corners: expected an array of shape \(n, 2\), found shape \(2,\)"),
        (crossing(0.5), {"accuracy_m": 0.0}, "accuracy_m: expected 10⁻⁴ to 10 m, found 0"),
    ):
        with pytest.raises(ValueError, match=complaint):
            predicted.clear(plan, **{"radius_m": 0.3, **options})
    assert predicted.clear(crossing(3.0), 0.3, most_speed_mps=3.0).shape == (5, 10)


def test_simulated_people(people):
    assert [len(trials) for trials in people] == [12, 12, 12]
    trial = people[0][0]
    assert (trial.steps, trial.states.shape, trial.turn_rates.shape) == (50, (51, 2, 3), (50,))
    assert np.isin(trial.turn_rates, [-0.5, 0.0, 0.5]).all()
    again = driven(trial.states[0, 0], trial.turn_rates)
    np.testing.assert_allclose(trial.states[:, 0, :2], again[:, :2], atol=1e-9)
    np.testing.assert_array_equal(sidestep.simulate(1, 1, seed=4)[0][0].states, trial.states)
