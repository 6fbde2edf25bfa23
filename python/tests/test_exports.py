"""Exports and solved grids, as the program writes them."""

import hashlib
import json
import os
import subprocess

import numpy as np
import pandas
import polars
import pytest

import sidestep
from sidestep import exports

FORMATS = ("csv", "parquet", "psych-ds")


@pytest.fixture(scope="session")
def program():
    """Runs the program `sidestep`, which the test command builds and names."""
    binary = os.environ.get("SIDESTEP_BIN")
    if binary is None:
        pytest.skip("SIDESTEP_BIN: run the tests with `cargo xtask test`")

    def run(*arguments):
        subprocess.run([binary, *map(str, arguments)], check=True, capture_output=True)

    return run


@pytest.fixture(scope="session")
def exported(program, tmp_path_factory):
    """Exports of three synthetic participants of ten trials, in each format."""
    folder = tmp_path_factory.mktemp("exports")
    database = f"sqlite:{folder / 'study.db'}"
    program("simulate", "--participants", 3, "--tasks", 10, "--seed", 7, "--out", folder / "trials.csv")
    program("import", "--database", database, "--study", "walk", "--trials", folder / "trials.csv")
    for name in FORMATS:
        program("export", "--database", database, "--study", "walk", "--format", name, "--out", folder / name)
    return folder


@pytest.mark.parametrize("name", FORMATS)
def test_tables_of_an_export(exported, name):
    for library, frame in (("pandas", pandas.DataFrame), ("polars", polars.DataFrame)):
        trials = exports.table(exported / name, "trials", library)
        steps = exports.table(str(exported / name), "steps", library)
        assert isinstance(trials, frame) and (len(trials), len(steps)) == (30, 1500)
        assert sorted(set(trials["participant"])) == [1, 2, 3]
    with pytest.raises(ValueError, match=r"name: expected a table of \[.*found prices"):
        exports.table(exported / name, "prices")
    with pytest.raises(ValueError, match="library: expected pandas or polars, found R"):
        exports.table(exported / name, "trials", "R")


@pytest.mark.parametrize("name", FORMATS)
def test_trajectories_of_an_export_are_what_was_driven(exported, name):
    drives = exports.trajectories(exported / name)
    assert [(drive.participant, drive.trial) for drive in drives] == [(p, t) for p in (1, 2, 3) for t in range(10)]
    # The states before each step are in the file that was imported, with as many digits.
    driven = pandas.read_csv(exported / "trials.csv")
    poses = driven[["hx", "hy", "hpsi", "rx", "ry", "rpsi"]].to_numpy().reshape(30, 50, 2, 3)
    trajectories = [drive.trajectory for drive in drives]
    np.testing.assert_array_equal([trajectory.states[:-1] for trajectory in trajectories], poses)
    turn_rates = driven["omega"].to_numpy().reshape(30, 50)
    np.testing.assert_array_equal([trajectory.turn_rates for trajectory in trajectories], turn_rates)
    # The last state follows from the one before.
    robot = trajectories[0].states[-2:, 1]
    along = 0.4 * np.array([np.cos(robot[0, 2]), np.sin(robot[0, 2])])
    np.testing.assert_allclose(robot[1, :2] - robot[0, :2], along, atol=1e-5)
    assert exports.trajectories(exported / name, phase="practice") == []


def test_what_is_not_whole_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"folder: expected a complete export with a manifest\.json"):
        exports.table(tmp_path, "steps")
    (tmp_path / "steps.csv").write_text("participant,trial\n1,0\n")
    digest = hashlib.sha256((tmp_path / "steps.csv").read_bytes()).hexdigest()
    manifest = {"files": [{"name": "steps.csv", "sha256": digest}]}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    assert exports.table(tmp_path, "steps")["participant"].tolist() == [1]
    (tmp_path / "steps.csv").write_text("participant,trial\n")
    with pytest.raises(ValueError, match=r"steps\.csv: expected the content that the manifest names"):
        exports.table(tmp_path, "steps")


def test_nodes_of_a_solved_grid(program, unequal, tmp_path, rng):
    path = tmp_path / "function.npz"
    pairs = {"evader": unequal.evader, "pursuer": unequal.pursuer}
    speeds = [[f"--{who}-speed", car.speed_mps, f"--{who}-turn-rate", car.turn_rate_radps] for who, car in pairs.items()]
    program("solve", *sum(speeds, []), "--radius", unequal.radius_m, "--accuracy", "draft", "--out", path)
    found = exports.nodes(path)
    assert found.value.shape == tuple(len(axis) for axis in found.axes) and found.meta["method"] == "polar"
    i, j, k = (rng.integers(0, n, 200) for n in found.value.shape)
    ranges, bearings, psi = found.axes[0][i], found.axes[1][j], found.axes[2][k]
    states = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), psi], axis=-1)
    solved = sidestep.solve(unequal, accuracy="draft")
    np.testing.assert_allclose(solved.value(states), found.value[i, j, k], atol=2e-3)
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **{**arrays, "value": arrays["value"].ravel()})
    with pytest.raises(ValueError, match=r"path: expected an archive of `sidestep solve`.*value of shape"):
        exports.nodes(path)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ValueError, match="path: expected an archive of `sidestep solve`"):
        exports.nodes(path)


def test_what_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "one.npy"
    np.save(path, np.zeros(3))
    with pytest.raises(ValueError, match="path: expected an archive of `sidestep solve`.*one array"):
        exports.nodes(path)
    # A number would be an open file, such as this process's output.
    with pytest.raises(TypeError):
        exports.nodes(1)
    os.fstat(1)
    for text in (b"{}", b"[]", b"\xff\xfe", b'{"files": [{"name": 3}]}'):
        (tmp_path / "manifest.json").write_bytes(text)
        with pytest.raises(ValueError, match=r"folder: expected a manifest\.json that lists files with their sha256"):
            exports.table(tmp_path, "steps")
