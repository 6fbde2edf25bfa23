"""Tests, intervals and scores as docs/analysis.md defines them, with NumPy and SciPy: no code is shared with the server."""

import functools
import itertools

import numpy as np
import pytest
from scipy import stats

LEVEL, TIE, EXACT = 0.05, 1e-12, 60


def ranks(sizes):
    """Midranks; numbers that differ only by rounding are tied."""
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
    """The probability of each sum of positive ranks (index: twice the sum), by convolution."""
    ways = np.ones(1)
    for rank in of:
        one = np.zeros(int(round(2 * rank)) + 1)
        one[0] = one[-1] = 0.5
        ways = np.convolve(ways, one)
    return ways


def tails(ways, at):
    return min(1.0, 2 * min(ways[: at + 1].sum(), ways[at:].sum()))


def signed_rank(gains):
    """p, r, typical gain and interval of Wilcoxon's test, for the non-zero gains."""
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
    # A shift is kept if a count between the means above it and those at or above it is not rejected.
    kept = [
        at for at in np.unique(means)
        if any(p_of(w / 2) >= LEVEL for w in range(2 * int((means > at + TIE).sum()), 2 * int((means >= at - TIE).sum()) + 1))
    ] if n < 40 else None
    if kept is None:
        # W falls by one at each mean: the least doubled sum that is kept gives the number outside on either side.
        least = next(w for w in range(len(means) + 1) if p_of(w / 2) >= LEVEL)
        kept = [means[-(-least // 2) - 1], means[len(means) - -(-least // 2)]] if least else []
    never = p_of(0) >= LEVEL
    interval = None if never else [min(kept), max(kept)]
    if p < LEVEL and interval:
        side = max if positive > total / 2 else min
        typical, interval = side(typical, 0.0), [side(end, 0.0) for end in interval]
    return {"p": p, "r": 2 * positive / total - 1, "typical": typical, "interval": interval, "differing": n}


def mann_whitney(a, b):
    """The Mann–Whitney test: exact by counting, also with ties; SciPy's normal approximation for many numbers."""
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


@functools.cache
def power(people, family, draws=20_000, seed=8):
    """The probability that p · `family` is below the level, for normal gains with a mean of 0.8 deviations."""
    gains = 0.8 + np.random.default_rng(seed).standard_normal((draws, people))
    of = np.abs(gains).argsort(axis=1).argsort(axis=1) + 1
    ways = sign_ways(range(1, people + 1))[::2]
    below = np.minimum(1.0, 2 * np.minimum(ways.cumsum(), ways[::-1].cumsum()[::-1]))
    return (below[(of * (gains > 0)).sum(axis=1)] * family < LEVEL).mean()


def share(hits, of):
    """A share of tasks, and the interval of Clopper and Pearson for as many tasks as Kish's effective sample size."""
    hits, of = np.asarray(hits), np.asarray(of)
    value, n = hits.sum() / of.sum(), of.sum() ** 2 / (of**2).sum()
    low = stats.beta.ppf(0.025, value * n, n - value * n + 1) if value > 0 else 0.0
    high = stats.beta.ppf(0.975, value * n + 1, n - value * n) if value < 1 else 1.0
    return [value, low, high]


def mean_share(shares):
    """The mean of people's shares, and Student's interval with half a person of share 0 and half a person of share 1."""
    shares = np.asarray(shares)
    n, weights = len(shares), [1.0] * len(shares) + [0.5, 0.5]
    middle = np.average([*shares, 0, 1], weights=weights)
    variance = np.dot(weights, (np.array([*shares, 0, 1]) - middle) ** 2) / n
    half = stats.t.ppf(0.975, n) * np.sqrt(variance / (n + 1))
    return [shares.mean(), max(0.0, middle - half), min(1.0, middle + half)]


def calibration(classes, truth, p):
    """Log loss, Brier score and calibration error of probabilities, row by row."""
    is_true = np.array([truth == of for of in classes]).T
    log_loss = -np.log(np.maximum((p * is_true).sum(axis=1), 1e-15)).mean()
    brier = ((p - is_true) ** 2).sum(axis=1).mean()
    top, place = p.max(axis=1), p.argmax(axis=1)
    right = is_true[np.arange(len(p)), place]
    bins = np.clip(np.ceil(top * 10), 1, 10)
    error = sum(abs(top[bins == of].sum() - right[bins == of].sum()) for of in range(1, 11)) / len(p)
    return log_loss, brier, error


def balanced(truth, predicted):
    """The share of steps predicted right in each class that occurs, averaged over classes, in percent."""
    return 100 * np.mean([(predicted[truth == of] == of).mean() for of in np.unique(truth)])


def close(found, expected, what):
    """Equal to 1e-9; `None` only where `None` is expected."""
    if expected is None or found is None:
        assert found is None and expected is None, what
        return
    assert np.allclose(np.asarray(found, float), np.asarray(expected, float), rtol=1e-9, atol=1e-9), (what, found, expected)


def gains_are(told, first, second, what):
    """Checks a paired comparison against the two lists, and for consistency."""
    gains = np.asarray(first) - np.asarray(second)
    paired, mine = told["paired"], signed_rank(gains)
    close(paired["gains"], gains, what)
    close(paired["mean"], np.mean(first) - np.mean(second), what)
    assert paired["p"] == pytest.approx(mine["p"], rel=1e-9, abs=0), what
    close(paired["rank_biserial"], mine["r"], what)
    close(paired["typical"], mine["typical"], what)
    close(paired["interval"], mine["interval"], what)
    assert paired["differing"] == mine["differing"], what
    assert paired["better"] == int((gains > TIE).sum()), what
    assert paired["contrary"] == (mine["p"] < LEVEL and abs(gains.mean()) > TIE and gains.mean() * mine["r"] < 0), what
    direction = lambda p: "open" if p >= LEVEL else "better" if mine["r"] > 0 else "worse"  # noqa: E731
    assert (told["before"], told["after"]) == (direction(paired["p"]), direction(told["holm"])), what
    if paired["interval"]:
        low, high = paired["interval"]
        assert low <= paired["typical"] <= high and (low <= 0 <= high) == (paired["p"] >= LEVEL), what
    return paired["p"]
