"""Syntax trees of both packages, parsed once for all tests that read them."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("balance", "testbench")


@cache
def trees() -> dict[Path, ast.Module]:
    """The tree of each file, by its path in the repository."""
    files = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return {path.relative_to(ROOT): ast.parse(path.read_text("utf-8")) for path in files}


@cache
def walked(tree: ast.Module) -> tuple[ast.AST, ...]:
    """All nodes of a tree."""
    return tuple(ast.walk(tree))


@cache
def modules() -> dict[str, ast.Module]:
    """The same by the module's name; a package's is that of its ``__init__``."""
    return {".".join(path.with_suffix("").parts).removesuffix(".__init__"): tree for path, tree in trees().items()}
