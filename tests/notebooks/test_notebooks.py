"""The notebooks run from top to bottom, through the front door alone, and are stored with their pictures."""

import ast
import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
IMPORTED = {"balance", "testbench", "pathlib", "numpy", "matplotlib.figure"}
LARGEST = 600_000
"""Bytes of a notebook."""


def code_cells(path):
    """The cells of code as they are stored."""
    return [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]


def parsed(source):
    """A cell's statements, magics left out."""
    return ast.parse("\n".join("" if line.startswith("%") else line for line in "".join(source).splitlines()))


def shown(source, names):
    """Run a cell; what its last line shows, and the figures that it leaves open."""
    tree = parsed(source)
    if isinstance(last := tree.body[-1], ast.Expr):
        tree.body[-1] = ast.Assign([ast.Name("_", ast.Store())], last.value)
    exec(compile(ast.fix_missing_locations(tree), "cell", "exec"), names)
    return [names.pop("_", None), *map(plt.figure, plt.get_fignums())]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    """Every cell runs without an error or a warning in an empty folder, and one shows a figure."""
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    values = [value for cell in code_cells(path) for value in shown(cell["source"], names)]
    plt.close("all")
    assert any(isinstance(value, Figure) for value in values)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_shows_its_pictures_where_it_is_stored(path):
    """Executed in order, with a picture of each cell that draws, no error or warning, and no place of a machine."""
    cells = code_cells(path)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert not any(output["output_type"] == "error" or output.get("name") == "stderr" for output in outputs)
    refused = [cell for cell in cells if isinstance(parsed(cell["source"]).body[-1], ast.Try)]
    assert all(cell["outputs"] for cell in refused), "what is said to be refused is shown to be"
    drawing = [cell for cell in cells if "".join(cell["source"]).rstrip().endswith((".plot()", "\nfigure"))]
    assert drawing
    assert all(any("image/png" in output.get("data", {}) for output in cell["outputs"]) for cell in drawing)
    assert not re.search(r"/(tmp|home|root|work|Users)/", path.read_text("utf-8"))
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_goes_through_the_front_door(path):
    """It imports the two packages whole, and nothing from inside them."""
    nodes = [node for cell in code_cells(path) for node in ast.walk(parsed(cell["source"]))]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    assert names <= IMPORTED
