"""A robot's loop: plans, the untrained model, the sets that a plan is clear of."""

import pickle

import numpy as np
import pytest
from conftest import constant, driven

import sidestep

WIDE = sidestep.ShfrsSettings([0.0, 0.3, 1.0], [1] * 10)
CROSSED = np.array([[0.0, 0.0, 0.0], [2.0, -2.4, np.pi / 2]])


def test_a_plan_is_driven_by_its_inputs(rng):
    start, rates = [1.0, -2.0, 3.0], rng.uniform(-2, 2, 12)
    plan = sidestep.drive(start, 1.3, rates, 0.1)
    expected = driven(start, rates, speed_mps=1.3, step_s=0.1)[1:]
    assert plan.shape == (12, 3) and (np.abs(plan[:, 2]) <= np.pi).all()
    np.testing.assert_allclose(plan[:, :2], expected[:, :2], atol=1e-12)
    np.testing.assert_allclose(np.exp(1j * plan[:, 2]), np.exp(1j * expected[:, 2]), atol=1e-12)
    # Many at once, each with its own speeds.
    many, speeds = rng.uniform(-1, 1, (2, 5, 7)), rng.uniform(-2, 2, (2, 5, 7))
    plans = sidestep.drive(start, speeds, many, 0.2)
    assert plans.shape == (2, 5, 7, 3)
    np.testing.assert_array_equal(plans[1, 3], sidestep.drive(start, speeds[1, 3], many[1, 3], 0.2))
    # Backward along the same line.
    np.testing.assert_allclose(sidestep.drive([0, 0, 0], [1.0, -1.0], [0.0, 0.0], 0.5)[:, 0], [0.5, 0.0], atol=1e-15)


def test_plans_that_are_none_are_refused():
    for arguments, complaint in (
        (([0, 0], 1.0, [0.0], 0.2), "start: expected an array of shape"),
        (([0, 0, 0], 1.0, 0.0, 0.2), r"turn_rates: expected an array of shape \(…, T\) with T ≥ 1, found shape \(\)"),
        (([0, 0, 0], 1.0, np.zeros((3, 0)), 0.2), r"turn_rates: expected an array of shape \(…, T\) with T ≥ 1"),
        (([0, 0, 0], [1.0], [0.0, 0.0], 0.2), r"speed_mps: expected an array of shape \[2\] as turn_rates, or a number"),
        (([0, 0, 0], 1.0, [[0.0, 20.0]], 0.2), r"turn_rates\[0, 1\]: expected at most half a turn in a step of 0.2 s, found 20"),
        (([0, 0, 0], 1e9, [0.0], 0.2), r"the pose after turn_rates\[0\]\.x: expected a number"),
        (([0, 0, 0], 1.0, [0.0], 0.0), "step_s: expected a finite number > 0, found 0"),
        (([0, 0, 0], np.nan, [0.0], 0.2), "speed_mps: expected a finite number, found NaN"),
    ):
        with pytest.raises(ValueError, match=complaint):
            sidestep.drive(*arguments)


def test_the_largest_clear_set():
    clearances = np.array([[2.0, 1.0], [1.5, 0.5], [0.3, -1.0]])
    found = [sidestep.largest_clear(clearances, margin) for margin in (0.0, 0.4, 0.5, 0.9, 1.0)]
    assert found == [1, 1, 0, 0, None]
    assert sidestep.largest_clear(clearances + 2) == 2
    for arguments, complaint in (
        (([1.0, 2.0],), r"clearances: expected an array of shape \(m, T\) with T ≥ 1, found shape \(2,\)"),
        ((np.zeros((2, 0)),), "clearances: expected an array of shape"),
        ((clearances, -0.1), "margin_m: expected a finite number ≥ 0, found -0.1"),
    ):
        with pytest.raises(ValueError, match=complaint):
            sidestep.largest_clear(*arguments)


def test_a_constant_predictor():
    assert sidestep.Predictor.constant([-1, 0, 1], [0.2, 0.6, 0.2]) == constant([0.2, 0.6, 0.2])
    own = sidestep.Predictor.constant([0, 1], [0.3, 0.7], actions=[-0.2, 0.4])
    assert (own.features, own.classes, own.actions) == ([], [0, 1], [-0.2, 0.4])
    np.testing.assert_array_equal(own.proba(np.zeros((2, 0))), [[0.3, 0.7]] * 2)
    lo, hi = sidestep.bounds([CROSSED], own, [0.0], [1, 2])
    np.testing.assert_array_equal([lo[0], hi[0]], [[0.4, -0.2], [0.4, 0.4]])
    for classes, probabilities, actions, complaint in (
        ([-1, 0, 1], [0.5, 0.5], None, "probabilities"),
        ([-1, 0, 1], [0.5, 0.5, 0.5], None, "probabilities: expected numbers from 0 to 1 that sum to 1"),
        ([1, 0], [0.5, 0.5], None, "classes"),
        ([0, 200], [0.5, 0.5], None, r"classes\[1\]: expected a whole number from -128 to 127, found 200"),
        ([0, 1], [0.5, 0.5], [0.4, 0.1], "actions: expected turn rates in rising order"),
    ):
        with pytest.raises(ValueError, match=complaint):
            sidestep.Predictor.constant(classes, probabilities, actions=actions)


def test_classes_are_the_humans_turn_rates_if_no_others_are_given():
    parameters = sidestep.SceneParameters(human=sidestep.VehicleModel(1.4, 1.2))
    model = sidestep.Predictor.constant([-1, 0, 1], [0.0, 0.0, 1.0])
    assert model.actions is None
    np.testing.assert_array_equal(sidestep.bounds([CROSSED], model, [0.0], [1], parameters=parameters), 1.2)


@pytest.mark.parametrize("turn_rate", [0.5, 1.0, 0.2])
def test_the_default_epsilon_admit_every_turn_of_the_human(turn_rate):
    parameters = sidestep.SceneParameters(human=sidestep.VehicleModel(1.4, turn_rate), step_s=0.1)
    model = sidestep.Predictor.constant([-1, 0, 1], [0.1, 0.8, 0.1])
    online = sidestep.OnlinePredictor(model, parameters=parameters)
    online.push(CROSSED)
    lo, hi = online.predict()
    assert (lo[-1] == -turn_rate).all() and (hi[-1] == turn_rate).all() and (hi[:-1, 2:] < turn_rate).all()
    whole = sidestep.ShfrsPredictor(model, parameters=parameters).predict([CROSSED])
    np.testing.assert_array_equal([lo, hi], [whole.lo, whole.hi])
    paper = sidestep.ShfrsSettings.paper(turn_rate_radps=turn_rate)
    np.testing.assert_array_equal(whole.epsilon, paper.epsilon)
    np.testing.assert_allclose(paper.epsilon, 2 * turn_rate * np.array([0.0, 0.15, 0.25, 0.4, 1.0]), rtol=1e-15)


def test_the_sets_of_a_loop_have_its_speed_and_step():
    parameters = sidestep.SceneParameters(human=sidestep.VehicleModel(1.4, 1.0), step_s=0.1)
    model = sidestep.Predictor.constant([-1, 0, 1], [0.1, 0.8, 0.1])
    online = sidestep.OnlinePredictor(model, parameters=parameters)
    with pytest.raises(ValueError, match="history: expected at least 1 state, .*found 0"):
        online.sets()
    online.push(CROSSED)
    sets = online.sets()
    whole = sidestep.ShfrsPredictor(model, parameters=parameters).predict([CROSSED])
    assert [each.steps for each in sets] == [10] * 5
    for ours, theirs in zip(sets, whole.sets, strict=True):
        np.testing.assert_array_equal(ours.tube(), theirs.tube())
    # Straight on for a second.
    assert sets[0].contains([[1.4, 0.0, 0.0]], 10)[0]
    # `sets` counts as a prediction, after which plans can be checked.
    assert online.clear(sidestep.drive(CROSSED[1], 0.0, np.zeros(10), 0.1), 0.3).shape == (5, 10)


def test_a_plan_that_turns_by_half_a_turn_is_refused():
    """To the right or to the left: the poses are the same."""
    parameters = sidestep.SceneParameters(robot=sidestep.VehicleModel(0.5, np.pi / 0.2))
    settings = sidestep.ShfrsSettings([0.0, 1.0], [1])
    model = sidestep.Predictor.constant([-1, 0, 1], [0.1, 0.6, 0.3])
    prediction = sidestep.ShfrsPredictor(model, settings, parameters=parameters).predict([CROSSED])
    for turn in (-np.pi, np.pi):
        plan = sidestep.drive(CROSSED[1], 0.0, [turn / 0.2], 0.2)
        complaint = r"plan\[0\]: expected less than half a turn after the present pose, since the direction would be ambiguous"
        with pytest.raises(ValueError, match=complaint):
            prediction.clear(plan, 0.4, corners=[[0, 0], [2, 0]])
    almost = sidestep.drive(CROSSED[1], 0.0, [-(np.pi - 1e-5) / 0.2], 0.2)
    assert prediction.clear(almost, 0.4, corners=[[0, 0], [2, 0]]).shape == (2, 1)


def test_a_human_who_slows_down_and_stands():
    straight = sidestep.Predictor.constant([-1, 0, 1], [0.0, 1.0, 0.0])
    online = sidestep.OnlinePredictor(straight, WIDE, speed_mps=(0, 2.2))
    human = np.array([0.0, 0.44, 0.6, 0.6])
    for x in human:
        assert online.push([[x, 0, 0], [6, 0, np.pi]]) and online.departure is None
    lo, _ = online.predict()
    assert (lo[0] == 0).all()
    # The human can stand, or drive straight on at up to 2.2 m/s.
    clearances = online.clear(np.tile([6.0, 0, np.pi], (10, 1)), 0.5)
    expected = 5.4 - 0.5 - 0.44 * np.arange(1, 11)
    assert (clearances[0] <= expected).all() and (clearances[0] >= expected - 0.02).all()
    last = online.sets()[0].polygon(10)
    np.testing.assert_allclose([last[:, 0].min(), last[:, 0].max()], [0.6, 5.0], atol=2e-3)
    again = pickle.loads(pickle.dumps(online))
    np.testing.assert_array_equal(again.clear(np.tile([6.0, 0, np.pi], (10, 1)), 0.5), clearances)
    assert not online.push([[1.2, 0, 0], [6, 0, np.pi]])
    assert online.departure == "the human moved at 3.00 m/s, the vehicle at 0 to 2.2 m/s"
    for wrong in ([[0, 1], [1, 2]], (0, 0), (2, 1)):
        with pytest.raises(ValueError, match="speed_mps"):
            sidestep.OnlinePredictor(straight, WIDE, speed_mps=wrong)


def test_a_collision_bound_in_a_loop(people):
    trajectories = [trial for trials in people for trial in trials]
    straight = sidestep.Predictor.constant([-1, 0, 1], [0.0, 1.0, 0.0])
    calibration = sidestep.calibrate(trajectories, straight, WIDE, p=0.8, delta=0.1)
    online = sidestep.OnlinePredictor(straight, WIDE)
    online.push(CROSSED)
    online.predict()
    predicted = sidestep.ShfrsPredictor(straight, WIDE).predict([CROSSED])
    bounds = set()
    for speed in (0.0, 1.2, 2.0):
        plan = sidestep.drive(CROSSED[1], speed, np.zeros(10), 0.2)
        ours, theirs = (calibration.collision(each, plan, 0.5) for each in (online, predicted))
        assert (ours.at_most, ours.set, ours.statement) == (theirs.at_most, theirs.set, theirs.statement)
        assert ours.set == sidestep.largest_clear(online.clear(plan, 0.5), ours.margin_m)
        bounds.add(ours.at_most)
    assert len(bounds) > 1
    # No human in the calibration stands still, walks slowly or jumps.
    for way_m in (0.0, 0.2, 0.5, 3.0):
        moved = np.array(CROSSED)
        moved[0, 0] += way_m
        loop = sidestep.OnlinePredictor(straight, WIDE)
        loop.push(CROSSED)
        loop.push(moved)
        loop.predict()
        complaint = r"state\.human\.x, y: expected a position 0\.4000 m away"
        with pytest.raises(ValueError, match=complaint):
            calibration.collision(loop, plan, 0.5)
        once = sidestep.ShfrsPredictor(straight, WIDE).predict([CROSSED, moved])
        with pytest.raises(ValueError, match=complaint.replace("state", r"history\[-1\]")):
            calibration.collision(once, plan, 0.5)
    other = sidestep.OnlinePredictor(constant([0.2, 0.6, 0.2]), WIDE)
    other.push(CROSSED)
    other.predict()
    narrow = sidestep.OnlinePredictor(straight, sidestep.ShfrsSettings([0.0], [2] + [1] * 9))
    elsewhere = sidestep.SceneParameters(step_s=0.1)
    for call, complaint in (
        (lambda: calibration.collision(other, plan, 0.5), "prediction: .*model and parameters, found others"),
        (lambda: calibration.collision(narrow, plan, 0.5), r"prediction: .*actions \(k = 1 1 .*\), found k = 2 1 1"),
        (
            lambda: calibration.collision(sidestep.OnlinePredictor(straight, WIDE, parameters=elsewhere), plan, 0.5),
            "prediction: .*model and parameters, found others",
        ),
        (lambda: calibration.collision(online, plan, 0.5, accuracy_m=0.1), "accuracy_m: expected None"),
        (
            lambda: sidestep.OnlinePredictor(sidestep.ActionModel([0.0], lambda history: [1.0])),
            "model: expected a Predictor; use ShfrsPredictor for an ActionModel, found an ActionModel",
        ),
    ):
        with pytest.raises(ValueError, match=complaint):
            call()


def test_why_there_are_too_few_windows(people):
    straight = sidestep.Predictor.constant([-1, 0, 1], [0.0, 1.0, 0.0])
    trial = people[0][0]
    short = [sidestep.Trajectory(trial.states[:6], trial.turn_rates[:5])] * 3
    with pytest.raises(ValueError, match="found 0: 3 of 3 are shorter than 10 steps$"):
        sidestep.calibrate(short, straight, WIDE)
    with pytest.raises(ValueError, match=r"p = 0.9 and no delta, found 1: 3 of 4 are shorter than 10 steps$"):
        sidestep.calibrate([*short, trial], straight, WIDE, delta=None)
    ahead = driven([0, 0, 0], np.zeros(12))
    still = [sidestep.Trajectory(np.stack([ahead, ahead + [9, 9, 0]], axis=1), np.zeros(12))]
    with pytest.raises(ValueError, match="found 0: 1 of 1 have no turn with 10 steps from it on$"):
        sidestep.calibrate(still, straight, WIDE, windows="avoidance_onset")
