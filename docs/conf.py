"""Configuration of the documentation (Sphinx); `make docs` builds it with warnings as errors."""

import functools
import inspect
import operator
import sys
import types
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from numpy import ndarray

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent)]

project = "counterpoise"
author = copyright = "The counterpoise developers"
release = version = version_of("counterpoise")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_click"]
html_math_renderer = "mathml"
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "counterpoise"
html_copy_source = False
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
smartquotes = False
nb_execution_timeout = 120
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 100
autodoc_member_order = "bysource"
suppress_warnings = ["misc.highlighting_failure"]


def plain(annotation: Any) -> Any:  # noqa: ANN401
    """An annotation without what tables and checks of files add to it, arrays by their class alone."""
    if isinstance(annotation, list):  # of a callable's arguments
        return [plain(one) for one in annotation]
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return plain(parts[0])
    if origin is ndarray:
        return ndarray
    if not parts or origin is Literal:
        return annotation
    of = [plain(one) for one in parts]
    return functools.reduce(operator.or_, of) if origin in (Union, types.UnionType) else origin[tuple(of)]


def plain_annotations(found: Any) -> None:  # noqa: ANN401
    """The annotations of a class with its members, or of a function, made plain in this process."""
    members = list(vars(found).values()) if inspect.isclass(found) else []
    for one in [found, *members]:
        one = getattr(one, "fget", getattr(one, "func", getattr(one, "__func__", one)))
        if isinstance(annotations := getattr(one, "__annotations__", None), dict):
            annotations.update({name: plain(value) for name, value in annotations.items()})
    if hasattr(found, "model_fields"):  # of files: made from them, and not by hand
        found.__signature__ = inspect.Signature()


DEEPER = {"testbench": ["rotating.vectors", "rotating.Vectors"]}
"""What people call that a module of a package offers."""


def write_api(_app: object) -> None:
    """A page of what each package offers by its own name, for autodoc."""
    import importlib

    lines: list[str] = []
    seen: list[object] = []
    for name in ("balance", "testbench"):
        package = importlib.import_module(name)
        lines += [f"``import {name}``", "-" * 40, ""]
        for public in [*package.__all__, *DEEPER.get(name, ())]:
            found = operator.attrgetter(public)(package)
            if any(found is one for one in seen):
                continue
            seen.append(found)
            if inspect.isclass(found):
                plain_annotations(found)
                lines += [
                    f".. autoclass:: {name}.{public}",
                    "   :members:",
                    "   :exclude-members: model_config",
                    "",
                    "",
                ]
            elif callable(found):
                plain_annotations(found)
                lines += [f".. autofunction:: {name}.{public}", "", ""]
    target = Path(__file__).parent / "_build" / "api.rst"
    target.parent.mkdir(exist_ok=True)
    target.write_text("\n".join(lines), encoding="utf-8")


def as_typed(_app: object, _context: object, lines: list[str]) -> None:
    """What help texts show line by line, examples and files, as it is typed."""
    given, lines[:] = lines[:], []
    for line in given:
        shown = line.removeprefix("| ")
        if not (line.startswith("| ") and shown.startswith(" ")):
            if lines and lines[-1].startswith("   "):
                lines.append("")
            lines.append(line.replace("*", "\\*"))
        else:
            if not (lines and lines[-1].startswith("   ")):
                lines += ["", ".. code-block:: text", ""]
            lines.append(f"   {shown}")


def particular(_app: object, _context: object, lines: list[str]) -> None:
    """Options without those that all commands have."""
    blocks = "\n".join(lines).split(".. option:: ")
    kept = [one for one in blocks if one.strip() and not one.startswith(("-v, --all", "-q, --quiet"))]
    lines[:] = [line for one in kept for line in f".. option:: {one}".split("\n")]


def explained(_app: object, _context: object, lines: list[str]) -> None:
    """Arguments that mean the same in all commands, in words; others are in the text of their command."""
    from command_groups import ARGUMENTS

    given, lines[:] = lines[:], []
    for line in given:
        if line.startswith(".. option:: ") and (meaning := ARGUMENTS.get(line[12:].strip("[]."))):
            lines += [line, "", f"   {meaning}", ""]


def plain_stars(_app: object, _context: object, lines: list[str]) -> None:
    """Help texts are no markup: a star in one begins no emphasis."""
    lines[:] = [line.replace("*", "\\*") for line in lines]


def plain_bars(_app: object, _what: str, _name: str, _found: object, _options: object, lines: list[str]) -> None:
    """Docstrings write |x| for a magnitude, and no substitutions: bars outside literals and code stay bars."""
    for i, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            parts = line.split("``")
            lines[i] = "``".join(part if k % 2 else part.replace("|", "\\|") for k, part in enumerate(parts))


def written_out(*event: Any) -> tuple[str | None, str | None]:  # noqa: ANN401
    """Defaults that are made anew for each object, as three dots."""
    *_, signature, returned = event
    return signature and signature.replace("<factory>", "..."), returned


def mathml(visitor: Any, node: Any) -> None:  # noqa: ANN401
    """Equations as MathML: browsers draw them without script or network."""
    from docutils.nodes import SkipNode
    from latex2mathml.converter import convert

    block = node.tagname == "math_block"
    formula = convert(node.astext(), display="block" if block else "inline")
    visitor.body.append(f'<div class="math">{formula}</div>' if block else formula)
    raise SkipNode


def setup(app: Any) -> None:  # noqa: ANN401
    """Write the page before anything is read; take help texts as they are."""
    app.add_html_math_renderer("mathml", inline_renderers=(mathml, None), block_renderers=(mathml, None))
    app.connect("builder-inited", write_api)
    app.connect("autodoc-process-docstring", plain_bars)
    app.connect("autodoc-process-signature", written_out)
    app.connect("sphinx-click-process-description", plain_stars)
    app.connect("sphinx-click-process-epilog", as_typed)
    app.connect("sphinx-click-process-options", particular)
    app.connect("sphinx-click-process-arguments", explained)
