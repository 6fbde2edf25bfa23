"""Fits the cells in which `sidestep analyze` and the reference differ again with scikit-learn.

Prints `shared/tests/data/sklearn_again.csv`. Each such cell has two lines: the hyper-parameters that the
reference chose, and those that Sidestep chose. Each line gives the numbers of rows predicted correctly,
among the 2,000 training rows (each while its fold is held out) and among the 500 test rows (after a
refit): first by scikit-learn as the reference called it, then by converged solvers (logistic regression:
newton-cholesky, tol 1e-12; SVMs: tol 1e-6). For trees, which have no such solver, it gives the fewest
and the most over 50 random states, which choose among equally good splits.

    sidestep analyze --trials trials.csv --features features.csv --out DIR    (in shared/tests/data)
    learning_again.py --data shared/tests/data --cells DIR/cells.csv > sklearn_again.csv
"""

import argparse
import csv
import json
import pathlib
import sys
import warnings

import numpy
from learning import BASE, LETTERS, MODELS
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

TO_THE_END = {
    "lr": [{"solver": "newton-cholesky", "tol": 1e-12}],
    "svm_rbf": [{"tol": 1e-6}],
    "svm_linear": [{"tol": 1e-6}],
    "dt": [{"random_state": state} for state in range(50)],
}


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def key(row):
    return tuple(row[column] for column in ["model", "experiment", "features", "participant"])


def right(estimator, x, y, learned, asked):
    model = make_pipeline(StandardScaler(), clone(estimator)).fit(x[learned], y[learned])
    return int((model.predict(x[asked]) == y[asked]).sum())


def counts(estimator, x, y, trial):
    training, test = trial < 40, trial >= 40
    held_out = [training & (trial % 5 == fold) for fold in range(5)]
    cv = sum(right(estimator, x, y, training & ~held, held) for held in held_out)
    return cv, right(estimator, x, y, training, test)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", required=True, type=pathlib.Path, help="shared/tests/data")
    parser.add_argument("--cells", required=True, help="cells.csv of sidestep analyze")
    options = parser.parse_args()
    warnings.filterwarnings("ignore")
    features = read(options.data / "features.csv")
    ours = {key(row): row for row in read(options.cells)}
    out = csv.writer(sys.stdout, lineterminator="\n")
    head = "model,experiment,features,participant,chosen_by,hyperparameters,cv_right,test_right"
    out.writerow([*head.split(","), "cv_least", "cv_most", "test_least", "test_most"])
    for theirs in read(options.data / "sklearn_cells.csv"):
        if abs(float(theirs["test_accuracy"]) - float(ours[key(theirs)]["test_accuracy"])) < 1e-9:
            continue
        model, experiment, name, participant = key(theirs)
        rows = [row for row in features if row["participant"] == participant]
        trial = numpy.array([int(row["trial"]) for row in rows])
        columns = BASE + [LETTERS[letter] for letter in name]
        x = numpy.array([[float(row[column]) for column in columns] for row in rows])
        y = numpy.array([int(row["y" + experiment]) for row in rows])
        for who, row in [("reference", theirs), ("sidestep", ours[key(theirs)])]:
            setting = json.loads(row["hyperparameters"])
            estimator = clone(MODELS[model][0]).set_params(**setting)
            first = counts(estimator, x, y, trial)
            again = [
                counts(clone(estimator).set_params(**end), x, y, trial) for end in TO_THE_END[model]
            ]
            cv, tested = zip(*again)
            out.writerow(
                [*key(theirs), who, json.dumps(setting), *first]
                + [min(cv), max(cv), min(tested), max(tested)]
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
