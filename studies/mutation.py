"""Does the suite notice? Small random faults go into the packages one at a time, and the tests that reach them run.

A fault is a swapped operator or comparison, a changed number or truth value, or a dropped statement. It is found where
a test fails or does not end. A file that no test reaches counts as not found. It needs to know which test executes
which line, once a state of the tree (pytest-cov)::

    pytest -n 2 --cov=balance --cov=testbench --cov-context=test --cov-report=
    python -m studies.mutation .coverage --count 300 --seed 1
"""

import argparse
import ast
import json
import os
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from typing import TypeGuard

PACKAGES = ("balance", "testbench")
SWAPPED: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"), ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"), ast.Pow: ("**", "*"), ast.MatMult: ("@", "*"), ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"), ast.NotIn: ("not in", "in"), ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}  # fmt: skip
"""How an operator is written, and what takes its place."""
MOST_TESTS = 40
"""Tests that are tried on one fault: those that reach its line and execute the fewest lines besides."""
LONGEST_S = 150.0
"""For the tests of one fault together; what takes longer does not end."""


@dataclass(frozen=True)
class Fault:
    """A piece of a file, by its bytes, and what takes its place."""

    path: str
    line: int
    kind: str
    start: int
    end: int
    text: str


def faults(root: Path, path: Path) -> Iterator[Fault]:
    """All faults of these kinds that a file can be given."""
    source = path.read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def span(node: ast.expr | ast.stmt) -> tuple[int, int]:
        last, column = node.end_lineno or node.lineno, node.end_col_offset or 0
        return starts[node.lineno - 1] + node.col_offset, starts[last - 1] + column

    name = path.relative_to(root).as_posix()
    for node in ast.walk(ast.parse(source)):
        for left, operator, right in _operations(node):
            (start, end), (written, other) = (span(left)[1], span(right)[0]), SWAPPED[type(operator)]
            between = source[start:end].decode()
            yield Fault(name, right.lineno, "operator", start, end, between.replace(written, other, 1))
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            changed = str(not node.value) if isinstance(node.value, bool) else repr(node.value + 1)
            yield Fault(name, node.lineno, "constant", *span(node), changed)
        elif _is_statement(node) and node.col_offset:
            yield Fault(name, node.lineno, "statement", *span(node), "pass")


def _is_statement(node: ast.AST) -> TypeGuard[ast.stmt]:
    """Whether a statement can be dropped: no definition, no return, no docstring."""
    documents = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return isinstance(node, ast.Assign | ast.AugAssign | ast.Raise | ast.Expr) and not documents


def _operations(node: ast.AST) -> list[tuple[ast.expr, ast.AST, ast.expr]]:
    if isinstance(node, ast.BinOp):
        return [(node.left, node.op, node.right)] if type(node.op) in SWAPPED else []
    if isinstance(node, ast.Compare):
        return [(node.left, node.ops[0], node.comparators[0])]
    return [(node.values[0], node.op, node.values[1])] if isinstance(node, ast.BoolOp) else []


def reaching_tests(root: Path, coverage: Path) -> dict[str, dict[int, list[str]]]:
    """The tests that execute each line, by file, those first that execute the fewest lines in all."""
    from coverage import CoverageData

    data = CoverageData(str(coverage))
    data.read()
    files = {file: Path(file) for file in data.measured_files() if Path(file).is_relative_to(root)}
    executed: Counter[str] = Counter()
    reached: dict[str, dict[int, set[str]]] = {}
    for file, path in files.items():
        lines = reached[path.relative_to(root).as_posix()] = {
            line: {test.partition("|")[0] for test in tests} - {""}
            for line, tests in data.contexts_by_lineno(file).items()
        }
        for tests in lines.values():
            executed.update(tests)
    return {
        name: {line: sorted(tests, key=lambda test: (executed[test], test)) for line, tests in lines.items()}
        for name, lines in reached.items()
    }


def outcome(tree: Path, fault: Fault, tests: list[str]) -> str:
    """``killed``, ``survived``, ``endless`` or ``not reached``, in a copy of the tree that is as before afterwards."""
    if not tests:
        return "not reached"
    target = tree / fault.path
    source = target.read_bytes()
    target.write_bytes(source[: fault.start] + fault.text.encode() + source[fault.end :])
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests]
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, timeout=LONGEST_S, check=False)
        return "killed" if done.returncode else "survived"
    except subprocess.TimeoutExpired:
        return "endless"
    finally:
        target.write_bytes(source)


def main() -> None:
    """Draw faults, try each, and print what survived and the share that was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("coverage", type=Path, help="what pytest-cov wrote with --cov-context=test")
    parser.add_argument("--root", type=Path, default=Path.cwd(), help="the checkout that was measured")
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    root, rng = given.root.resolve(), random.Random(given.seed)
    paths = sorted(path for package in PACKAGES for path in (root / package).rglob("*.py"))
    drawn = rng.sample([fault for path in paths for fault in faults(root, path)], given.count)
    tests = reaching_tests(root, given.coverage)
    chosen = [_reaching(tests.get(fault.path, {}), fault.line)[:MOST_TESTS] for fault in drawn]
    with TemporaryDirectory() as folder, ThreadPoolExecutor(given.workers) as pool:
        trees: SimpleQueue[Path] = SimpleQueue()
        for i in range(given.workers):
            subprocess.run(["git", "worktree", "add", "-q", "--detach", f"{folder}/{i}", "HEAD"], cwd=root, check=True)
            trees.put(Path(folder, str(i)))

        def tried(fault: Fault, names: list[str]) -> str:
            tree = trees.get()
            try:
                return outcome(tree, fault, names)
            finally:
                trees.put(tree)

        counted: Counter[str] = Counter()
        for fault, found in zip(drawn, pool.map(tried, drawn, chosen), strict=True):
            counted[found] += 1
            sys.stdout.write(json.dumps({"outcome": found, **asdict(fault)}) + "\n")
            sys.stdout.flush()
        for i in range(given.workers):
            subprocess.run(["git", "worktree", "remove", "--force", f"{folder}/{i}"], cwd=root, check=True)
    sys.stdout.write(json.dumps({"share": (counted["killed"] + counted["endless"]) / given.count, **counted}) + "\n")


def _reaching(tests: dict[int, list[str]], line: int) -> list[str]:
    """The tests that reach a line; of one that runs on import, those that reach any other of its file."""
    return tests.get(line) or list(dict.fromkeys(test for found in tests.values() for test in found))


if __name__ == "__main__":
    main()
