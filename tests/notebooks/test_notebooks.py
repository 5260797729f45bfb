"""The notebooks run from top to bottom, and are stored without outputs."""

import ast
import json
import shutil
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

from testbench import public_recordings

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
RECORDING = "09_double_pendulum_A0_061705.csv"
"""What the notebooks say of one recording they say of each."""


def code_cells(path):
    """The cells of code as they are stored."""
    return [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]


def shown(source, names):
    """Run a cell, magics left out; what its last line shows, and the figures that it leaves open."""
    lines = "".join(source).splitlines()
    tree = ast.parse("\n".join("" if line.startswith("%") else line for line in lines))
    if isinstance(last := tree.body[-1], ast.Expr):
        tree.body[-1] = ast.Assign([ast.Name("_", ast.Store())], last.value)
    exec(compile(ast.fix_missing_locations(tree), "cell", "exec"), names)
    return [names.pop("_", None), *map(plt.figure, plt.get_fignums())]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    """Every cell runs without an error or a warning in an empty folder, and one shows a figure."""
    if (recording := public_recordings.local_recording(RECORDING)) is not None:
        shutil.copy(recording, tmp_path)
        monkeypatch.setenv(public_recordings.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    values = [value for cell in code_cells(path) for value in shown(cell["source"], names)]
    plt.close("all")
    assert any(isinstance(value, Figure) for value in values)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_without_outputs(path):
    """No output and no execution count is in the repository."""
    assert code_cells(path)
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code_cells(path))
