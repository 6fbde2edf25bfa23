"""Shared fixtures and helpers."""

import os
import signal
import threading

import matplotlib
import numpy as np
import pytest

import sidestep

matplotlib.use("Agg")


@pytest.fixture
def ctrl_c():
    """Sends Ctrl-C to this process after some seconds, also if it runs in the background, where it would be ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield lambda seconds: threading.Timer(seconds, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def rng():
    """Random numbers, the same in every run."""
    return np.random.default_rng(2019)


@pytest.fixture(scope="session")
def paper():
    """The paper's game: two vehicles of 2 m/s and 0.5 rad/s, radius 3 m."""
    car = sidestep.VehicleModel(2.0, 0.5)
    return sidestep.PursuitGame(car, car, 3.0)


@pytest.fixture(scope="session")
def unequal():
    """A game without a closed form."""
    return sidestep.PursuitGame(sidestep.VehicleModel(2.0, 0.5), sidestep.VehicleModel(1.5, 0.8), 3.0)


@pytest.fixture(scope="session")
def unequal_scene(unequal):
    """Its vehicles as human and robot, with the safety levels of both."""
    parameters = sidestep.SceneParameters(human=unequal.evader, robot=unequal.pursuer)
    return parameters, sidestep.SafetyLevels(parameters)


@pytest.fixture(scope="session")
def people():
    """Trials of three synthetic participants."""
    return sidestep.simulate(3, 12, seed=4)


def constant(probabilities):
    """A predictor with these constant probabilities of right, straight and left."""
    text = '{"format":"sidestep-predictor/1","kind":"constant","features":[],"classes":[-1,0,1],"probabilities":%s}'
    return sidestep.Predictor.from_json(text % list(probabilities))


def driven(start, turn_rates, speed_mps=2.0, step_s=0.2):
    """The poses of a Dubins car before each step and after the last, integrated by its exact arcs."""
    poses = [np.asarray(start, dtype=float)]
    for rate in turn_rates:
        x, y, psi = poses[-1]
        half = 0.5 * rate * step_s
        chord = speed_mps * step_s * np.sinc(half / np.pi)
        after = [x + chord * np.cos(psi + half), y + chord * np.sin(psi + half), psi + rate * step_s]
        poses.append(np.array(after))
    return np.array(poses)
