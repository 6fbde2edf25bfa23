"""The notebooks run and show the expected output."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))


def ran(path):
    """The outputs of a notebook, by content type."""
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert not any(cell.get("outputs") for cell in notebook.cells), "stored outputs belong to nobody's version"
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(path.parent)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    contents = {}
    for output in outputs:
        for kind, content in output.get("data", {"text/plain": output.get("text", "")}).items():
            contents.setdefault(kind, []).append(content)
    return contents


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    contents = ran(path)
    text = "".join(contents["text/plain"])
    match path.stem:
        case "figure1":
            assert len(contents["image/png"]) == 2
        case "figure3":
            assert len(contents["image/png"]) == 1
            # Every turn: 16/3 m² in each of the three (decision 7).
            assert text.count("5.33]") == 3
        case "table1":
            (table,) = contents["text/html"]
            assert len(contents["image/png"]) == 1 and "accuracy (%)" in table
            assert table.count("<td>") == 6 * 7 and "nan" not in table.lower()
            assert "Shfrs(areas_m2=[" in text
        case other:
            raise AssertionError(f"what does {other} promise?")


def test_there_are_three_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["figure1", "figure3", "table1"]
