"""Input files: TOML, JSON, XML, and CSV with units in the header, read into models that check and document every key.

One loader reads them all within limits of size, depth and encoding, and says in one way what is beyond them.

A model is a ``Table``; a key that is a quantity is a text with its unit, ``Annotated[float, Quantity("mass")]``, and
comes out in SI. All errors of a file are reported at once, a line each: the file, the key, what was found, what was
expected. ``json_schema`` is the documentation of a file, from the docstrings of its model.
"""

import csv
import json
import math
import re
import reprlib
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Annotated, Any, Generic, NamedTuple, TypeVar, cast, get_args
from xml.etree import ElementTree

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StrictBool,
    StrictInt,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from .datasets import text_of
from .errors import CounterpoiseError, DataError, UnitError, suggestion
from .units import SI_UNITS, dimension_of, example, factor_to_si, parse, parse_vector

T = TypeVar("T")
V = TypeVar("V")
Model = TypeVar("Model", bound=BaseModel)

LARGEST_FILE = 10_000_000
"""Size limit of an input file [bytes]: a larger one is another kind of file, given by mistake."""
DEEPEST = 32
"""Deepest nesting of tables and lists."""
_LONGEST_TEXT = 200
"""Length limit of a quantity [characters]."""
_SHOWN = 20
"""Most errors shown of a file."""
_DEEPEST_XML = 1000
"""Deepest nesting of elements: a chain of bodies nests one in the other."""
_LONG_KEY = re.compile(rf"""(?<![\w."'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*\.[ \t]*){{{DEEPEST},}}""")
_XML_ENCODING = re.compile(r"""\s*<\?xml[^>]*?\bencoding\s*=\s*["']([^"'>]*)["']""")
_BARE_KEY = re.compile(r"[\w-]+")
_COLUMN = re.compile(r"\s*([^()]*?)\s*(?:(?:\((.+)\)|\[(.+)\])\s*)?")
_EXPLAINED, _ABSENT = "explained", "absent"
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _LONGEST_TEXT
_SHORT.maxlevel = 2


class FromText:
    """Annotation of a field that is written as a text and read by a function of the text and the reader's context."""

    def __init__(self, read: Callable[[str, Any], Any], such_as: str, dimensions: Sequence[str] = ()) -> None:
        self._read, self.example = read, such_as
        self.unit = " or ".join(SI_UNITS[dimension] for dimension in dimensions)

    def __get_pydantic_core_schema__(self, _source: Any, _handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        return core_schema.with_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(self, _schema: CoreSchema, _handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"type": "string", "examples": [self.example]} | ({"unit": self.unit} if self.unit else {})

    def _validate(self, value: object, info: ValidationInfo) -> Any:  # noqa: ANN401
        if isinstance(value, int | float) and not isinstance(value, bool) and self.unit:
            raise ValueError(f"{value} has no unit: expected a text with a unit, such as {self.example!r}")
        if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
            raise ValueError(f"expected a text{' with a unit' if self.unit else ''}, such as {self.example!r}")
        try:
            return self._read(value, info.context)
        except CounterpoiseError as error:
            raise ValueError(str(error)) from error


class Measured(NamedTuple, Generic[V]):
    """A quantity of one of several dimensions."""

    value: V
    """In SI."""
    dimension: str


class Quantity(FromText):
    """A text with a unit such as ``80 mm``: a float in SI, or Measured where it may have one of several dimensions."""

    def __init__(self, *dimensions: str, above: float = -math.inf, at_least: float = -math.inf) -> None:
        self.dimensions, self._above, self._at_least = dimensions, above, at_least
        super().__init__(self.parse, example(dimensions[0]), dimensions)

    def parse(self, text: str, _context: object = None) -> Any:  # noqa: ANN401
        """What the text says. Raises UnitError."""
        dimension = dimension_of(text, *self.dimensions)
        value = parse(text, dimension)
        if not value > self._above:
            raise UnitError(f"{text!r}: expected more than {'zero' if not self._above else self._above}")
        if not value >= self._at_least:
            raise UnitError(f"{text!r}: expected {'zero' if not self._at_least else self._at_least} or more")
        return value if len(self.dimensions) == 1 else Measured(value, dimension)


class Vector(FromText):
    """``magnitude @ angle``: a complex number in SI, or Measured where it may have one of several dimensions."""

    def __init__(self, *dimensions: str) -> None:
        self._dimensions = dimensions
        super().__init__(self._parse, f"{example(dimensions[0])} @ 30 deg", dimensions)

    def _parse(self, text: str, _context: object) -> complex | Measured[complex]:
        value, dimension = parse_vector(text, *self._dimensions), dimension_of(text, *self._dimensions)
        return value if len(self._dimensions) == 1 else Measured(value, dimension)


def _distinct(tables: list[T]) -> list[T]:
    names = [name for table in tables if (name := getattr(table, "name", None))]
    if again := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{again[0]!r} is there twice: give each a name of its own")
    return tables


Distinct = AfterValidator(_distinct)
"""Annotation of a list of tables: no two have one name (likely a line copied twice)."""


def _without_underscores(cell: object) -> object:
    if isinstance(cell, str) and "_" in cell:
        raise ValueError(f"{cell!r}: expected a number")
    return cell


NoUnderscores = BeforeValidator(_without_underscores)
"""Annotation of a number in a CSV: Python alone takes ``1_451`` for one."""


class OneForAll:
    """Annotation of a list of ``count`` items, or of any number: a single item may be written for all of them."""

    def __init__(self, count: int = 1) -> None:
        self._count = count

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        return core_schema.no_info_before_validator_function(self._listed, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        listed = handler(schema)
        return {"anyOf": [listed["prefixItems"][0] if "prefixItems" in listed else listed["items"], listed]}

    def _listed(self, value: object) -> object:
        return value if isinstance(value, list | tuple) else [value] * self._count


OneOrMore = OneForAll()
"""Annotation of a list of which a single item may be written without brackets."""
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0)]
Count = StrictInt
Flag = StrictBool
Text = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """A table of an input file: frozen, no key that is not known; the docstring of a field is its documentation."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, use_attribute_docstrings=True)

    @model_validator(mode="wrap")
    @classmethod
    def _explained(cls, value: object, handler: ValidatorFunctionWrapHandler) -> Any:  # noqa: ANN401
        """Word errors here, where the table's keys are known."""
        try:
            table = handler(value)
            table._check()
        except ValidationError as error:
            found = [_explain(cls, each) for each in error.errors(include_url=False)]
            raise ValidationError.from_exception_data(cls.__name__, found) from error
        except CounterpoiseError as error:
            wrong = InitErrorDetails(type=PydanticCustomError(_EXPLAINED, str(error)), loc=(), input=value)
            raise ValidationError.from_exception_data(cls.__name__, [wrong]) from error
        return table

    def _check(self) -> None:
        """Raise DataError for keys that do not go together."""


def load_model(
    model: type[Model], path: Path, error: type[CounterpoiseError] = DataError, context: object = None
) -> Model:
    """Read a TOML file into a model. Raises ``error``, a line for each key that is wrong."""
    return model_from_table(model, read_toml(path, error), path.name, error, context)


def model_from_table(
    model: type[Model],
    table: Mapping[str, object],
    source: str,
    error: type[CounterpoiseError] = DataError,
    context: object = None,
) -> Model:
    """Check a table against a model; ``source`` is what messages call the file, ``context`` what its texts refer to."""
    try:
        return model.model_validate(table, context=context)
    except ValidationError as wrong:
        lines = [_line(source, each, table) for each in wrong.errors(include_url=False)]
        raise error(_joined(lines)) from wrong


@contextmanager
def in_file(source: str, key: str = "") -> Iterator[None]:
    """Name the file, and the key where it is known, in what is raised about what was read from it."""
    try:
        yield
    except CounterpoiseError as error:
        kind = DataError if isinstance(error, UnitError) else type(error)
        raise kind(f"{source}: {key}: {error}" if key else f"{source}: {error}") from error


def read_text(path: Path, error: type[CounterpoiseError] = DataError, largest: int = LARGEST_FILE) -> str:
    """The text of a file in UTF-8 of at most ``largest`` bytes; a byte order mark stays in it.

    Raises ``error`` where there is no such file, or it is too large, or in another encoding.
    """
    try:
        size = path.stat().st_size
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise error(f"{path}: is a pipe or device; expected a file")
        if size > largest:
            raise error(f"{path.name}: is {size / 1e6:.0f} MB: expected at most {largest / 1e6:.0f} MB")
        return text_of(path)
    except FileNotFoundError as missing:
        raise error(f"no such file {path.name!r}") from missing
    except IsADirectoryError as folder:
        raise error(f"{path}: is a folder; expected a file") from folder
    except OSError as trouble:
        raise error(f"{path.name}: cannot be read: {trouble.strerror}") from trouble
    except UnicodeDecodeError as wrong:
        raise error(f"{path.name}: not UTF-8 at byte {wrong.start}: save it as UTF-8") from wrong


def read_toml(path: Path, error: type[CounterpoiseError] = DataError) -> dict[str, Any]:
    """The tables of a TOML file. Raises ``error`` if it is none."""
    return toml_tables(read_text(path, error), path.name, error)


def toml_tables(text: str, source: str, error: type[CounterpoiseError] = DataError) -> dict[str, Any]:
    """The tables of a TOML text; ``source`` is what messages call it. Raises ``error`` if it is none."""
    try:
        if _LONG_KEY.search(text):
            raise RecursionError  # tomllib takes quadratic time for such keys
        tables = tomllib.loads(text.removeprefix("\ufeff"))
        if _depth(tables) > DEEPEST:
            raise RecursionError
    except RecursionError:
        raise error(f"{source}: tables or lists are nested more than {DEEPEST} deep") from None
    except ValueError as wrong:  # also of an integer of more digits than Python reads
        raise error(f"{source}: not a TOML file: {_short(wrong)}") from wrong
    return tables


def json_document(text: str, source: str, error: type[CounterpoiseError] = DataError) -> Any:  # noqa: ANN401
    """What a JSON text says; ``source`` is what messages call it. Raises ``error`` if it is none."""
    try:
        document = json.loads(text.removeprefix("\ufeff"), object_pairs_hook=_once_each)
        if _depth(document) > DEEPEST:
            raise RecursionError
    except RecursionError:
        raise error(f"{source}: tables or lists are nested more than {DEEPEST} deep") from None
    except ValueError as wrong:  # also of an integer of more digits than Python reads
        raise error(f"{source}: not a JSON file: {_short(wrong)}") from wrong
    return document


def _short(wrong: ValueError) -> str:
    """What Python says of a text, without what it says to programmers."""
    return _SHORT.repr(str(wrong).partition("; use sys.")[0])[1:-1]


def _once_each(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """The table of these keys and values. Raises ValueError for a key that is there twice."""
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(key for k, (key, _) in enumerate(pairs) if any(key == before for before, _ in pairs[:k]))
        raise ValueError(f"{twice!r} is there twice: remove one")
    return table


def xml_root(text: str, source: str, error: type[CounterpoiseError] = DataError) -> ElementTree.Element:
    """The root of an XML text; ``source`` is what messages call it. Raises ``error`` if it is none.

    A document type, which may define entities, is refused, and so is a declared encoding that the text is not in.
    """
    text = text.removeprefix("\ufeff")
    declared = _XML_ENCODING.match(text)
    if declared and declared[1].casefold() not in ("utf-8", "us-ascii", "ascii"):
        raise error(f"{source}: not UTF-8 but {declared[1][:40]!r}, as it says: save it as UTF-8")
    if "<!DOCTYPE" in text:
        raise error(f"{source}: has a document type, which may define entities: take it out")
    parser: ElementTree.XMLPullParser[ElementTree.Element] = ElementTree.XMLPullParser(("start", "end"))
    root, depth = None, 0
    try:
        for begin in range(0, len(text), 1 << 16):
            parser.feed(text[begin : begin + (1 << 16)])
            for found in parser.read_events():
                event, element = cast(tuple[str, ElementTree.Element], found)
                root, depth = element if root is None else root, depth + (1 if event == "start" else -1)
                if depth > _DEEPEST_XML:
                    raise error(f"{source}: elements are nested more than {_DEEPEST_XML} deep")
        parser.close()
    except (ElementTree.ParseError, ValueError) as wrong:
        raise error(f"{source}: not an XML file: {wrong}") from wrong
    assert isinstance(root, ElementTree.Element)
    return root


def _depth(value: object) -> int:
    inner: Iterable[object] = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + max((_depth(item) for item in inner), default=0)


# CSV


_DECIMALS = re.compile(r"[+-]?\d*([.,])\d+(?:[eE][+-]?\d+)?")


def csv_cells(text: str, source: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Cells of the header, and line and cells of each row that is not blank; ``source`` is what messages call it.

    Semicolons or tabs separate them where the header has some; numbers then may have decimal commas, all or none.
    """
    text = text.removeprefix("\ufeff")
    first = text.partition("\n")[0]
    delimiter = next((mark for mark in ";\t" if mark in first), ",")
    try:
        lines = csv.reader(StringIO(text, newline=""), delimiter=delimiter, strict=True)
        header = next(lines, [])
        rows = [(lines.line_num, row) for row in lines if any(cell.strip() for cell in row)]
    except csv.Error as wrong:
        raise DataError(f"{source}: not a CSV file: {wrong}") from wrong
    for line, row in rows:
        if len(row) > len(header) and any(cell.strip() for cell in row[len(header) :]):
            raise DataError(
                f"{source}, line {line}: {len(row)} cells, the header has {len(header)} columns: is there a comma "
                "in a number?"
            )
    return header, rows if delimiter == "," else _decimal_points(header, rows, source)


def _decimal_points(
    header: Sequence[str], rows: Sequence[tuple[int, list[str]]], source: str
) -> list[tuple[int, list[str]]]:
    """Rows whose numbers have points for decimal commas; a column ``name`` has none."""
    lines: dict[str, int] = {}
    found = []
    for line, row in rows:
        cells = list(row)
        for i, cell in enumerate(row):
            if (number := _DECIMALS.fullmatch(cell.strip())) and [
                one.strip().casefold() for one in header[i : i + 1]
            ] != ["name"]:
                lines.setdefault(number[1], line)
                cells[i] = cell.replace(",", ".")
        found.append((line, cells))
    if len(lines) > 1:
        raise DataError(
            f"{source}: decimal commas (line {lines[',']}) and decimal points (line {lines['.']}): write all numbers "
            "with one mark"
        )
    return found


def csv_rows(model: type[Model], path: Path) -> list[Model]:
    """Read a CSV into models, a row each: ``radius (mm)`` in the header is the key ``radius`` in millimetres.

    A key that names its unit, ``mass_kg``, may be written in another: ``mass_g``, ``mass (g)`` or ``mass [g]``. Raises
    DataError, a line for each column and each cell that is wrong.
    """
    header, rows = csv_cells(read_text(path), path.name)
    columns, wrong = list[_Column](), list[str]()
    for cell in header:
        try:
            with in_file(path.name, f"column {cell!r}"):
                columns.append(_key_column(model, *_name_and_unit(cell)))
        except DataError as error:
            columns.append(_Column("", ""))
            wrong.append(str(error))
    keys = [column.key for column in columns]
    for key in dict.fromkeys(key for key in keys if keys.count(key) > 1 and key):
        twice = " and ".join(repr(cell) for cell, one in zip(header, keys, strict=True) if one == key)
        wrong.append(f"{path.name}: columns {twice}: state {key} more than once: keep one")
    wrong += [
        f"{path.name}: no column {key!r}: expected {_meaning(model, key)}"
        for key, field in model.model_fields.items()
        if field.is_required() and key not in keys
    ]
    found, is_whole = list[Model](), not wrong
    for line, row in rows:
        read = [(column, head, cell.strip()) for column, head, cell in zip(columns, header, row, strict=False)]
        cells = {column.key: column.read(cell) for column, _, cell in read if column.key and cell}
        renamed = {c.key: (head, cell) for c, head, cell in read if c.key and not c.unit and c.key != head.strip()}
        source = f"{path.name}, line {line}" + (f" ({cells['name']})" if "name" in cells else "")
        try:
            found.append(model.model_validate(cells))
        except ValidationError as error:
            for each in error.errors(include_url=False):
                if is_whole or (each["loc"] and each["loc"][0] in cells):  # the header's errors are said above
                    wrong.append(_row_line(source, each, cells, renamed))
    if wrong:
        raise DataError(_joined(wrong))
    try:
        return _distinct(found)
    except ValueError as error:
        raise DataError(f"{path.name}: {error}") from error


def csv_columns(text: str, source: str, dimensions: Mapping[str, tuple[str, ...]]) -> dict[str, Measured[list[float]]]:
    """Columns of numbers in SI and their dimensions, by name; each is required, in one of its ``dimensions``.

    Raises DataError, naming line and column of ``source``.
    """
    header, rows = csv_cells(text, source)
    columns = dict(_name_and_unit(cell) for cell in header)
    expected = ", ".join(f"{name} ({SI_UNITS[possible[0]]})" for name, possible in dimensions.items())
    if not set(dimensions) <= set(columns) or len(columns) < len(header):
        raise DataError(f"{source}: must hold the columns {expected}: found {', '.join(header) or 'none'}")
    found = {}
    for i, (name, unit) in enumerate(columns.items()):
        if name not in dimensions:
            continue
        with in_file(source, f"column {header[i]!r}"):
            if not unit:
                raise DataError(f"has no unit: write for example '{name} ({example(dimensions[name][0])[2:]})'")
            factor = factor_to_si(unit, *dimensions[name])
        cells = [_number(row[i] if i < len(row) else "", f"{source}, line {line}: {name}") for line, row in rows]
        found[name] = Measured([factor * cell for cell in cells], dimension_of(f"1 {unit}", *dimensions[name]))
    return found


def _name_and_unit(cell: str) -> tuple[str, str]:
    """Of a column."""
    match = _COLUMN.fullmatch(cell)
    return (match[1], match[2] or match[3] or "") if match else (cell.strip(), "")


class _Column(NamedTuple):
    """How a column is read."""

    key: str
    """Of the model; empty where it is none."""
    unit: str
    """That is written behind each cell."""
    factor: float = 1.0
    """By which each number is multiplied."""

    def read(self, cell: str) -> str:
        """What the model reads."""
        if self.factor == 1.0:
            return f"{cell} {self.unit}".strip()
        try:
            return cell if "_" in cell else f"{float(cell) * self.factor:.12g}"
        except ValueError:
            return cell


def _key_column(model: type[BaseModel], name: str, unit: str) -> _Column:
    """The column of a key. Raises DataError or UnitError for one that is no key, or lacks its unit or has another."""
    name = name.casefold() if name.casefold() in model.model_fields else name
    if name not in model.model_fields:
        stem, _, own = (name.casefold(), "", unit) if unit else name.partition("_")
        for key in model.model_fields:
            if own and key.startswith(f"{stem.casefold()}_"):
                wanted = key.removeprefix(f"{stem.casefold()}_")
                if any(isinstance(note, FromText) for note in _notes(model, key)):
                    raise DataError(f"is in {wanted} alone: write {key!r}")
                return _Column(key, "", _factor(own, wanted))
        known = ", ".join(model.model_fields)
        other = " (or in another unit, such as mass_g)" * ("mass_kg" in model.model_fields)
        raise DataError(
            f"is not expected{suggestion(name, model.model_fields) or f': expected some of {known}{other}'}"
        )
    forms = _text_forms(model, name)
    if unit and not forms:
        stem, _, own = name.partition("_")
        other = f", or {f'{stem} ({unit})'!r}" * bool(
            own and not any(isinstance(n, FromText) for n in _notes(model, name))
        )
        raise DataError(f"takes no unit in brackets: write {name!r}{other}")
    for quantity in forms:
        if not unit:
            raise DataError(f"has no unit: write for example '{name} ({quantity.example.split()[-1]})'")
        if isinstance(quantity, Quantity):
            factor_to_si(unit, *quantity.dimensions)
    return _Column(name, unit)


def _factor(unit: str, wanted: str) -> float:
    """Factor from a unit to that ``wanted`` as keys name them: ``g_per_cm3``."""
    written, known = unit.replace("_per_", "/"), wanted.replace("_per_", "/")
    dimension = dimension_of(f"1 {known}", *SI_UNITS)
    return factor_to_si(written, dimension) / factor_to_si(known, dimension)


def _text_forms(model: type[BaseModel], name: str) -> list[FromText]:
    """How a field is written as a text with a unit."""
    return [note for note in _notes(model, name) if isinstance(note, FromText) and note.unit]


def _notes(model: type[BaseModel], name: str) -> list[object]:
    """What annotates a field, or a part of it."""
    field = model.model_fields[name]
    return [*field.metadata, *(note for part in get_args(field.annotation) for note in get_args(part)[1:])]


def _number(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(f"{where} is {cell!r}: expected a number")
    return value


# What is wrong, and what is expected


def _explain(table: type[Table], error: Any) -> InitErrorDetails:  # noqa: ANN401
    """An error within a table, worded by the innermost table; others pass it on."""
    location, kind, context = error["loc"], error["type"], error.get("ctx", {})
    if kind in {_EXPLAINED, _ABSENT}:
        message = error["msg"]
    elif kind == "missing" and location[-1] in table.model_fields:
        kind, message = _ABSENT, f"missing: expected {_meaning(table, location[-1])}"
    elif kind == "extra_forbidden":
        known = list(table.model_fields)
        message = f"unknown key{suggestion(str(location[-1]), known) or ': expected ' + ', '.join(known)}"
    elif kind == "union_tag_not_found":
        kinds = " or ".join(_kinds(table.model_fields[str(location[0])].annotation))
        kind, location, message = _ABSENT, (*location, "kind"), f"missing: expected {kinds}"
    elif kind == "union_tag_invalid":
        known = _quoted(context["expected_tags"])
        kind, location = _ABSENT, (*location, "kind")
        message = f"{context['tag']!r}: expected {' or '.join(known)}{suggestion(str(context['tag']), known)}"
    else:
        message = _worded(kind, error["input"], context, error["msg"])
    known_kind = _ABSENT if kind == _ABSENT else _EXPLAINED
    return InitErrorDetails(type=PydanticCustomError(known_kind, message), loc=location, input=error["input"])


def _kinds(annotation: object) -> list[str]:
    """What ``kind`` may be in the tables of a union."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [str(kind) for kind in get_args(annotation.model_fields["kind"].annotation)]
    return [kind for part in get_args(annotation) for kind in _kinds(part)]


def _worded(kind: str, found: object, context: Mapping[str, Any], message: str) -> str:
    """One of pydantic's errors: what was found, and what was expected."""
    bounds = {"greater_than": "gt", "greater_than_equal": "ge", "less_than": "lt", "less_than_equal": "le"}
    if kind == "value_error":
        expected = str(context["error"])
    elif kind in bounds:
        bound = context[bounds[kind]]
        limit = {"gt": "more than {}", "ge": "{} or more", "lt": "less than {}", "le": "{} or less"}[bounds[kind]]
        expected = "expected " + limit.format("zero" if bound == 0 else f"{bound:g}")
    elif kind == "literal_error":
        near = suggestion(found, _quoted(context["expected"])) if isinstance(found, str) else ""
        expected = f"expected {context['expected']}{near}"
    elif kind in {"too_short", "too_long"}:
        bound = context.get("min_length" if kind == "too_short" else "max_length")
        return (
            f"has {context['actual_length']} values: expected at {'least' if kind == 'too_short' else 'most'} {bound}"
        )
    elif kind == "missing":
        return "missing: expected one value more"
    else:
        expected = _EXPECTED.get(kind, message[0].lower() + message[1:])
    named = isinstance(found, str | int | float) and not expected.startswith(repr(found))
    listed = isinstance(found, list) and not any(isinstance(item, dict) for item in found)
    return f"{_SHORT.repr(found)}: {expected}" if named or listed else expected


_EXPECTED = dict.fromkeys(("model_type", "dict_type", "model_attributes_type"), "expected a table")
_EXPECTED |= dict.fromkeys(("list_type", "tuple_type"), "expected a list")
_EXPECTED |= dict.fromkeys(("float_type", "float_parsing", "finite_number"), "expected a number")
_EXPECTED |= dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "expected a whole number")
_EXPECTED |= {
    "string_type": "expected a text",
    "string_too_short": "expected a text",
    "bool_type": "expected true or false",
}


def _quoted(text: str) -> list[str]:
    return re.findall(r"'([^']*)'", text)


def _meaning(table: type[BaseModel], key: str) -> str:
    """What a field of a table is, from its docstring, with an example."""
    described = (table.model_fields[key].description or key).split("\n")[0].rstrip(".")
    such_as = "".join(f", such as {form.example!r}" for form in _text_forms(table, key)[:1])
    choices = [repr(choice) for choice in get_args(table.model_fields[key].annotation) if isinstance(choice, str)]
    return described[0].lower() + described[1:] + such_as + f": {' or '.join(choices)}" * bool(choices)


def _joined(lines: Sequence[str]) -> str:
    """One line for each distinct error, _SHOWN at most."""
    distinct = list(dict.fromkeys(lines))
    more = f"\n... and {len(distinct) - _SHOWN} more" if len(distinct) > _SHOWN else ""
    return "\n".join(distinct[:_SHOWN]) + more


def _line(source: str, error: Any, table: object) -> str:  # noqa: ANN401
    """``FILE: masses[1] (B).angle: what is wrong``: the keys as in the file, without those of pydantic."""
    path, here = "", table
    for i, part in enumerate(error["loc"]):
        if isinstance(here, dict) and part in here:
            here = here[part]
            path += f".{_key(part)}"
        elif isinstance(here, list | tuple) and isinstance(part, int) and part < len(here):
            here = here[part]
            path += f"[{part}]"
            if isinstance(here, dict) and isinstance(here.get("name"), str):
                path += f" ({here['name']})"
        elif error["type"] == _ABSENT and i == len(error["loc"]) - 1:
            path += f".{_key(part)}"
    explained = error["type"] in {_EXPLAINED, _ABSENT}
    message = error["msg"] if explained else _worded(error["type"], error["input"], error.get("ctx", {}), error["msg"])
    return f"{source}: {path.removeprefix('.')}: {message}" if path else f"{source}: {message}"


def _row_line(source: str, error: Any, cells: Mapping[str, str], renamed: Mapping[str, tuple[str, str]]) -> str:  # noqa: ANN401
    """As ``_line``, of the row of a CSV; ``renamed`` has the column and the cell of a key as they are written."""
    key = error["loc"][0] if error["loc"] else ""
    if key in renamed:
        head, cell = renamed[key]
        read = f", {cell!r} as {key}" if cell != cells.get(key, cell) else ""
        return _line(f"{source}: column {head!r}{read}", {**error, "loc": ()}, cells)
    message = error["msg"]
    for key, (head, _) in renamed.items():
        message = message.replace(key, head)
    return _line(source, {**error, "msg": message}, cells)


def _key(part: object) -> str:
    """A key as TOML writes it."""
    text = str(part) if len(str(part)) < _LONGEST_TEXT else f"{str(part)[:_LONGEST_TEXT]}..."
    return text if _BARE_KEY.fullmatch(text) else f'"{text}"'


class _Schema(GenerateJsonSchema):
    """Defaults as they are written in a file."""

    def default_schema(self, schema: Any) -> JsonSchemaValue:  # noqa: ANN401
        inner = self.generate_inner(schema["schema"])
        default = schema.get("default")
        if isinstance(default, float) and "unit" in inner:
            return inner | {"default": f"{default:g} {inner['unit']}"}
        return super().default_schema(schema)


def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """JSON schema of an input file: keys with their meaning, unit, example and default."""
    return model.model_json_schema(schema_generator=_Schema)
