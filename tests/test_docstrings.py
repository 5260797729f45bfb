"""Arrays in public signatures have their shape and unit in the docstring."""

import ast
import re

from .source_trees import trees

ARRAY = re.compile(r"\b(Floats|Complexes|NDArray)\b")
UNIT = re.compile(r"\[[^\]\n]{1,40}\]|dimensionless|in SI|per cent")
SHAPE = re.compile(r"\((\d+|[a-z]\w*|\.\.\.|[\w ]+ [-+*] ?\w+)(, ?[\w .+*-]+)*,?\)|scalar")


def entries():
    """Public functions and methods with arrays in their signature, by file, name and docstring."""
    for path, tree in trees().items():
        public = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name[0] != "_"]
        for node in [*tree.body, *(inner for owner in public for inner in owner.body)]:
            if isinstance(node, ast.FunctionDef) and node.name[0] != "_" and ARRAY.search(_annotations(node)):
                yield path.as_posix(), node.name, ast.get_docstring(node) or ""


def _annotations(node: ast.FunctionDef) -> str:
    arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
    return " ".join(ast.unparse(part) for part in (*(a.annotation for a in arguments), node.returns) if part)


def test_shape_and_unit():
    """Of nine in ten at least; those without are named."""
    every = list(entries())
    without = [f"{path}: {name}" for path, name, text in every if not (UNIT.search(text) and SHAPE.search(text))]
    assert len(every) > 350
    assert len(without) <= 0.1 * len(every), "\n".join(without)
