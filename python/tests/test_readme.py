"""The examples of the readme run, one after the other."""

import re
from pathlib import Path

import matplotlib.pyplot as plt

README = Path(__file__).parent.parent / "README.md"


def test_the_examples_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 6
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "With confidence 0.95" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"function.value", "predictor.json", "regions.png", "solution.npz"}
    plt.close("all")
