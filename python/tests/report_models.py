"""The models of an analysis, read according to docs/predictor.md, and computations with them.

No code is shared with the server, but safety levels are those of `sidestep features`.
"""

import csv
import json
from collections import defaultdict

import numpy as np
from conftest import driven
from scipy.special import expit

from report_data import RATE, SPEED_MPS, STEP_S, sidestep, table


class Model:
    """A model from a file of `models/`, for rows of features."""

    def __init__(self, path):
        self.file = json.loads(path.read_text())
        self.features, self.classes = self.file["features"], np.array(self.file["classes"])
        self.pairs = [(a, b) for a in range(len(self.classes)) for b in range(a + 1, len(self.classes))]

    def standardised(self, rows):
        return (rows - np.array(self.file["mean"])) / np.array(self.file["scale"])

    def decisions(self, rows):
        """The decision value of an SVM for each row and pair of classes."""
        z = self.standardised(rows)
        if self.file["kernel"] == "linear":
            return z @ np.array(self.file["coefficients"]).T + self.file["intercepts"]
        vectors = np.array(self.file["support_vectors"])
        squares = ((z[:, None, :] - vectors) ** 2).sum(axis=2)
        return np.exp(-self.file["gamma"] * squares) @ np.array(self.file["dual_coefficients"]).T + self.file["intercepts"]

    def coupled(self, decisions):
        """Pairwise coupling: the P with a sum of 1 that minimises the squared residuals of the pairs."""
        a, b = np.array(self.file["sigmoids"]).T
        r = np.clip(expit(-a * decisions - b), 1e-7, 1 - 1e-7)
        count = len(self.classes)
        if count == 2:
            return np.column_stack([r, 1 - r])
        # A multiplier for the sum makes the conditions a linear system.
        system = np.zeros((len(r), count + 1, count + 1))
        for (c, d), of in zip(self.pairs, r.T, strict=True):
            system[:, c, c] += (1 - of) ** 2
            system[:, d, d] += of**2
            system[:, c, d] = system[:, d, c] = -of * (1 - of)
        system[:, count, :count] = system[:, :count, count] = 1
        return np.linalg.solve(system, np.eye(count + 1)[:, -1:])[:, :count, 0]

    def leaf(self, row):
        tree, node = self.file["tree"], 0
        while tree["left"][node]:
            side = "left" if row[tree["feature"][node]] <= tree["threshold"][node] else "right"
            node = tree[side][node]
        return tree["counts"][node]

    def probabilities(self, rows):
        """The probability of each class, row by row."""
        if self.file["kind"] == "tree":
            counts = np.array([self.leaf(row) for row in rows]) + 1
            return counts / counts.sum(axis=1, keepdims=True)
        if self.file["kind"] == "svm":
            return self.coupled(self.decisions(rows))
        scores = self.standardised(rows) @ np.array(self.file["coefficients"]).T + self.file["intercepts"]
        scores = np.exp(scores - scores.max(axis=1, keepdims=True))
        return scores / scores.sum(axis=1, keepdims=True)

    def predicted(self, rows):
        """The predicted class: for an SVM the one with the most votes of pairs, otherwise the likeliest."""
        if self.file["kind"] != "svm":
            return self.classes[self.probabilities(rows).argmax(axis=1)]
        votes = np.zeros((len(rows), len(self.classes)), int)
        for (a, b), f in zip(self.pairs, self.decisions(rows).T, strict=True):
            votes[np.arange(len(rows)), np.where(f > 0, a, b)] += 1
        return self.classes[votes.argmax(axis=1)]


def features(folder, every):
    """Every feature of the states of several predictions, computed by the program as trials of one step."""
    with open(folder / "states.csv", "w", newline="") as file:
        out = csv.writer(file)
        out.writerow("participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega".split(","))
        for name, of in enumerate(every):
            for trial, poses in enumerate(np.hstack([wrapped(of.human), wrapped(of.robot)])):
                out.writerow([name, trial, 0, 0, *map(repr, poses.tolist()), 0])
    sidestep("features", "--trials", folder / "states.csv", "--trial-steps", 1, "--out", folder / "features.csv")
    yield from by_person(folder / "features.csv").values()


def by_person(path):
    """The columns of a file of features for each person, in the order of the file."""
    rows = defaultdict(list)
    for row in table(path):
        rows[int(row["participant"])].append(row)
    return {name: {key: np.array([float(row[key]) for row in of]) for key in of[0]} for name, of in rows.items()}


def wrapped(poses):
    """Poses with headings wrapped to -pi to pi."""
    return np.column_stack([poses[:, :2], np.arctan2(np.sin(poses[:, 2]), np.cos(poses[:, 2]))])


def of_names(columns, names):
    return np.column_stack([columns[name] for name in names])


class Ahead:
    """Predictions up to `horizon` steps ahead, from every step of some trials of one person."""

    def __init__(self, trials, driver, horizon):
        steps = len(trials[0].rates)
        begins = [(trial, begin) for trial in range(len(trials)) for begin in range(steps)]
        self.trial, self.begin = np.array(begins).T
        self.driven = np.array([driven(trial.start, trial.rates) for trial in trials])
        self.rates = np.array([trial.rates for trial in trials])
        self.human = self.driven[self.trial, self.begin]
        self.robot = np.array([trial.robot for trial in trials])[self.trial, self.begin]
        before = np.hstack([np.zeros((len(trials), 1)), self.rates])
        self.held, self.driver, self.horizon, self.of = before[self.trial, self.begin], driver, horizon, []

    def expected(self, columns):
        """The driver's next turn rate, and the probability of each turn rate -RATE, 0 and RATE."""
        if not isinstance(self.driver, Model):
            rates = self.held if self.driver == "held_input" else np.zeros(len(self.human))
            return rates, np.where(rates[:, None] == [-RATE, 0, RATE], 0.9, 0.05)
        found = self.driver.probabilities(of_names(columns, self.driver.features))
        p = np.zeros((len(found), 3))
        p[:, self.driver.classes + 1] = found
        return RATE * self.driver.classes[found.argmax(axis=1)], p

    def step(self, columns, ahead):
        """Drives one step, and records windows, hits, log loss and distance at the targets of this step ahead."""
        rates, p = self.expected(columns)
        self.human, self.robot = on(self.human, rates), on(self.robot, np.zeros(len(rates)))
        target = self.begin + ahead
        at = (target >= self.horizon - 1) & (target < self.rates.shape[1])
        truth = self.rates[self.trial[at], target[at]]
        there = self.driven[self.trial[at], target[at] + 1]
        of_truth = p[at, np.rint(truth / RATE).astype(int) + 1]
        apart = np.hypot(*(self.human[at, :2] - there[:, :2]).T)
        self.of.append([at.sum(), (rates[at] == truth).sum(), -np.log(np.maximum(of_truth, 1e-15)).sum(), apart.sum()])
        self.held = rates


def on(pose, rate):
    """The poses after a step."""
    chord = SPEED_MPS * STEP_S * np.sinc(0.5 * rate * STEP_S / np.pi)
    middle = pose[:, 2] + 0.5 * rate * STEP_S
    return np.column_stack([pose[:, 0] + chord * np.cos(middle), pose[:, 1] + chord * np.sin(middle), pose[:, 2] + rate * STEP_S])


def rolled_out(report, drivers):
    """For each driver, by steps ahead: windows, hits, sums of log loss and of distance.

    A driver is a word for one without a model, or a model's name and feature set.
    """
    horizon = min(10, report.steps)
    every = []
    for driver in drivers:
        for name in report.names:
            trials = [report.people[name][task] for task in report.tested(name)]
            of = Model(report.model_file(driver[0], 1, driver[1], name)) if isinstance(driver, tuple) else driver
            every.append(Ahead(trials, of, horizon))
    learned = [of for of in every if isinstance(of.driver, Model)]
    for ahead in range(horizon):
        known = features(report.folder, learned) if learned else []
        for of in every:
            of.step(next(known) if of in learned else None, ahead)
    count = len(report.names)
    return {driver: sum(np.array(of.of) for of in every[i * count : (i + 1) * count]) for i, driver in enumerate(drivers)}


class Generator:
    """ChaCha with 8 rounds, seeded as the Rust crate rand_core does: the random order of the importance of features."""

    def __init__(self, seed):
        self.counter, self.words, key = 0, [], []
        for _ in range(8):
            seed = (seed * 6364136223846793005 + 11634580027462260723) % 2**64
            mixed, turn = ((seed >> 18 ^ seed) >> 27) % 2**32, seed >> 59
            key.append((mixed >> turn | mixed << (32 - turn)) % 2**32)
        self.start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *key]

    def block(self):
        start = [*self.start, self.counter % 2**32, self.counter >> 32, 0, 0]
        self.counter, x = self.counter + 1, list(start)
        rows = [(0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15)]
        diagonals = [(0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14)]
        for a, b, c, d in (rows + diagonals) * 4:
            for first, second, third, turn in [(a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)]:
                x[first] = (x[first] + x[second]) % 2**32
                mixed = x[third] ^ x[first]
                x[third] = (mixed << turn | mixed >> (32 - turn)) % 2**32
        return [(a + b) % 2**32 for a, b in zip(x, start, strict=True)]

    def below(self, n):
        """A number from 0 to n - 1."""
        self.words = self.words or self.block()
        low, high = self.words[:2]
        self.words = self.words[2:]
        return (high << 32 | low) * n >> 64

    def order(self, n):
        """A random order of 0 to n - 1, by Fisher and Yates."""
        found = list(range(n))
        for i in range(n - 1, 0, -1):
            j = self.below(i + 1)
            found[i], found[j] = found[j], found[i]
        return found
