"""Trials for an analysis, and the files it wrote about them."""

import csv
import json
import os
import re
import subprocess
from collections import defaultdict

import numpy as np
from conftest import driven

from report_statistics import balanced

RATE, STEP_S, SPEED_MPS = 0.5, 0.2, 2.0
PAPERS = ["svm", "dt", "lr"]
# One value of each hyper-parameter: the choice does not matter here.
GRIDS = {"rbf_c": [1], "rbf_gamma": [0.1], "linear_c": [1], "tree_depth": [3], "tree_leaf": [5], "logistic_c": [1]}


def sidestep(*arguments):
    """Runs the program."""
    done = subprocess.run([os.environ["SIDESTEP_BIN"], *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


def table(path):
    """The rows of a CSV file."""
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


class Trial:
    """One trial: the robot's poses, the human's start and the turn rates that the human held."""

    def __init__(self, rows, steps):
        rows = rows[:steps]
        self.start = [float(rows[0][key]) for key in ("hx", "hy", "hpsi")]
        self.robot = [[float(row[key]) for key in ("rx", "ry", "rpsi")] for row in rows]
        self.rates = [float(row["omega"]) for row in rows]

    def turned(self, rates):
        """The same trial with other inputs."""
        other = object.__new__(Trial)
        other.start, other.robot, other.rates = self.start, self.robot, list(rates)
        return other

    def parts(self):
        """A trial of one step for each step."""
        human = driven(self.start, self.rates)
        for step in range(len(self.rates)):
            part = object.__new__(Trial)
            part.start, part.robot, part.rates = human[step], [self.robot[step]], [self.rates[step]]
            yield part


def simulated(folder, people, tasks, steps, seed):
    """The trials of synthetic people: one list per person."""
    path = folder / "simulated.csv"
    sidestep("simulate", "--participants", people, "--seed", seed, "--keys", "clock", "--tasks", tasks, "--out", path)
    rows = defaultdict(list)
    for row in table(path):
        rows[int(row["participant"]), int(row["trial"])].append(row)
    return [[Trial(rows[person, task], steps) for task in range(tasks)] for person in range(people)]


def written(path, people):
    """Writes the trials as a file that the program reads. Names of people and trials are their indices."""
    with open(path, "w", newline="") as file:
        out = csv.writer(file)
        out.writerow("participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega,synthetic".split(","))
        for name, tasks in enumerate(people):
            for number, trial in enumerate(tasks):
                human = driven(trial.start, trial.rates)
                for step, rate in enumerate(trial.rates):
                    pose = [repr(float(x)) for x in [*human[step], *trial.robot[step]]]
                    out.writerow([name, number, step, step / 5, *pose, rate, 1])
    return path


class Cell:
    """The test rows of one model."""

    def __init__(self, rows, steps):
        self.trials = sorted({int(row["trial"]) for row in rows})
        shape = (len(rows) // steps, steps)
        self.truth = np.array([int(row["truth"]) for row in rows]).reshape(shape)
        self.predicted = np.array([int(row["predicted"]) for row in rows]).reshape(shape)
        names = {"p_right": -1, "p_straight": 0, "p_left": 1} if rows[0]["experiment"] == "1" else {"p_straight": 0, "p_avoid": 1}
        self.classes = list(names.values())
        self.p = np.array([[float(row[name] or 0) for name in names] for row in rows])

    def by_trial(self, metric):
        if metric == "accuracy":
            return 100 * (self.truth == self.predicted).mean(axis=1)
        place = 0 if metric == "D_start" else 1
        ends = lambda rows: np.array([ends_of_avoidance(row)[place] for row in rows])  # noqa: E731
        return np.abs(ends(self.truth) - ends(self.predicted)).astype(float)

    def accuracy(self):
        return self.by_trial("accuracy").mean()

    def balanced(self):
        return balanced(self.truth, self.predicted)


def ends_of_avoidance(row):
    """First and last step of avoidance, penalised where there is none."""
    at = np.flatnonzero(row)
    return (at[0], at[-1]) if len(at) else (len(row), -1)


class Report:
    """An analysis of people's trials: the people, and the files."""

    def __init__(self, folder, people, grids=GRIDS, **settings):
        self.folder, self.people, self.steps = folder, people, len(people[0][0].rates)
        self.trials = written(folder / "trials.csv", people)
        (folder / "settings.json").write_text(json.dumps({"grids": grids, **settings}))
        of = ["--trials", self.trials, "--trial-steps", self.steps, "--settings", folder / "settings.json"]
        sidestep("analyze", *of, "--out", folder / "out")
        self.numbers = json.loads((folder / "out" / "numbers.json").read_text())
        rows = defaultdict(list)
        for row in self.table("predictions"):
            rows[row["model"], int(row["experiment"]), row["features"], int(row["participant"])].append(row)
        self.cells = {key: Cell(of, self.steps) for key, of in rows.items()}
        self.names = sorted({key[3] for key in self.cells})

    def table(self, name):
        return table(self.folder / "out" / f"{name}.csv")

    def model_file(self, model, experiment, features, name):
        return self.folder / "out" / "models" / f"{model}-{experiment}-{features}-{name}.json"

    def of(self, model, experiment, features):
        """A model's cells, one per person."""
        return [self.cells[model, experiment, features, name] for name in self.names]

    def accuracy(self, model, experiment, features):
        """The accuracy for each person."""
        return np.array([cell.accuracy() for cell in self.of(model, experiment, features)])

    def tested(self, name):
        """The numbers of a person's test tasks."""
        return self.cells["lr", 1, "hrd", name].trials

    def training(self, name):
        """A person's training tasks, in order."""
        return self.people[name][: -len(self.tested(name))]

    def classes(self, experiment, trials):
        """The classes of each step of some trials."""
        signs = np.sign([trial.rates for trial in trials]).astype(int)
        return np.abs(signs) if experiment == 2 else signs

    def commonest(self, experiment):
        """For each person, by step: the truth, and a model that always predicts the commonest class."""
        classes = np.array([-1, 0, 1] if experiment == 1 else [0, 1])
        for name in self.names:
            truth = self.classes(experiment, [self.people[name][task] for task in self.tested(name)]).ravel()
            counts = (self.classes(experiment, self.training(name)).reshape(-1, 1) == classes).sum(axis=0)
            p = np.tile((counts + 1) / (counts + 1).sum(), (len(truth), 1))
            yield truth, np.full(len(truth), classes[counts.argmax()]), classes, p


def printed(text, number, places=4):
    """Checks that a number is printed with this many decimals, and `None` as nothing."""
    if number is None:
        assert text == ""
        return
    assert re.fullmatch(rf"-?\d+\.\d{{{places}}}" if places else r"\d+", text) and not re.fullmatch(r"-0\.?0*", text), text
    assert abs(float(text) - float(number)) <= 0.5 * 10.0**-places * (1 + 1e-9), (text, number)


def printed_beside_zero(text, number):
    """Checks for four decimals, with a magnitude of at least 0.0001 unless the number is 0."""
    least = number and np.copysign(max(abs(number), 1e-4), number)
    printed(text, least)


def printed_p(text, p):
    """Checks for scientific notation with six decimals."""
    assert re.fullmatch(r"\d\.\d{6}e-?\d+", text), text
    assert abs(float(text) - p) <= 0.5e-6 * 10.0 ** int(text.split("e")[1]) * (1 + 1e-9), (text, p)
