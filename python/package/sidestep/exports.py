"""Reads files of `sidestep export` and `sidestep solve` as data frames, trajectories and arrays.

Tables are read with pandas or polars, figures of value functions with NumPy alone.
"""

from __future__ import annotations

import hashlib
import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from ._sidestep import Trajectory

if TYPE_CHECKING:
    import pandas
    import polars

__all__ = ["Drive", "Nodes", "nodes", "table", "trajectories"]

_PHASES = ("familiarisation", "practice", "task")
_POSES = ["hx", "hy", "hpsi", "rx", "ry", "rpsi"]


@overload
def table(folder: str | PathLike[str], name: str, library: Literal["pandas"] = "pandas") -> pandas.DataFrame: ...
@overload
def table(folder: str | PathLike[str], name: str, library: Literal["polars"]) -> polars.DataFrame: ...
def table(folder: str | PathLike[str], name: str, library: str = "pandas") -> Any:
    """A table of an export, as a data frame.

    Parameters
    ----------
    folder : path
        Output of `sidestep export --format csv`, `parquet` or `psych-ds`, or an unpacked archive of the laboratory.
    name : str
        `participants`, `trials`, `steps` or `key_events`; the data dictionary beside the tables explains their columns.
    library : {"pandas", "polars"}

    Returns
    -------
    pandas.DataFrame or polars.DataFrame

    Raises
    ------
    TypeError
        If the name is not a string.
    ValueError
        If the export is incomplete, does not match its manifest or has no such table, or if the file cannot be read.
    """
    if library not in ("pandas", "polars"):
        raise ValueError(f"library: expected pandas or polars, found {library}")
    if not isinstance(name, str):
        raise TypeError(f"name: expected the name of a table, found {name!r}")
    path = _file(Path(folder), name)
    try:
        return _read(path, library)
    except (ImportError, MemoryError):
        raise
    except Exception as error:
        # The libraries raise different exceptions for a damaged file, and none names the file.
        kind = "Parquet" if path.suffix == ".parquet" else "CSV"
        found = f"content that {library} refuses: {error}"
        raise ValueError(f"{path.name}: expected a table as {kind}, found {found}") from error


def _read(path: Path, library: str) -> Any:
    """The data frame in a file."""
    if library == "pandas":
        import pandas

        if path.suffix == ".parquet":
            return pandas.read_parquet(path)
        return pandas.read_csv(path)
    import polars

    if path.suffix == ".parquet":
        return polars.read_parquet(path)
    # Infer column types from all rows, because the first ones may have no value.
    return polars.read_csv(path, infer_schema_length=None)


def _file(folder: Path, name: str) -> Path:
    """The file of a table, in any format, if it matches the manifest."""
    manifest = folder / "manifest.json"
    if not manifest.is_file():
        raise ValueError(f"folder: expected a complete export with a manifest.json, found {folder}")
    try:
        listed: dict[str, str] = {
            file["name"]: file["sha256"] for file in json.loads(manifest.read_text(encoding="utf-8"))["files"]
        }
        if not all(isinstance(file, str) for file in listed):
            raise TypeError("a name that is not a string")
    except (KeyError, RecursionError, TypeError, ValueError) as error:
        expected = "a manifest.json that lists files with their sha256"
        raise ValueError(f"folder: expected {expected}, found an invalid one in {folder}: {error!r}") from error
    keyword = f"_description-{name.replace('_', '')}_data.csv"
    for file, expected in listed.items():
        if file in (f"{name}.csv", f"{name}.parquet") or file.endswith(keyword):
            path = folder / file
            if not path.is_file():
                raise ValueError(f"folder: expected {file}, which {manifest} lists, found no such file")
            with path.open("rb") as content:
                found = hashlib.file_digest(content, "sha256").hexdigest()
            if found != expected:
                raise ValueError(f"{file}: expected the content that the manifest names, found another: export again")
            return path
    raise ValueError(f"name: expected a table of {sorted(listed)} as CSV or Parquet, found {name}")


class Drive(NamedTuple):
    """A trial of an export.

    Attributes
    ----------
    participant : int
        The participant's number.
    trial : int
        The trial's number, unique among the participant's trials.
    trajectory : Trajectory
        The drive.
    """

    participant: int
    trial: int
    trajectory: Trajectory


def trajectories(folder: str | PathLike[str], *, phase: str | None = "task") -> list[Drive]:
    """The trials of an export, in its order.

    Parameters
    ----------
    folder : path
        As for `table`.
    phase : {"task", "practice", "familiarisation"} or None
        The part of the study; `None` for all.

    Returns
    -------
    list of Drive

    Raises
    ------
    ValueError
        As for `table`, and if there is no such phase, a table lacks a column, or a trial has no steps.
    """
    if phase is not None and phase not in _PHASES:
        raise ValueError(f"phase: expected one of {', '.join(_PHASES)}, or None for all, found {phase!r}")
    trials, steps = table(folder, "trials"), table(folder, "steps")
    _has("trials", trials, ["participant", "trial", "trial_id", *(f"end_{pose}" for pose in _POSES)])
    _has("steps", steps, ["trial_id", "step", "omega", *_POSES])
    if phase is not None:
        _has("trials", trials, ["phase"])
        trials = trials[trials["phase"] == phase]
    by_trial = dict(list(steps.groupby("trial_id", sort=False)))
    ends = trials[[f"end_{pose}" for pose in _POSES]].to_numpy(dtype=float)
    drives = []
    for end, (_, trial) in zip(ends, trials.iterrows(), strict=True):
        if trial["trial_id"] not in by_trial:
            raise ValueError(f"steps: expected steps of the trial {trial['trial_id']}, found none")
        driven = by_trial[trial["trial_id"]].sort_values("step")
        poses = np.vstack([driven[_POSES].to_numpy(dtype=float), end]).reshape(-1, 2, 3)
        trajectory = Trajectory(poses, driven["omega"].to_numpy(dtype=float))
        drives.append(Drive(int(trial["participant"]), int(trial["trial"]), trajectory))
    return drives


def _has(name: str, frame: pandas.DataFrame, columns: list[str]) -> None:
    """Refuses a table without one of these columns."""
    for column in columns:
        if column not in frame.columns:
            raise ValueError(f"{name}: expected a column {column}, found {list(frame.columns)}")


class Nodes(NamedTuple):
    """A value function on the nodes of its grid.

    Attributes
    ----------
    value : array of float32, shape (n0, n1, n2)
        V, m.
    axes : three arrays of float64, shapes (n0,), (n1,), (n2,)
        Coordinates of the nodes: x, y, ψ, or range, bearing, ψ in polar coordinates; m, m or rad, rad.
    meta : dict
        The game, the method and the horizon.
    """

    value: NDArray[np.float32]
    axes: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    meta: dict[str, Any]


def nodes(path: str | PathLike[str]) -> Nodes:
    """Reads an archive of `sidestep solve --out function.npz`.

    Raises
    ------
    ValueError
        If the file is not such an archive.
    """
    refused = f"path: expected an archive of `sidestep solve`, found {path}"
    # `Path` refuses a number, which would be an open file of other code.
    with Path(path).open("rb") as file:
        try:
            value, axes, meta = _arrays(file)
        except Exception as error:
            # NumPy, zipfile and zlib raise various exceptions for a damaged file.
            raise ValueError(f"{refused}: {error!r}") from error
    if any(axis.ndim != 1 for axis in axes) or value.shape != tuple(len(axis) for axis in axes):
        shapes = f"value of shape {value.shape} on axes of shapes {', '.join(str(axis.shape) for axis in axes)}"
        raise ValueError(f"{refused}: {shapes}")
    return Nodes(value, axes, meta)


def _arrays(file: BinaryIO) -> Nodes:
    """Content of an archive, without checks of the shapes."""
    archive = np.load(file, allow_pickle=False)
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise ValueError("one array, not an archive")
    with archive:
        axes = (archive["axis0"], archive["axis1"], archive["axis2"])
        meta = json.loads(bytes(archive["meta"]))
        if not isinstance(meta, dict):
            raise ValueError("meta that is not an object")
        return Nodes(archive["value"], axes, meta)
