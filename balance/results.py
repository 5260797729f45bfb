"""Fields of a result, listed once: the JSON document, the table of a command and the CSV export are made of that list.

A field says in its annotation how it is shown; so does a property, in the annotation of what it returns:

    @dataclass(frozen=True)
    class Swing:
        condition: Annotated[Condition, INLINE]
        speed: Annotated[float, Key("speed_rpm", "speed [rpm]", ".5g", to=rpm)]

        @property
        def ratio(self) -> Annotated[float, Key("", "ratio", ".3f")]:

``document(swing)`` is the JSON object, ``table(swings)`` the header and the cells of a table. A class without any such
annotation is shown by the names of its fields.
"""

import dataclasses
import inspect
import math
import re
import textwrap
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, cached_property, reduce
from importlib import import_module
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, get_args

from .errors import CounterpoiseError

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

NO_VALUE = "-"
"""Cell of a table for what has no value."""
_ROUNDING = 1e-9
"""Part of a vector in which a component is rounding."""


class Key(NamedTuple):
    """How a field of a result is shown."""

    name: str | None = ""
    """Key in JSON, the unit at its end; empty: the name of the field; None: in the table alone.

    ``{0.unit}`` stands for an attribute of the result, where its unit differs.
    """
    label: str = ""
    """Heading in a table, unit included; empty: in JSON alone."""
    form: str | Callable[[Any], str] = ""
    """Format of a cell, as of ``format``, in the unit of the key; or a function from the value itself to the text."""
    to: Callable[[Any], Any] | None = None
    """From a number in SI to the unit of the key; for tuples and mappings, each value. None stays None."""
    optional: bool = False
    """Whether the key is left out of JSON where the value is None."""
    parts: tuple[str, ...] = ()
    """Keys of the values of a tuple, which is an object in JSON then."""
    inline: bool = False
    """Whether the keys and columns of the value take its place."""
    inner: Any = None
    """Class of such a value; of a mapping, nothing is shown in a table."""


INLINE = Key(inline=True)


def along_axes(vector: Any, digits: int = 5) -> str:  # noqa: ANN401
    """Components of a vector (3,) [any unit] that are not zero, in ``digits``, such as ``x 130, z 4``."""
    least = _ROUNDING * max(map(abs, vector))
    shown = [f"{axis} {x:.{digits}g}" for axis, x in zip("xyz", vector, strict=True) if abs(x) > least]
    return ", ".join(shown) or "0"


IN_BODY = Key("position_m", "in body [mm]", lambda at: along_axes(1e3 * at))
"""How a place (3,) [m] in the frame of a body as in the file is shown."""


def per_cent(share: Any) -> Any:  # noqa: ANN401
    """A share, or array of shares (...,) [-], in per cent."""
    return 100.0 * share


def per_cent_text(value: float | None) -> str:
    """Per cent for people, or a dash where there is nothing to compare with."""
    return NO_VALUE if value is None else f"{value:.3g} %"


def rpm(speed: Any) -> Any:  # noqa: ANN401
    """A speed, or array of speeds (...,) [rad/s], in revolutions per minute."""
    return speed / (math.pi / 30.0)


LARGE_INSTANT_S = 1e5
"""From which six digits no longer tell seconds apart [s]."""


def instant_text(seconds: float) -> str:
    """An instant for a message [s]: of a large one, such as seconds since 1970, to the millisecond."""
    return f"{seconds:.6g}" if abs(seconds) < LARGE_INSTANT_S else f"{seconds:.3f}"


def given(text: str) -> str | None:
    """A text, or None for an empty one."""
    return text or None


def milli(value: Any) -> Any:  # noqa: ANN401
    """A value, or array of values (...,) [SI], in thousandths of its unit: metres in mm, kilograms in g."""
    return 1e3 * value


def first_of(names: Iterable[str], most: int) -> str:
    """The first names, and how many more there are."""
    every = list(names)
    return ", ".join(every[:most]) + (f" and {len(every) - most} more" if len(every) > most else "")


def grouped_texts(texts: Mapping[str, str]) -> dict[str, list[str]]:
    """Texts by name that differ in that name and in numbers alone, each once: the first, less the name that it begins
    with, and all names.
    """
    found: dict[str, tuple[str, list[str]]] = {}
    for name, text in texts.items():
        same = re.sub(r"-?\d[\d.]*", "", text.replace(name, ""))
        found.setdefault(same, (text.removeprefix(f"{name}: "), []))[1].append(name)
    return dict(found.values())


def counted(names: Iterable[str]) -> str:
    """Names in the order in which they come, with how many there are of each: ``2 large + tiny``; - if none."""
    return " + ".join(f"{n} {name}" if n > 1 else name for name, n in Counter(names).items()) or "-"


def micro(value: Any) -> Any:  # noqa: ANN401
    """A value, or array of values (...,) [SI], in millionths of its unit: metres in um, kg m in g mm."""
    return 1e6 * value


def finite(number: float) -> float | None:
    """A number, or None for one that is not finite."""
    return number if math.isfinite(number) else None


def plain_text(text: str) -> str:
    """Text from a file with control characters escaped."""
    return "".join(c if unicodedata.category(c)[0] != "C" else f"\\x{ord(c):02x}" for c in text)


class Brief:
    """A dataclass that Python's prompt shows by those of its fields that are short; others are three dots."""

    def __init_subclass__(cls, **named: Any) -> None:  # noqa: ANN401
        super().__init_subclass__(**named)
        cls.__repr__ = Brief.__repr__  # type: ignore[method-assign]  # before the dataclass writes one of all its fields

    def __repr__(self) -> str:
        shown = {f.name: repr(getattr(self, f.name)) for f in dataclasses.fields(self) if f.repr}  # type: ignore[arg-type]
        short = [f"{name}={text}" for name, text in shown.items() if len(text) <= _SHORT and "\n" not in text]
        return f"{type(self).__name__}({', '.join(short + ['...'] * (len(short) < len(shown)))})"


_SHORT, _LINE, _CELL = 60, 100, 22
"""Characters of a value, and of a line and a cell of a table, at the prompt."""
_COMPONENT, _ROUNDING = "(^|_)[FM][xyz]_Nm?$", 1e-9
"""Columns of components of force and moment, and the share of the largest that is rounding."""


def _names(cell: Any) -> Any:  # noqa: ANN401
    """A list of objects that have names as these names, as many as fit; anything else as it is."""
    named = isinstance(cell, list) and all(isinstance(one, dict) and "name" in one for one in cell)
    return textwrap.shorten(", ".join(one["name"] for one in cell), _CELL, placeholder=" ...") if named else cell


class Shown:
    """A result with faces: a table, a picture, what a notebook shows.

    ``class Swings(Shown, rows="swings", figure="package.module:function")`` names the attribute that the table lists
    and the function that draws the result, which lies higher up and is imported when it is asked for.
    """

    _rows: ClassVar[str] = ""
    _figure: ClassVar[str] = ""

    def __init_subclass__(cls, *, rows: str = "", figure: str = "") -> None:
        super().__init_subclass__()
        cls._rows, cls._figure = rows or cls._rows, figure or cls._figure
        if "__repr__" not in vars(cls):  # before the dataclass writes one of all its fields
            cls.__repr__ = Shown.__repr__  # type: ignore[method-assign]

    def table(self) -> "pandas.DataFrame":
        """A DataFrame, a row each; the columns are the keys of the JSON document, with the unit at their end."""
        return frame(getattr(self, self._rows))

    def plot(self) -> "Figure":
        """A figure of matplotlib that is saved by ``.savefig(path)``. Raises CounterpoiseError for none."""
        if not self._figure:
            raise CounterpoiseError(f"{type(self).__name__} has no picture: see its .table()")
        module, _, function = self._figure.partition(":")
        figure: Figure = getattr(import_module(module), function)(self)
        return figure

    def __repr__(self) -> str:
        from pandas import DataFrame

        rows = list(getattr(self, self._rows)) if self._rows else []
        header, cells = table(type(rows[0]), rows) if rows else ([], [])
        shown = DataFrame(cells, columns=header) if header else self.table()
        sizes = shown.filter(regex=_COMPONENT).abs().max()  # of planar mechanisms some are rounding alone
        shown = shown.drop(columns=sizes.index[sizes < _ROUNDING * sizes.max()]).map(_names)
        lines = [type(self).__name__]
        if header:
            shown = shown.loc[:, ~shown.isin(["", NO_VALUE]).all()]
            sizes = shown.map(len).max()
            if len(shown) > 1 and sum(max(size, len(str(name))) + 1 for name, size in sizes.items()) > _LINE:
                alike, wide = shown.nunique() == 1, sizes > _CELL  # such as lists of runs: last, where lines are broken
                lines += filter(None, [", ".join(f"{name}: {shown[name].iloc[0]}" for name in shown.columns[alike])])
                shown = shown[[*shown.columns[~alike & ~wide], *shown.columns[~alike & wide]]]
        text = shown.to_string(index=bool(shown.index.name), max_rows=20, line_width=_LINE)
        return "\n".join([*lines, text, *self.below()])

    def below(self) -> tuple[str, ...]:
        """Lines that are printed below the table."""
        return ()

    def _repr_html_(self) -> str:
        return str(self.table().to_html(border=0, na_rep=NO_VALUE))


def frame(results: Iterable[Any]) -> "pandas.DataFrame":
    """Results as rows of a DataFrame, a column a key of their JSON objects, such as ``counter_masses_kg.A``.

    ``.attrs["units"]`` has the units of the columns that name one.
    """
    from pandas import json_normalize

    return with_units(json_normalize([plain(one) for one in results]))


def with_units(of: "pandas.DataFrame") -> "pandas.DataFrame":
    """The same DataFrame, in ``.attrs["units"]`` the units that its columns name; a half width has its value's."""
    parts = {name: [part.removesuffix("_within") for part in str(name).split(".")] for name in of}
    units = {name: next(filter(None, (name_and_unit(part)[1] for part in own)), "") for name, own in parts.items()}
    of.attrs["units"] = {name: unit for name, unit in units.items() if unit}
    return of


_UNITS = {"percent": "%", "kgm": "kg m", "kgm2": "kg m2", "kgmm": "kg mm", "kgmm2": "kg mm2", "gmm": "g mm",
          "m_s2": "m/s2", "rad_s2": "rad/s2", "hz": "Hz", "Hz": "Hz", "mr": "m r", "mrw2": "m r omega^2",
          "mrw2a": "m r omega^2 a", "mrw2r": "m r omega^2 r"}  # fmt: skip
_UNIT = re.compile(rf"(.+?)_((?:{'|'.join(_UNITS)}|rad|deg|mm|um|m|Nm|N|kg|g|W|J|s|rpm|a|SI)(?:_per_(?:rad|s2?|m|g))?)")
"""Units at the end of keys."""


def name_and_unit(key: str) -> tuple[str, str]:
    """A key without its unit, and that: ``Fx`` and ``N`` of ``Fx_N``; of one without a unit the key, and none."""
    found = _UNIT.fullmatch(key)
    if not found:
        return key, ""
    unit = "g0" if key.endswith("acceleration_g") else found[2]
    return found[1], _UNITS.get(unit, unit.replace("_per_", "/").replace("Nm", "N m"))


def document(result: Any) -> dict[str, Any]:  # noqa: ANN401
    """The JSON object of a result, a dataclass, by its keys; numbers that are not finite are left to who prints it."""
    found: dict[str, Any] = {}
    of: type = type(result)
    for attribute, key in keys(of).items():
        value = getattr(result, attribute)
        if key.inline:
            found |= plain(value)
        elif key.name is not None and not (key.optional and value is None):
            parts = dict(zip(key.parts, value, strict=True)) if key.parts else value
            found[(key.name or attribute).format(result)] = plain(parts, key.to)
    return found


def plain(value: Any, to: Callable[[Any], Any] | None = None) -> Any:  # noqa: ANN401
    """A value in plain JSON types: results as objects, arrays and tuples as lists, paths as text."""
    if isinstance(value, Mapping):
        return {name: plain(one, to) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one, to) for one in value]
    if value is not None and to is not None:
        return plain(to(value))
    if dataclasses.is_dataclass(value):
        return document(value)
    if isinstance(value, PurePath):
        return str(value)
    return value.tolist() if hasattr(value, "tolist") else value


def table(of: type, results: Iterable[Any], *wanted: str) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table of results of a class: the ``wanted`` columns, by attribute, or all with a label."""
    columns = _columns(of)
    chosen = [columns[name] for name in wanted or columns]
    return [key.label for _, key in chosen], [[_cell(one, path, key) for path, key in chosen] for one in results]


@cache
def keys(of: type) -> dict[str, Key]:
    """The keys of a class of results by attribute: those of its bases, its fields, then its properties."""
    found: dict[str, Key] = {}
    for owner in reversed(of.__mro__):
        shown = dict(inspect.get_annotations(owner))
        for name, one in vars(owner).items():
            if isinstance(one, property | cached_property):
                getter = one.fget if isinstance(one, property) else one.func
                shown[name] = getattr(getter, "__annotations__", {}).get("return")
        for name, annotation in shown.items():
            for key in get_args(annotation)[1:]:
                if isinstance(key, Key):
                    found[name] = key._replace(inner=get_args(annotation)[0]) if key.inline else key
    if not found and dataclasses.is_dataclass(of):
        return {field.name: Key() for field in dataclasses.fields(of)}
    return found


def _columns(of: type) -> dict[str, tuple[tuple[str, ...], Key]]:
    """The columns of a class by attribute: the way to the value, and its key."""
    found: dict[str, tuple[tuple[str, ...], Key]] = {}
    for attribute, key in keys(of).items():
        if isinstance(key.inner, type):
            found |= {name: ((attribute, *path), one) for name, (path, one) in _columns(key.inner).items()}
        elif key.label:
            found[attribute] = (attribute,), key
    return found


def _cell(result: Any, path: Sequence[str], key: Key) -> str:  # noqa: ANN401
    value = reduce(getattr, path, result)
    if value is not None and callable(key.form):
        return key.form(value)
    shown = value if value is None or key.to is None else key.to(value)
    form = str(key.form)  # of a number that rounds to zero without a sign
    return NO_VALUE if shown is None else format(shown, f"z{form}" if form.startswith(".") else form)
