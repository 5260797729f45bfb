"""Printed tables, as printed."""

import json

import pytest

from balance import datasets
from testbench.errors import AnalysisError
from testbench.published_tables import load_published


def test_every_number():
    """All 78 printed numbers are found under their conditions."""
    table, found = load_published("kiper2019"), 0
    source = json.loads(datasets.find_dataset("kiper2019", "published", ".json").read_text("utf-8"))
    for payload, motion, acceleration, *percents in source["acceleration_amplitude_reduction_percent"]["rows"]:
        assert [table.reduction(payload, motion, acceleration, axis) for axis in "xyz"] == percents
        found += len(percents)
    assert found == 78


@pytest.mark.parametrize(("payload", "printed"), [(1.451, 40.77), (3.4116, 72.37), (5.0, 62.76)])
def test_payloads_have_the_label_they_round_to(payload, printed):
    """A payload has the label that it rounds to: 1.451 kg is printed as 1.45."""
    assert load_published("kiper2019").reduction(payload, "x", 3.0, "x") == printed


@pytest.mark.parametrize(
    ("payload", "motion", "acceleration", "axis"),
    [(1.46, "x", 3.0, "x"), (5.0, "triangle", 3.0, "x"), (5.0, "x", 3.5, "x"), (5.0, "x", 3.0, "w")],
)
def test_what_is_not_printed(payload, motion, acceleration, axis):
    """What is not printed is None, not a neighbour."""
    assert load_published("kiper2019").reduction(payload, motion, acceleration, axis) is None


def test_no_table(tmp_path):
    """Another name lists the shipped tables; another file is refused."""
    with pytest.raises(AnalysisError, match="kiper2019"):
        load_published("kiper2020")
    other = tmp_path / "other.json"
    other.write_text('{"source": 1}', encoding="utf-8")
    with pytest.raises(AnalysisError, match=r"other\.json: source: 1: expected a text"):
        load_published(str(other))


def test_what_is_no_number_is_refused(tmp_path):
    """A number that is none is named with its condition, not carried into a mean."""
    document = json.loads(datasets.find_dataset("kiper2019", "published", ".json").read_text("utf-8"))
    document["acceleration_amplitude_reduction_percent"]["rows"][5][4] = float("nan")
    other = tmp_path / "other.json"
    other.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(AnalysisError, match=r"rows\[5\]: y_axis: nan: expected a number"):
        load_published(str(other))


def test_a_table_of_ones_own(tmp_path):
    """Its columns are those of the run table that its conditions state, in any order; null is not printed."""
    table = {"definition": "RMS", "columns": ["y_axis", "motion", "peak_acceleration_rad_s2", "x_axis"]}
    rows = {"rows": [[80, "swing", 60, None], [70, "sweep", 30, 60.5]]}
    own, key = tmp_path / "own.json", "acceleration_amplitude_reduction_percent"
    own.write_text(json.dumps({"source": "mine", key: table | rows}), encoding="utf-8")
    found = load_published(str(own))
    assert [found.reduction(None, "swing", None, axis, 60.0) for axis in "xy"] == [None, 80.0]
    assert [found.reduction(None, "sweep", None, axis, 30.0) for axis in "xy"] == [60.5, 70.0]
    assert found.reduction(5.0, "sweep", None, "x", 30.0) is None
    own.write_text(
        json.dumps({"source": "mine", key: table | rows | {"columns": ["x_achse", "motion", "a", "b"]}}), "utf-8"
    )
    with pytest.raises(
        AnalysisError, match=r"columns: 'x_achse': expected some of payload_kg, .*; did you mean 'x_axis'"
    ):
        load_published(str(own))


@pytest.mark.parametrize(
    ("columns", "rows", "message"),
    [
        (["motion", "x_axis", "x_axis"], [["x", 80.0, 90.0]], r"columns: 'x_axis' is there twice"),
        (["motion", "w_axis"], [["x", 80.0]], r"columns: 'w_axis': expected some of"),
        (["motion", "x_axis"], [["x", 189.5]], r"rows\[0\]: x_axis: 189.5: expected a number of at most 100"),
        (["motion", "x_axis"], [["x", True]], r"rows\[0\]"),
        (["motion", "x_axis"], [["", 80.0]], r"rows\[0\]: motion: '': expected the name"),
        (["payload_kg", "motion", "x_axis"], [[-5.0, "x", 80.0]], r"payload_kg: -5.0: expected a number from 0 on"),
        (
            ["payload_kg", "motion", "x_axis"],
            [[5.0, "x", 80.0], [6.0, "x", 70.0], [5.004, "x", 60.0]],
            r"rows\[2\]: the condition of rows\[0\]",
        ),
    ],
)
def test_no_row_of_ones_own_table_is_guessed(columns, rows, message, tmp_path):
    """What is there twice, no percentage, or no name is refused by row and column."""
    table = {"definition": "rms", "columns": columns, "rows": rows}
    (tmp_path / "own.json").write_text(
        json.dumps({"source": "mine", "acceleration_amplitude_reduction_percent": table}), "utf-8"
    )
    with pytest.raises(AnalysisError, match=message):
        load_published(str(tmp_path / "own.json"))


def test_a_key_that_is_there_twice(tmp_path):
    """Neither of the two is taken."""
    (tmp_path / "own.json").write_text('{"source": "mine", "source": "yours"}', "utf-8")
    with pytest.raises(AnalysisError, match="'source' is there twice: remove one"):
        load_published(str(tmp_path / "own.json"))
