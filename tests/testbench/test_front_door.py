"""What `import balance` and `import testbench` offer: names, examples that run, a guard against other distributions."""

import doctest
import os
import pkgutil
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import testbench

from .conftest import PAIR, conditions

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(request, tmp_path_factory):
    """The files that the examples of testbench name."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(request.getfixturevalue("shared")(PAIR).campaign, folder / "campaign")
    (folder / "log.csv").write_text("t (s),a (m/s^2)\n0.0,0.5\n0.1,0.25\n0.2,0.75\n", encoding="utf-8")
    (folder / "edges.csv").write_text("t (s)\n" + "".join(f"{0.01 * k:.6f}\n" for k in range(300)), encoding="utf-8")
    (folder / "one-run.toml").write_text(conditions((5.0, 0.0, ("x",))), encoding="utf-8")
    theta = 2.0 * np.pi * 40.0 * (time := np.arange(2500) / 2500.0)
    noise = np.random.default_rng(0).normal(0.0, 0.01, len(time))
    columns = [time, np.sin(theta), 4.0 * np.cos(theta + np.radians(40.0)) + noise]
    pd.DataFrame(dict(zip(("t (s)", "tacho (V)", "A (m/s^2)"), columns, strict=True))).to_csv(
        folder / "run.csv", index=False
    )
    testbench.ingest([folder / "run.csv"], to=folder / "rotor")
    return folder


COMPUTED = {}
"""What the front door's long computations gave, by name and arguments: examples share them."""


LONG = (
    "testbench.vibration.reduction.analyze", "testbench.vibration.comparison.compare_campaign",
    "testbench.cross_examination.examine", "testbench.identification.identify", "testbench.trimming.trim_runs",
)  # fmt: skip
"""Long computations of the front door."""


@pytest.fixture
def laboratory(folder, monkeypatch):
    """The folder where the examples run, each computation once."""
    for place in LONG:
        module, _, name = place.rpartition(".")
        whole = getattr(import_module(module), name)

        def once(*given, name=name, whole=whole, **named):
            key = f"{name} {given} {named}"
            if key not in COMPUTED:
                COMPUTED[key] = whole(*given, **named)
            return COMPUTED[key]

        monkeypatch.setattr(place, once)
    monkeypatch.chdir(folder)


def examples(package):
    """The docstrings of a package and of all its public names."""
    deeper = ["testbench.rotating.vectors", "testbench.Run.spectra"] if package == "testbench" else []
    return [package, *(f"{package}.{name}" for name in import_module(package).__all__), *deeper]


def run_example(name):
    """Run the example in the docstring of a name; how many lines failed, of how many."""
    text = pkgutil.resolve_name(name).__doc__ or ""
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    return doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test)


@pytest.mark.parametrize("name", examples("balance"))
def test_examples_of_balance_run(name, tmp_path, monkeypatch):
    """Every public name has an example, and it gives what it says."""
    monkeypatch.chdir(tmp_path)
    found = run_example(name)
    assert found.attempted > 0
    assert found.failed == 0


@pytest.mark.parametrize("name", examples("testbench"))
def test_examples_of_testbench_run(name, laboratory):
    """Every public name has an example, and it gives what it says."""
    found = run_example(name)
    assert found.attempted > 0
    assert found.failed == 0


CODE = re.findall(
    r"^```python\n(.*?)^```",
    (ROOT / "docs" / "how-to" / "testbench.md").read_text("utf-8"),
    re.DOTALL | re.MULTILINE,
)
SHOWN = [
    "base_acc x: r002 less r001",
    r"'base_acc y': '\(m/s\^2\)\^2/Hz'",
    r"(?s)'stored', 'stored'.* (80|79\.[89])\.?\d* \[",
    "RMS of the difference: ",
]


@pytest.mark.parametrize(("code", "shown"), list(zip(CODE, SHOWN, strict=True)), ids=SHOWN)
def test_examples_of_the_how_to_run(code, shown, laboratory, capsys):
    """As they stand there, with what their reader is after."""
    exec(compile(code, "testbench.md", "exec"), {})
    assert re.search(shown, capsys.readouterr().out)


@pytest.mark.parametrize("name", ["export.sep005", "report.html_report"])
def test_what_is_named_of_a_module_is_there_at_once(name):
    """What documents and messages name needs no further import."""
    code = f"import testbench; print('report' in dir(testbench), testbench.{name}.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", name.partition(".")[2]]


@pytest.mark.parametrize("package", ["balance", "testbench"])
def test_names_are_shown_and_imported_late(package):
    """dir() has them; the import alone brings no library; an unknown name is an AttributeError; types are marked."""
    code = f"import {package} as p, sys; print(len(p.__all__), set(p.__all__) <= set(dir(p)), 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    number, shown, heavy = done.stdout.split()
    assert (shown, heavy) == ("True", "False")
    assert 25 <= int(number) <= 36
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = import_module(package).nothing
    assert (ROOT / package / "py.typed").exists()
    assert import_module(package).__version__


def imported(folder, package):
    """The error of importing a package with `folder` first on the path."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    words = [sys.executable, "-c", f"import {package}"]
    return subprocess.run(words, env=environment, cwd=folder, capture_output=True, text=True, check=False).stderr


def test_another_distribution_in_its_place_is_refused(tmp_path):
    """Of the same import name: by its metadata in the folder, and by its files where balance should be."""
    for package in ("balance", "testbench"):
        (tmp_path / package).symlink_to(ROOT / package)
    assert imported(tmp_path, "testbench.errors") == ""
    (tmp_path / "balance-0.23.0.dist-info").mkdir()
    assert "balance-0.23.0 is another distribution" in imported(tmp_path, "balance")
    (tmp_path / "balance").unlink()
    (tmp_path / "balance").mkdir()
    (tmp_path / "balance" / "__init__.py").write_text("weights = None\n", encoding="utf-8")
    assert "pip uninstall balance, then" in imported(tmp_path, "testbench")


def test_clocks_of_a_campaign(laboratory):
    """A list of those of each run, of one run its own; by a trigger as by the command, refused with the reason."""
    import testbench
    from testbench.errors import AnalysisError

    named = [one.run for one in testbench.align("campaign", by="trigger", drift=False)]
    assert named == [run.name for run in testbench.open_campaign("campaign").runs]
    refused = testbench.align("campaign/r002.h5", by="trigger").refused
    assert "no sensor of kind 'trigger' in r002_controller: add one" in refused["r002_daq"]
    with pytest.raises(AnalysisError, match="by: 'edges': expected correlation, tap, trigger"):
        testbench.align("campaign", by="edges")
