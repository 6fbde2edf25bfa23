"""The paper's comparison of one participant by scikit-learn, timed.

Prints one line of JSON: wall_s, fits (cross-validation), the accuracy of each cell and versions.
The protocol is the project's: folds by trajectory, standardisation inside each fold, the same
grids, refit on all training tasks.
"""

import argparse
import csv
import json
import time
import warnings

import numpy
import sklearn
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, PredefinedSplit
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC
from sklearn.tree import DecisionTreeClassifier

BASE = ["apx", "apy", "dpsi", "cosd", "sind"]
LETTERS = {"h": "vh", "r": "vr", "d": "d"}
SETS = ["hrd", "hr", "hd", "rd", "h", "r", "d"]
MODELS = {
    "svm_rbf": (
        SVC(cache_size=500),
        {"svc__C": [0.1, 1, 10, 100], "svc__gamma": [0.01, 0.03, 0.1, 0.3]},
    ),
    "svm_linear": (SVC(kernel="linear", cache_size=500), {"svc__C": [0.01, 0.1, 1, 10]}),
    "dt": (
        DecisionTreeClassifier(random_state=0),
        {
            "decisiontreeclassifier__max_depth": [2, 3, 4, 6, 8, None],
            "decisiontreeclassifier__min_samples_leaf": [1, 5, 10, 20],
        },
    ),
    "lr": (
        LogisticRegression(max_iter=5000),
        {"logisticregression__C": [1e-3, 1e-2, 1e-1, 1, 10, 100]},
    ),
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--features", required=True, help="features.csv with the reference's header")
    parser.add_argument("--participant", required=True)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    with open(options.features, newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["participant"] == options.participant]
    trial = numpy.array([int(row["trial"]) for row in rows])
    training, test = trial < 40, trial >= 40
    folds = PredefinedSplit(trial[training] % 5)
    warnings.filterwarnings("ignore")

    start = time.perf_counter()
    fits, cells = 0, {}
    for name in SETS:
        columns = BASE + [LETTERS[letter] for letter in name]
        x = numpy.array([[float(row[column]) for column in columns] for row in rows])
        for experiment, label in [(1, "y1"), (2, "y2")]:
            y = numpy.array([int(row[label]) for row in rows])
            for model, (estimator, grid) in MODELS.items():
                pipeline = make_pipeline(StandardScaler(), estimator)
                search = GridSearchCV(pipeline, grid, cv=folds, n_jobs=options.processes)
                search.fit(x[training], y[training])
                fits += 5 * len(search.cv_results_["params"])
                right = (search.predict(x[test]) == y[test]).mean()
                cells[f"{model} {experiment} {name}"] = float(right)
    wall = time.perf_counter() - start
    versions = {"scikit_learn": sklearn.__version__, "numpy": numpy.__version__}
    print(json.dumps({"wall_s": wall, "fits": fits, "cells": cells, "versions": versions}))


if __name__ == "__main__":
    main()
