"""Predicted sets and their calibration."""

import threading

import numpy as np
import pytest
import shapely
from conftest import constant, driven

import sidestep

NOW = np.array([[[1, 2, 0.5], [9, 2, 3.0]]])


def test_areas_of_a_human_who_turns_right():
    found = sidestep.ShfrsPredictor(constant([0.6, 0.3, 0.1])).predict(NOW)
    # The areas that the library's own test has from the reference.
    np.testing.assert_allclose(found.areas_m2, [1.22, 2.05, 2.60, 3.43, 5.33], atol=0.01)
    tubes = [shapely.Polygon(tube) for tube in found.tubes]
    assert all(tube.is_valid and tube.exterior.is_ccw for tube in tubes)
    np.testing.assert_allclose([tube.area for tube in tubes], found.areas_m2, rtol=1e-9)
    assert all(large.buffer(2e-3).contains(small) for small, large in zip(tubes, tubes[1:], strict=False))
    assert len(found) == 5 and found.step_polygons == [[]] * 5


def test_what_a_prediction_holds(rng):
    settings = sidestep.ShfrsSettings([0.0, 0.3, 1.0], [2, 1, 1, 1], by_step=True)
    predictor = sidestep.ShfrsPredictor(constant([0.2, 0.6, 0.2]), settings)
    found = predictor.predict(NOW)
    lo, hi = sidestep.bounds(NOW, constant([0.2, 0.6, 0.2]), [0.0, 0.3, 1.0], [2, 1, 1, 1])
    np.testing.assert_array_equal((found.lo, found.hi), (lo, hi))
    np.testing.assert_array_equal(found.epsilon, [0.0, 0.3, 1.0])
    assert [len(steps) for steps in found.step_polygons] == [4, 4, 4]
    np.testing.assert_array_equal(found.step_polygons[1][3], found.sets[1].polygon(4))
    straight, left = driven(NOW[0, 0], np.zeros(4))[1:], driven(NOW[0, 0], np.full(4, 0.25))[1:]
    np.testing.assert_array_equal(found.contains(straight), [True, True, True])
    np.testing.assert_array_equal(found.contains(left), [False, True, True])
    np.testing.assert_array_equal(found.contains(np.zeros((4, 3))), [False] * 3)
    # An older prediction is its own, whatever was predicted since.
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
    """It neither waits for itself nor disturbs the prediction around it."""
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
    with pytest.raises(ValueError, match=r"calibration trajectories: expected at least 59 for p = 0\.95"):
        sidestep.calibrate(trajectories, model, settings, p=0.95)


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


def test_simulated_people(people):
    assert [len(trials) for trials in people] == [12, 12, 12]
    trial = people[0][0]
    assert (trial.steps, trial.states.shape, trial.turn_rates.shape) == (50, (51, 2, 3), (50,))
    assert np.isin(trial.turn_rates, [-0.5, 0.0, 0.5]).all()
    again = driven(trial.states[0, 0], trial.turn_rates)
    np.testing.assert_allclose(trial.states[:, 0, :2], again[:, :2], atol=1e-9)
    np.testing.assert_array_equal(sidestep.simulate(1, 1, seed=4)[0][0].states, trial.states)
