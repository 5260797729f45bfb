"""The words of the field: docs/glossary.md against the names of files, public names, keys of JSON and messages."""

import ast
import re

import pytest

from .source_trees import ROOT, modules, trees, walked

PAGE = (ROOT / "docs" / "glossary.md").read_text("utf-8")
COMPATIBLE = {"held_value", "phases_alike", "phases_off_alike_deg_within", "told"}
"""Keys of documents and of input files, and codes, that keep an older word: users' scripts and files have them."""
BANNED = re.findall(r"^\| ([a-z ]+) \|", PAGE.split("## Words that are not used")[1].split("|---|")[1], re.MULTILINE)
HELD_OUT = r"(?!held[_ -]out)"
"""Data that a model is tested on and was not fitted to: a term of statistics."""
WORD = re.compile(rf"(?<![a-z]){HELD_OUT}(?:{'|'.join(BANNED)})(?:es|s)?(?![a-z])", re.IGNORECASE)
REPORTING = {"Finding", "Refusal", "echo", "emit_table", "secho"}


def public_names(tree: ast.Module) -> set[str]:
    """Functions, classes, constants, fields and parameters that others see."""
    names: set[str] = set()
    for node in walked(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            names.add(node.name)
            if isinstance(node, ast.FunctionDef):
                names |= {argument.arg for argument in (*node.args.args, *node.args.kwonlyargs)}
            else:
                targets = (item.target for item in node.body if isinstance(item, ast.AnnAssign))
                names |= {target.id for target in targets if isinstance(target, ast.Name)}
    constants = (target for node in tree.body if isinstance(node, ast.Assign) for target in node.targets)
    return names | {target.id for target in constants if isinstance(target, ast.Name) and target.id[0] != "_"}


def keys(tree: ast.Module) -> set[str]:
    """Keys of dictionaries that are written out: those of JSON documents are among them."""
    found = (key for node in walked(tree) if isinstance(node, ast.Dict) for key in node.keys)
    return {key.value for key in found if isinstance(key, ast.Constant) and isinstance(key.value, str)}


def messages(tree: ast.Module) -> set[str]:
    """Texts in what is raised, reported as a finding or printed."""
    calls = [node for node in walked(tree) if isinstance(node, ast.Call) and _reports(node)]
    calls += [node.exc for node in walked(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)]
    constants = (part for call in calls for part in ast.walk(call) if isinstance(part, ast.Constant))
    return {part.value for part in constants if isinstance(part.value, str)}


def _reports(call: ast.Call) -> bool:
    return (call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")) in REPORTING


@pytest.mark.parametrize("texts", [public_names, keys, messages])
def test_no_private_words(texts):
    """What users and developers read has the words of the field."""
    found = {str(path): sorted(filter(WORD.search, texts(tree) - COMPATIBLE)) for path, tree in trees().items()}
    assert {path: words for path, words in found.items() if words} == {}


def test_files_have_names_of_the_field():
    """No folder and no file of the packages has such a word in its name."""
    assert len(BANNED) > 10
    assert [path for path in trees() if WORD.search(str(path))] == []


def test_what_the_glossary_names_exists():
    """Every module that the glossary refers to is there."""
    cells = [row.split("|")[3] for row in PAGE.split("## Words that")[0].splitlines() if row.count("|") == 5]
    named = {name for cell in cells for name in re.findall(r"`([a-z_.0-9]+)`", cell)}
    assert len(named) > 30
    assert [n for n in sorted(named) if not any(f".{module}".endswith(f".{n}") for module in modules())] == []
