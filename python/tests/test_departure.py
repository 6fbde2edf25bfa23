"""A human who does not move like the model's vehicle, and headings that are not in radians."""

import warnings

import numpy as np
import pytest
from conftest import driven
from hypothesis import given, settings
from hypothesis import strategies as st

import sidestep

STRAIGHT = sidestep.Predictor.constant([-1, 0, 1], [0.2, 0.6, 0.2])
WIDE = sidestep.ShfrsSettings([0.0, 1.0], [1] * 10)
STANDS = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, np.pi]])
OVER = sidestep.drive(STANDS[1], 2.0, np.zeros(10), 0.2)
"""A robot that drives over the origin: after step 8 it is at 3 − 8 · 0.4 = −0.2 m."""


def pushed(states, **named):
    online = sidestep.OnlinePredictor(STRAIGHT, WIDE, **named)
    followed = [online.push(state) for state in states]
    online.predict()
    return online, followed


def test_nobody_who_stands_still_is_driven_over():
    online, followed = pushed([STANDS] * 3)
    assert followed == [True, False, False]
    assert online.departure == "the human moved at 0.00 m/s, the vehicle at 2 m/s"
    clearances = online.clear(OVER, 0.5)
    assert clearances.shape == (2, 10) and (clearances == -np.inf).all()
    assert sidestep.largest_clear(clearances) is None and sidestep.largest_clear(clearances, 0.3) is None
    prediction = sidestep.ShfrsPredictor(STRAIGHT, WIDE).predict([STANDS] * 3)
    assert prediction.departure == online.departure
    np.testing.assert_array_equal(prediction.clear(OVER, 0.5), clearances)
    # The plan is still checked.
    with pytest.raises(ValueError, match=r"plan\[0\]"):
        online.clear(OVER + [9, 0, 0], 0.5)
    # With `assume_vehicle` the clearance is 2 m although the robot drives over the human.
    assumed, followed = pushed([STANDS] * 3, assume_vehicle=True)
    assert followed == [True] * 3 and assumed.departure is None
    sure = assumed.clear(OVER, 0.5)
    assert (sure[1, 7:9] > 1).all()
    whole = sidestep.ShfrsPredictor(STRAIGHT, WIDE, assume_vehicle=True).predict([STANDS] * 3)
    assert whole.departure is None
    np.testing.assert_array_equal(whole.clear(OVER, 0.5), sure)


@pytest.mark.parametrize("share", [0.85, 1.15])
def test_people_who_walk_are_noticed_with_their_speed(share):
    ahead = np.arange(3) * 0.4 * share
    states = [np.array([[x, 0.0, 0.0], STANDS[1]]) for x in ahead]
    online, followed = pushed(states)
    assert followed == [True, False, False]
    assert online.departure == f"the human moved at {2 * share:.2f} m/s, the vehicle at 2 m/s"
    assert (online.clear(OVER, 0.5) == -np.inf).all()


@pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")
def test_a_heading_in_degrees_and_a_turn_are_noticed():
    start = [0.0, 0.0, 0.5]
    ahead = driven(start, [0.0])[1]
    for psi, said in ((np.degrees(0.5), "which fits in degrees"), (0.7, "the human moved in direction 0.5000 rad")):
        states = [np.array([[*pose[:2], psi], STANDS[1]]) for pose in (start, ahead)]
        assert said in pushed(states)[0].departure


@settings(derandomize=True, max_examples=200, deadline=None)
@given(st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=6), st.floats(-3, 3))
def test_whoever_drives_like_the_vehicle_never_departs(rates, psi):
    poses = driven([1.0, -2.0, psi], rates)
    states = np.stack([poses, np.tile([30.0, 0.0, 0.0], (len(poses), 1))], axis=1)
    online, followed = pushed(states)
    assert all(followed) and online.departure is None
    # To a millimetre, too.
    assert all(pushed(np.round(states, 3))[1])


def test_a_plan_in_other_steps_is_refused():
    online, _ = pushed([STANDS])
    prediction = sidestep.ShfrsPredictor(STRAIGHT, WIDE).predict([STANDS])
    fine = sidestep.drive(STANDS[1], 1.0, np.zeros(10), 0.1)
    assert fine.step_s == 0.1 and isinstance(fine, np.ndarray)
    for each in (online, prediction):
        with pytest.raises(ValueError, match=r"plan: expected steps of 0\.2 s, those of the prediction, found steps of 0\.1 s"):
            each.clear(fine + 0.0, 0.5)
    # Every second pose of twenty is a plan in steps of 0.2 s; a plain array is accepted.
    halved = sidestep.drive(STANDS[1], 1.0, np.zeros(20), 0.1)[1::2]
    assert halved.step_s is None
    same = sidestep.drive(STANDS[1], 1.0, np.zeros(10), 0.2)
    # The poses differ by rounding, and clearances by at most the accuracy.
    np.testing.assert_allclose(online.clear(halved, 0.5), online.clear(same, 0.5), atol=0.02)
    assert online.clear(np.asarray(fine), 0.5).shape == (2, 10)
    many = sidestep.drive(STANDS[1], 1.0, np.zeros((3, 10)), 0.1)
    assert many[2].step_s == 0.1 and many[..., :2].step_s is None


FULL = np.full(3, 0.5)
GAME = sidestep.PursuitGame(sidestep.VehicleModel(2.0, 0.5), sidestep.VehicleModel(2.0, 0.5), 3.0)


def test_headings_that_may_be_degrees_are_told():
    turned, now = [[9.0, 0.0, 180.0]], [[[0.0, 0.0, 90.0], [9.0, 0.0, 3.0]]]
    online = sidestep.OnlinePredictor(sidestep.Predictor.constant([-1, 0, 1], [0.1, 0.6, 0.3]))
    for call, place in (
        (lambda: sidestep.value(turned, GAME), r"states\[0, 2\]: 180 is more than a full turn; headings are in radians \(180° are 3\.1416\)"),
        (lambda: sidestep.state(turned[0], GAME), r"states\[2\]: 180"),
        (lambda: sidestep.solve(GAME).value(turned), r"states\[0, 2\]"),
        (lambda: sidestep.relative_state(turned, [[1.0, 2.0, 0.3]]), r"evader\[0, 2\]"),
        (lambda: sidestep.ReachableSet(turned[0], -FULL, FULL), r"start\[2\]"),
        (lambda: sidestep.reach(turned[0], [-FULL], [FULL]), r"start\[2\]"),
        (lambda: sidestep.ReachableSet([0, 0, 0], -FULL, FULL).contains(turned, 1), r"states\[0, 2\]"),
        (lambda: sidestep.bounds(now, STRAIGHT, [0.0], [1]), r"history\[0, 0, 2\]: 90"),
        (lambda: sidestep.ShfrsPredictor(STRAIGHT, WIDE).predict(now), r"history\[0, 0, 2\]"),
        (lambda: online.push(now[0]), r"state\[0, 2\]: 90 is more than a full turn"),
        (lambda: sidestep.solve(GAME).level_curves(90), r"psi: 90 is more than a full turn"),
    ):
        with pytest.warns(sidestep.AngleWarning, match=place):
            assert call() is not None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sidestep.AngleWarning)
        # They are still computed with: 180 rad are 28 turns and 4.0708 rad.
        np.testing.assert_allclose(sidestep.value(turned, GAME), sidestep.value([[9.0, 0.0, 180 - 56 * np.pi]], GAME), atol=1e-9)
    # A full turn does not warn; a warning would raise here.
    sidestep.value([[9.0, 0.0, 2 * np.pi], [9.0, 0.0, -2 * np.pi]], GAME)
    sidestep.solve(GAME).level_curves(2 * np.pi)
    assert issubclass(sidestep.AngleWarning, UserWarning)


def test_booleans_are_no_numbers():
    own = sidestep.ReachableSet([0, 0, 0], -FULL, FULL)
    masks = [[True, False, True], np.array([[True, False, True]]), [[1.0, True, 0.5]], ((1, 2, np.True_),)]
    for mask in masks:
        for call in (
            lambda mask=mask: sidestep.value(mask, GAME),
            lambda mask=mask: sidestep.state(mask, GAME),
            lambda mask=mask: sidestep.solve(GAME).gradient(mask),
            lambda mask=mask: sidestep.relative_state(mask, mask),
            lambda mask=mask: own.contains(mask, 1),
            lambda mask=mask: sidestep.ReachableSet(mask, -FULL, FULL),
            lambda mask=mask: sidestep.bounds([[mask, mask]], STRAIGHT, [0.0], [1]),
            lambda mask=mask: sidestep.OnlinePredictor(STRAIGHT, WIDE).push([mask, mask]),
            lambda mask=mask: sidestep.Trajectory([[mask, mask]] * 2, [0.0]),
            lambda mask=mask: sidestep.drive(mask, 1.0, [0.0], 0.2),
        ):
            with pytest.raises(ValueError, match="expected.*found"):
                call()
    with pytest.raises(TypeError, match="bool"):
        sidestep.VehicleModel(True, 0.5)
