"""Exports and solved grids that the program wrote."""

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
    # The imported file has the states before each step, with the same number of digits.
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


def whole(folder, **files):
    """A folder with these files, by name without extension, and their manifest."""
    listed = []
    for name, content in files.items():
        file = name.replace("_", ".")
        (folder / file).write_bytes(content)
        listed.append({"name": file, "sha256": hashlib.sha256(content).hexdigest()})
    (folder / "manifest.json").write_text(json.dumps({"files": listed}))
    return folder


def test_files_that_cannot_be_read_are_refused_by_name(tmp_path):
    whole(tmp_path, steps_csv=b"", trials_parquet=b"PAR1 and no more PAR1")
    for library in ("pandas", "polars"):
        with pytest.raises(ValueError, match=r"steps\.csv: expected a table as CSV, found content that"):
            exports.table(tmp_path, "steps", library)
        with pytest.raises(ValueError, match=r"trials\.parquet: expected a table as Parquet, found content that"):
            exports.table(tmp_path, "trials", library)
    (tmp_path / "steps.csv").unlink()
    with pytest.raises(ValueError, match=r"folder: expected steps\.csv, which .*manifest\.json lists, found no such"):
        exports.table(tmp_path, "steps")
    with pytest.raises(TypeError, match="name: expected the name of a table, found None"):
        exports.table(tmp_path, None)
    for text in ('{"files": [{"name": 3, "sha256": "0"}]}', "[" * 100_000):
        (tmp_path / "manifest.json").write_text(text)
        with pytest.raises(ValueError, match=r"folder: expected a manifest\.json that lists files with their sha256"):
            exports.table(tmp_path, "steps")


def test_tables_that_do_not_fit_each_other_are_refused(tmp_path):
    poses = {pose: [0.0, 1.0] for pose in ("hx", "hy", "hpsi", "rx", "ry", "rpsi")}
    ends = {f"end_{pose}": column for pose, column in poses.items()}
    trials = {"participant": [1, 1], "trial": [0, 1], "trial_id": ["a", "b"], "phase": ["task", "practice"], **ends}
    steps = {"trial_id": ["b", "a"], "step": [0, 0], "omega": [0.1, 0.2], **poses}

    def written(trials, steps):
        tables = {"trials_csv": trials, "steps_csv": steps}
        texts = {name: pandas.DataFrame(of).to_csv(index=False).encode() for name, of in tables.items()}
        return whole(tmp_path, **texts)

    def without(table, column):
        return {name: values for name, values in table.items() if name != column}

    (drive,) = exports.trajectories(written(trials, steps))
    assert (drive.participant, drive.trial, drive.trajectory.turn_rates.tolist()) == (1, 0, [0.2])
    assert len(exports.trajectories(tmp_path, phase=None)) == 2
    assert exports.trajectories(tmp_path, phase="familiarisation") == []
    for phase in ("nonsense", 3):
        with pytest.raises(ValueError, match="phase: expected one of familiarisation, practice, task, or None"):
            exports.trajectories(tmp_path, phase=phase)
    for column in ("phase", "trial_id", "end_rx"):
        with pytest.raises(ValueError, match=rf"trials: expected a column {column}, found \['participant'"):
            exports.trajectories(written(without(trials, column), steps))
    for column in ("omega", "trial_id", "rx"):
        with pytest.raises(ValueError, match=rf"steps: expected a column {column}, found \["):
            exports.trajectories(written(trials, without(steps, column)))
    with pytest.raises(ValueError, match="steps: expected steps of the trial a, found none"):
        exports.trajectories(written(trials, {**steps, "trial_id": ["b", "b"]}))


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


def test_damaged_archives_are_refused_by_name(tmp_path, rng):
    path = tmp_path / "damaged.npz"
    axes = {f"axis{i}": np.linspace(0, 1, n) for i, n in enumerate((3, 4, 5))}
    meta = np.frombuffer(b'{"method": "polar"}', dtype=np.uint8)
    np.savez_compressed(path, **axes, value=np.ones((3, 4, 5), np.float32), meta=meta)
    assert exports.nodes(path).meta == {"method": "polar"}
    sound, refused = path.read_bytes(), 0
    for _ in range(500):
        damaged = bytearray(sound)
        damaged[rng.integers(len(sound))] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            found = exports.nodes(path)
        except ValueError as error:
            assert str(error).startswith(f"path: expected an archive of `sidestep solve`, found {path}")
            refused += 1
        else:
            # A byte that is irrelevant to the arrays, for example of a time.
            assert found.value.shape == (3, 4, 5)
    assert refused > 250
    np.savez(path, **axes, value=np.ones((3, 4, 5), np.float32), meta=np.frombuffer(b"[1]", dtype=np.uint8))
    with pytest.raises(ValueError, match="path: expected an archive of `sidestep solve`.*meta that is not an object"):
        exports.nodes(path)
    with pytest.raises(FileNotFoundError, match="absent"):
        exports.nodes(tmp_path / "absent.npz")


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
