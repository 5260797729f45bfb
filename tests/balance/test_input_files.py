"""Input files: each key is read with its unit; all errors are reported at once, by key, with what was expected."""

from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field

from balance.errors import DataError
from balance.input_files import (
    Count,
    Distinct,
    Flag,
    Measured,
    Number,
    OneOrMore,
    Positive,
    Quantity,
    Table,
    Text,
    Vector,
    csv_columns,
    csv_rows,
    json_document,
    json_schema,
    load_model,
    model_from_table,
    read_toml,
    xml_root,
)


class Mass(Table):
    """A mass."""

    name: Text | None = None
    """Name of it."""
    mass: Annotated[float, Quantity("mass", above=0.0)]
    """Mass of the body [kg]."""
    angle: Annotated[float, Quantity("angle")] = 0.0
    """Its direction [rad]."""


class Round(Table):
    """A round section."""

    kind: Literal["round"]
    """Kind of section."""
    diameter: Annotated[float, Quantity("length")]
    """Diameter [m]."""


class Square(Table):
    """A square section."""

    kind: Literal["square"]
    """Kind of section."""
    side: Annotated[float, Quantity("length")]
    """Side [m]."""


class Everything(Table):
    """A file with a key of every form."""

    masses: Annotated[list[Mass], Distinct, OneOrMore] = Field(default_factory=list)
    """Masses."""
    section: Annotated[Round | Square, Field(discriminator="kind")] | None = None
    """Section."""
    at: tuple[Annotated[float, Quantity("length")], Annotated[float, Quantity("length")]] = (0.0, 0.0)
    """A point [m]."""
    move: Annotated[Measured[float], Quantity("angle", "length")] | None = None
    """What moves, and how far [rad or m]."""
    unbalance: Annotated[complex, Vector("first moment")] = 0j
    """An unbalance [kg m]."""
    n: Number = 0.0
    """A number."""
    ratio: Positive = 1.0
    """A number above zero."""
    count: Count = 1
    """A whole number."""
    on: Flag = False
    """Whether it is on."""
    phase: Literal["lead", "lag"] = "lead"
    """What phases count."""
    limits: dict[str, Annotated[float, Quantity("force")]] = Field(default_factory=dict)
    """Limits by name [N]."""

    def _check(self) -> None:
        if self.on and not self.masses:
            raise DataError("on: means nothing without masses")


def test_every_form_is_read_in_si():
    """Quantities with their units, one of several dimensions, a single item as a list, and vectors."""
    found = model_from_table(
        Everything,
        {
            "masses": {"mass": "250 g", "angle": "90 deg"}, "section": {"kind": "square", "side": "3 mm"},
            "at": ["1 cm", "-2 mm"], "move": "20 mm", "unbalance": "3 g mm @ 180 deg", "count": 3,
            "limits": {"A": "2 kN"},
        },
        "x.toml",
    )  # fmt: skip
    assert found.masses[0].mass == 0.25
    assert found.masses[0].angle == pytest.approx(1.5707963267948966)
    assert found.section == Square(kind="square", side="3 mm")
    assert found.at == pytest.approx((0.01, -0.002))
    assert found.move == Measured(0.02, "length")
    assert found.unbalance == pytest.approx(-3e-6)
    assert found.limits == {"A": 2000.0}


WRONG = {
    "missing": (
        {"masses": [{"name": "A"}]},
        r"masses\[0\] \(A\)\.mass: missing: expected mass of the body",
    ),
    "misspelt": ({"massses": []}, r"massses: unknown key; did you mean 'masses'\?"),
    "unknown": ({"masses": [{"mass": "1 kg", "colour": 1}]}, r"masses\[0\]\.colour: unknown key: expected name, mass"),
    "bare": (
        {"masses": [{"mass": 3}]},
        r"masses\[0\]\.mass: 3 has no unit: expected a text with a unit",
    ),
    "no unit": ({"at": ["0", "0 m"]}, r"at\[0\]: '0' has no unit: write for example '0 m'"),
    "other unit": (
        {"limits": {"A": "3 kg"}},
        r"limits\.A: '3 kg': 'kg' is not a unit of force: expected",
    ),
    "too few": ({"at": ["0 m"]}, "at: missing: expected one value more"),
    "too many": ({"at": ["0 m"] * 3}, "at: has 3 values: expected at most 2"),
    "bound": ({"masses": [{"mass": "-1 kg"}]}, r"'-1 kg': expected more than zero"),
    "number": ({"n": True}, "n: True: expected a number"),
    "text for a number": ({"n": "3"}, "n: '3': expected a number"),
    "not finite": ({"n": float("nan")}, "n: nan: expected a number"),
    "not positive": ({"ratio": 0}, "ratio: 0: expected more than zero"),
    "whole": ({"count": 2.5}, r"count: 2\.5: expected a whole number"),
    "flag": ({"on": "yes"}, "on: 'yes': expected true or false"),
    "choice": ({"phase": "led"}, "phase: 'led': expected 'lead' or 'lag'; did you mean 'lead'"),
    "kind": ({"section": {"kind": "oval"}}, r"section\.kind: 'oval': expected round or square"),
    "no kind": ({"section": {"side": "3 mm"}}, r"section\.kind: missing: expected round or square"),
    "of a kind": ({"section": {"kind": "round"}}, r"section\.diameter: missing: expected diameter \[m\]"),
    "no table": ({"section": 3}, "section: 3: expected a table"),
    "no list": ({"at": "3 m"}, "at: '3 m': expected a list"),
    "twice": ({"masses": [{"name": "A", "mass": "1 kg"}] * 2}, "masses: 'A' is there twice"),
    "no angle": ({"unbalance": "3 g mm"}, "unbalance: '3 g mm' has no angle"),
    "no dimension": ({"move": "3 kg"}, "move: '3 kg': 'kg' is not a unit of angle"),
    "long": (
        {"at": ["1" * 1_000_000 + " m", "0 m"]},
        r"at\[0\]: '1{90,99}\.\.\.1{90,99} m': expected",
    ),
    "large": ({"n": 10**400}, "n: 1.*0: .*number"),
    "together": ({"on": True}, "on: means nothing without masses"),
}


@pytest.mark.parametrize(("table", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named_by_its_key(table, message):
    """File, key with its index, what stands there, what was expected; braces in a value are only text."""
    with pytest.raises(DataError, match=f"^x.toml: .*{message}"):
        model_from_table(Everything, table, "x.toml")
    with pytest.raises(DataError, match=r"'\{0\} kg'"):
        model_from_table(Mass, {"mass": "{0} kg"}, "x.toml")


def test_all_that_is_wrong_is_said_at_once():
    """A line each, and not without end."""
    with pytest.raises(DataError) as refused:
        model_from_table(Everything, {"n": "3", "phase": 1, "masses": [{"mass": "1"}]}, "x.toml")
    assert len(str(refused.value).splitlines()) == 3
    with pytest.raises(DataError, match=r"\.\.\. and 80 more"):
        model_from_table(Everything, {"masses": [{}] * 100}, "x.toml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a = [", "not a TOML file"),
        (b"a = 1\na = 2\n", "not a TOML file: Cannot overwrite"),
        (b'a = "\x00"\n', "not a TOML file: Illegal character"),
        ('a = "ö"'.encode("latin-1"), "not UTF-8 at byte 5"),
        ('a = "ö"'.encode("utf-16"), "not UTF-8 at byte 0"),
        (b"#" * 10_000_001, "is 10 MB: expected at most 10 MB"),
        (b"a = " + b"[" * 100_000, "more than 32 deep"),
        (b"a = " + b"[" * 40 + b"]" * 40, "more than 32 deep"),
        (b".".join([b"a"] * 1_000_000) + b" = 1", "more than 32 deep"),
        (b"a = " + b"1" * 5000, "not a TOML file: Exceeds the limit"),
        (b".".join([b'"a"'] * 20_000) + b" = 1", "more than 32 deep"),
        (b"a." * 20 + b"a = {" + b"b." * 20 + b"b = 1}", "more than 32 deep"),
    ],
    ids=[
        "open",
        "twice",
        "NUL",
        "latin-1",
        "utf-16",
        "large",
        "open lists",
        "lists",
        "dotted",
        "digits",
        "quoted",
        "dotted twice",
    ],
)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(tmp_path: Path, content, message):
    """Broken, hostile, or in another encoding."""
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(DataError, match=rf"^x\.toml: .*{message}") as refused:
        read_toml(tmp_path / "x.toml")
    assert len(str(refused.value).splitlines()) == 1
    assert len(str(refused.value)) < 300


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path: Path):
    """As editors of Windows write it."""
    (tmp_path / "x.toml").write_text('\ufeffmass = "1 kg"\n', encoding="utf-8")
    assert load_model(Mass, tmp_path / "x.toml").mass == 1.0


def test_rows_of_a_table_are_models(tmp_path: Path):
    """Units stand in the header; an empty cell is a key that is not given."""
    (tmp_path / "x.csv").write_text("name,mass (g),angle (deg)\nA,250,180\n\nB,1,\n", encoding="utf-8")
    first, second = csv_rows(Mass, tmp_path / "x.csv")
    assert (first.name, first.mass, first.angle) == ("A", 0.25, pytest.approx(3.141592653589793))
    assert (second.mass, second.angle) == (0.001, 0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,mass\nA,1\n", r"column 'mass': has no unit: write for example 'mass \(kg\)'"),
        ("name,mass (mm)\nA,1\n", r"column 'mass \(mm\)': 'mm' is not a unit of mass"),
        ("name,mas (kg)\nA,1\n", r"column 'mas \(kg\)': is not expected; did you mean 'mass'"),
        ("mass (kg),mass (g)\n1,1\n", r"columns 'mass \(kg\)' and 'mass \(g\)': state mass more than once"),
        ("name,angle (deg)\nA,1\n", "no column 'mass'"),
        ("name,mass (kg)\nA,\n", r"line 2 \(A\): mass: missing"),
        ("name,mass (kg)\nA,1,5\n", r"line 2: 3 cells, the header has 2 columns: is there a comma in a number"),
        ("name,mass (kg)\nA,one\n", r"line 2 \(A\): mass: 'one kg' is no mass"),
        ('name,mass (kg)\n"A,1\n', "not a CSV file"),
        ("name,mass (kg)\nA,1\nA,2\n", "'A' is there twice"),
        ("mas (kg),angle (mm),at\n,,\n", r"'mas \(kg\)': .*\n.*'angle \(mm\)': .*\n.*'at': .*\n.*no column 'mass'"),
        ("name,angle (deg)\nA,up\nB,1\nC,on\n", r"no column 'mass'.*\n.*2 \(A\): angle: 'up deg'.*\n.*4 \(C\): angle"),
    ],
)
def test_a_wrong_table_is_named_by_line_and_column(tmp_path: Path, text, message):
    """Header, unit, cell."""
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=rf"^x\.csv.*{message}"):
        csv_rows(Mass, tmp_path / "x.csv")


def test_columns_of_numbers_come_in_si_with_their_dimension():
    """In the order of the header; others are left aside."""
    found = csv_columns("x (mm),note,time (ms)\n1,a,2\n3,b,4\n", "x.csv", {"time": ("time",), "x": ("angle", "length")})
    assert found["time"].value == pytest.approx([0.002, 0.004])
    assert found["x"].value == pytest.approx([0.001, 0.003])
    assert found["x"].dimension == "length"


def test_the_schema_says_what_every_key_means():
    """Meaning, unit, example, and the default as it would be written."""
    mass = json_schema(Everything)["$defs"]["Mass"]["properties"]
    assert mass["mass"] == {
        "title": "Mass", "description": "Mass of the body [kg].", "type": "string", "unit": "kg", "examples": ["1 kg"],
    }  # fmt: skip
    assert mass["angle"]["default"] == "0 rad"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<a>" * 50_000, "elements are nested more than 1000 deep"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type"),
        ('<?xml version="1.0" encoding="gbk"?><a/>', "not UTF-8 but 'gbk'"),
        ('<?xml version="1.0" encoding="utf-7"?><a/>', "not UTF-8 but 'utf-7'"),
        ("<a><b></a>", "not an XML file: mismatched tag"),
        ("", "not an XML file"),
    ],
)
def test_xml_that_is_not_read(text, said):
    """Without end in depth, with entities, in another encoding than it is read in; the file is named."""
    with pytest.raises(DataError, match=f"m.xml: .*{said}|m.xml: {said}"):
        xml_root(text, "m.xml")
    assert xml_root('\ufeff<?xml version="1.0" encoding="utf-8"?><a b="1"/>', "m.xml").get("b") == "1"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 50_000, "nested more than 32 deep"),
        ("[" * 40 + "]" * 40, "nested more than 32 deep"),
        ('{"a": ' + "9" * 6000 + "}", "value has 6000 digits$"),
        ("{", "not a JSON file"),
    ],
)
def test_json_that_is_not_read(text, said):
    """Without end in depth, of integers without end, or none at all; the file is named."""
    with pytest.raises(DataError, match=rf"t\.json: .*{said}"):
        json_document(text, "t.json")
    assert json_document('\ufeff{"a": [1]}', "t.json") == {"a": [1]}
