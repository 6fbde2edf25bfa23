"""Predictors from scikit-learn, and to it. Nothing of scikit-learn is imported before it is needed."""

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
    """A predictor that gives what a fitted estimator of scikit-learn gives.

    Parameters
    ----------
    estimator : LogisticRegression, DecisionTreeClassifier or GradientBoostingClassifier
        Fitted. A logistic regression may come last in a `Pipeline` after a `StandardScaler`. For other estimators,
        see `ActionModel`.
    features : list of str
        The names of its columns, as in `FEATURES`.
    experiment : {1, 2}
        What the classes mean: 1 the direction of a turn (−1 right, 0 straight, 1 left), 2 whether the human avoids.
    actions : list of float, optional
        The turn rate of each class, rad/s, rising, if classes are not turns.

    Returns
    -------
    Predictor
        With the probabilities of `predict_proba`, but for rounding. Those of a decision tree are (m + 1)/(Σ m + K)
        for leaves with m training rows of each of K classes, which is never 0; scikit-learn has m/Σ m. Trees of
        scikit-learn round features to float32 before they compare them with a threshold, which this does not.

    Raises
    ------
    ValueError
        If the estimator is not fitted, is of another kind, or does not fit the features.
    """
    scaler, model = _parts(estimator)
    kind = type(model).__name__
    describe = {
        "LogisticRegression": _logistic,
        "DecisionTreeClassifier": _tree,
        "GradientBoostingClassifier": _boosted,
    }.get(kind)
    if describe is None:
        known = "a LogisticRegression, DecisionTreeClassifier or GradientBoostingClassifier"
        raise ValueError(f"estimator: expected {known}, found {kind}")
    if not hasattr(model, "classes_"):
        raise ValueError("estimator: expected a fitted one, found one that was not fitted")
    if scaler is not None and describe is not _logistic:
        raise ValueError(f"estimator: expected a {kind} on features as they are, found one after a StandardScaler")
    if model.n_features_in_ != len(features):
        raise ValueError(f"features: expected {model.n_features_in_} names, found {len(features)}")
    document: dict[str, Any] = {
        "format": "sidestep-predictor/1",
        "experiment": experiment,
        "features": list(features),
        "classes": [_whole(label) for label in model.classes_],
        **describe(model, scaler),
    }
    if actions is not None:
        document["actions"] = [float(rate) for rate in actions]
    return Predictor.from_json(json.dumps(document))


def _parts(estimator: Any) -> tuple[Any, Any]:
    """The scaler, if there is one, and the model."""
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
    """A class as a whole number."""
    if isinstance(label, (str, bytes)) or int(label) != label:
        raise ValueError(f"estimator: expected whole numbers as classes, found {label!r}")
    return int(label)


def _logistic(model: Any, scaler: Any) -> dict[str, Any]:
    coefficients, intercepts = model.coef_, np.atleast_1d(model.intercept_)
    if len(intercepts) == 1 and len(model.classes_) == 2:
        # scikit-learn has one row then, the log-odds of the second class.
        coefficients = np.vstack([np.zeros_like(coefficients), coefficients])
        intercepts = np.append(0.0, intercepts)
    width = coefficients.shape[1]
    mean = getattr(scaler, "mean_", None)
    scale = getattr(scaler, "scale_", None)
    return {
        "kind": "logistic",
        "mean": (np.zeros(width) if mean is None else mean).tolist(),
        "scale": (np.ones(width) if scale is None else scale).tolist(),
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
    counts = tree.value[:, 0, :] * tree.weighted_n_node_samples[:, None]
    whole = np.rint(counts)
    if np.abs(counts - whole).max() > 1e-6:
        raise ValueError("estimator: expected a tree fitted without weights, found one with weights")
    return {"kind": "tree", "tree": {**_questions(tree), "counts": whole.astype(int).tolist()}}


def _boosted(model: Any, _scaler: Any) -> dict[str, Any]:
    if model.loss != "log_loss":
        raise ValueError(f"estimator: expected the loss log_loss, found {model.loss}")
    # The scores before any tree do not depend on the features, unless an estimator was given for them.
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
        self.predictor = predictor
        self.classes_: NDArray[np.int64] = np.array(predictor.classes, dtype=np.int64)
        self.n_features_in_ = len(predictor.features)
        self.feature_names_in_ = np.array(predictor.features, dtype=object)

    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> SidestepClassifier:
        """Nothing: it is fitted."""
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """The class of each row, shape (n,), of features as they are, shape (n, features)."""
        return self.predictor.predict(X)

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """The probability of each class, shape (n, K)."""
        return self.predictor.proba(X)

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """The share of rows whose class is right."""
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
