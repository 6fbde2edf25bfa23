"""Every test, interval, effect size, correction and calibration of a report, computed again.

The program below knows what the documents say (docs/analysis.md) and shares no code with the server: it reads the
predictions that an analysis wrote, computes everything from them with NumPy and SciPy, and compares with the numbers
behind the report, on six sets of data that were made to be awkward.
"""

import csv
import itertools
import json
import os
import subprocess
from collections import defaultdict

import numpy as np
import pytest
from scipy import stats

from conftest import driven

pytestmark = pytest.mark.skipif("SIDESTEP_BIN" not in os.environ, reason="needs the program sidestep")

RATE = 0.5
PAPERS = ["svm", "dt", "lr"]
PAIRS = [("hrd", "d"), ("hr", "d"), ("hd", "d"), ("rd", "d"), ("h", "d"), ("r", "d"), ("hrd", "hr"), ("h", "r")]
LEVEL, TIE, EXACT = 0.05, 1e-12, 60
# One value of each hyper-parameter: what is chosen does not matter here.
GRIDS = {"rbf_c": [1], "rbf_gamma": [0.1], "linear_c": [1], "tree_depth": [3], "tree_leaf": [5], "logistic_c": [1]}


def sidestep(*arguments):
    """Runs the program."""
    done = subprocess.run([os.environ["SIDESTEP_BIN"], *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


# Data.


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


def simulated(folder, people, tasks, steps, seed):
    """The trials of synthetic people: for each a list."""
    path = folder / "simulated.csv"
    sidestep("simulate", "--participants", people, "--seed", seed, "--keys", "clock", "--tasks", tasks, "--out", path)
    rows = defaultdict(list)
    with open(path) as file:
        for row in csv.DictReader(file):
            rows[int(row["participant"]), int(row["trial"])].append(row)
    return [[Trial(rows[person, task], steps) for task in range(tasks)] for person in range(people)]


def written(folder, people):
    """The trials as a file that `analyze` reads."""
    path = folder / "trials.csv"
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


def once(rng, trial):
    """The same trial of somebody who turns in one step only."""
    rates = np.zeros(len(trial.rates))
    rates[rng.integers(len(rates))] = rng.choice([-RATE, RATE])
    return trial.turned(rates)


def ties(folder, rng):
    """Most people turn in one step of each task: models of every feature set predict the same of them."""
    people = simulated(folder, 14, 6, 25, 5)
    return people[:6] + [[once(rng, trial) for trial in tasks] for tasks in people[6:]]


def one_class(folder, _rng):
    """Nobody turns in the tasks that test."""
    return [tasks[:4] + [trial.turned(np.zeros(25)) for trial in tasks[4:]] for tasks in simulated(folder, 7, 6, 25, 6)]


def two_people(folder, _rng):
    """Too few for any test."""
    return simulated(folder, 2, 10, 50, 7)


def many(folder, _rng):
    """More people than exact tests count."""
    return simulated(folder, 200, 5, 12, 9)


def copied_trials(folder, _rng):
    """The first tasks again at the end, among those that test."""
    return [tasks[:8] + tasks[:2] for tasks in simulated(folder, 8, 8, 25, 8)]


def identical_people(folder, _rng):
    """Eight times the same person: no variance at all."""
    return simulated(folder, 1, 8, 30, 3) * 8


# What the documents say.


def ranks(sizes):
    """Midranks; what differs by rounding is tied."""
    order = np.argsort(sizes, kind="stable")
    found, begin = np.empty(len(sizes)), 0
    while begin < len(order):
        end = begin + 1
        while end < len(order) and sizes[order[end]] - sizes[order[end - 1]] <= TIE:
            end += 1
        found[order[begin:end]] = (begin + end + 1) / 2
        begin = end
    return found


def sign_ways(of):
    """How likely each sum of positive ranks is (index: twice the sum), by convolution."""
    ways = np.ones(1)
    for rank in of:
        one = np.zeros(int(round(2 * rank)) + 1)
        one[0] = one[-1] = 0.5
        ways = np.convolve(ways, one)
    return ways


def tails(ways, at):
    return min(1.0, 2 * min(ways[: at + 1].sum(), ways[at:].sum()))


def signed_rank(gains):
    """p, r, typical gain and interval of Wilcoxon's test, all of the gains that are not zero."""
    gains = np.asarray(gains)
    d = gains[np.abs(gains) > TIE]
    n = len(d)
    if n == 0:
        return {"p": 1.0, "r": 0.0, "typical": 0.0, "interval": None, "differing": 0}
    of = ranks(np.abs(d))
    positive, total = of[d > 0].sum(), of.sum()
    if n <= EXACT:
        ways = sign_ways(of)
        p_of = lambda w: tails(ways, int(round(2 * w)))  # noqa: E731
    else:
        tied = sum(t**3 - t for t in np.unique(of, return_counts=True)[1])
        variance = n * (n + 1) * (2 * n + 1) / 24 - tied / 48
        p_of = lambda w: min(1.0, 2 * stats.norm.sf(abs(w - n * (n + 1) / 4) / np.sqrt(variance)))  # noqa: E731
    p = p_of(positive)
    means = np.sort([(a + b) / 2 for a, b in itertools.combinations_with_replacement(d, 2)])
    typical = np.median(means)
    # A shift is kept if some count of means above it, between those above and those at or above it, is not rejected.
    kept = [
        at for at in np.unique(means)
        if any(p_of(w / 2) >= LEVEL for w in range(2 * int((means > at + TIE).sum()), 2 * int((means >= at - TIE).sum()) + 1))
    ] if n < 40 else None
    if kept is None:
        # W falls by one at each mean: the least doubled sum that is kept tells how many lie outside on either side.
        least = next(w for w in range(len(means) + 1) if p_of(w / 2) >= LEVEL)
        kept = [means[-(-least // 2) - 1], means[len(means) - -(-least // 2)]] if least else []
    never = p_of(0) >= LEVEL
    interval = None if never else [min(kept), max(kept)]
    if p < LEVEL and interval:
        side = max if positive > total / 2 else min
        typical, interval = side(typical, 0.0), [side(end, 0.0) for end in interval]
    return {"p": p, "r": 2 * positive / total - 1, "typical": typical, "interval": interval, "differing": n}


def mann_whitney(a, b):
    """Exact by counting, also with ties; SciPy's normal approximation for many numbers."""
    if len(a) + len(b) > EXACT:
        if np.ptp([*a, *b]) <= TIE:
            return 1.0
        rounded = np.round(np.concatenate([a, b]), 9)
        return stats.mannwhitneyu(rounded[: len(a)], rounded[len(a) :], method="asymptotic").pvalue
    of = np.rint(2 * ranks(np.concatenate([a, b]))).astype(int)
    ways = [np.zeros(of.sum() + 1) for _ in range(len(a) + 1)]
    ways[0][0] = 1.0
    for rank in of:
        for chosen in range(len(a), 0, -1):
            ways[chosen][rank:] += ways[chosen - 1][: len(ways[0]) - rank]
    ways = ways[len(a)] / ways[len(a)].sum()
    return tails(ways, of[: len(a)].sum())


def holm(p):
    p, corrected, highest = np.asarray(p), np.empty(len(p)), 0.0
    for place, i in enumerate(np.argsort(p, kind="stable")):
        highest = max(highest, min(1.0, (len(p) - place) * p[i]))
        corrected[i] = highest
    return corrected


def ends_of_avoidance(row, steps):
    """First and last step of avoidance, penalised where there is none."""
    at = np.flatnonzero(row)
    return (at[0], at[-1]) if len(at) else (steps, -1)


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
        steps = self.truth.shape[1]
        ends = lambda rows: np.array([ends_of_avoidance(row, steps)[place] for row in rows])  # noqa: E731
        return np.abs(ends(self.truth) - ends(self.predicted)).astype(float)

    def balanced(self):
        present = np.unique(self.truth)
        return 100 * np.mean([(self.predicted[self.truth == of] == of).mean() for of in present])


def calibration(cells):
    """Log loss, Brier score and calibration error of all rows together."""
    p = np.concatenate([cell.p for cell in cells])
    truth = np.concatenate([cell.truth.ravel() for cell in cells])
    is_true = np.array([truth == of for of in cells[0].classes]).T
    log_loss = -np.log(np.maximum((p * is_true).sum(axis=1), 1e-15)).mean()
    brier = ((p - is_true) ** 2).sum(axis=1).mean()
    top, place = p.max(axis=1), p.argmax(axis=1)
    right = is_true[np.arange(len(p)), place]
    bins = np.clip(np.ceil(top * 10), 1, 10)
    error = sum(abs(top[bins == of].sum() - right[bins == of].sum()) for of in range(1, 11)) / len(p)
    return log_loss, brier, error


def close(found, expected, what):
    """Equal to 1e-9; none only where none is expected."""
    if expected is None or found is None:
        assert found is None and expected is None, what
        return
    assert np.allclose(np.asarray(found, float), np.asarray(expected, float), rtol=1e-9, atol=1e-9), (what, found, expected)


def gains_are(told, first, second, what):
    """A paired comparison is what the two lists say, and does not contradict itself."""
    paired, mine = told["paired"], signed_rank(np.asarray(first) - np.asarray(second))
    close(paired["gains"], np.asarray(first) - np.asarray(second), what)
    close(paired["mean"], np.mean(first) - np.mean(second), what)
    assert paired["p"] == pytest.approx(mine["p"], rel=1e-9, abs=0), what
    close(paired["rank_biserial"], mine["r"], what)
    close(paired["typical"], mine["typical"], what)
    close(paired["interval"], mine["interval"], what)
    assert paired["differing"] == mine["differing"], what
    assert paired["better"] == int((np.asarray(first) - np.asarray(second) > TIE).sum()), what
    direction = lambda p: "open" if p >= LEVEL else "better" if mine["r"] > 0 else "worse"  # noqa: E731
    assert (told["before"], told["after"]) == (direction(paired["p"]), direction(told["holm"])), what
    if paired["interval"]:
        low, high = paired["interval"]
        assert low <= paired["typical"] <= high and (low <= 0 <= high) == (paired["p"] >= LEVEL), what
    return paired["p"]


@pytest.mark.parametrize("made", [ties, one_class, two_people, many, copied_trials, identical_people], ids=lambda of: of.__name__)
def test_every_number_of_the_report(made, tmp_path, rng):
    people = made(tmp_path, rng)
    trials, out, settings = written(tmp_path, people), tmp_path / "out", tmp_path / "settings.json"
    settings.write_text(json.dumps({"grids": GRIDS, "paper_only": True}))
    steps = len(people[0][0].rates)
    sidestep("analyze", "--trials", trials, "--trial-steps", steps, "--settings", settings, "--out", out)
    numbers = json.loads((out / "numbers.json").read_text())
    rows = defaultdict(list)
    with open(out / "predictions.csv") as file:
        for row in csv.DictReader(file):
            rows[row["model"], int(row["experiment"]), row["features"], int(row["participant"])].append(row)
    cells = {key: Cell(of, steps) for key, of in rows.items()}
    names = sorted({key[3] for key in cells})
    # Who shows one class only in the tasks that train is left out, since no model can be fitted to it.
    tasks = len(people[0])
    training = tasks - len(cells["lr", 1, "hrd", names[0]].trials)
    assert names == [name for name, of in enumerate(people) if len({rate for trial in of[:training] for rate in trial.rates}) > 1]

    # The predictions are of the last fifth of the tasks, and their truth is what was driven.
    tested = cells["lr", 1, "hrd", names[0]].trials
    assert tested == list(range(tasks - len(tested), tasks)) and tasks // 5 <= len(tested) <= -(-tasks // 5)
    for name in names:
        cell = cells["lr", 1, "hrd", name]
        assert cell.trials == tested
        assert (cell.truth == np.sign([people[name][task].rates for task in tested])).all()

    of_person = lambda model, experiment, of, value: np.array([value(cells[model, experiment, of, name]) for name in names])  # noqa: E731
    accuracy = lambda model, experiment, of: of_person(model, experiment, of, lambda cell: cell.by_trial("accuracy").mean())  # noqa: E731

    # Tests of the paper, with the corrections of each metric.
    compared = 0
    for metric in ["accuracy", "D_start", "D_end"]:
        told = [test for test in numbers["tests"] if test["gain"]["metric"] == metric]
        mine = defaultdict(list)
        for test in told:
            model, experiment = test["gain"]["model"], test["gain"]["experiment"]
            lists = [[cells[model, experiment, of, name].by_trial(metric) for name in names] for of in (test["first"], test["second"])]
            means = [np.array([each.mean() for each in of]) for of in lists]
            better, worse = means if metric == "accuracy" else means[::-1]
            what = (made.__name__, model, experiment, metric, test["first"], test["second"])
            mine["paired"].append(gains_are(test["gain"], better, worse, what))
            for unit, pair in [("persons", means), ("trajectories", [np.concatenate(of) for of in lists])]:
                p = mann_whitney(*pair)
                close(test[f"mann_whitney_{unit}"], p, what + (unit,))
                mine[unit].append(p)
            compared += 1
        close([test["gain"]["holm"] for test in told], holm(mine["paired"]), metric)
        for unit in ["persons", "trajectories"]:
            close([test[f"mann_whitney_{unit}_holm"] for test in told], holm(mine[unit]), (metric, unit))
        assert [(test["first"], test["second"]) for test in told][: len(PAIRS)] == PAIRS
    assert compared == 6 * 8 + 3 * 8 * 2

    # The families beside the paper's.
    commonest = {}
    for experiment in (1, 2):
        per_person = []
        for name in names:
            train = np.sign(np.concatenate([people[name][task].rates for task in range(tasks - len(tested))]))
            test = np.sign(np.concatenate([people[name][task].rates for task in tested]))
            if experiment == 2:
                train, test = train != 0, test != 0
            values, counts = np.unique(train, return_counts=True)
            per_person.append(100 * (test == values[counts.argmax()]).mean())
        commonest[experiment] = np.array(per_person)
    for family in numbers["beside"]:
        found = []
        for gain in family["gains"]:
            experiment = gain["experiment"]
            second = commonest[experiment] if family["second"] == "none" else accuracy(gain["model"], experiment, family["second"])
            what = (made.__name__, gain["model"], experiment, family["first"], family["second"])
            found.append(gains_are(gain, accuracy(gain["model"], experiment, family["first"]), second, what))
        close([gain["holm"] for gain in family["gains"]], holm(found), family["first"])

    # Calibration of all rows together, and the ablation.
    for told in numbers["calibration"]:
        if told["model"] is None:
            continue
        experiment = told["experiment"]
        mine = calibration([cells[told["model"], experiment, told["features"], name] for name in names])
        close([told["of"][key] for key in ("log_loss", "brier", "calibration_error")], mine, (made.__name__, told["model"], told["features"]))
    for told in numbers["ablations"]:
        if told["model"] is None:
            continue
        experiment = told["experiment"]
        own = accuracy(told["model"], experiment, told["features"])
        close(told["accuracy"], own.mean(), told)
        close(told["balanced"], of_person(told["model"], experiment, told["features"], Cell.balanced).mean(), told)
        if told["over_d"]:
            base = accuracy(told["model"], experiment, "d")
            close(told["over_d"], [own.mean() - base.mean(), signed_rank(own - base)["p"]], told)

    # The tables of the paper, as they are printed.
    with open(out / "table1.csv") as file:
        for row in csv.DictReader(file):
            for of in ["hrd", "hr", "hd", "rd", "h", "r", "d"]:
                mine = accuracy(row["model"], int(row["experiment"]), of).mean()
                assert abs(float(row[of]) - mine) <= 0.5e-4 * (1 + 1e-9), (row, of, mine)
    with open(out / "table2.csv") as file:
        for row in csv.DictReader(file):
            for of in ["hrd", "hr", "hd", "rd", "h", "r", "d"]:
                own = [cells[row["model"], 2, of, name] for name in names]
                distance = np.concatenate([cell.by_trial(row["metric"]) for cell in own])
                both = np.concatenate([(cell.truth.any(axis=1) & cell.predicted.any(axis=1)) for cell in own])
                mine = {"penalised": distance.mean(), "n": both.sum(), "both": distance[both].mean() if both.any() else None}[row["convention"]]
                assert (row[of] == "") == (mine is None), (row, of)
                assert mine is None or abs(float(row[of]) - mine) <= 0.5e-4 * (1 + 1e-9), (row, of, mine)

    # Roll-outs: every time ahead is judged on the same steps, so who always drives straight on is right equally often.
    straight = next(of for of in numbers["rollouts"] if of["driver"] == "straight")["horizons"]
    targets = np.concatenate([people[name][task].rates[len(straight) - 1 :] for name in names for task in tested])
    assert {of["windows"] for of in straight} == {len(targets)}
    assert {of["right"] for of in straight} == {int((targets == 0).sum())}
    held = next(of for of in numbers["rollouts"] if of["driver"] == "held_input")["horizons"]
    for ahead, of in enumerate(held, 1):
        right = 0
        for name, task in itertools.product(names, tested):
            rates = [0.0, *people[name][task].rates]
            right += sum(rates[target + 1] == rates[target + 1 - ahead] for target in range(len(held) - 1, len(rates) - 1))
        assert of["right"] == right, (made.__name__, ahead)
