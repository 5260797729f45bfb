"""Configuration of the documentation (Sphinx); `make docs` builds it with warnings as errors."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

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
autodoc_typehints = "description"
autodoc_member_order = "bysource"
suppress_warnings = ["misc.highlighting_failure"]


def write_api(_app: object) -> None:
    """A page of what each package offers by its own name, for autodoc."""
    import importlib
    import inspect

    lines: list[str] = []
    seen: list[object] = []
    for name in ("balance", "testbench"):
        package = importlib.import_module(name)
        lines += [f"``import {name}``", "-" * 40, ""]
        for public in getattr(package, "__all__", ()):
            found = getattr(package, public)
            if any(found is one for one in seen):
                continue
            seen.append(found)
            if inspect.isclass(found):
                lines += [f".. autoclass:: {name}.{public}", "   :members:", "", ""]
            elif callable(found):
                lines += [f".. autofunction:: {name}.{public}", "", ""]
    target = Path(__file__).parent / "_build" / "api.rst"
    target.parent.mkdir(exist_ok=True)
    target.write_text("\n".join(lines), encoding="utf-8")


def plain_stars(_app: object, _context: object, lines: list[str]) -> None:
    """Help texts are no markup: a star in one begins no emphasis."""
    lines[:] = [line.replace("*", "\\*") for line in lines]


def plain_bars(_app: object, _what: str, _name: str, _found: object, _options: object, lines: list[str]) -> None:
    """Docstrings write |x| for a magnitude, and no substitutions: bars outside literals and code stay bars."""
    for i, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            parts = line.split("``")
            lines[i] = "``".join(part if k % 2 else part.replace("|", "\\|") for k, part in enumerate(parts))


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
    app.connect("sphinx-click-process-description", plain_stars)
    app.connect("sphinx-click-process-epilog", plain_stars)
