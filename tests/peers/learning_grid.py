"""Every setting of the comparison's grids by scikit-learn: `shared/tests/data/sklearn_grid.csv`.

A line for each model, experiment, feature set, participant and setting, in the order of the
grids: of the 2,000 training rows, how many are predicted right where their fold is held out; of
the 500 test rows, how many after a refit. Trees are grown with several random states, which
decide between splits that are equally good: cv_right is that of state 0, the reference's, and
the last four columns are the fewest and the most over all states.
"""

import argparse
import csv
import json
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy
from learning import BASE, LETTERS, MODELS, SETS
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

TREE_STATES = 5


def right(estimator, x, y, learned, asked):
    model = make_pipeline(StandardScaler(), clone(estimator)).fit(x[learned], y[learned])
    return int((model.predict(x[asked]) == y[asked]).sum())


def lines(task):
    name, participant, rows = task
    warnings.filterwarnings("ignore")
    trial = numpy.array([int(row["trial"]) for row in rows])
    training, test = trial < 40, trial >= 40
    columns = BASE + [LETTERS[letter] for letter in name]
    x = numpy.array([[float(row[column]) for column in columns] for row in rows])
    found = []
    for experiment, label in [(1, "y1"), (2, "y2")]:
        y = numpy.array([int(row[label]) for row in rows])
        for model, (estimator, grid) in MODELS.items():
            names = [key.split("__")[1] for key in grid]
            for values in product(*grid.values()):
                setting = dict(zip(names, values))
                results = []
                for state in range(TREE_STATES if model == "dt" else 1):
                    estimator.set_params(**setting)
                    if model == "dt":
                        estimator.set_params(random_state=state)
                    folds = [(training & (trial % 5 != k), training & (trial % 5 == k)) for k in range(5)]
                    cv = sum(right(estimator, x, y, *fold) for fold in folds)
                    results.append((cv, right(estimator, x, y, training, test)))
                cv, tested = zip(*results)
                spread = [min(cv), max(cv), min(tested), max(tested)] if model == "dt" else [""] * 4
                found.append(
                    [model, experiment, name, participant, json.dumps(setting), *results[0], *spread]
                )
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--features", required=True, help="features.csv with the reference's header")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    people = {}
    with open(options.features, newline="") as file:
        for row in csv.DictReader(file):
            people.setdefault(int(row["participant"]), []).append(row)
    tasks = [(name, participant, rows) for name in SETS for participant, rows in people.items()]
    out = csv.writer(sys.stdout, lineterminator="\n")
    head = "model,experiment,features,participant,hyperparameters,cv_right,test_right"
    out.writerow([*head.split(","), "cv_least", "cv_most", "test_least", "test_most"])
    with ProcessPoolExecutor(options.processes) as pool:
        for found in pool.map(lines, tasks):
            out.writerows(found)


if __name__ == "__main__":
    main()
