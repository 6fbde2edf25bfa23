"""Algorithm 1, against a plain implementation in Python."""

import numpy as np
import pytest
from conftest import constant, driven

import sidestep

ACTIONS = np.array([-0.5, 0.0, 0.5])


def likely(history):
    """A model with memory: it uses the human's last turn and the robot's bearing."""
    human, robot = history[-1]
    bearing = np.arctan2(robot[1] - human[1], robot[0] - human[0]) - human[2]
    turned = 0.0 if len(history) < 2 else history[-1, 0, 2] - history[-2, 0, 2]
    scores = np.exp([np.sin(bearing), 0.3, 5 * turned - np.sin(2 * bearing)])
    return scores / scores.sum()


def plain_bounds(history, model, epsilon, k, rollout):
    """The paper's Algorithm 1, line by line."""
    low = high = np.asarray(history, dtype=float)
    lo, hi = np.empty((2, len(epsilon), len(k)))
    for i, count in enumerate(k):
        chosen = []
        for states in (low, high):
            p = np.asarray(model(states))
            chosen.extend(ACTIONS[p >= np.sort(p)[-count]])
        least, most = min(chosen), max(chosen)
        for j, e in enumerate(epsilon):
            lo[j, i], hi[j, i] = max(least - e, -0.5), min(most + e, 0.5)
        first = epsilon[0] if rollout == "paper" else 0.0
        ends = max(least - first, -0.5), min(most + first, 0.5)
        low, high = (
            np.concatenate([states, [[driven(states[-1, 0], [rate])[-1], driven(states[-1, 1], [0.0])[-1]]]])
            for states, rate in zip((low, high), ends, strict=True)
        )
    return lo, hi


@pytest.mark.parametrize("rollout", ["base", "paper"])
def test_it_is_the_plain_algorithm(rng, rollout):
    model = sidestep.ActionModel(ACTIONS, likely)
    for _ in range(40):
        start = rng.uniform([-5, -5, -2], [5, 5, 2], (2, 3))
        before = rng.choice(ACTIONS, 4)
        history = np.stack([driven(start[0], before), driven(start[1], np.zeros(4))], axis=1)
        epsilon, k = np.sort(rng.uniform(0, 0.6, 3)), rng.integers(1, 4, 8).tolist()
        expected = plain_bounds(history, likely, epsilon, k, rollout)
        found = sidestep.bounds(history, model, epsilon, k, rollout=rollout)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_trained_model_and_a_function_agree(people):
    history = people[0][0].states[:10]
    given = [0.5, 0.3, 0.2]
    own = sidestep.ActionModel(ACTIONS, lambda history: given)
    for choice in ({"k": [2, 2, 1, 1]}, {"tau": 0.25, "steps": 4}):
        trained = sidestep.bounds(history, constant(given), [0, 0.2], **choice)
        np.testing.assert_array_equal(trained, sidestep.bounds(history, own, [0, 0.2], **choice))
        assert trained[0].shape == (2, 4)


def below(edges, masses, rate, with_rate):
    """The probability of turn rates below a rate, and of this rate itself if it is to count."""
    total = 0.0
    for from_, to, mass in zip(edges, edges[1:], masses):
        if to > from_:
            total += mass * np.clip((rate - from_) / (to - from_), 0, 1)
        elif from_ < rate or (with_rate and from_ == rate):
            total += mass
    return total


def least_length(edges, masses, q):
    """The length of the shortest interval with probability q, tried on a fine grid of both ends."""
    grid = np.linspace(-0.5, 0.5, 1001)
    upper, lower = (np.array([below(edges, masses, rate, with_it) for rate in grid]) for with_it in (True, False))
    lengths = [grid[np.argmax(upper - least >= q - 1e-9)] - rate for rate, least in zip(grid, lower) if upper[-1] - least >= q - 1e-9]
    return min(lengths)


def test_a_model_of_a_range_of_turn_rates(rng):
    now = [[[0, 0, 0], [12, 0, 3]]]
    for _ in range(12):
        inner = np.round(np.sort(rng.uniform(-0.5, 0.5, 3)), 3)
        edges = [-0.5, -0.5, *inner, 0.5, 0.5]
        masses = rng.dirichlet(np.ones(len(edges) - 1))
        model = sidestep.ActionModel(edges, lambda history, masses=masses: masses, bins=True)
        q = rng.uniform(0.3, 1, 4)
        lo, hi = sidestep.bounds(now, model, [0.0, 1.0], q=q)
        for step, each in enumerate(q):
            from_, to = lo[0, step], hi[0, step]
            probability = below(edges, masses, to + 1e-9, True) - below(edges, masses, from_ - 1e-9, False)
            length = least_length(edges, masses, each)
            assert probability >= each - 1e-6 and to - from_ >= length - 2.1e-3
            # It is longer only if it surrounds several equally short intervals, as within a bin.
            for a, b in ((from_, from_ + length), (to - length, to)):
                assert below(edges, masses, b + 1e-9, True) - below(edges, masses, a - 1e-9, False) >= each - 1e-6
        np.testing.assert_array_equal([lo[1], hi[1]], [[-0.5] * 4, [0.5] * 4])
    # Predicted sets take the same model and q.
    settings = sidestep.ShfrsSettings([0.0, 1.0], q=[0.9, 0.6, 0.6])
    assert (settings.q, settings.k, settings.tau, settings.steps) == ([0.9, 0.6, 0.6], None, None, 3)
    prediction = sidestep.ShfrsPredictor(model, settings).predict(now)
    assert 0 < prediction.areas_m2[0] < prediction.areas_m2[1]
    for wrong, said in (
        (lambda: sidestep.bounds(now, model, [0.0], [1]), "settings: expected q, because the model has bins of turn rates"),
        (lambda: sidestep.ActionModel([0.1, 0.0], len, bins=True), r"actions\[1\]: expected 0.1 rad/s or more"),
        (lambda: sidestep.ActionModel([0.1], len, bins=True), "actions: expected at least two edges of bins, found one"),
        (lambda: sidestep.ActionModel([], len), "actions: expected at least one action, found none"),
        (lambda: sidestep.ShfrsSettings([0.0], q=[0.0]), r"q\[0\]: expected a number in \(0, 1\], found 0"),
        (lambda: sidestep.ShfrsSettings([0.0], [1], q=[0.5]), "q: expected none beside k"),
        (lambda: sidestep.ShfrsSettings([0.0], q=[0.5], steps=2), "steps: expected 1 as q has, or None, found 2"),
    ):
        with pytest.raises(ValueError, match=said):
            wrong()


def test_the_function_sees_every_state(people):
    history, seen = people[0][0].states[:6], []

    def model(states):
        seen.append(states.copy())
        return [0.2, 0.6, 0.2]

    sidestep.bounds(history, sidestep.ActionModel(ACTIONS, model), [0.0], [1, 1, 1])
    assert [len(states) for states in seen] == [6, 7, 8]
    np.testing.assert_array_equal(seen[0], history)


def test_what_the_function_raises_is_raised(people):
    history = people[0][0].states[:3]

    def broken(states):
        raise LookupError("no such thing")

    with pytest.raises(LookupError, match="no such thing"):
        sidestep.bounds(history, sidestep.ActionModel(ACTIONS, broken), [0.0], [1])
    for answer, complaint in (
        ([0.5, 0.5], "probabilities: expected 3 numbers, one for each action, found 2"),
        ([0.5, np.nan, 0.5], r"probabilities\[1\]: expected a finite number, found NaN"),
        ([0.5, 0.5, 0.5], "probabilities of step 0: expected numbers that sum to 1, found 1.5"),
        ([2, -1, 0], r"probabilities\[1\] of step 0: expected a finite number ≥ 0, found -1"),
        (None, "probabilities: expected an array of float64"),
    ):
        with pytest.raises(ValueError, match=complaint):
            model = sidestep.ActionModel(ACTIONS, lambda states, answer=answer: answer)
            sidestep.bounds(history, model, [0.0], [1])
