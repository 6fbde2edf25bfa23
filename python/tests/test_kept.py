"""Everything public can be pickled, copied, compared and, where a file is natural, saved."""

import copy
import inspect
import json
import pickle

import numpy as np
import pytest
from conftest import constant, driven

import sidestep

CAR = sidestep.VehicleModel(2.0, 0.5)
STRAIGHT = sidestep.Predictor.constant([-1, 0, 1], [0.1, 0.8, 0.1])
WIDE = sidestep.ShfrsSettings([0.0, 0.3, 1.0], [2] + [1] * 9, accuracy_m=0.01, by_step=True)
WALK = np.stack([driven([0, 0, 0], [0.0, 0.3, 0.3]), np.tile([9.0, 1.0, 3.0], (4, 1))], axis=1)


def turns(history):
    """A function that pickle can name."""
    return [0.2, 0.5, 0.3] if len(history) % 2 else [0.1, 0.8, 0.1]


MODEL = sidestep.ActionModel([-0.5, 0.0, 0.5], turns)


@pytest.fixture(scope="module")
def examples(people, unequal, unequal_scene):
    """At least one object of each public class."""
    trajectories = [trial for trials in people for trial in trials]
    grid = sidestep.Grid([-3, -2], [3, 2], [15, 11], periodic=[1])
    drift = lambda x: np.stack([np.sin(x[..., 1]), 0 * x[..., 0]], axis=-1)  # noqa: E731
    solution = sidestep.hj_solve(
        grid, drift, [[0], [1]], [[0.3], [0]], [[-1, 2]], [[-0.1, 0.3]], lambda x: np.abs(x[..., 0]) - 0.5, np.linspace(0, 0.5, 3)
    )
    calibration = sidestep.calibrate(trajectories, STRAIGHT, WIDE, p=0.8, delta=0.1)
    predicted = sidestep.ShfrsPredictor(STRAIGHT, WIDE).predict(WALK)
    own = sidestep.ShfrsPredictor(MODEL, WIDE, assume_vehicle=True).predict(WALK[:1])
    plan = sidestep.drive(WALK[-1, 1], 0.5, np.zeros(10), 0.2)
    objects = [
        CAR,
        unequal,
        sidestep.SceneParameters(CAR, unequal.pursuer, 2.5, 0.1, 40),
        unequal_scene[1],
        sidestep.solve(unequal, 1.0, accuracy="draft"),
        sidestep.solve(sidestep.PursuitGame(CAR, CAR, 3.0)),
        grid,
        solution,
        STRAIGHT,
        MODEL,
        sidestep.ReachableSet([1, 2, 3], [-0.5, 0.1], [0.2, 0.1], 1.3, 0.4),
        sidestep.ReachableSet([1, 2, 3], [1e-6, 0.0], [0.2, 0.1]),
        trajectories[0],
        WIDE,
        sidestep.ShfrsSettings([0.1], tau=0.2, steps=4, rollout="paper"),
        sidestep.ShfrsSettings([0.1], q=[0.9, 0.8]),
        sidestep.ActionModel([-0.5, 0.0, 0.0, 0.5], turns, bins=True),
        predicted,
        own,
        calibration,
        sidestep.calibrate(trajectories, MODEL, WIDE, p=0.5, delta=None),
        calibration.collision(predicted, plan, 0.5),
    ]
    return {(type(each).__name__, i): each for i, each in enumerate(objects)}


MACHINES = {"OnlinePredictor", "ShfrsPredictor"}


def test_every_public_class_is_among_the_examples(examples):
    classes = {name for name in sidestep.__all__ if inspect.isclass(getattr(sidestep, name))}
    # `AngleWarning` and `Plan` are types of Python and NumPy; the classifier is tested with scikit-learn.
    assert classes - {"AngleWarning", "Plan", "SidestepClassifier"} == {name for name, _ in examples} | MACHINES


def test_everything_is_equal_after_a_round_trip(examples):
    assert all(isinstance(hash(each), int) for (name, _), each in examples.items() if name not in {
        "SceneParameters", "SafetyLevels", "ValueFunction", "Grid", "Predictor"
    })
    for (name, _), each in examples.items():
        for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
            again = pickle.loads(pickle.dumps(each, protocol))
            assert type(again) is type(each) and again == each, (name, protocol)
            assert name == "SafetyLevels" or repr(again) == repr(each)
        assert copy.copy(each) == each and copy.deepcopy(each) == each, name
    # Different objects of a class are not equal.
    for (one, i), this in examples.items():
        for (other, j), that in examples.items():
            assert (this == that) == (i == j) or one != other, (one, i, j)


def test_a_pickled_solution_still_steers(examples):
    (solution,) = (each for (name, _), each in examples.items() if name == "Solution")
    again = pickle.loads(pickle.dumps(solution))
    states = [[1.2, 0.3], [-0.4, 1.9]]
    for ours, theirs in zip(again.inputs(states), solution.inputs(states), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_predictors_go_on_where_they_were():
    for many in (1, 2, 4):
        online = sidestep.OnlinePredictor(STRAIGHT, WIDE, accuracy_m=0.05)
        for state in WALK[:many]:
            assert online.push(state)
        online.predict()
        plan = sidestep.drive(WALK[many - 1, 1], 0.5, np.zeros(10), 0.2)
        for again in (pickle.loads(pickle.dumps(online)), copy.deepcopy(online), copy.copy(online)):
            assert again is not online
            np.testing.assert_array_equal(again.history, online.history)
            # The predictor has predicted already.
            np.testing.assert_array_equal(again.clear(plan, 0.4), online.clear(plan, 0.4))
    stood = copy.copy(online)
    assert not stood.push(WALK[-1]) and online.departure is None
    assert pickle.loads(pickle.dumps(stood)).departure == stood.departure is not None
    sets = sidestep.ShfrsPredictor(MODEL, WIDE)
    assert pickle.loads(pickle.dumps(sets)).predict(WALK) == sets.predict(WALK) == copy.copy(sets).predict(WALK)


def test_a_function_that_pickle_cannot_name_is_named():
    own = sidestep.ActionModel([0.0], lambda history: [1.0])
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(sidestep.ShfrsPredictor(own, sidestep.ShfrsSettings([0.0], [1])))
    assert copy.copy(own) == own and copy.deepcopy(own) == own


def test_a_calibration_is_stored_and_loaded(examples, tmp_path):
    trained, own = (each for (name, _), each in examples.items() if name == "Calibration")
    path = tmp_path / "calibration.json"
    trained.save(path)
    again = sidestep.Calibration.load(path)
    assert again == trained and again.statement == trained.statement and again.settings == trained.settings
    np.testing.assert_array_equal(again.scores, trained.scores)
    held = json.loads(path.read_text(encoding="utf-8"))
    assert held["format"] == "sidestep-calibration/1" and held["epsilon"] == trained.epsilon
    with pytest.raises(ValueError, match="model: expected a Predictor, which a file can hold.*found an ActionModel"):
        own.save(path)
    assert sidestep.Calibration.load(path) == trained
    for change, complaint in (
        ({"format": "sidestep-calibration/9"}, "calibration.format"),
        ({"epsilon": 0.01}, r"calibration\.epsilon: expected .*, the ε of the scores, for F_1, found 0\.01"),
        ({"scores": [-1.0]}, r"calibration\.scores"),
        ({"scores": []}, "calibration.scores: expected at least one, found none"),
        ({"p": 2}, r"calibration\.p: expected"),
        ({"delta": True}, r"calibration\.delta"),
        ({"settings": {**held["settings"], "k": [1]}}, r"calibration\.settings\.k: expected 10 entries, found 1"),
        ({"parameters": {**held["parameters"], "step_s": 0}}, r"calibration\.parameters\.step_s"),
        ({"predictor": {**held["predictor"], "classes": [0]}}, r"calibration\.predictor"),
        ({"more": 1}, "calibration"),
    ):
        path.write_text(json.dumps({**held, **change}), encoding="utf-8")
        with pytest.raises(ValueError, match=complaint):
            sidestep.Calibration.load(path)
    for text in ("", "[]", '{"format"'):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match="calibration: expected"):
            sidestep.Calibration.load(path)
    with pytest.raises(FileNotFoundError):
        sidestep.Calibration.load(tmp_path / "none.json")


def test_a_calibration_of_safety_levels_is_loaded_with_them(people, unequal_scene, tmp_path):
    parameters, safety = unequal_scene
    text = STRAIGHT.to_json().replace('"features":[]', '"features":["v_h"]')
    text = text.replace('"kind":"constant"', '"kind":"constant"')
    model = sidestep.Predictor.from_json(text)
    still = driven([0, 0, 0], np.zeros(12), parameters.human.speed_mps)
    drives = [sidestep.Trajectory(np.stack([still, still + [9 + i, 9, 0]], axis=1), np.zeros(12)) for i in range(4)]
    settings = sidestep.ShfrsSettings([0.0], [1] * 10)
    found = sidestep.calibrate(drives, model, settings, p=0.5, delta=None, parameters=parameters, safety=safety)
    found.save(tmp_path / "calibration.json")
    with pytest.raises(ValueError, match=r"safety: expected SafetyLevels\(parameters\), since the feature v_h needs them"):
        sidestep.Calibration.load(tmp_path / "calibration.json")
    assert sidestep.Calibration.load(tmp_path / "calibration.json", safety=safety) == found
    assert pickle.loads(pickle.dumps(found)) == found


def test_settings_are_files_of_the_laboratory(tmp_path):
    path = tmp_path / "shfrs-settings.json"
    for settings in (
        WIDE,
        sidestep.ShfrsSettings.paper(),
        sidestep.ShfrsSettings([0.1], tau=0.2, steps=4, rollout="paper"),
        sidestep.ShfrsSettings([0.1], q=[0.9, 0.8]),
    ):
        settings.save(path)
        assert sidestep.ShfrsSettings.load(path) == settings
    sidestep.ShfrsSettings.paper().save(path)
    # The format that `sidestep shfrs --settings` reads, without unknown fields.
    assert json.loads(path.read_text(encoding="utf-8")) == {
        "format": "sidestep-shfrs/1", "steps": 10, "epsilon": [0.0, 0.15, 0.25, 0.4, 1.0], "k": [2, 2] + [1] * 8, "rollout": "base",
    }
    for text, complaint in (
        ('{"format":"sidestep-shfrs/2","steps":1,"epsilon":[0],"k":[1]}', r"settings\.format"),
        ('{"format":"sidestep-shfrs/1","steps":2,"epsilon":[0],"k":[1]}', r"settings\.k: expected 2 entries, found 1"),
        ('{"format":"sidestep-shfrs/1","steps":1,"epsilon":[0]}', r"settings\.k: expected one of k, q and tau"),
        ('{"format":"sidestep-shfrs/1","steps":1,"epsilon":[0.2,0.1],"k":[1]}', r"settings\.epsilon\[1\]"),
        ('{"format":"sidestep-shfrs/1","steps":1,"epsilon":[0],"k":[1],"accuracy_m":9}', r"settings\.accuracy_m"),
        ('{"format":"sidestep-shfrs/1","steps":1,"epsilon":[0],"k":[1],"more":9}', "settings"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=complaint):
            sidestep.ShfrsSettings.load(path)


def test_a_value_function_is_loaded_as_it_was_saved(unequal, paper, tmp_path):
    path = tmp_path / "function.value"
    for function in (sidestep.solve(unequal, 1.0, accuracy="draft"), sidestep.solve(paper)):
        function.save(path)
        assert sidestep.ValueFunction.load(path) == function
        exact = path.stat().st_size
        function.save(path, rounded=True)
        rounded = sidestep.ValueFunction.load(path)
        assert path.stat().st_size <= exact and (rounded == function) == function.exact
        states = np.array([[4.0, 1.0, 2.0], [-3.5, 0.5, 0.0]])
        assert np.abs(rounded.value(states) - function.value(states)).max() <= 1e-3
        rounded.save(path)
        assert sidestep.ValueFunction.load(path) == rounded


def test_constants_of_a_file_are_equal():
    assert constant([0.1, 0.8, 0.1]) == STRAIGHT
