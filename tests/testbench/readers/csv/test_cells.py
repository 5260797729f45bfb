"""Cells and rows that are no plain numbers: what is a number in another notation, or none at all."""

import pytest

HEADER = "Time (s),AccX (g),AccY (g)\n"
ROWS = [f"{i / 1000:.4f},{i % 7 - 3}.5,{i % 5}.25\n" for i in range(600)]


@pytest.mark.parametrize(
    ("token", "said"),
    [("01C3", "hexadecimal"), ("FF0A", "hexadecimal"), ("(1.5)", "notation"), ("1.5-", "notation"),
     ("- 1.5", "notation"), ("1.5D+08", "notation"), ("1.5+103", "notation"), ("1.5 kN", "notation"),
     ('"1.5"', "notation"), ("0x1F", "notation"), ("1_000", "notation"), ("0.1e", "notation"), ("12A", "hexadecimal"),
     ("E005", None), ("Err 5", None), ("OL", None), ("****", None), ("1e999", None), ("nan", None), ("1.#IND", None)],
)  # fmt: skip
def test_a_number_in_another_notation_is_refused(log, token, said):
    """What is a number to a person, below numbers written otherwise, is no missing value: its loss is an error."""
    found = log(HEADER + "".join([*ROWS[:500], f"0.5000,{token},1.0\n", *ROWS[501:]]))
    errors = [(f.code, f.where) for f in found.findings if f.severity == 2]
    assert errors == ([("ambiguous_number", "line 502")] if said else [])
    assert said is None or said in found.message("ambiguous_number")


def test_words_before_the_sensor_is_ready_hide_no_numbers(log):
    """A column of words in all of the first lines, and of numbers at the end, is a channel with values missing."""
    found = log(
        "Time (s),F (N),G (N),note\n" + "".join(f"{i / 100},{'WAIT' if i < 600 else i},{i},ok\n" for i in range(1200))
    )
    assert found.column("F (N)")[600:].tolist() == [float(i) for i in range(600, 1200)]
    assert "600 of its cells" in found.message("not_a_number")
    assert [f.channel for f in found.findings if f.code == "text_channel"] == ["note"]


def test_means_under_the_data_are_no_samples(log):
    """A word where the time stands: the line is no row, and an error; a word in another column is a row."""
    found = log(HEADER + "".join(ROWS) + "Average,1.5,2.5\nMax,2.5,3.5\n")
    assert len(found.time()) == len(ROWS)
    assert [(f.code, f.where) for f in found.findings if f.severity == 2] == [
        ("text_row", f"lines {len(ROWS) + 2}, {len(ROWS) + 3}")
    ]
    found = log("AccX (g),Time (s)\n" + "".join(f"{'OL' if i == 50 else i},{i / 100}\n" for i in range(100)))
    assert len(found.time()) == 100
    assert not [f for f in found.findings if f.severity == 2]
