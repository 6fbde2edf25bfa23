"""Every test, interval, effect size, correction, calibration and count of a report, computed again.

This program follows docs/analysis.md and shares no code with the server: it reads the predictions of an analysis and
its input trials, computes everything from them with NumPy and SciPy, and compares with the numbers behind the report,
on six deliberately awkward data sets. Then it compares each figure of the printed tables with the number behind it.

Not computed: `cv_accuracy` and the chosen hyper-parameters, because the models of the folds are not in any file. Powers
are shares of random samples; here other samples are drawn, and powers compared to 0.02.
Learning curves, unseen people, importance, roll-outs of models and leakage are in test_report_people.py.
"""

import itertools
import os
from collections import defaultdict

import numpy as np
import pytest
from conftest import driven

from report_data import PAPERS, RATE, SPEED_MPS, STEP_S, Report, printed, printed_beside_zero, printed_p, simulated
from report_models import rolled_out
from report_statistics import LEVEL, balanced, calibration, close, gains_are, holm, mann_whitney, mean_share
from report_statistics import power, share, signed_rank

pytestmark = pytest.mark.skipif("SIDESTEP_BIN" not in os.environ, reason="needs the program sidestep")

SETS = ["hrd", "hr", "hd", "rd", "h", "r", "d"]
PAIRS = [("hrd", "d"), ("hr", "d"), ("hd", "d"), ("rd", "d"), ("h", "d"), ("r", "d"), ("hrd", "hr"), ("h", "r")]
RADIUS_M = 3.0


# Data.


def once(rng, trial):
    """The same trial with a turn in one step only."""
    rates = np.zeros(len(trial.rates))
    rates[rng.integers(len(rates))] = rng.choice([-RATE, RATE])
    return trial.turned(rates)


def ties(folder, rng):
    """Most people turn in one step of each task: models of every feature set predict the same of them."""
    people = simulated(folder, 14, 6, 25, 5)
    return people[:6] + [[once(rng, trial) for trial in tasks] for tasks in people[6:]]


def one_class(folder, _rng):
    """Nobody turns in the test tasks."""
    return [tasks[:4] + [trial.turned(np.zeros(25)) for trial in tasks[4:]] for tasks in simulated(folder, 7, 6, 25, 6)]


def two_people(folder, _rng):
    """Too few for any test."""
    return simulated(folder, 2, 10, 50, 7)


def many(folder, _rng):
    """More people than exact tests count."""
    return simulated(folder, 200, 5, 12, 9)


def copied_trials(folder, _rng):
    """The first tasks are repeated at the end, among the test tasks."""
    return [tasks[:8] + tasks[:2] for tasks in simulated(folder, 8, 8, 25, 8)]


def identical_people(folder, _rng):
    """The same person eight times: no variance."""
    return simulated(folder, 1, 8, 30, 3) * 8


MADE = [ties, one_class, two_people, many, copied_trials, identical_people]


@pytest.fixture(scope="module", params=MADE, ids=lambda of: of.__name__)
def report(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param.__name__)
    return Report(folder, request.param(folder, np.random.default_rng(2019)), paper_only=True)


# The numbers.


def test_people_and_predictions(report):
    """The predictions are of the last fifth of the tasks, and their truth is the driven input."""
    tasks = len(report.people[0])
    # A person with only one class in the training tasks is left out, because no model can be fitted.
    training = [of[: tasks - tasks // 5] for of in report.people]
    turned = [{rate for trial in of for rate in trial.rates} for of in training]
    assert report.names == [name for name, rates in enumerate(turned) if len(rates) > 1]
    for model, experiment, features, name in report.cells:
        cell = report.cells[model, experiment, features, name]
        assert cell.trials == list(range(tasks - tasks // 5, tasks))
        assert (cell.truth == report.classes(experiment, report.people[name][-len(cell.trials) :])).all()
    for row in report.table("cells"):
        cell = report.cells[row["model"], int(row["experiment"]), row["features"], int(row["participant"])]
        close(float(row["test_accuracy"]), cell.accuracy() / 100, row)
        close(float(row["test_balanced_accuracy"]), cell.balanced() / 100, row)
    models = [key for key in report.cells if key[0] != "svm"]
    assert report.numbers["counts"] == {
        "participants": len(report.names),
        "test_trials": len(report.names) * (tasks // 5),
        "test_steps": len(report.names) * (tasks // 5) * report.steps,
        "models": len(models),
    }


def test_tests_of_the_paper(report):
    """With the corrections of each metric."""
    compared = 0
    for metric in ["accuracy", "D_start", "D_end"]:
        told = [test for test in report.numbers["tests"] if test["gain"]["metric"] == metric]
        mine = defaultdict(list)
        for test in told:
            model, experiment = test["gain"]["model"], test["gain"]["experiment"]
            pair = test["first"], test["second"]
            lists = [[cell.by_trial(metric) for cell in report.of(model, experiment, of)] for of in pair]
            means = [np.array([each.mean() for each in of]) for of in lists]
            better, worse = means if metric == "accuracy" else means[::-1]
            what = (model, experiment, metric, *pair)
            mine["paired"].append(gains_are(test["gain"], better, worse, what))
            for unit, each in [("persons", means), ("trajectories", [np.concatenate(of) for of in lists])]:
                p = mann_whitney(*each)
                close(test[f"mann_whitney_{unit}"], p, what + (unit,))
                mine[unit].append(p)
            compared += 1
        close([test["gain"]["holm"] for test in told], holm(mine["paired"]), metric)
        for unit in ["persons", "trajectories"]:
            close([test[f"mann_whitney_{unit}_holm"] for test in told], holm(mine[unit]), (metric, unit))
        assert [(test["first"], test["second"]) for test in told][: len(PAIRS)] == PAIRS
    assert compared == 6 * 8 + 3 * 8 * 2


def always_commonest(report, experiment):
    return np.array([100 * (truth == predicted).mean() for truth, predicted, *_ in report.commonest(experiment)])


def test_families_beside_the_papers(report):
    for family in report.numbers["beside"]:
        found = []
        for gain in family["gains"]:
            model, experiment, first, second = gain["model"], gain["experiment"], family["first"], family["second"]
            own = report.accuracy(model, experiment, first)
            other = always_commonest(report, experiment) if second == "none" else report.accuracy(model, experiment, second)
            found.append(gains_are(gain, own, other, (model, experiment, first, second)))
        close([gain["holm"] for gain in family["gains"]], holm(found), family["first"])
    pairs = [(of["first"], of["second"]) for of in report.numbers["beside"]]
    assert pairs == [("d_body", "hrd"), ("hrd_body", "d_body"), ("hrd", "none")]


def pooled(report, model, experiment, features):
    """Classes, and truth, predictions and probabilities of all rows together; those of the commonest class without a model."""
    if model is None:
        truth, predicted, classes, p = zip(*report.commonest(experiment), strict=True)
        return classes[0], np.concatenate(truth), np.concatenate(predicted), np.concatenate(p)
    cells = report.of(model, experiment, features)
    truth, predicted = (np.concatenate([getattr(cell, of).ravel() for cell in cells]) for of in ("truth", "predicted"))
    return cells[0].classes, truth, predicted, np.concatenate([cell.p for cell in cells])


def test_calibration_and_ablation(report):
    """Over all rows together."""
    losses = {}
    for told in report.numbers["calibration"]:
        what = told["model"], told["experiment"], told["features"]
        classes, truth, _, p = pooled(report, *what)
        mine = calibration(classes, truth, p)
        close([told["of"][key] for key in ("log_loss", "brier", "calibration_error")], mine, what)
        assert told["of"]["rows"] == len(truth)
        losses[what] = mine[0]
    assert len(losses) == 2 + 5 * 2 * 9
    for told in report.numbers["ablations"]:
        model, experiment, features = told["model"], told["experiment"], told["features"]
        own = report.accuracy(model, experiment, features) if model else always_commonest(report, experiment)
        rows = report.of(model, experiment, features) if model else report.commonest(experiment)
        even = [cell.balanced() if model else balanced(*cell[:2]) for cell in rows]
        mine = [own.mean(), np.mean(even), losses[model, experiment, features]]
        close([told["accuracy"], told["balanced"], told["log_loss"]], mine, told)
        if model and features != "d":
            base = report.accuracy(model, experiment, "d")
            close(told["over_d"], [own.mean() - base.mean(), signed_rank(own - base)["p"]], told)
        else:
            assert told["over_d"] is None
    assert len(report.numbers["ablations"]) == 2 + 3 * 2 * 4
    for told in report.numbers["confusions"]:
        classes, truth, predicted, _ = pooled(report, told["model"], told["experiment"], "hrd")
        assert told["confusion"] == [[int(((truth == a) & (predicted == b)).sum()) for b in classes] for a in classes]


def distances(report, model, features, metric):
    """Mean distance of first or last steps of avoidance: penalised; for trials in which both avoid; their number."""
    cells = report.of(model, 2, features)
    distance = np.concatenate([cell.by_trial(metric) for cell in cells])
    both = np.concatenate([cell.truth.any(axis=1) & cell.predicted.any(axis=1) for cell in cells])
    return {"penalised": distance.mean(), "both": distance[both].mean() if both.any() else None, "n": both.sum()}


def test_tables_of_the_paper(report):
    for told in report.numbers["table1"]:
        model, experiment = told["model"], told["experiment"]
        close(told["accuracies"], [report.accuracy(model, experiment, of).mean() for of in SETS], told)
        beside = [report.accuracy(model, experiment, of).mean() for of in ("hrd_body", "d_body")]
        close(told["beside"], [*beside, always_commonest(report, experiment).mean()], told)
    for row in report.table("table1"):
        for of in SETS:
            printed(row[of], report.accuracy(row["model"], int(row["experiment"]), of).mean())
    for told in report.numbers["table2"]:
        for of, each in zip(SETS, told["distances"], strict=True):
            for metric, key in [("D_start", "start"), ("D_end", "end")]:
                mine = distances(report, told["model"], of, metric)
                close([each[key]["penalised"], each["both"]], [mine["penalised"], mine["n"]], told)
                close(each[key]["both"], mine["both"], told)
            assert each["trajectories"] == sum(len(cell.trials) for cell in report.of(told["model"], 2, of))
    for row in report.table("table2"):
        for of in SETS:
            mine = distances(report, row["model"], of, row["metric"])
            printed(row[of], mine[row["convention"]], 0 if row["convention"] == "n" else 4)


def test_answers(report):
    """The overall conclusion from the tests, and the power with this number of people."""
    findings, tests = report.numbers["findings"], report.numbers["tests"]
    of_tests = lambda metric, *pair: [  # noqa: E731
        test["gain"] for test in tests if (test["gain"]["metric"], test["first"], test["second"]) == (metric, *pair)
    ]
    beside = [family["gains"] for family in report.numbers["beside"]]
    ends = findings["start_and_end"]
    answers = [
        (findings["safety_over_distance"]["answer"], of_tests("accuracy", "hrd", "d"), 48),
        (findings["which_level"], of_tests("accuracy", "h", "r"), 48),
        (ends["start"], of_tests("D_start", "hrd", "d"), 24),
        (ends["end"], of_tests("D_end", "hrd", "d"), 24),
        (findings["body_frame_instead"], beside[0], 6),
        (findings["body_frame_too"], beside[1], 6),
        (findings["over_baseline"], beside[2], 6),
    ]
    for told, gains, family in answers:
        assert told["gains"] == sorted(gains, key=lambda gain: gain["experiment"])
        assert told["verdict"] == verdict(gains)
        power_is(told["power"], len(report.names), family)
    assert ends["verdict"] == verdict(answers[2][1] + answers[3][1])
    power_is(report.numbers["study_power"], len(report.names), 48)
    main = findings["safety_over_distance"]
    assert main["main"] == tests[0]
    close(main["accuracies"], [report.accuracy("svm", 1, of).mean() for of in ("hrd", "d")], main)
    entries = findings["calibration"]["entries"]
    told = {(of["model"], of["experiment"]): of["of"] for of in report.numbers["calibration"] if of["features"] == "hrd"}
    assert entries == [[model, experiment, told[model, experiment]] for experiment in (1, 2) for model in PAPERS]
    errors = [of["calibration_error"] for *_, of in entries]
    assert findings["calibration"]["errors"] == [min(errors), max(errors)]


def verdict(gains):
    if min(gain["holm"] for gain in gains) < LEVEL:
        return "shown"
    if min(gain["paired"]["p"] for gain in gains) < LEVEL:
        return "hint"
    some = any(2 * 0.5 ** gain["paired"]["differing"] < LEVEL for gain in gains)
    return "not_shown" if some else "too_few"


def power_is(told, people, family):
    """Powers are shares of 10 000 samples, and ours of 20 000 others: together they err by less than 0.02."""
    least = min(1.0, 2 * 0.5**people)
    needed = next(n for n in itertools.count(1) if 2 * 0.5**n * family < LEVEL)
    assert (told["participants"], told["family"], told["needed"]) == (people, family, needed)
    close([told["least_p"], told["least_p_after_holm"]], [least, min(1.0, family * least)], told)
    # For more than 100 people it is the power of 100.
    most = min(people, 100)
    mine = [power(most, 1), power(most, family), power(needed, family)]
    assert np.allclose([told["shown"], told["shown_after_holm"], told["needed_shown"]], mine, rtol=0, atol=0.02), (told, mine)
    assert power(told["enough"] - 1, family) - 0.02 < 0.8 < power(told["enough"], family) + 0.02, told


def test_rollouts_without_a_model(report):
    for driver, mine in rolled_out(report, ["held_input", "straight"]).items():
        told = next(of["horizons"] for of in report.numbers["rollouts"] if of["driver"] == driver)
        close([[of[key] for key in ("windows", "right", "log_loss", "distance_m")] for of in told], mine, driver)


# Behaviour.


def behaviour(trial):
    """Behaviour in one task. The smallest distance is over 21 instants of each step, as in the library."""
    human, rates = driven(trial.start, trial.rates), np.array(trial.rates)
    robot = np.array([*trial.robot, driven(trial.robot[-1], [0])[1]])
    instants = np.linspace(0, STEP_S, 21)
    psi, turned = human[:-1, 2, None], rates[:, None] * instants
    chord, way = SPEED_MPS * instants * np.sinc(0.5 * turned / np.pi), SPEED_MPS * instants
    x = human[:-1, 0, None] + chord * np.cos(psi + 0.5 * turned) - robot[:-1, 0, None] - way * np.cos(robot[:-1, 2, None])
    y = human[:-1, 1, None] + chord * np.sin(psi + 0.5 * turned) - robot[:-1, 1, None] - way * np.sin(robot[:-1, 2, None])
    apart = robot - human
    distance = np.hypot(apart[:, 0], apart[:, 1])
    nearest = distance.argmin()
    left = apart[nearest, 1] * np.cos(human[nearest, 2]) - apart[nearest, 0] * np.sin(human[nearest, 2])
    turns = np.flatnonzero(rates)
    first = turns[0] if len(turns) else None
    onset = {"time_s": first * STEP_S, "distance_m": distance[first], "to_left": rates[first] > 0} if len(turns) else None
    closest = np.hypot(x, y).min()
    goal = robot[0, :2] + SPEED_MPS * STEP_S * len(rates) * np.array([np.cos(robot[0, 2]), np.sin(robot[0, 2])])
    return {
        "robot": None,
        "robot_to_goal_m": np.hypot(*(robot[-1, :2] - goal)),
        "in_danger": closest <= RADIUS_M,
        "closest_m": closest,
        "robot_on_left": left > 0,
        "onset": onset,
        "turning": len(turns) / len(rates),
    }


def summary(tasks):
    """Summary of several tasks; `None` for no task."""
    if not tasks:
        return None
    onsets = [of["onset"] for of in tasks if of["onset"]]
    mean = lambda key, of: np.mean([each[key] for each in of]) if of else None  # noqa: E731
    return {
        "tasks": len(tasks),
        "in_danger": sum(of["in_danger"] for of in tasks),
        "closest_m": mean("closest_m", tasks),
        "least_m": min(of["closest_m"] for of in tasks),
        "steered": len(onsets),
        "to_left": sum(of["to_left"] for of in onsets),
        "robot_on_left": sum(of["robot_on_left"] for of in tasks),
        "onset_s": mean("time_s", onsets),
        "onset_distance_m": mean("distance_m", onsets),
        "turning": mean("turning", tasks),
        "robot_to_goal_m": mean("robot_to_goal_m", tasks),
    }


def same(told, mine, what):
    """The same keys with the same numbers."""
    assert (told is None) == (mine is None) and (mine is None or told.keys() == mine.keys()), what
    for key in mine or {}:
        close(told[key], mine[key], (*what, key)) if key != "onset" else same(told[key], mine[key], (*what, key))


def test_behaviour(report):
    told = report.numbers["behaviour"]
    tasks = {name: [behaviour(trial) for trial in report.people[name]] for name in report.names}
    assert [of["name"] for of in told["people"]] == [str(name) for name in report.names]
    for of, (name, own) in zip(told["people"], tasks.items(), strict=True):
        for number, (each, mine) in enumerate(zip(of["tasks"], own, strict=True)):
            same(each, {"trial": number, **mine}, (name, number))
        same(of["all"], summary(own), (name,))
        ends = [part * len(own) // 5 for part in range(6)]
        for part, (begin, end) in enumerate(itertools.pairwise(ends)):
            same(of["parts"][part], summary(own[begin:end]), (name, part))
    same(told["all"], summary([of for own in tasks.values() for of in own]), ())
    hits = [sum(of["in_danger"] for of in own) for own in tasks.values()]
    counts = [len(own) for own in tasks.values()]
    for key, mine in [("danger", share(hits, counts)), ("danger_of_people", mean_share(np.divide(hits, counts)))]:
        close([told[key][end] for end in ("value", "low", "high")], mine, key)


# The printed tables.


def printed_gain(row, gain):
    """Checks a paired comparison in tests.csv and beside.csv."""
    paired = gain["paired"]
    assert (row["model"], row["experiment"]) == (gain["model"], str(gain["experiment"]))
    assert row["differing"] == str(paired["differing"])
    printed(row["gain"], paired["mean"])
    printed(row["rank_biserial"], paired["rank_biserial"])
    printed_beside_zero(row["typical_gain"], paired["typical"])
    for key, end in zip(("gain_low", "gain_high"), paired["interval"] or (None, None), strict=True):
        printed_beside_zero(row[key], end)
    printed_p(row["wilcoxon_persons"], paired["p"])
    printed_p(row["wilcoxon_persons_holm"], gain["holm"])


def test_printed_tests(report):
    for row, test in zip(report.table("tests"), report.numbers["tests"], strict=True):
        assert [row[key] for key in ("metric", "first", "second")] == [test["gain"]["metric"], test["first"], test["second"]]
        printed_gain(row, test["gain"])
        for key in ("mann_whitney_persons", "mann_whitney_trajectories"):
            printed_p(row[key], test[key])
            printed_p(row[f"{key}_holm"], test[f"{key}_holm"])
    beside = [(family, gain) for family in report.numbers["beside"] for gain in family["gains"]]
    for row, (family, gain) in zip(report.table("beside"), beside, strict=True):
        assert (row["first"], row["second"]) == (family["first"], family["second"])
        printed_gain(row, gain)


def names_model(row, told):
    model = told["model"] or "constant"
    assert (row["model"], row["experiment"], row["features"]) == (model, str(told["experiment"]), told["features"])


def test_printed_calibration_and_ablation(report):
    for row, told in zip(report.table("calibration"), report.numbers["calibration"], strict=True):
        names_model(row, told)
        assert row["rows"] == str(told["of"]["rows"])
        for key in ("log_loss", "brier", "calibration_error"):
            printed(row[key], told["of"][key])
    for row, told in zip(report.table("ablation"), report.numbers["ablations"], strict=True):
        names_model(row, told)
        printed(row["accuracy_percent"], told["accuracy"])
        printed(row["balanced_accuracy_percent"], told["balanced"])
        printed(row["log_loss"], told["log_loss"])
        if told["over_d"]:
            printed(row["gain_over_d"], told["over_d"][0])
            printed_p(row["wilcoxon_persons"], told["over_d"][1])
        else:
            assert row["gain_over_d"] == row["wilcoxon_persons"] == ""


def test_printed_behaviour(report):
    people = report.numbers["behaviour"]["people"]
    places = {"closest_m": 4, "least_m": 4, "onset_s": 4, "onset_distance_m": 4, "turning": 6}
    for row, told in zip(report.table("behaviour"), people, strict=True):
        assert row.pop("participant") == told["name"]
        for key, text in row.items():
            printed(text, told["all"][{"first_turn_left": "to_left"}.get(key, key)], places.get(key, 0))
    tasks = [(told["name"], task) for told in people for task in told["tasks"]]
    for row, (name, task) in zip(report.table("behaviour_trials"), tasks, strict=True):
        onset = task["onset"] or {"time_s": None, "distance_m": None}
        assert (row["participant"], row["trial"]) == (name, str(task["trial"]))
        assert row["first_turn"] == ("0" if task["onset"] is None else "1" if onset["to_left"] else "-1")
        assert (row["in_danger"], row["robot_on_left"]) == (str(int(task["in_danger"])), str(int(task["robot_on_left"])))
        printed(row["closest_m"], task["closest_m"])
        printed(row["turning"], task["turning"], 6)
        printed(row["onset_s"], onset["time_s"])
        printed(row["onset_distance_m"], onset["distance_m"])
