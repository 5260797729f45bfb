"""One self-contained page made of a JSON document: every number on it is looked up there, every text shown as text.

A number is written by :meth:`Page.number` with a JSON pointer (RFC 6901) into the document, and stands in the page as
``<data value="83.41267" data-at="/comparison/rows/0/reduction_percent">83.4</data>``: so a reader, or a test, can
follow each one to the document that ``--json`` prints. A policy in the page's head forbids every request.
"""

import base64
import hashlib
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import DataError
from ..results import NO_VALUE, plain, plain_text

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

_HERE = Path(__file__).parent
SCRIPTS = ("vendor/uPlot.iife.min.js", "page.js")
STYLES = ("vendor/uPlot.min.css", "page.css")
_COLOURS = {"#000000": "currentColor", "#555555": "currentColor", "#ffffff": "none"}
"""Colours of a drawing that follow the page's, light or dark."""


@dataclass(frozen=True)
class Page:
    """A page of a template, of the document that its numbers are from, and of data for its script."""

    template: Path
    """A Jinja template that extends ``base.html`` of this folder."""
    document: Mapping[str, Any]
    """In plain JSON types; ``--json`` prints the same."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """What the script draws: series, spectra, moving mechanisms; plain JSON types."""
    about: Mapping[str, Any] = field(default_factory=dict)
    """What else the template shows: pictures, texts."""
    live: Path | None = None
    """A script beside that of every page, which asks the server of the page for more; None: a page asks nobody."""

    def html(self) -> str:
        """The page as text."""
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
        from markupsafe import Markup

        def shown(value: Any) -> Any:  # noqa: ANN401
            if isinstance(value, str) and not isinstance(value, Markup):
                return "\n".join(map(plain_text, value.split("\n")))
            return value

        environment = Environment(
            loader=FileSystemLoader([self.template.parent, _HERE]),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            finalize=shown,
        )
        environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
        environment.filters["pointer"] = lambda name: str(name).replace("~", "~0").replace("/", "~1")
        environment.filters["of"] = lambda place, values: values[place]
        *vendored, own = (_HERE / name for name in SCRIPTS)
        files = [*vendored, self.live, own] if self.live else [*vendored, own]
        scripts = [file.read_text(encoding="utf-8") for file in files]
        styles = [(_HERE / name).read_text(encoding="utf-8") for name in STYLES]
        return environment.get_template(self.template.name).render(
            document=self.document,
            data=printable(self.data),
            number=self.number,
            interval=self.interval,
            scripts=[Markup(text) for text in scripts],
            styles=[Markup(text) for text in styles],
            script_hashes=_hashes(scripts),
            style_hashes=_hashes(styles),
            live=self.live is not None,
            version=version("counterpoise"),
            **self.about,
        )

    def write(self, path: str | Path) -> Path:
        """Write the page whole, or leave what was there before."""
        path = writable(path)
        part = path.with_name(f".{path.name}.part")
        try:
            part.write_text(self.html(), encoding="utf-8", errors="backslashreplace")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return path

    def at(self, pointer: str) -> Any:  # noqa: ANN401
        """What stands in the document at a JSON pointer. Raises KeyError where there is nothing."""
        found: Any = self.document
        for step in pointer.split("/")[1:]:
            step = step.replace("~1", "/").replace("~0", "~")
            found = found[int(step)] if isinstance(found, list) else found[step]
        return found

    def number(self, pointer: str, form: str = ".4g") -> "Markup":
        """A number of the document, as ``format`` writes it; a dash where it is null."""
        from markupsafe import Markup

        value = self.at(pointer)
        if value is None:
            return Markup(f'<span data-at="{{}}">{NO_VALUE}</span>').format(pointer)
        return Markup('<data value="{}" data-at="{}">{}</data>').format(json.dumps(value), pointer, format(value, form))

    def interval(self, pointer: str, form: str = ".4g") -> "Markup":
        """An interval of the document as ``[93.1, 95.0]``; nothing where it is null."""
        from markupsafe import Markup

        if self.at(pointer) is None:
            return Markup("")
        return Markup("[{}, {}]").format(self.number(f"{pointer}/0", form), self.number(f"{pointer}/1", form))


def writable(path: str | Path, endings: Sequence[str] = ()) -> Path:
    """The path of a page to be. Raises DataError where its folder is not there, it is one, or has other ``endings``."""
    path = Path(path)
    if endings and path.suffix.lower() not in endings:
        raise DataError(f"{path}: expected a name ending in {' or '.join(endings)}")
    if not path.parent.is_dir() or path.is_dir():
        what = "is a folder" if path.is_dir() else f"there is no folder {path.parent}"
        raise DataError(f"{path}: {what}; expected the name of a page in a folder that is there")
    return path


def printable(value: Any) -> Any:  # noqa: ANN401
    """Plain JSON data for a script, control characters of its texts escaped, those that turn the writing included."""
    if isinstance(value, Mapping):
        return {name: printable(one) for name, one in value.items()}
    if isinstance(value, list):
        return [printable(one) for one in value]
    return plain_text(value) if isinstance(value, str) and not value.isprintable() else value


def _hashes(texts: Sequence[str]) -> str:
    """As a page's policy names them."""
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts)
    return " ".join(f"'sha256-{digest}'" for digest in digests)


def inline_svg(figure: "Figure", name: str) -> "Markup":
    """A figure as SVG inside the page, its text as text, in the page's colours; ``name`` is read out in its place."""
    from markupsafe import Markup
    from matplotlib import rc_context

    out = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "sans-serif"}):
        figure.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    text = out.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    for colour, ours in _COLOURS.items():
        text = text.replace(colour, ours)
    text = re.sub(r"(stroke|fill)-opacity: 1;?", "", text)
    head = Markup('<svg role="img" aria-label="{}" ').format(plain_text(name))
    return head + Markup(re.sub(r'^<svg\s+(height="[^"]*"\s*|width="[^"]*"\s*)*', "", text))


def document_of(parts: Mapping[str, Any]) -> dict[str, Any]:
    """Results as the plain document of a page; numbers that are not finite become null, as a page cannot show them."""
    return dict(json.loads(json.dumps(plain(parts)), parse_constant=lambda _: None))
