"""Loads an export of Sidestep and prints a small summary.

    python load_export.py FOLDER [pandas|polars|pyarrow]

FOLDER is what `sidestep export --format csv`, `parquet` or `psych-ds` wrote, or an archive from the laboratory
after it was unpacked. It needs the package of that name; pandas reads Parquet with pyarrow.
"""

import hashlib
import json
import sys
from pathlib import Path


def checked(folder):
    """The files of the export by name. Without a manifest, or with other content than it says, it is not whole."""
    path = folder / "manifest.json"
    if not path.exists():
        sys.exit(f"{folder} has no manifest.json: the export is not complete, export again")
    manifest = json.loads(path.read_text(encoding="utf-8"))
    for file in manifest["files"]:
        digest = hashlib.sha256((folder / file["name"]).read_bytes()).hexdigest()
        if digest != file["sha256"]:
            sys.exit(f"{file['name']}: expected SHA-256 {file['sha256']}, found {digest}: export again")
    return [file["name"] for file in manifest["files"]]


def table(folder, name):
    """The file of a table, whatever the format: steps.csv, steps.parquet or …_description-steps_data.csv."""
    keyword = f"_description-{name.replace('_', '')}_data.csv"
    for file in checked(folder):
        if file in (f"{name}.csv", f"{name}.parquet") or file.endswith(keyword):
            return folder / file
    sys.exit(f"{folder} has no table {name} as CSV or Parquet")


def with_pandas(folder):
    import pandas as pd

    def read(name):
        path = table(folder, name)
        if path.suffix == ".parquet":
            return pd.read_parquet(path)
        # pandas before 3 needs float_precision="round_trip" to keep the last digit.
        return pd.read_csv(path)

    trials, steps = read("trials"), read("steps")
    tasks = trials[trials["phase"] == "task"]
    closest = tasks["closest_m"].mean()
    # An empty field has no value: nobody was in the danger zone.
    entered = int(tasks["first_step_in_danger"].notna().sum())
    turning = (steps["omega"] != 0).mean()
    return trials["participant"].nunique(), len(tasks), len(steps), closest, entered, turning


def with_polars(folder):
    import polars as pl

    def read(name):
        path = table(folder, name)
        if path.suffix == ".parquet":
            return pl.read_parquet(path)
        # All rows decide what a column is, because the first ones may have no value.
        return pl.read_csv(path, infer_schema_length=None)

    trials, steps = read("trials"), read("steps")
    tasks = trials.filter(pl.col("phase") == "task")
    entered = len(tasks) - tasks["first_step_in_danger"].null_count()
    turning = (steps["omega"] != 0).mean()
    closest = tasks["closest_m"].mean()
    return trials["participant"].n_unique(), len(tasks), len(steps), closest, entered, turning


def with_pyarrow(folder):
    import pyarrow.compute as pc
    from pyarrow import csv, parquet

    def read(name):
        path = table(folder, name)
        return parquet.read_table(path) if path.suffix == ".parquet" else csv.read_csv(path)

    trials, steps = read("trials"), read("steps")
    tasks = trials.filter(pc.equal(trials["phase"], "task"))
    entered = len(tasks) - tasks["first_step_in_danger"].null_count
    turning = pc.mean(pc.not_equal(steps["omega"], 0)).as_py()
    closest = pc.mean(tasks["closest_m"]).as_py()
    people = len(trials["participant"].unique())
    return people, len(tasks), len(steps), closest, entered, turning


def main():
    readers = {"pandas": with_pandas, "polars": with_polars, "pyarrow": with_pyarrow}
    if len(sys.argv) not in (2, 3) or (len(sys.argv) == 3 and sys.argv[2] not in readers):
        sys.exit(__doc__)
    reader = readers[sys.argv[2] if len(sys.argv) == 3 else "pandas"]
    people, tasks, steps, closest, entered, turning = reader(Path(sys.argv[1]))
    print(f"{people} participants, {tasks} tasks, {steps} steps")
    print(f"mean closest distance in tasks: {closest:.6f} m; danger zone entered: {entered}")
    print(f"share of steps with a turn: {turning:.6f}")


if __name__ == "__main__":
    main()
