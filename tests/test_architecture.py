"""The walls of the house: no circle of imports, none upwards; what the first second does without.

Imports are read from the source, late ones and those for type checking alone included.
"""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from .source_trees import PACKAGES, ROOT, modules, walked

LAYERS: tuple[str, ...] = (
    "balance.errors balance.arrays balance.user_cache",
    "balance.task_pool balance.units balance.datasets balance.results balance.compiled_kernels",
    "balance.input_files balance.table_files",
    "balance.mechanism",
    "balance.motion",
    "balance.closure",
    "balance.dynamics",
    "balance.balancing",
    "balance.estimation",
    "balance.rotors balance.drives balance.linkages",
    "balance.engines",
    "balance.figures",
    "balance.report",
    "balance.front_door",
    "balance",
    "balance.cli",
    "testbench.errors testbench.units testbench.compiled_kernels",
    "testbench.recording testbench.public_recordings",
    "testbench.calibration testbench.readers testbench.store",
    "testbench.rig",
    "testbench.campaign_plan testbench.published_tables",
    "testbench.quality",
    "testbench.runs",
    "testbench.signal testbench.ingestion",
    "testbench.kinematics testbench.rotating",
    "testbench.synchronization",
    "testbench.vibration",
    "testbench.runs.aligned_run",
    "testbench.loads testbench.kinematics.motion_recognition testbench.figures.style testbench.runs.joined_channels",
    "testbench.cross_examination testbench.export",
    "testbench.identification testbench.trimming testbench.vibration.reduction",
    "testbench.simulator",
    "testbench.vibration.comparison testbench.next_run testbench.project",
    "testbench.figures",
    "testbench.report",
    "testbench.front_door",
    "testbench",
    "testbench.cli",
)
"""Modules and folders from the ground up, one row a layer: none imports from a row above, nor its neighbours in a row.

The longest name that fits places a module; a package's name alone is its front door.
"""
FOREIGN = {"h5py", "polars", "pyarrow", "idelib", "mcap", "pyulog", "rosbags", "nptdms", "google", "pandas"}
"""Libraries that read foreign bytes: a damaged file may end their process, which must not be the one that was asked."""
STORE = "testbench.store"
"""Opens the campaign's own HDF5 files with h5py, after their structure was checked."""
KERNELS = {"numba"}
HEAVY = {
    "numpy",
    "scipy",
    "pinocchio",
    "mujoco",
    "h5py",
    "numba",
    "pydantic",
    "pandas",
    "polars",
    "pyarrow",
    "matplotlib",
    "sympy",
    "dask",
    "distributed",
}


@cache
def packages() -> set[str]:
    """The modules that hold others."""
    return {name.rpartition(".")[0] for name in modules()}


def named(module: str, node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    """What a statement of a module imports, written out: of ``from a import b`` both ``a`` and ``a.b``."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
        return
    above = module.split(".")[: module.count(".") + 1 + (module in packages()) - node.level] if node.level else []
    base = ".".join([*above, *([node.module] if node.module else [])])
    for alias in node.names:
        yield f"{base}.{alias.name}" if f"{base}.{alias.name}" in modules() else base


@cache
def imports() -> dict[str, set[str]]:
    """All that each module imports, anywhere in its text, foreign packages included."""
    return {
        module: {
            name
            for node in walked(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for name in named(module, node)
            if name != module
        }
        for module, tree in modules().items()
    }


def own(module: str) -> set[str]:
    """Which modules of both packages a module imports."""
    return {name for name in imports()[module] if name in modules()}


@cache
def place(module: str) -> tuple[int, str] | None:
    """Layer of a module and the entry of LAYERS that places it."""
    entries = [(len(entry), i, entry) for i, row in enumerate(LAYERS) for entry in row.split()]
    fitting = [e for e in entries if module == e[2] or (e[2] not in PACKAGES and module.startswith(f"{e[2]}."))]
    return max(fitting)[1:] if fitting else None


def test_studies_lie_outside() -> None:
    """The studies import the packages; back leads one door, which a wheel has too."""
    reaching = {module for module, names in imports().items() if any(name.split(".")[0] == "studies" for name in names)}
    assert reaching == {"testbench.cli.predict"}


def test_every_module_has_a_layer() -> None:
    """A new folder says where it stands."""
    assert {module for module in modules() if place(module) is None} == set()


def test_no_import_leads_upwards() -> None:
    """From a layer to those below it alone."""
    upwards = []
    for module in modules():
        (layer, entry) = place(module)
        for other in own(module):
            (its_layer, its_entry) = place(other)
            if its_layer > layer or (its_layer == layer and its_entry != entry):
                upwards.append(f"{module} -> {other}")
    assert not upwards, "\n".join(upwards)


def test_no_circle_of_imports() -> None:
    """Files can be read one after the other: take away those that import no other one until none is left."""
    left = {module: own(module) for module in modules()}
    while free := [module for module, others in left.items() if not others & left.keys()]:
        for module in free:
            del left[module]
    assert not left, "\n".join(f"{module} -> {', '.join(others & left.keys())}" for module, others in left.items())


def test_foreign_bytes_are_read_in_another_process() -> None:
    """Modules that import a library for foreign files are imported by one another alone: their process starts them."""
    readers = [module for module in modules() if module.startswith("testbench.readers")]
    walled = {module for module in readers if {name.partition(".")[0] for name in imports()[module]} & FOREIGN}
    assert walled
    through = {f"{module} -> {other}" for module in modules() if module not in walled for other in own(module) & walled}
    assert through == set()


def test_kernels_alone_import_their_compiler() -> None:
    """A module that imports numba is loaded inside a function, or by its name, where compiled code serves."""
    kernels = {m for m in modules() if {name.partition(".")[0] for name in imports()[m]} & KERNELS}
    assert kernels
    at_once = {
        f"{module} -> {name}"
        for module, tree in modules().items()
        for node in tree.body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in named(module, node)
        if name in kernels and module not in kernels
    }
    assert at_once == set()


QUANTILES = "balance.estimation.estimate"
DISTRIBUTIONS = {
    "stdtr", "stdtrit", "ndtr", "ndtri", "log_ndtr", "chdtr", "chdtrc", "chdtri", "fdtr", "fdtrc", "fdtri", "betainc",
    "betaincinv", "gammainc", "gammaincc", "gammaincinv", "gammainccinv", "erfinv", "erfcinv", "btdtr", "btdtri",
}  # fmt: skip


def test_quantiles_are_taken_in_one_place() -> None:
    """No other module imports a distribution or writes the normal quantile out."""
    taken = {
        f"{module}: {ast.unparse(node)}"
        for module, tree in modules().items()
        for node in walked(tree)
        if module != QUANTILES and _is_of_a_distribution(node)
    }
    assert taken == set()


def _is_of_a_distribution(node: ast.AST) -> bool:
    if isinstance(node, ast.ImportFrom):
        of_special = node.module == "scipy.special" and any(alias.name in DISTRIBUTIONS for alias in node.names)
        return of_special or f"{node.module}".startswith("scipy.stats") or "stats" in {a.name for a in node.names}
    if isinstance(node, ast.Import):
        return any(alias.name.startswith("scipy.stats") for alias in node.names)
    if isinstance(node, ast.Attribute):
        return node.attr in DISTRIBUTIONS
    return isinstance(node, ast.Constant) and isinstance(node.value, float) and 1.955 < node.value < 1.965


def run(code: str, *arguments: str | Path) -> dict:
    """The JSON document that a program prints, run in a process of its own."""
    words = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


HELP = """
import contextlib, importlib, io, json, sys
cli = importlib.import_module(sys.argv[1])
def help_of(*words):
    sys.argv = [cli.__name__, *words, "--help"]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        cli.main()
help_of()
for name in cli.COMMANDS:
    help_of(name)
    module, _, function = cli.COMMANDS[name][0].partition(":")
    group = getattr(importlib.import_module(f"{cli.__name__}.{module}"), function or name)
    for inner in group.list_commands(None) if hasattr(group, "list_commands") else ():
        help_of(name, inner)
print(json.dumps(sorted({name.partition(".")[0] for name in sys.modules})))
"""


@pytest.mark.parametrize("package", PACKAGES)
def test_help_imports_nothing_heavy(package: str) -> None:
    """``--help`` of every command answers at once."""
    assert HEAVY & set(run(HELP, f"{package}.cli")) == set()


LOADED = """
import contextlib, importlib, io, sys
package, *words = sys.argv[1:]
sys.argv = [package, *words]
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    importlib.import_module(f"{package}.cli").main()
loaded = sorted(sys.modules)
import json
print(json.dumps(loaded))
"""
NOT_NEEDED = {
    "balance --help": "json difflib shutil bz2 rich decimal balance.cli.options",
    "testbench --help": "json difflib shutil bz2 rich decimal testbench.cli.options",
    "balance size parallelogram-6bar": "pydantic scipy rich.console webbrowser balance.input_files fractions numba",
    "testbench ingest no-such-log.csv -o no-such-folder": "pydantic scipy rich.console balance.input_files numba",
}
"""By command, modules that cost time and are of no use to it."""


@pytest.mark.parametrize("words", NOT_NEEDED)
def test_commands_start_without_what_they_do_not_need(words: str) -> None:
    """Of a small command, most of the time is imports."""
    assert set(NOT_NEEDED[words].split()) & set(run(LOADED, *words.split())) == set()


WALK = """
import contextlib, importlib, io, json, sys, threading
roots, seen = tuple(sys.argv[1].split(";")), set()
def enter(frame, event, argument):
    code = frame.f_code
    if event == "call" and code.co_flags & 1 and code.co_filename.startswith(roots):  # functions, not bodies of classes
        seen.add(code.co_filename)
main = importlib.import_module("testbench.cli").main
sys.argv = ["testbench", *sys.argv[2:]]
threading.setprofile(enter)
sys.setprofile(enter)
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main()
sys.setprofile(None)
own = [name for name in sys.modules if name.partition(".")[0] in ("balance", "testbench")]
print(json.dumps({"files": len(seen), "modules": len(own)}))
"""


def walk(*words: str | Path) -> dict:
    """How many files a command's functions are in, and how many modules of ours it imports."""
    return run(WALK, ";".join(str(ROOT / package) for package in PACKAGES), *words)


def test_ingest_passes_few_files(tmp_path: Path) -> None:
    """One CSV asks no other format's reader."""
    (tmp_path / "log.csv").write_text("t (s),a (m/s^2)\n" + "".join(f"{i / 1000:.3f},{i % 7}.25\n" for i in range(900)))
    found = walk("ingest", tmp_path / "log.csv", "-o", tmp_path / "campaign")
    assert (tmp_path / "campaign" / "log.h5").exists()
    assert found["files"] <= 36
    assert found["modules"] <= 53


def test_identify_imports_few_modules() -> None:
    """What the command and its function import, late or not: nothing of trim, of aligning clocks, of a campaign.

    The cross-examination of the runs, which other commands have too, is counted apart.
    """
    front = modules()["testbench.front_door"]
    functions = [f for f in front.body if getattr(f, "name", "") in ("identify", "bound_runs", "_model")]
    needed = {"testbench.front_door", *own("testbench.cli.identify")}
    for node in (node for function in functions for node in ast.walk(function)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            needed |= {name for name in named("testbench.front_door", node) if name in modules()}
    needed -= {name for name in needed if "figure" in name or "cross_examination" in name}
    code = (
        "import importlib, json, sys\n"
        "for name in sys.argv[1:]: importlib.import_module(name)\n"
        "own = [name for name in sys.modules if name.partition('.')[0] in ('balance', 'testbench')]\n"
        "print(json.dumps({'modules': len(own), 'trim': 'testbench.trimming' in own}))"
    )
    found = run(code, *sorted(needed))
    assert not found["trim"]
    assert found["modules"] <= 93
