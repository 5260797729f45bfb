"""Fields of results, listed once."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
import pytest
from pandas import DataFrame

from balance.errors import CounterpoiseError, suggestion
from balance.results import (
    INLINE,
    Key,
    Shown,
    document,
    frame,
    grouped_texts,
    instant_text,
    per_cent,
    rpm,
    table,
)


@dataclass(frozen=True)
class Condition:
    """What two runs share."""

    motion: Annotated[str, Key("", "motion")]
    payload: Annotated[float, Key("payload_kg", "payload kg", "g")]


@dataclass(frozen=True)
class Reading:
    """Every kind of field."""

    condition: Annotated[Condition, INLINE]
    speed: Annotated[float, Key("speed_rpm", "speed [rpm]", ".1f", to=rpm)]
    course: Annotated[np.ndarray, Key("course_rpm", to=rpm)]
    sizes: Annotated[tuple[float | None, float], Key("sizes_m", to=per_cent, parts=("with", "without"))]
    parts: Annotated[tuple[Condition, ...], Key()] = ()
    note: Annotated[str | None, Key("", "note", optional=True)] = None
    hidden: int = 3

    @cached_property
    def ends(self) -> Annotated[tuple[float, float], Key("ends_percent", to=per_cent)]:
        """Both ends."""
        return 0.25, 0.5

    @property
    def text(self) -> Annotated[str, Key(None, "text", lambda text: f"<{text}>")]:
        """In the table alone."""
        return "word"


TURN = 2.0 * np.pi / 60.0
ONE = Reading(Condition("x", 5.0), TURN, np.array([TURN, 2.0 * TURN]), (None, 0.5), (Condition("y", 1.0),))


def test_document_is_what_the_fields_say():
    """Units converted leaf by leaf, nested results, inlined ones; None stays None, or is left out if optional."""
    assert document(ONE) == {
        "motion": "x",
        "payload_kg": 5.0,
        "speed_rpm": pytest.approx(1.0),
        "course_rpm": pytest.approx([1.0, 2.0]),
        "sizes_m": {"with": None, "without": 50.0},
        "parts": [{"motion": "y", "payload_kg": 1.0}],
        "ends_percent": [25.0, 50.0],
    }


def test_a_class_without_keys_is_shown_by_its_fields():
    """As :func:`dataclasses.asdict`."""

    @dataclass(frozen=True)
    class State:
        name: str
        size: int = 1

    assert document(State("a")) == {"name": "a", "size": 1}


@pytest.mark.parametrize(
    ("wanted", "header", "row"),
    [
        ((), ["motion", "payload kg", "speed [rpm]", "note", "text"], ["x", "5", "1.0", "-", "<word>"]),
        (("text", "payload"), ["text", "payload kg"], ["<word>", "5"]),
    ],
)
def test_table_by_labels_and_formats(wanted, header, row):
    """All columns with a label, or those that are wanted, in that order; a header where there are no rows."""
    assert table(Reading, [ONE], *wanted) == (header, [row])
    assert table(Reading, [], *wanted) == (header, [])


@dataclass(frozen=True)
class Rounded:
    """A number in few digits."""

    value: Annotated[float, Key("", "value", ".4f")]


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("rms_F_N", "N"), ("torque_A_Nm", "N m"), ("counter_masses_kg.A0A", "kg"), ("amplitude_m_s2.with", "m/s2"),
        ("added_inertia_kgm2", "kg m2"), ("reduction_percent", "%"), ("peak_acceleration_g", "g0"),
        ("peak_acceleration_rad_s2", "rad/s2"), ("band_hz", "Hz"), ("stiffness_N_per_m", "N/m"), ("axis", None),
    ],
)  # fmt: skip
def test_units_of_columns_are_beside_the_table(key, unit):
    """Of a key with its unit at the end, also where names of sites or joints follow; of another none."""
    whole, *part = key.split(".")
    found = frame([{whole: {part[0]: 1.0} if part else 1.0}])
    assert found.attrs["units"] == ({} if unit is None else {key: unit})


@dataclass(frozen=True)
class Listed:
    """A row of a result that is printed."""

    motion: Annotated[str, Key("", "motion")]
    names: Annotated[str, Key("", "names")]
    size: Annotated[float | None, Key("", "size", "g")]
    doubts: Annotated[str, Key("", "doubts")] = ""


@pytest.mark.parametrize(
    ("rows", "printed"),
    [
        ([Listed("x", "a", 1.5)], ["motion names size", "     x     a  1.5"]),
        ([Listed("x", "a", 1.5), Listed("x", "b", None)],
         ["motion names size", "     x     a  1.5", "     x     b    -"]),
        ([Listed("x" * 60, "a", None), Listed("x" * 60, "b" * 40, 2.0)],
         ["motion: " + "x" * 60, "size" + f"{'names':>41}", "   -" + f"{'a':>41}", "   2 " + "b" * 40]),
    ],
)  # fmt: skip
def test_a_print_is_no_wider_than_what_it_says(rows, printed):
    """Without columns that no row has; where it is too wide what all rows share once, and long cells last."""

    class Printed(Shown, rows="rows"):
        def __init__(self):
            self.rows = rows

    assert repr(Printed()).splitlines() == ["Printed", *printed]


@pytest.mark.parametrize(
    ("least", "printed"), [(1e-16, ["rms_F_N", "rms_Fx_N", "A_mass_kg"]), (1e-6, None), (1.0, None)]
)
def test_components_that_are_rounding_alone_are_not_printed(least, printed):
    """Beside others that are not; whole vectors and variables are, also where they are zero."""

    class Printed(Shown):
        def table(self):
            return DataFrame({"rms_F_N": [0.0], "rms_Fx_N": [1.0], "rms_Fy_N": [-least], "A_mass_kg": [0.0]})

    assert repr(Printed()).splitlines()[1].split() == (printed or list(Printed().table()))


def test_a_result_without_a_picture_says_so():
    """In a sentence that names what it has."""

    class Rows(Shown, rows="rows"):
        rows = ()

    with pytest.raises(CounterpoiseError, match=r"Rows has no picture: see its \.table\(\)"):
        Rows().plot()


def test_what_rounds_to_zero_has_no_sign():
    """Negative numbers below the last digit are printed as zero; others keep their sign."""
    assert table(Rounded, [Rounded(-1e-6), Rounded(-0.0), Rounded(-0.25)])[1] == [["0.0000"], ["0.0000"], ["-0.2500"]]


def test_what_differs_by_names_and_numbers_is_said_once():
    """With the numbers and in the order of the first; other words are another text."""
    texts = {"r1": "r1: lost 3 of 4 at -0.5 s", "r2": "r2: lost 1 of 9 at 12.25 s", "r3": "r3: lost all", "r4": "whole"}
    said = {"lost 3 of 4 at -0.5 s": ["r1", "r2"], "lost all": ["r3"], "whole": ["r4"]}
    assert list(grouped_texts(texts).items()) == list(said.items())


@pytest.mark.parametrize(
    ("word", "known", "meant"), [("x", ["Mx", "y"], ""), ("X", ["x"], "'x'"), ("mx", ["Mx", "My"], "'Mx'")]
)
def test_no_other_word_is_meant_by_a_letter(word, known, meant):
    """Half of every name of two letters is like one letter."""
    assert suggestion(word, known) == (f"; did you mean {meant}?" if meant else "")


def test_instants_a_second_apart_are_written_apart():
    """Of a logger that counts from its start, and of one that counts from 1970."""
    assert [instant_text(t) for t in (0.0, 1.5, 12.345678)] == ["0", "1.5", "12.3457"]
    assert [instant_text(1773479520.123 + i) for i in (0, 1)] == ["1773479520.123", "1773479521.123"]
