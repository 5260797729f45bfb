"""A run and its rig are bound once: no function is handed both."""

import ast
import re
from collections.abc import Iterator

import pytest

from ...source_trees import trees, walked

RUNS, RIGS = {"Run", "SIRun", "AlignedRun"}, {"Rig"}
BINDS = {"runs/si_run.py: of", "front_door.py: bound_runs"}
"""The one constructor that takes both, and the front door's call of it for all runs."""


def functions() -> Iterator[tuple[str, list[ast.arg]]]:
    """Every function of the package with its parameters."""
    for path, tree in trees().items():
        where = path.relative_to(path.parts[0]).as_posix()
        for node in walked(tree) if path.parts[0] == "testbench" else ():
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                given = node.args
                yield (
                    f"{where}: {getattr(node, 'name', 'lambda')}",
                    [*given.posonlyargs, *given.args, *given.kwonlyargs],
                )


def named(argument: ast.arg) -> set[str]:
    """The words in an annotation, in quotes or not; of none, the parameter's own as a class would have it."""
    if argument.annotation is None:
        return {argument.arg.rstrip("s").capitalize()}
    return set(re.findall(r"\w+", ast.unparse(argument.annotation)))


def both(arguments: list[ast.arg]) -> bool:
    """Whether one parameter is of runs and another of rigs."""
    of_runs = {a.arg for a in arguments if named(a) & RUNS}
    of_rigs = {a.arg for a in arguments if named(a) & RIGS}
    return bool(of_runs and of_rigs)


def test_no_function_takes_a_run_and_its_rig() -> None:
    """What a run's rig says is asked of the run: only the constructor of SIRun binds them."""
    found = {name for name, arguments in functions() if both(arguments)}
    assert found == BINDS


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('def f(run: "Run", rig: "Rig | None") -> None: ...', True),
        ("def f(runs: Sequence[SIRun], rigs: list[rigs.Rig]) -> None: ...", True),
        ("lambda run, rig: None", True),
        ('def f(run: "SIRun", mechanism: Mechanism) -> None: ...', False),
    ],
)
def test_a_function_that_takes_both_is_seen(text: str, expected: bool) -> None:
    """Quoted, nested and missing annotations are read alike."""
    (node,) = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef | ast.Lambda)]
    assert both(node.args.args) is expected
