"""Predictors and features, against scikit-learn and NumPy."""

import json
import pickle
import time

import numpy as np
import pandas
import pytest
from conftest import constant
from sklearn.base import clone, is_classifier
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import GradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC, NuSVC
from sklearn.tree import DecisionTreeClassifier

import sidestep

NAMES = ["abs_dx", "abs_dy", "dpsi", "v_h", "distance", "turned_1"]


@pytest.fixture(scope="module")
def rows(people):
    """Features and turns of all trials."""
    x = np.vstack([sidestep.features(trial.states[:-1], NAMES) for trials in people for trial in trials])
    y = np.concatenate([np.sign(trial.turn_rates) for trials in people for trial in trials]).astype(int)
    # Trees of scikit-learn compare float32.
    return x.astype(np.float32).astype(float), y


@pytest.mark.parametrize("scaled", [True, False])
def test_names_are_those_of_the_data_frame(rows, scaled):
    x, y = rows
    frame = pandas.DataFrame(x, columns=NAMES)
    model = LogisticRegression(max_iter=2000)
    model = make_pipeline(StandardScaler(), model) if scaled else model
    model.fit(frame, y)
    np.testing.assert_allclose(sidestep.from_sklearn(model, NAMES).proba(x), model.predict_proba(frame), atol=1e-12)
    for wrong in (NAMES[::-1], [*NAMES[:-1], "turned_2"]):
        with pytest.raises(ValueError, match=r"features: expected \['abs_dx', .*columns.* fitted on, found \['"):
            sidestep.from_sklearn(model, wrong)


def test_features_of_a_long_drive_take_no_longer_each(people):
    states = np.tile(people[0][0].states, (1000, 1, 1))
    names = ["turned", "turned_5", "distance"]
    begin = time.process_time()
    found = sidestep.features(states, names)
    # Recomputing every row from the start takes a thousand times as long.
    assert time.process_time() - begin < 1
    for n in (1, 2, 40, 2000):
        np.testing.assert_array_equal(found[n - 1], sidestep.features(states[:n], names)[-1])
    turned = np.diff(states[:, 0, 2])
    np.testing.assert_allclose(found[1:, 0], np.cumsum((turned + np.pi) % (2 * np.pi) - np.pi), atol=1e-6)


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("scaled", [True, False])
def test_a_logistic_regression(rows, classes, scaled):
    x, y = rows
    y = np.abs(y) if classes == 2 else y
    model = LogisticRegression(max_iter=2000)
    model = make_pipeline(StandardScaler(), model) if scaled else model
    model.fit(x, y)
    predictor = sidestep.from_sklearn(model, NAMES, experiment=2 if classes == 2 else 1)
    np.testing.assert_allclose(predictor.proba(x), model.predict_proba(x), atol=1e-12)
    np.testing.assert_array_equal(predictor.predict(x), model.predict(x))


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("with_mean", [True, False])
@pytest.mark.parametrize("with_std", [True, False])
def test_a_scaler_does_what_it_was_told(rows, classes, with_mean, with_std):
    x, y = rows
    y = np.abs(y) if classes == 2 else y
    scaler = StandardScaler(with_mean=with_mean, with_std=with_std)
    model = make_pipeline(scaler, LogisticRegression(max_iter=2000)).fit(x, y)
    predictor = sidestep.from_sklearn(model, NAMES, experiment=2 if classes == 2 else 1)
    np.testing.assert_allclose(predictor.proba(x), model.predict_proba(x), rtol=0, atol=1e-12)
    if classes == 2:
        x, y = x[::4], y[::4]
        inner = make_pipeline(clone(scaler), SVC())
        for machine in (
            CalibratedClassifierCV(inner, ensemble=False),
            make_pipeline(clone(scaler), CalibratedClassifierCV(SVC(), ensemble=False)),
        ):
            found = sidestep.from_sklearn(machine.fit(x, y), NAMES, experiment=2).proba(x)
            np.testing.assert_allclose(found, machine.predict_proba(x), rtol=0, atol=1e-9)


def test_a_sparse_logistic_regression(rows):
    x, y = rows
    for labels in (y, np.abs(y)):
        model = make_pipeline(StandardScaler(), LogisticRegression(l1_ratio=1, solver="saga", C=0.1, max_iter=2000))
        dense = sidestep.from_sklearn(model.fit(x, labels), NAMES)
        model[-1].sparsify()
        assert sidestep.from_sklearn(model, NAMES) == dense


def test_a_decision_tree(rows):
    x, y = rows
    model = DecisionTreeClassifier(max_depth=6, random_state=0).fit(x, y)
    predictor = sidestep.from_sklearn(model, NAMES)
    leaf = model.apply(x)
    counts = np.rint(model.tree_.value[leaf, 0] * model.tree_.weighted_n_node_samples[leaf, None])
    np.testing.assert_allclose(predictor.proba(x), (counts + 1) / (counts.sum(1, keepdims=True) + 3), atol=1e-12)
    np.testing.assert_array_equal(predictor.predict(x), model.predict(x))
    # A weight of 0 excludes a row.
    chosen = np.arange(len(y)) % 2
    without = DecisionTreeClassifier(max_depth=6, random_state=0).fit(x, y, sample_weight=chosen)
    kept = DecisionTreeClassifier(max_depth=6, random_state=0).fit(x[chosen == 1], y[chosen == 1])
    found = sidestep.from_sklearn(without, NAMES).proba(x)
    np.testing.assert_array_equal(found, sidestep.from_sklearn(kept, NAMES).proba(x))


def test_a_decision_tree_with_weights_is_refused(rows):
    x, y = rows
    twice = np.where(y == 0, 2.0, 1.0)
    for model in (
        DecisionTreeClassifier(max_depth=3).fit(x, y, sample_weight=np.full(len(y), 2)),
        DecisionTreeClassifier(max_depth=3).fit(x, y, sample_weight=twice),
        DecisionTreeClassifier(max_depth=3).fit(x, y, sample_weight=0.3 * twice),
        DecisionTreeClassifier(max_depth=3, class_weight={-1: 1, 0: 2, 1: 1}).fit(x, y),
        # The weights of the only node are integers and sum to the number of its rows.
        DecisionTreeClassifier(min_samples_leaf=200, class_weight="balanced").fit(x[:300], np.arange(300) // 120 - 1),
    ):
        with pytest.raises(ValueError, match="estimator: expected a tree fitted without weights or constraints, found"):
            sidestep.from_sklearn(model, NAMES)


def test_boosted_trees_with_weights(rows):
    x, y = rows
    model = GradientBoostingClassifier(n_estimators=5, random_state=0)
    model.fit(x, y, sample_weight=np.where(y == 0, 2.0, 1.0))
    found = sidestep.from_sklearn(model, NAMES).proba(x)
    np.testing.assert_allclose(found, model.predict_proba(x), rtol=0, atol=1e-12)


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("init", [None, "zero"])
def test_boosted_trees(rows, classes, init):
    x, y = rows
    y = np.abs(y) if classes == 2 else y
    model = GradientBoostingClassifier(n_estimators=20, init=init, random_state=0).fit(x, y)
    predictor = sidestep.from_sklearn(model, NAMES, experiment=2 if classes == 2 else 1)
    np.testing.assert_allclose(predictor.proba(x), model.predict_proba(x), atol=1e-12)


def coupled(pairwise, classes):
    """libsvm's `multiclass_probability` for one row: pairwise coupling by iteration, and the same solved exactly.

    The iteration ends when the equations miss by 0.005/K (Wu, Lin, Weng 2004, algorithm 2).
    """
    r = np.zeros((classes, classes))
    r[np.triu_indices(classes, 1)] = np.clip(pairwise, 1e-7, 1 - 1e-7)
    r += np.tril(1 - r.T, -1)
    q = -r.T * r
    np.fill_diagonal(q, (r**2).sum(0) - np.diag(r) ** 2)
    p = np.full(classes, 1 / classes)
    for _ in range(100):
        qp = q @ p
        pqp = p @ qp
        if np.abs(qp - pqp).max() < 0.005 / classes:
            break
        for t in range(classes):
            change = (pqp - qp[t]) / q[t, t]
            p[t] += change
            pqp = (pqp + change * (change * q[t, t] + 2 * qp[t])) / (1 + change) ** 2
            qp = (qp + change * q[t]) / (1 + change)
            p /= 1 + change
    system = np.block([[q, -np.ones((classes, 1))], [np.ones((1, classes)), np.zeros((1, 1))]])
    return p, np.linalg.solve(system, np.append(np.zeros(classes), 1))[:-1]


@pytest.mark.filterwarnings("ignore:.*prob.*deprecated:FutureWarning")
@pytest.mark.parametrize("kernel", ["linear", "rbf"])
@pytest.mark.parametrize("kind", [SVC, NuSVC])
@pytest.mark.parametrize("classes", [2, 3])
def test_a_support_vector_machine(rows, kind, kernel, classes):
    """From scikit-learn's decision values and sigmoids: our probabilities are the exact solution to 1e-9, and those of
    scikit-learn are the result of libsvm's iteration, also to 1e-9."""
    x, y = (of[::4] for of in rows)
    y = np.abs(y) if classes == 2 else y
    share = {"nu": 0.2} if kind is NuSVC else {"C": 3.0}
    model = kind(kernel=kernel, probability=True, random_state=0, decision_function_shape="ovo", **share)
    model = make_pipeline(StandardScaler(), model).fit(x, y)
    predictor = sidestep.from_sklearn(model, NAMES, experiment=2 if classes == 2 else 1)
    x = rows[0][1::4]
    # With two classes the only pair is reversed.
    decisions = model.decision_function(x) if classes == 3 else -model.decision_function(x)[:, None]
    pairwise = 1 / (1 + np.exp(decisions * model[-1].probA_ + model[-1].probB_))
    iterated, solved = (np.array(of) for of in zip(*(coupled(row, classes) for row in pairwise), strict=True))
    np.testing.assert_allclose(predictor.proba(x), solved, rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.predict_proba(x), iterated, rtol=0, atol=1e-9)
    assert np.abs(iterated - solved).max() < (0.005 if classes == 2 else 0.02)
    np.testing.assert_array_equal(predictor.predict(x), model.predict(x))


@pytest.mark.parametrize("kernel", ["linear", "rbf"])
def test_a_calibrated_support_vector_machine(rows, kernel):
    x, y = rows[0][::4], np.abs(rows[1][::4])
    machine = make_pipeline(StandardScaler(), SVC(kernel=kernel))
    model = CalibratedClassifierCV(machine, ensemble=False).fit(x, y)
    predictor = sidestep.from_sklearn(model, NAMES, experiment=2)
    np.testing.assert_allclose(predictor.proba(x), model.predict_proba(x), rtol=0, atol=1e-9)
    outside = make_pipeline(StandardScaler(), CalibratedClassifierCV(SVC(kernel=kernel), ensemble=False)).fit(x, y)
    found = sidestep.from_sklearn(outside, NAMES, experiment=2).proba(x)
    np.testing.assert_allclose(found, outside.predict_proba(x), rtol=0, atol=1e-9)
    # Votes, as in the inner machine; near the boundary the likeliest class differs.
    within = model.calibrated_classifiers_[0].estimator
    np.testing.assert_array_equal(predictor.predict(x), within.predict(x))
    assert np.mean(predictor.predict(x) != model.predict(x)) < 0.02


@pytest.mark.filterwarnings("ignore:.*prob.*deprecated:FutureWarning")
def test_support_vector_machines_that_are_refused(rows):
    x, y = rows[0][::8], rows[1][::8]
    calibrated = CalibratedClassifierCV(SVC(), ensemble=False).fit(x, y)
    several = CalibratedClassifierCV(SVC(), cv=2).fit(x, np.abs(y))
    steps = CalibratedClassifierCV(SVC(), method="isotonic", ensemble=False).fit(x, np.abs(y))
    other = CalibratedClassifierCV(LogisticRegression(max_iter=2000), ensemble=False).fit(x, np.abs(y))
    inner = make_pipeline(StandardScaler(), SVC())
    twice = make_pipeline(StandardScaler(), CalibratedClassifierCV(inner, ensemble=False))
    for estimator, complaint in (
        (SVC().fit(x, y), "with probabilities, found none"),
        (SVC(kernel="poly", probability=True).fit(x, y), "kernel linear or rbf, found 'poly'"),
        (SVC(probability=True), "expected a fitted one"),
        (CalibratedClassifierCV(SVC()), "expected a fitted one"),
        (SVC(kernel=lambda a, b: a @ b.T).fit(x, y), "expected the kernel linear or rbf, found <function"),
        (calibrated, "expected two classes, found 3"),
        (several, "ensemble=False, found 2 estimators"),
        (steps, "method sigmoid, found isotonic"),
        (other, "expected a support vector machine in a CalibratedClassifierCV, found LogisticRegression"),
        (twice.fit(x, np.abs(y)), "expected one StandardScaler, found two"),
    ):
        with pytest.raises(ValueError, match=complaint):
            sidestep.from_sklearn(estimator, NAMES, experiment=2)


def test_a_predictor_survives_file_pickle_and_scikit_learn(rows, tmp_path):
    x, y = rows
    predictor = sidestep.from_sklearn(LogisticRegression(max_iter=2000).fit(x, y), NAMES, actions=[-0.4, 0.1, 0.5])
    predictor.save(tmp_path / "predictor.json")
    loaded = sidestep.Predictor.load(tmp_path / "predictor.json")
    assert loaded == predictor == pickle.loads(pickle.dumps(predictor))
    assert (loaded.features, loaded.classes, loaded.actions) == (NAMES, [-1, 0, 1], [-0.4, 0.1, 0.5])
    assert loaded.experiment == 1

    classifier = sidestep.SidestepClassifier(loaded)
    assert is_classifier(classifier) and clone(classifier).predictor == loaded
    assert classifier.score(x, y) == (loaded.predict(x) == y).mean() > 0.5
    assert log_loss(y, classifier.predict_proba(x), labels=classifier.classes_) < 1.1


def test_what_is_no_predictor_is_refused(rows, tmp_path):
    x, y = rows
    path = tmp_path / "predictor.json"
    document = json.loads(constant([0.2, 0.5, 0.3]).to_json())
    for change, complaint in (
        ({"format": "sidestep-predictor/2"}, "format: expected sidestep-predictor/1, found .*sidestep-predictor/2"),
        ({"features": ["speed"]}, r"features\[0\]: expected one of abs_dx, .*found speed"),
        ({"kind": "oracle"}, "kind: expected .*found .*oracle"),
        ({"probabilities": [0.5, 0.5]}, "probabilities: expected 3 entries, found 2 entries"),
    ):
        path.write_text(json.dumps({**document, **change}))
        with pytest.raises(ValueError, match=f"predictor.*{complaint}"):
            sidestep.Predictor.load(path)
    for text in ("", "{", "[" * 100_000, "null", '{"a": 1}'):
        path.write_text(text)
        with pytest.raises(ValueError, match="predictor"):
            sidestep.Predictor.load(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="UTF-8"):
        sidestep.Predictor.load(path)

    x = StandardScaler().fit_transform(x)
    logistic, words = (LogisticRegression().fit(x, labels) for labels in (y, y.astype(str)))
    forest = RandomForestClassifier(n_estimators=2).fit(x, y)
    of_nan = LogisticRegression().fit(x, y)
    of_nan.coef_[1, 2] = np.nan
    for estimator, names, complaint in (
        (forest, NAMES, "estimator: expected .*found RandomForestClassifier; for others, see ActionModel"),
        (LogisticRegression(), NAMES, "estimator: expected a fitted one"),
        (make_pipeline(StandardScaler(), logistic), NAMES, "estimator: expected a fitted one"),
        (DecisionTreeClassifier().fit(x, np.c_[y, y]), NAMES, "expected a tree with one output, found one with 2"),
        (of_nan, NAMES, "estimator: expected finite numbers, found NaN or an infinity"),
        (logistic, NAMES[:3], "features: expected 6 names, found 3"),
        (logistic, [*NAMES[:5], "speed"], r"features\[5\]"),
        (make_pipeline(StandardScaler(), DecisionTreeClassifier()).fit(x, y), NAMES, "after a StandardScaler"),
        (words, NAMES, "whole numbers as classes"),
        (object(), NAMES, "found object"),
    ):
        with pytest.raises(ValueError, match=complaint):
            sidestep.from_sklearn(estimator, names)


def test_arguments_of_from_sklearn_are_refused_by_name(rows):
    x, y = rows
    model = make_pipeline(StandardScaler(), LogisticRegression()).fit(x, y)
    for arguments, refusal, complaint in (
        ({"actions": [0, 1, 10**400]}, ValueError, "actions: expected an array of float64"),
        ({"actions": [np.nan, 0, 1]}, ValueError, r"actions\[0\]: expected a finite number, found NaN"),
        ({"actions": "abc"}, ValueError, "actions: expected an array of float64"),
        ({"actions": 3}, ValueError, r"actions: expected an array of shape \(n,\)"),
        ({"actions": [0, 1]}, ValueError, "actions: expected 3 entries, found 2"),
        ({"actions": [1, 0, 2]}, ValueError, "actions: expected turn rates in rising order"),
        ({"experiment": 3}, ValueError, "experiment: expected 1 or 2, found 3"),
        ({"experiment": "1"}, TypeError, "experiment: expected 1 or 2, found '1'"),
        ({"experiment": True}, TypeError, "experiment: expected 1 or 2, found True"),
        ({"features": None}, TypeError, "features: expected a list of names, found NoneType"),
        ({"features": "abs_dx"}, TypeError, "features: expected a list of names, found str"),
        ({"features": set(NAMES)}, TypeError, "features: expected a list of names, found set"),
        ({"features": [*NAMES[:5], 3]}, TypeError, r"features\[5\]: expected a name, found 3"),
    ):
        with pytest.raises(refusal, match=f"^{complaint}"):
            sidestep.from_sklearn(model, **{"features": NAMES, **arguments})
    plain = sidestep.from_sklearn(model, NAMES, experiment=1, actions=[-1.0, 0.0, 1.0])
    names, rates = pandas.Index(NAMES), np.array([-1, 0, 1])
    assert sidestep.from_sklearn(model, names, experiment=np.int64(1), actions=rates) == plain


def test_features_are_what_their_meanings_say(people):
    states = people[1][2].states
    human, robot = states[:, 0], states[:, 1]
    names = [name for name, _, _ in sidestep.FEATURES]
    found = dict(zip(names, sidestep.features(states, names).T, strict=True))
    np.testing.assert_allclose(found["abs_dx"], np.abs(human[:, 0] - robot[:, 0]))
    np.testing.assert_allclose(found["distance"], np.hypot(*(human - robot).T[:2]))
    car = sidestep.VehicleModel(2.0, 0.5)
    game = sidestep.PursuitGame(car, car, 3.0)
    np.testing.assert_allclose(found["v_h"], sidestep.value(sidestep.relative_state(human, robot), game), atol=1e-12)
    np.testing.assert_allclose(found["v_r"], sidestep.value(sidestep.relative_state(robot, human), game), atol=1e-12)
    np.testing.assert_allclose(found["robot_ahead"], sidestep.relative_state(human, robot)[:, 0], atol=1e-12)
    turned = np.angle(np.exp(1j * np.diff(human[:, 2])))
    np.testing.assert_allclose(found["turned_1"], np.append(0, turned), atol=1e-12)


def test_unequal_vehicles_need_their_safety_levels(people, unequal_scene):
    states = people[0][0].states
    parameters, safety = unequal_scene
    assert sidestep.features(states, ["distance"], parameters=parameters).shape == (51, 1)
    with pytest.raises(ValueError, match=r"safety: expected SafetyLevels\(parameters\), since the feature v_h"):
        sidestep.features(states, ["v_h"], parameters=parameters)
    other = sidestep.SafetyLevels(sidestep.SceneParameters())
    with pytest.raises(ValueError, match="safety: expected the safety levels of `parameters`"):
        sidestep.features(states, ["v_h"], parameters=parameters, safety=other)
    found = sidestep.features(states, ["v_h"], parameters=parameters, safety=safety)[:, 0]
    np.testing.assert_array_equal(found, safety.human.value(sidestep.relative_state(states[:, 0], states[:, 1])))
