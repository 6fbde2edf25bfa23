"""Conversion of predictors from and to scikit-learn, which is imported only when needed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._sidestep import Predictor


def from_sklearn(
    estimator: Any,
    features: Sequence[str],
    *,
    experiment: int = 1,
    actions: Sequence[float] | None = None,
) -> Predictor:
    """A predictor with the same results as a fitted estimator of scikit-learn.

    Parameters
    ----------
    estimator : LogisticRegression, SVC, NuSVC, DecisionTreeClassifier or GradientBoostingClassifier
        Fitted. A logistic regression or support vector machine may come last in a `Pipeline` after a
        `StandardScaler`. A support vector machine has a linear or an RBF kernel, and probabilities: by
        `probability=True`, or for two classes by a `CalibratedClassifierCV` with `method="sigmoid"` and
        `ensemble=False` around it. For other estimators, see `ActionModel`.
    features : list of str
        The names of its columns in order, as in `FEATURES`. If the estimator was fitted on a data frame, they must be
        the columns of that frame.
    experiment : {1, 2}
        Meaning of the classes: 1 the direction of a turn (−1 right, 0 straight, 1 left), 2 whether the human avoids.
    actions : list of float, optional
        The turn rate of each class, rad/s, increasing, if classes are not turns.

    Returns
    -------
    Predictor
        With the probabilities of `predict_proba`, up to rounding, with these exceptions. Support vector machine with
        `probability=True`: libsvm in scikit-learn stops its iteration at a residual of 0.005 divided by the number of
        classes; here the equations are solved exactly. With two classes, where the probabilities are the sigmoid
        itself, the difference is less than 0.005. The probabilities are at least 10⁻⁷ away from 0 and 1, and `predict`
        counts the votes of the pairs, as `SVC.predict` does. `CalibratedClassifierCV.predict` takes the likeliest
        class instead, which differs in about 1 % of rows: where the sigmoid's 0.5 is not at a decision value of 0.
        Decision tree: (m + 1)/(Σ m + K) for leaves with m training rows of each of K classes, which is never 0;
        scikit-learn has m/Σ m. Trees of scikit-learn round features to float32 before comparing them with a
        threshold; this predictor does not.

    Raises
    ------
    TypeError
        If the features are not a list of names, or `experiment` is not an integer.
    ValueError
        If the estimator is not fitted, is of another kind, or does not fit the features.
    """
    features = _names(features)
    _same_names(estimator, features)
    outer, model = _parts(estimator)
    sigmoids = None
    if type(model).__name__ == "CalibratedClassifierCV":
        model, sigmoids = _calibrated(model)
    inner, model = _parts(model)
    for part in (outer, inner, model):
        _same_names(part, features)
    scaler = inner if outer is None else outer
    if inner is not None and outer is not None:
        raise ValueError("estimator: expected one StandardScaler, found two")
    kind = type(model).__name__
    describe = {
        "LogisticRegression": _logistic,
        "SVC": _svm,
        "NuSVC": _svm,
        "DecisionTreeClassifier": _tree,
        "GradientBoostingClassifier": _boosted,
    }.get(kind)
    if describe is None:
        known = "a LogisticRegression, SVC, NuSVC, DecisionTreeClassifier or GradientBoostingClassifier"
        raise ValueError(f"estimator: expected {known}, found {kind}; for others, see ActionModel")
    if sigmoids is not None and describe is not _svm:
        raise ValueError(f"estimator: expected a support vector machine in a CalibratedClassifierCV, found {kind}")
    if not hasattr(model, "classes_") or (scaler is not None and not hasattr(scaler, "scale_")):
        raise ValueError("estimator: expected a fitted one, found one that was not fitted")
    if scaler is not None and describe not in (_logistic, _svm):
        raise ValueError(f"estimator: expected a {kind} on raw features, found one after a StandardScaler")
    if callable(getattr(model, "kernel", None)):
        raise ValueError(f"estimator: expected the kernel linear or rbf, found {model.kernel!r}")
    if model.n_features_in_ != len(features):
        raise ValueError(f"features: expected {model.n_features_in_} names, found {len(features)}")
    fields = _svm(model, scaler, sigmoids) if describe is _svm else describe(model, scaler)
    document: dict[str, Any] = {
        "format": "sidestep-predictor/1",
        "experiment": _experiment(experiment),
        "features": features,
        "classes": [_whole(label) for label in model.classes_],
        **fields,
    }
    if actions is not None:
        document["actions"] = _rates(actions, document["classes"])
    try:
        text = json.dumps(document, allow_nan=False)
    except ValueError as error:
        raise ValueError("estimator: expected finite numbers, found NaN or an infinity") from error
    return Predictor.from_json(text)


def _names(features: Any) -> list[str]:
    """The names of features as a list."""
    # The characters of a string are not names, and a set has no order.
    if isinstance(features, (str, set, frozenset)) or not hasattr(features, "__iter__"):
        raise TypeError(f"features: expected a list of names, found {type(features).__name__}")
    names = list(features)
    for i, name in enumerate(names):
        if not isinstance(name, str):
            raise TypeError(f"features[{i}]: expected a name, found {name!r}")
    return names


def _experiment(number: Any) -> int:
    """The experiment, 1 or 2, from any integer type."""
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)):
        raise TypeError(f"experiment: expected 1 or 2, found {number!r}")
    if number not in (1, 2):
        raise ValueError(f"experiment: expected 1 or 2, found {number!r}")
    return int(number)


def _rates(actions: Any, classes: list[int]) -> list[float] | None:
    """The turn rate of each class, rad/s, validated by the library."""
    even = np.full(len(classes), 1 / len(classes))
    return Predictor.constant(classes, even, actions=actions).actions


def _same_names(part: Any, features: Sequence[str]) -> None:
    """Refuses features other than those of the data frame on which an estimator or a scaler was fitted."""
    known = getattr(part, "feature_names_in_", None)
    if known is not None and list(known) != list(features):
        expected = f"{list(known)}, the columns that the estimator was fitted on"
        raise ValueError(f"features: expected {expected}, found {list(features)}")


def _parts(estimator: Any) -> tuple[Any, Any]:
    """The scaler, if any, and the model."""
    if type(estimator).__name__ != "Pipeline":
        return None, estimator
    steps = [step for _, step in estimator.steps if step not in (None, "passthrough")]
    kinds = [type(step).__name__ for step in steps]
    if len(steps) == 1:
        return None, steps[0]
    if len(steps) == 2 and kinds[0] == "StandardScaler":
        return steps[0], steps[1]
    raise ValueError(f"estimator: expected a pipeline of a StandardScaler and a model, found {kinds}")


def _whole(label: Any) -> int:
    """A class as an integer."""
    if isinstance(label, (str, bytes)) or int(label) != label:
        raise ValueError(f"estimator: expected whole numbers as classes, found {label!r}")
    return int(label)


def _standardised(scaler: Any, width: int) -> dict[str, Any]:
    """The offset and the scale of each feature."""
    # Without `with_mean` the scaler still has a mean, but does not subtract it.
    mean = scaler.mean_ if scaler is not None and scaler.with_mean else np.zeros(width)
    scale = scaler.scale_ if scaler is not None and scaler.with_std else np.ones(width)
    return {"mean": mean.tolist(), "scale": scale.tolist()}


def _calibrated(model: Any) -> tuple[Any, list[list[float]]]:
    """The inner estimator, and the sigmoid of its only pair of classes."""
    if not hasattr(model, "calibrated_classifiers_"):
        raise ValueError("estimator: expected a fitted one, found one that was not fitted")
    if len(model.calibrated_classifiers_) != 1:
        found = f"{len(model.calibrated_classifiers_)} estimators in one"
        raise ValueError(f"estimator: expected a CalibratedClassifierCV with ensemble=False, found {found}")
    if model.method != "sigmoid":
        raise ValueError(f"estimator: expected a CalibratedClassifierCV with method sigmoid, found {model.method}")
    if len(model.classes_) != 2:
        # It calibrates each class against all others, which gives no probability for each pair.
        found = f"{len(model.classes_)} in a CalibratedClassifierCV; SVC(probability=True) may have more"
        raise ValueError(f"estimator: expected two classes, found {found}")
    within = model.calibrated_classifiers_[0]
    (sigmoid,) = within.calibrators
    # Its decision values are positive for the second class, those of a pair for the first.
    return within.estimator, [[float(sigmoid.a_), -float(sigmoid.b_)]]


def _svm(model: Any, scaler: Any, sigmoids: list[list[float]] | None = None) -> dict[str, Any]:
    if model.kernel not in ("linear", "rbf"):
        raise ValueError(f"estimator: expected the kernel linear or rbf, found {model.kernel!r}")
    if sigmoids is None:
        if len(model._probA) == 0:
            raise ValueError("estimator: expected a support vector machine with probabilities, found none")
        sigmoids = np.column_stack([model._probA, model._probB]).tolist()
    vectors = model.support_vectors_
    if not isinstance(vectors, np.ndarray):
        raise ValueError(f"estimator: expected one fitted on an array, found {type(vectors).__name__}")
    # With two classes, scikit-learn reverses the only pair.
    sign = -1.0 if len(model.classes_) == 2 else 1.0
    ends = np.cumsum([0, *model.n_support_])
    pairs = [(a, b) for a in range(len(ends) - 1) for b in range(a + 1, len(ends) - 1)]
    dual = np.zeros((len(pairs), len(vectors)))
    for row, (a, b) in zip(dual, pairs, strict=True):
        # A vector has a coefficient for each other class, in order.
        for own, other in ((a, b - 1), (b, a)):
            part = slice(ends[own], ends[own + 1])
            row[part] = sign * model.dual_coef_[other, part]
    common = {
        "kind": "svm",
        "kernel": model.kernel,
        **_standardised(scaler, vectors.shape[1]),
        "intercepts": (sign * model.intercept_).tolist(),
        "sigmoids": sigmoids,
    }
    if model.kernel == "linear":
        return {**common, "coefficients": (dual @ vectors).tolist()}
    return {
        **common,
        "gamma": float(model._gamma),
        "support_vectors": vectors.tolist(),
        "dual_coefficients": dual.tolist(),
    }


def _logistic(model: Any, scaler: Any) -> dict[str, Any]:
    coefficients, intercepts = model.coef_, np.atleast_1d(model.intercept_)
    if hasattr(coefficients, "toarray"):
        # After `sparsify`.
        coefficients = coefficients.toarray()
    if len(intercepts) == 1 and len(model.classes_) == 2:
        # scikit-learn then has one row, the log-odds of the second class.
        coefficients = np.vstack([np.zeros_like(coefficients), coefficients])
        intercepts = np.append(0.0, intercepts)
    return {
        "kind": "logistic",
        **_standardised(scaler, coefficients.shape[1]),
        "coefficients": coefficients.tolist(),
        "intercepts": intercepts.tolist(),
    }


def _questions(tree: Any) -> dict[str, list[Any]]:
    """The inner nodes of a tree; a leaf has zeros."""
    leaf = tree.children_left < 0
    return {
        "feature": np.where(leaf, 0, tree.feature).tolist(),
        "threshold": np.where(leaf, 0.0, tree.threshold).tolist(),
        "left": np.where(leaf, 0, tree.children_left).tolist(),
        "right": np.where(leaf, 0, tree.children_right).tolist(),
    }


def _tree(model: Any, _scaler: Any) -> dict[str, Any]:
    tree = model.tree_
    if model.n_outputs_ != 1:
        raise ValueError(f"estimator: expected a tree with one output, found one with {model.n_outputs_}")
    counts = tree.value[:, 0, :] * tree.weighted_n_node_samples[:, None]
    whole = np.rint(counts)
    # Integer weights also give integer counts, but their sum is not the number of rows.
    weighted = model.class_weight is not None or np.any(tree.n_node_samples != tree.weighted_n_node_samples)
    if weighted or np.abs(counts - whole).max() > 1e-6:
        raise ValueError("estimator: expected a tree fitted without weights or constraints, found other shares in its leaves")
    return {"kind": "tree", "tree": {**_questions(tree), "counts": whole.astype(int).tolist()}}


def _boosted(model: Any, _scaler: Any) -> dict[str, Any]:
    if model.loss != "log_loss":
        raise ValueError(f"estimator: expected the loss log_loss, found {model.loss}")
    # The initial scores do not depend on the features, unless `init` is an estimator.
    if model.init_ != "zero" and type(model.init_).__name__ != "DummyClassifier":
        raise ValueError(f"estimator: expected no init, found {model.init_!r}")
    intercepts = np.asarray(model._raw_predict_init(np.zeros((1, model.n_features_in_), dtype=np.float32)))[0]

    def summand(tree: Any) -> dict[str, list[Any]]:
        value = np.where(tree.children_left < 0, model.learning_rate * tree.value[:, 0, 0], 0.0)
        return {**_questions(tree), "value": value.tolist()}

    trees = [summand(each.tree_) for stage in model.estimators_ for each in stage]
    return {"kind": "boosted", "boosted": {"intercepts": intercepts.tolist(), "trees": trees}}


class SidestepClassifier:
    """A predictor as a fitted classifier, for scikit-learn's metrics and curves.

    Parameters
    ----------
    predictor : Predictor

    Attributes
    ----------
    classes_ : array of int64, shape (K,)
    n_features_in_ : int
    feature_names_in_ : array of str, shape (n,)
    """

    _estimator_type = "classifier"

    def __init__(self, predictor: Predictor) -> None:
        if not isinstance(predictor, Predictor):
            raise TypeError(f"predictor: expected a Predictor, found {type(predictor).__name__}")
        self.predictor = predictor
        self.classes_: NDArray[np.int64] = np.array(predictor.classes, dtype=np.int64)
        self.n_features_in_ = len(predictor.features)
        self.feature_names_in_ = np.array(predictor.features, dtype=object)

    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> SidestepClassifier:
        """Does nothing: the predictor is already fitted."""
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """The class of each row, shape (n,), of raw features, shape (n, features)."""
        return self.predictor.predict(X)

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """The probability of each class, shape (n, K)."""
        return self.predictor.proba(X)

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """The share of rows whose class is predicted right."""
        return float(np.mean(self.predict(X) == np.asarray(y)))

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Its parameter, as scikit-learn copies estimators."""
        return {"predictor": self.predictor}

    def set_params(self, **parameters: Any) -> SidestepClassifier:
        """Replaces its parameter."""
        self.__init__(**{**self.get_params(), **parameters})  # type: ignore[misc]
        return self

    def __sklearn_is_fitted__(self) -> bool:
        return True

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags

        return Tags(
            estimator_type="classifier",
            target_tags=TargetTags(required=True),
            classifier_tags=ClassifierTags(),
            input_tags=InputTags(),
        )
