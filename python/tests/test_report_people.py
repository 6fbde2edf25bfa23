"""Learning curves, unseen people, importance of features, roll-outs and leakage of a report, computed again.

As in test_report.py. The predictions behind these numbers are not in any file, but their inputs are:

- Models in `models/` are evaluated here (report_models.py) on features that `sidestep features` writes. This reproduces
  the exported predictions, the importance of features and the roll-outs of the paper's models.
- Models trained on other tasks (learning curves, unseen people, leakage) are not in any file. A second analysis trains
  them again, on artificial people whose first four fifths are these tasks, and exports its predictions.

Not computed: roll-outs of boosted trees and of models with memory, which are neither in a file nor exported by a second
analysis; only the numbers of their windows are compared.
"""

import itertools
import os

import numpy as np
import pytest

from report_data import GRIDS, PAPERS, Report, printed, printed_p, sidestep, simulated
from report_models import Generator, Model, by_person, of_names, rolled_out
from report_statistics import balanced, close, gains_are, holm

pytestmark = pytest.mark.skipif("SIDESTEP_BIN" not in os.environ, reason="needs the program sidestep")

COMPARED = ["hrd", "d", "hrd_body"]
ROLLED_OUT = ["hrd", "d", "hrd_body", "d_body"]
# These are permuted together, because each alone would still carry the same information.
TOGETHER = ["dpsi", "cos_dpsi", "sin_dpsi"]


# Data.


def differing(folder):
    """People with 6 to 26 tasks. One starts to turn late, one never turns, and one turns right only in the test."""
    people = simulated(folder, 6, 26, 12, 11)
    people = [tasks[:count] for tasks, count in zip(people, (13, 14, 6, 6, 13, 26), strict=True)]
    straight = lambda trials: [trial.turned(np.zeros(12)) for trial in trials]  # noqa: E731
    people[1][:5], people[3] = straight(people[1][:5]), straight(people[3])
    people[4][:11] = [trial.turned(np.abs(trial.rates)) for trial in people[4][:11]]
    return people


def alike(folder):
    """The same person six times: models of others are as good as one's own, or all equally worse."""
    return simulated(folder, 1, 6, 12, 3) * 6


def alone(folder):
    """Nobody else."""
    return simulated(folder, 1, 9, 20, 13)


def crowd(folder):
    """More people than left-out groups: the first and the last person are left out together."""
    return simulated(folder, 21, 5, 8, 12)


@pytest.fixture(scope="module", params=[differing, alike, alone], ids=lambda of: of.__name__)
def report(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param.__name__)
    return Report(folder, request.param(folder), leakage=True)


class Again:
    """A second analysis, with models trained and tested on given trials: `wanted` has both lists for each key."""

    def __init__(self, folder, wanted, grids=GRIDS):
        people, self.parts = [], {}
        for key, (training, test) in wanted.items():
            fifth = len(training) // 4
            self.parts[key] = []
            for begin in range(0, len(test), fifth):
                part = test[begin : begin + fifth]
                self.parts[key].append((len(people), len(part)))
                # A fifth of the tasks are test tasks: they are repeated if there are fewer.
                people.append([*training, *itertools.islice(itertools.cycle(part), fifth)])
        self.report = Report(folder, people, grids, paper_only=True)
        assert self.report.names == list(range(len(people)))

    def tested(self, model, experiment, features, key):
        """The driven and the predicted inputs."""
        cells = [(self.report.cells[model, experiment, features, place], count) for place, count in self.parts[key]]
        return [np.vstack([getattr(cell, of)[:count] for cell, count in cells]) for of in ("truth", "predicted")]


def accuracy(truth, predicted):
    return 100 * (truth == predicted).mean()


# The numbers.


def test_learning_curves(report, tmp_path):
    wanted = {}
    for name, tasks in itertools.product(report.names, (5, 10, 20)):
        rates = {rate for trial in report.people[name][:tasks] for rate in trial.rates}
        if tasks < len(report.training(name)) and len(rates) > 1 and 0 in rates:
            wanted[name, tasks] = (report.people[name][:tasks], [report.people[name][task] for task in report.tested(name)])
    if not wanted:
        assert report.numbers["learning"] == report.table("learning") == []
        return
    again, points = Again(tmp_path, wanted), []
    for model, experiment, features in itertools.product(("svm_rbf", "dt", "lr"), (1, 2), COMPARED):
        for tasks in sorted({tasks for _, tasks in wanted}):
            of = [again.tested(model, experiment, features, key) for key in wanted if key[1] == tasks]
            points.append([model, experiment, features, tasks, of])
        of = [(cell.truth, cell.predicted) for cell in report.of(model, experiment, features)]
        points.append([model, experiment, features, np.mean([len(report.training(name)) for name in report.names]), of])
    told = report.numbers["learning"]
    for row, each, (*what, tasks, of) in zip(report.table("learning"), told, points, strict=True):
        assert [each[key] for key in ("model", "experiment", "features")] == what
        mine = np.mean([accuracy(*one) for one in of]), np.mean([balanced(*one) for one in of])
        close([each[key] for key in ("tasks", "people", "accuracy", "balanced")], [tasks, len(of), *mine], what)
        assert [row["model"], int(row["experiment"]), row["features"], int(row["participants"])] == [*what, len(of)]
        assert float(row["training_tasks"]) == each["tasks"]
        printed(row["accuracy_percent"], each["accuracy"])
        printed(row["balanced_accuracy_percent"], each["balanced"])


def test_unseen_people(report, tmp_path):
    unseen_are_right(report, tmp_path, report.names)


def test_unseen_people_of_a_crowd(tmp_path):
    (tmp_path / "again").mkdir()
    report = Report(tmp_path, crowd(tmp_path))
    unseen_are_right(report, tmp_path / "again", [report.names[place] for place in (0, 2, 20)])


def unseen_are_right(report, folder, checked):
    """Accuracies are right for the people checked, and everything else for all people."""
    told, rows = report.numbers["unseen"], iter(report.table("unseen"))
    if len(report.names) == 1:
        assert told == list(rows) == []
        return
    groups = min(len(report.names), 20)
    wanted = {}
    for place, name in enumerate(report.names):
        others = [other for at, other in enumerate(report.names) if at % groups != place % groups]
        if name in checked:
            test = [report.people[name][task] for task in report.tested(name)]
            wanted[name] = ([trial for other in others for trial in report.people[other]], test)
    # No support vector machine is checked, so their training may be trivial.
    again = Again(folder, wanted, {**GRIDS, "rbf_c": [1e-3], "linear_c": [1e-3]})
    whats, found = list(itertools.product(("dt", "lr"), (1, 2), COMPARED)), []
    for what, each in zip(whats, told, strict=True):
        model, experiment, features = what
        assert [each["own"][key] for key in ("model", "experiment", "metric")] == [model, experiment, "accuracy"]
        assert each["features"] == features
        mine = {name: again.tested(*what, name) for name in checked}
        close([each["accuracies"][report.names.index(name)] for name in checked], [accuracy(*of) for of in mine.values()], what)
        own = report.accuracy(*what)
        close([each["mean"], each["own_mean"]], [np.mean(each["accuracies"]), own.mean()], what)
        if checked == report.names:
            close(each["balanced"], np.mean([balanced(*of) for of in mine.values()]), what)
        found.append(gains_are(each["own"], own, each["accuracies"], what))
    close([each["own"]["holm"] for each in told], holm(found), "holm")
    for (what, each), place in itertools.product(zip(whats, told, strict=True), range(len(report.names))):
        row, own = next(rows), each["own"]
        assert [row["model"], int(row["experiment"]), row["features"], int(row["participant"])] == [*what, report.names[place]]
        printed(row["accuracy_percent"], each["accuracies"][place])
        printed(row["own_accuracy_percent"], report.accuracy(*what)[place])
        printed_p(row["wilcoxon_persons"], own["paired"]["p"])
        printed_p(row["wilcoxon_persons_holm"], own["holm"])
        printed(row["rank_biserial"], own["paired"]["rank_biserial"])
        assert row["differing"] == str(own["paired"]["differing"])
    assert not list(rows)


def test_leakage(report, tmp_path):
    """Every fifth step is a test step: as trials of one step, the training steps come first."""
    people = []
    for name in report.names:
        steps = [part for trial in report.people[name] for part in trial.parts()]
        held = [at % 5 == 4 for at in range(len(steps))]
        people.append([*itertools.compress(steps, [not of for of in held]), *itertools.compress(steps, held)])
    leaking = Report(tmp_path, people, paper_only=True)
    whats = itertools.product(PAPERS, (1, 2))
    for row, each, (model, experiment) in zip(report.table("leakage"), report.numbers["leaking"], whats, strict=True):
        mine = [of.accuracy(model, experiment, "hrd").mean() for of in (report, leaking)]
        assert (each["model"], each["experiment"]) == (model, experiment) == (row["model"], int(row["experiment"]))
        close([each["grouped"], each["leaking"]], mine, (model, experiment))
        printed(row["grouped_percent"], mine[0])
        printed(row["leaking_percent"], mine[1])


@pytest.fixture(scope="module")
def known(report):
    """The features of each person's test steps, as the program exports them."""
    path = report.folder / "all.csv"
    sidestep("features", "--trials", report.trials, "--trial-steps", report.steps, "--out", path)
    rows = lambda name: slice(len(report.training(name)) * report.steps, None)  # noqa: E731
    every = by_person(path)
    return {name: {key: of[rows(name)] for key, of in every[name].items()} for name in report.names}


def test_models_of_files(report, known):
    """They reproduce the exported predictions, with the same probabilities."""
    for key, cell in report.cells.items():
        model = Model(report.model_file(*key))
        rows = of_names(known[key[3]], model.features)
        assert (model.predicted(rows) == cell.predicted.ravel()).all(), key
        p = np.zeros_like(cell.p)
        p[:, np.searchsorted(cell.classes, model.classes)] = model.probabilities(rows)
        close(cell.p, p, key)


def exchanged(features):
    """The features that are permuted, one list for each permutation."""
    return [TOGETHER if name == TOGETHER[0] else [name] for name in features if name not in TOGETHER[1:]]


def test_importance(report, known):
    """Each value is replaced by that of another test step, five times, in orders with a fixed seed."""
    told = {}
    for row in report.table("importance"):
        told[row["model"], int(row["experiment"]), row["features"], row["permuted"], int(row["participant"])] = row["loss"]
    count = len(told)
    for model, experiment, features, name in itertools.product(PAPERS, (1, 2), ("hrd", "hrd_body"), report.names):
        key = model, experiment, features, name
        cell, of = report.cells[key], Model(report.model_file(*key))
        rows, generator = of_names(known[name], of.features), Generator(20_010_801)
        for group in exchanged(of.features):
            columns, shuffled = [of.features.index(feature) for feature in group], []
            for _ in range(5):
                other = rows.copy()
                other[:, columns] = rows[generator.order(len(rows))][:, columns]
                shuffled.append(of.predicted(other))
            loss = cell.accuracy() - accuracy(np.tile(cell.truth.ravel(), 5), np.concatenate(shuffled))
            printed(told.pop((model, experiment, features, "+".join(group), name)), loss)
    assert not told and count == 3 * 2 * (6 + 8) * len(report.names)


def test_rollouts(report):
    drivers = [*itertools.product(PAPERS, ROLLED_OUT), "held_input", "straight"]
    mine = rolled_out(report, drivers)
    straight, rows, seen = mine["straight"], iter(report.table("rollouts")), []
    for each in report.numbers["rollouts"]:
        driver = (each["driver"], each["features"]) if each["features"] else each["driver"]
        found = np.array([[of[key] for key in ("windows", "right", "log_loss", "distance_m")] for of in each["horizons"]])
        if driver in mine:
            close(found, mine[driver], driver)
            seen.append(driver)
        assert (found[:, 0] == straight[:, 0]).all()
        means = found[:, 1:] / found[:, :1]
        for ahead, (windows, (right, log_loss, distance_m)) in enumerate(zip(found[:, 0], means, strict=True)):
            row, base = next(rows), straight[ahead] / straight[ahead, 0]
            assert (row["driver"], row["features"], row["horizon"]) == (each["driver"], each["features"], str(ahead + 1))
            assert row["windows"] == str(int(windows))
            for key, number in [("accuracy_percent", 100 * right), ("log_loss", log_loss), ("distance_m", distance_m)]:
                printed(row[key], number)
            printed(row["accuracy_over_straight"], 100 * (right - base[1]))
            printed(row["distance_of_straight"], distance_m / base[3] if base[3] else None)
    assert not list(rows) and sorted(seen, key=str) == sorted(drivers, key=str)


def test_furthest_ahead(report):
    """The report describes the last step of roll-outs."""
    furthest = {}
    last = {(of["driver"], of["features"]): of["horizons"][-1] for of in report.numbers["rollouts"]}
    for (driver, features), of in last.items():
        numbers = [of[key] / of["windows"] for key in ("right", "distance_m")]
        straight = last["straight", ""]["right"] / of["windows"]
        furthest[driver, features] = [numbers[0], 100 * (numbers[0] - straight), numbers[1]]
    told = report.numbers["findings"]["rollouts"]
    assert (told["steps"], told["windows"]) == (min(10, report.steps), last["straight", ""]["windows"])
    both = [[of["driver"], of["features"]] for of in told["papers"]]
    assert both == [[model, "hrd"] for model in PAPERS]
    for of in [*told["papers"], *told["beyond"], told["held"], told["straight"]]:
        close([of[key] for key in ("accuracy", "over_straight", "distance_m")], furthest[of["driver"], of["features"]], of)
    for who in ("papers", "beyond"):
        drivers, simple = told[who], [told["held"], told["straight"]]
        assert told[f"{who}_beaten"] == {
            "more_often_right": sum(of["accuracy"] > max(by["accuracy"] for by in simple) for of in drivers),
            "closer": sum(of["distance_m"] < min(by["distance_m"] for by in simple) for of in drivers),
            "of": len(drivers),
        }
