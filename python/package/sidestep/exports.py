"""What `sidestep export` and `sidestep solve` wrote, as data frames, trajectories and arrays.

Tables are read with pandas or polars, figures of value functions with NumPy alone.
"""

from __future__ import annotations

import hashlib
import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ._sidestep import Trajectory

if TYPE_CHECKING:
    import pandas
    import polars

__all__ = ["Drive", "Nodes", "nodes", "table", "trajectories"]

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
        What `sidestep export --format csv`, `parquet` or `psych-ds` wrote, or an unpacked archive of the laboratory.
    name : str
        `participants`, `trials`, `steps` or `key_events`; the data dictionary beside the tables says what their
        columns mean.
    library : {"pandas", "polars"}

    Returns
    -------
    pandas.DataFrame or polars.DataFrame

    Raises
    ------
    ValueError
        If the export is not complete, has other content than its manifest says, or no such table.
    """
    if library not in ("pandas", "polars"):
        raise ValueError(f"library: expected pandas or polars, found {library}")
    path = _file(Path(folder), name)
    if library == "pandas":
        import pandas

        if path.suffix == ".parquet":
            return pandas.read_parquet(path)
        return pandas.read_csv(path)
    import polars

    if path.suffix == ".parquet":
        return polars.read_parquet(path)
    # All rows decide what a column is, because the first ones may have no value.
    return polars.read_csv(path, infer_schema_length=None)


def _file(folder: Path, name: str) -> Path:
    """The file of a table, whatever the format, if it is what the manifest says."""
    manifest = folder / "manifest.json"
    if not manifest.is_file():
        raise ValueError(f"folder: expected a complete export with a manifest.json, found {folder}")
    try:
        listed: dict[str, str] = {
            file["name"]: file["sha256"] for file in json.loads(manifest.read_text(encoding="utf-8"))["files"]
        }
    except (KeyError, TypeError, ValueError) as error:
        expected = "a manifest.json that lists files with their sha256"
        raise ValueError(f"folder: expected {expected}, found another in {folder}: {error!r}") from error
    keyword = f"_description-{name.replace('_', '')}_data.csv"
    for file, expected in listed.items():
        if file in (f"{name}.csv", f"{name}.parquet") or file.endswith(keyword):
            path = folder / file
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
        The trial's number, which no other trial of the participant has.
    trajectory : Trajectory
        What was driven.
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
    phase : str or None
        The part of the study; `None` for all.

    Returns
    -------
    list of Drive
    """
    trials, steps = table(folder, "trials"), table(folder, "steps")
    if phase is not None:
        trials = trials[trials["phase"] == phase]
    by_trial = dict(list(steps.groupby("trial_id", sort=False)))
    ends = trials[[f"end_{pose}" for pose in _POSES]].to_numpy(dtype=float)
    drives = []
    for end, (_, trial) in zip(ends, trials.iterrows(), strict=True):
        driven = by_trial[trial["trial_id"]].sort_values("step")
        poses = np.vstack([driven[_POSES].to_numpy(dtype=float), end]).reshape(-1, 2, 3)
        trajectory = Trajectory(poses, driven["omega"].to_numpy(dtype=float))
        drives.append(Drive(int(trial["participant"]), int(trial["trial"]), trajectory))
    return drives


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
    """What `sidestep solve --out function.npz` wrote.

    Raises
    ------
    ValueError
        If the file is no such archive.
    """
    refused = f"path: expected an archive of `sidestep solve`, found {path}"
    try:
        # Of a path, not of a number, which would be an open file of somebody else.
        with Path(path).open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise ValueError("one array, not an archive")
            with archive:
                axes = (archive["axis0"], archive["axis1"], archive["axis2"])
                value, meta = archive["value"], json.loads(bytes(archive["meta"]))
    except (KeyError, EOFError, ValueError, BadZipFile) as error:
        raise ValueError(f"{refused}: {error}") from error
    if any(axis.ndim != 1 for axis in axes) or value.shape != tuple(len(axis) for axis in axes):
        shapes = f"value of shape {value.shape} on axes of shapes {', '.join(str(axis.shape) for axis in axes)}"
        raise ValueError(f"{refused}: {shapes}")
    return Nodes(value, axes, meta)
