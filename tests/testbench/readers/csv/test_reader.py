"""Texts as loggers write them, and as they should not."""

import contextlib
import json
import random
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from balance.results import plain
from testbench.errors import RecordingError
from testbench.quality.log_description import describe_log
from testbench.readers import ReadOptions
from testbench.recording import Refusal

from .. import reading

HEADER = "Time (s),AccX (g),AccY (g)\n"
ROWS = [f"{i / 1000:.4f},{0.5 * i % 7 - 3:.4f},{1.25 * (i % 11):.4f}\n" for i in range(400)]


@settings(max_examples=30, deadline=None)
@given(
    values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=30),
    form=st.sampled_from(["{!r}", "{:.3f}", "{:.18e}", "{:.7E}", "{:+.10g}"]),
    comma=st.booleans(),
)
def test_numbers_have_the_bits_of_float(tmp_path_factory, values, form, comma):
    """Every number has the bits that Python's float() gives its text, with decimal point and with comma."""
    texts = [form.format(value) for value in values]
    written = [text.replace(".", ",") if comma else text for text in texts]
    path = tmp_path_factory.mktemp("bits") / "log.csv"
    path.write_text("i;value\n" + "".join(f"{i};{text}\n" for i, text in enumerate(written)))
    column = reading.read(path, ReadOptions(decimal="," if comma else ".")).column("value")
    assert column.tobytes() == np.array([float(text) for text in texts]).tobytes()


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "cp1254"])
def test_every_encoding_gives_the_same_recording(log, encoding):
    """The same text in any encoding has the same names, units and numbers."""
    text = "Zaman (s);İvme X (m/s²);Şaft (°)\n" + "".join(r.replace(",", ";").replace(".", ",") for r in ROWS)
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    found = log(mark + text.encode(encoding))
    assert [(c.name, c.unit) for c in found.group().channels] == [
        ("Zaman (s)", "s"), ("İvme X (m/s²)", "m/s²"), ("Şaft (°)", "°"),
    ]  # fmt: skip
    assert found.column("İvme X (m/s²)")[:3] == pytest.approx([-3, -2.5, -2])
    assert len(found.time()) == len(ROWS)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_of_all_systems(log, end):
    """LF, CRLF and CR end a line alike."""
    found = log((HEADER + "".join(ROWS)).replace("\n", end).encode())
    assert (len(found.time()), found.time()[-1]) == (len(ROWS), 0.399)


def test_a_second_header_begins_a_second_recording(log):
    """Two recordings in one file stay two, each with its own clock."""
    found = log("# cal 7\n" + HEADER + "".join(ROWS) + "# cal 7\n" + HEADER + "".join(ROWS[:50]))
    assert [len(found.time(name)) for name in found.groups] == [400, 50]
    assert list(found.groups) == ["log", "log part 2"]
    assert found.message("repeated_header").startswith("the header comes again; time starts again at 0;")
    assert not [f for f in found.findings if f.severity == 2]


def test_columns_of_text_are_named(log):
    """A column of words is no channel; the others are read as if it were not there."""
    found = log(
        "Time (s),phase,AccX (g)\n" + "".join(f"{i / 10},{'run' if i % 2 else 'stop'},{i}\n" for i in range(30))
    )
    assert [c.name for c in found.group().channels] == ["Time (s)", "AccX (g)"]
    assert next(f.channel for f in found.findings if f.code == "text_kept") == "phase"
    assert found.message("text_kept").startswith("holds text ('stop', 'run'), not numbers")
    assert found.column("AccX (g)")[-1] == 29


def test_metadata_above_the_header(log):
    """Origin, range and rate are read from comments; a declared rate is the clock where there is no time column."""
    found = log("# origin: simulated\n# rate: 2000 Hz, range +-16 g, 16 bit\nAccX (g)\n1.5\n2.5\n3.5\n")
    assert found.recording.origin == "simulated"
    assert found.group().clock.rate_hz == 2000.0
    assert (found.recording.ranges[0].limit, found.recording.ranges[0].bits) == (16.0, 16)


def test_a_log_does_not_make_itself_measured(log):
    """Only a person says that data are measured."""
    assert log("# origin: measured\n" + HEADER + "".join(ROWS)).recording.origin == "unstated"


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "empty_file"),
        (HEADER.encode(), "no_data"),
        (b"\n\n\n", "no_data"),
        (b"hello\nworld\n", "no_data"),
        (b"PK\x03\x04" + b"\0" * 200, "other_format"),
        (b"1" * 6_000_000, "line_too_long"),
        (HEADER.encode() + b"1," * 3_000_000, "line_too_long"),
        (b"10,13\n11,14\n12,15\n", "unknown_dialect"),
        (b"Time (s),Force, N\n0.1,2.5\n0.2,2.6\n", "unknown_dialect"),
    ],
)
def test_files_that_cannot_be_read_are_refused_by_name(log, content, code):
    """One message with the file's name and what was expected."""
    with pytest.raises(Refusal, match=r"log\.csv") as refusal:
        log(content)
    assert refusal.value.finding.code == code


def test_a_person_overrides_what_is_detected(log):
    """Encoding, delimiter, decimal mark and header as given."""
    found = log("10,13\n11,14\n12,15\n", ReadOptions(delimiter=",", header=False))
    assert [c.name for c in found.group().channels] == ["col0", "col1"]
    found = log("10,13\n11,14\n12,15\n", ReadOptions(delimiter="", decimal=","))
    assert found.column("col0").tolist() == [10.13, 11.14, 12.15]
    found = log("t,\u011f\n1.5,2\n2.5,3\n".encode("cp1254"), ReadOptions(encoding="cp1254"))
    assert found.group().channels[1].name == "\u011f"


def test_noise_gives_clear_errors_only(tmp_path):
    """Logs cut, flipped and spliced at random are read or refused; nothing else happens, whatever they hold."""
    chance = random.Random(23)
    whole = ("# range +-16 g, 16 bit\n" + HEADER + "".join(ROWS[:40])).encode()
    pieces = [
        b"\0",
        b'"',
        b"\r",
        b"\n\n",
        b";",
        b"1e999",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"1.234,5",
        HEADER.encode(),
        b"9" * 400,
    ]
    refusals = []
    for _ in range(100):
        data = bytearray(whole)
        for _ in range(chance.randrange(1, 7)):
            at = chance.randrange(len(data) + 1)
            match chance.randrange(4):
                case 0:
                    data[at:at] = chance.choice(pieces)
                case 1:
                    del data[at : at + chance.randrange(80)]
                case 2:
                    del data[at:]
                case _ if data:
                    data[at % len(data)] ^= 1 << chance.randrange(8)
        path = tmp_path / "noise.csv"
        path.write_bytes(data)
        try:
            json.dumps(plain(describe_log(path).document(stats=True)), allow_nan=False)
        except RecordingError as error:
            refusals.append(str(error))
    assert refusals
    assert all("noise.csv" in message for message in refusals)


def test_brackets_that_are_not_understood_are_no_missing_unit(log):
    """They are said as what they are, and indices are no brackets of units."""
    found = log("Time (s),A (filtered),B,C [2]\n" + "".join(f"{i / 10},{i},{-i},{i * i}\n" for i in range(30)))
    units = {(f.code, f.channel) for f in found.findings if f.code.startswith("unit_")}
    assert units == {("unit_unknown", "A (filtered)"), ("unit_missing", None)}
    assert "for B, C [2]" in found.message("unit_missing")


ENDLESS = {
    "digits": b"7" * 300_000 + b"x",
    "digits and a rest": b"1.5" + b"7" * 300_000 + b"e",
    "blanks": b"1" + b" " * 300_000 + b"x",
    "marks": b"1" + b".," * 150_000,
    "words": b"# " + b"rate " * 60_000,
    "brackets": b"(" * 150_000 + b"[" * 150_000,
}


@pytest.mark.parametrize("place", ["above", "inside", "in its last line"])
@pytest.mark.parametrize("name", ENDLESS)
def test_long_lines_take_no_time(tmp_path, name, place):
    """300 kB in one cell, whatever it holds, is read or refused in seconds, and never by backtracking."""
    rows, endless = (HEADER + "".join(ROWS)).encode(), ENDLESS[name]
    at = {"above": 0, "inside": rows.index(b"0.2000"), "in its last line": len(rows)}[place]
    path = tmp_path / "log.csv"
    path.write_bytes(rows[:at] + endless + (b"" if place == "in its last line" else b",1\n") + rows[at:])
    began = time.process_time()
    with contextlib.suppress(RecordingError):
        reading.read(path)
    assert time.process_time() - began < 10.0


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
@pytest.mark.parametrize("mark", [";", ",", "\t", "|", " "])
def test_marks_inside_quoted_texts_part_no_cells(log, delimiter, mark):
    """A note with a mark in it is one cell, and its row a row."""
    rows = "".join(delimiter.join((f"{i / 100:.2f}", f'"{i}.5"', f'"hot{mark} {i}"')) + "\n" for i in range(300))
    found = log(delimiter.join(("Time (s)", "F (N)", "note")) + f"\n{rows}")
    assert found.column("F (N)").tolist() == [i + 0.5 for i in range(300)]
    assert {f.code for f in found.findings if f.severity > 0} == set()
    assert found.recording.texts.kept[0].texts == [f"hot{mark} {i}" for i in range(300)]


def test_values_far_down_a_last_column_without_a_name_are_kept_as_text(log):
    """Empty in all lines that the header is found by, it is no column; what stands in it later is lost nowhere."""
    found = log("Time (s),F [N],\n" + "".join(f"{i / 100},{i},{'7.5' if i >= 500 else ''}\n" for i in range(800)))
    (kept,) = (finding for finding in found.findings if finding.code == "text_kept")
    assert (kept.channel, kept.where) == ("col2", "sample 500")
    assert kept.message.startswith("holds text ('7.5'), not numbers")
