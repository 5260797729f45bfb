"""Workbooks: a sheet is read as the text of the same rows is, and what only a spreadsheet can do is said."""

import gc
import re
import zipfile
from datetime import datetime, time, timedelta

import numpy as np
import openpyxl
import pytest
from openpyxl.utils.datetime import CALENDAR_MAC_1904

from testbench.errors import RecordingError
from testbench.readers import ReadOptions, open_recording
from testbench.readers.import_description import ImportDescription

from . import examples, reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")
RANDOM = np.random.default_rng(3)


def _book(path, *sheets, edit=lambda book: None):
    """A workbook of these rows, each sheet named S1, S2, ..."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for number, rows in enumerate(sheets, 1):
        sheet = book.create_sheet(f"S{number}")
        for row in rows:
            sheet.append(row)
    edit(book)
    book.save(path)
    return path


def _edited(path, part, edit):
    """The workbook with one of its parts edited; None: another part of these bytes."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (parts | {part: edit(parts.get(part, b""))}).items():
            archive.writestr(name, content)
    return path


SHEET = "xl/worksheets/sheet1.xml"
ROWS = [["Time (s)", "a [g]"], *([i / 64, round(i * 0.1, 9)] for i in range(20))]


@pytest.mark.parametrize(
    "rows",
    [
        ROWS,
        [["Bench 2"], ["Sampling rate: 50 Hz"], [], ["Force (N)", "u"], ["", "mV"], *([i, -i / 8] for i in range(9))],
        [["Trajectories"], [100], ["", "", "hip"], ["Frame", "Sub", "X", "Y"], ["", "", "mm", "mm"],
         *([i, 0, i / 8, None if i == 3 else i * 2**-20] for i in range(9))],
        [["t", "x", "state"], *([i, i, "on" if i > 4 else "off"] for i in range(9)), ["t", "x", "state"],
         *([i, i, "on"] for i in range(9))],
        RANDOM.standard_normal((30, 4)).round(6).tolist(),
    ],
    ids=["usual", "rate above", "motion capture", "repeated", "no header"],
)  # fmt: skip
def test_a_sheet_is_read_as_its_rows_in_a_text(tmp_path, rows):
    """The same names, units, clocks, samples and codes of findings."""
    text = "\n".join("\t".join("" if c is None else str(c) for c in row) for row in rows) + "\n"
    (tmp_path / "S1.txt").write_text(text)
    one, other = reading.read(tmp_path / "S1.txt"), reading.read(_book(tmp_path / "S1.xlsx", rows))
    assert other.groups == one.groups
    for group, columns in one.data.items():
        np.testing.assert_array_equal(other.data[group], columns)
    assert other.codes == one.codes
    assert [(t.channel, t.samples, t.texts) for t in other.recording.texts.kept] == [
        (t.channel, t.samples, t.texts) for t in one.recording.texts.kept
    ]


@pytest.mark.parametrize("epoch", [None, CALENDAR_MAC_1904])
def test_dates_are_times_to_the_microsecond(tmp_path, epoch):
    """Days since 1900 or 1904, as the workbook says; openpyxl itself gives milliseconds."""
    begun = datetime(2024, 3, 1, 23, 59, 59, 900_000)
    rows = [["When", "a"], *([begun + timedelta(microseconds=12_345 * i), i] for i in range(20))]

    def edit(book):
        book.epoch = epoch or book.epoch

    found = reading.read(_book(tmp_path / "run.xlsx", rows, edit=edit))
    np.testing.assert_allclose(found.column("When"), 0.012345 * np.arange(20), rtol=0, atol=1.1e-6)
    assert found.group().zero.time.startswith("2024-03-01T23:59:59.9")


@pytest.mark.parametrize(
    ("stamps", "seconds", "form"),
    [
        ([time(8, 0, i, 500_000) for i in range(6)], range(6), None),
        ([timedelta(hours=23, minutes=59, seconds=57 + i) for i in range(6)], range(6), None),
        ([0.5 + i / 86_400 / 1000 for i in range(6)], np.arange(6) / 1000, "HH:MM:SS.000"),
        ([45_352.25 + i / 86_400 for i in range(6)], range(6), '[$-409]m/d/yy h:mm AM/PM;@"s"'),
    ],
    ids=["times of day", "stop watch", "milliseconds", "local notation"],
)
def test_what_a_cell_shows_says_whether_it_is_a_time(tmp_path, stamps, seconds, form):
    """The format of the cell, of which there are many; a number in another format stays one."""

    def edit(book):
        for row in range(2, 8 if form else 2):
            book["S1"].cell(row, 1).number_format = form

    found = reading.read(_book(tmp_path / "run.xlsx", [["Time", "a"], *zip(stamps, range(6), strict=True)], edit=edit))
    np.testing.assert_allclose(found.column("Time"), seconds, rtol=0, atol=1e-9)
    assert found.unit("Time") == "s"


def test_numbers_in_a_format_of_dates_that_are_none_stay_numbers(tmp_path):
    """Small, negative, or beyond any calendar."""

    def edit(book):
        for row in range(2, 6):
            book["S1"].cell(row, 1).number_format = "yyyy-mm-dd"

    rows = [["a", "b"], [3, 1], [-2.5, 2], [1e12, 3], [5, 4]]
    assert reading.read(_book(tmp_path / "run.xlsx", rows, edit=edit)).column("a").tolist() == [3, -2.5, 1e12, 5]


@pytest.mark.parametrize(
    ("head", "form", "kept"),
    [
        ("load (%)", "0%", 7.0),
        ("load (%)", "0.00%;[Red]-0.00%", 7.0),
        ("load (%)", "0.00", 0.07),
        ("load (%)", '0.00" %"', 0.07),
        ("load", "0%", 0.07),
    ],
    ids=["percent", "with a sign", "number", "sign as text", "share"],
)
def test_percent_are_what_the_head_says(tmp_path, head, form, kept):
    """A spreadsheet stores 7 % as 0.07: in a column of percent that is 7, and 0.07 without a unit; formulas too."""

    def edit(book):
        for row in range(2, 11):
            book["S1"].cell(row, 2).number_format = form

    path = _book(tmp_path / "run.xlsx", [["Time (s)", head], *([i, 0.07] for i in range(9))], edit=edit)
    _edited(path, SHEET, lambda raw: re.sub(rb'(<c r="B5"[^>]*>)<v>', rb"\1<f>0.07</f><v>", raw))
    found = reading.read(path)
    assert found.column(head).tolist() == [kept] * 9
    assert found.unit(head) == ("%" if "%" in head else None)


def test_percent_below_a_merged_head_are_refused(tmp_path):
    """Which of the cells are percent is known too late."""

    def edit(book):
        book["S1"].merge_cells("B1:C1")
        for row in range(3, 12):
            book["S1"].cell(row, 3).number_format = "0%"

    rows = [["Time (s)", "load (%)", None], [None, "x", "y"], *([i, 0.07, 0.07] for i in range(9))]
    with pytest.raises(RecordingError, match=r"'load \(%\)' is merged above cells that are shown as percent"):
        reading.read(_book(tmp_path / "run.xlsx", rows, edit=edit))


def test_merged_cells_are_part_of_the_names_below_them(tmp_path):
    """A title over the whole width is none; names without such are as they are."""
    rows = [["Test 7"], ["Time (s)", "Plate 1 (N)", None, "Acc", None], [None, "X", "Y", "m/s^2", "g"],
            *([i, i, -i, 2 * i, 3 * i] for i in range(9))]  # fmt: skip

    def edit(book):
        for place in ("A1:E1", "A2:A3", "B2:C2", "D2:E2"):
            book["S1"].merge_cells(place)

    found = reading.read(_book(tmp_path / "run.xlsx", rows, edit=edit))
    channels = [(c.label, c.unit) for c in found.group().channels]
    assert channels[:3] == [("Time", "s"), ("Plate 1 X", "N"), ("Plate 1 Y", "N")]
    assert any("merged cells of row 2" in f.message for f in found.findings if f.code == "dialect")
    assert found.column("Plate 1 (N) Y").tolist() == [-i for i in range(9)]


def test_several_sheets_are_several_groups_and_notes_are_left_out_by_name(tmp_path):
    """Findings know their sheet; hidden sheets, rows and columns are kept, and said."""

    def edit(book):
        book["S2"].sheet_state = "veryHidden"
        book["S2"].row_dimensions[4].hidden = True
        book["S1"].column_dimensions["B"].hidden = True

    found = reading.read(_book(tmp_path / "run.xlsx", ROWS, [["t", "F (N)"], [0, 1], [1, None], [2, 3]], [["by", "me"]],
                               [], edit=edit))  # fmt: skip
    assert list(found.groups) == ["S1", "S2"]
    assert found.column("F (N)").tolist()[::2] == [1, 3]
    said = {finding.where: finding.message for finding in found.findings if finding.code == "hidden_cells"}
    assert said["worksheet 'S2'"] == "the spreadsheet hides the worksheet itself, 1 rows; all are kept"
    assert said["worksheet 'S1'"] == "the spreadsheet hides columns from B on; all are kept"
    assert [f.where for f in found.findings if f.code == "left_out"] == ["worksheet 'S3'", "worksheet 'S4'"]
    assert next(f.where for f in found.findings if f.code == "not_a_number").startswith("worksheet 'S2', line")


@pytest.mark.parametrize(
    ("cell", "value", "code", "said"),
    [
        (b"<c r='B5'><f>A5*2</f><v>8.5</v></c>", 8.5, "calculated_cells", "by column: B (1)"),
        (b"<c r='B5'><f>A5*2</f></c>", np.nan, "not_a_number", "'=A5*2' in line 5"),
        (b"<c r='B5' t='e'><v>#DIV/0!</v></c>", np.nan, "not_a_number", "'DIV/0!' in line 5"),
        (b"<c r='B5' t='e'><f>NA()</f><v>#N/A</v></c>", np.nan, "not_a_number", "'N/A' in line 5"),
        (b"<c r='B5'/>", np.nan, "not_a_number", "an empty cell in line 5"),
        (b"<c r='B5' t='inlineStr'><is><t>lost\nhere</t></is></c>", np.nan, "not_a_number", "'lost here' in line 5"),
        (b"<c r='B5'><v>1.1000000000000001E-3</v></c>", 1.1e-3, "dialect", "row 2"),
        (b"<c r='B5' t='b'><v>1</v></c>", np.nan, "not_a_number", "'True' in line 5"),
        (b"<c r='B5'><v>9007199254740993</v></c>", 2.0**53, "not_exact", ""),
    ],
    ids=["formula", "not calculated", "error", "error of a formula", "empty", "text", "digits", "truth", "large"],
)
def test_every_kind_of_cell_is_a_number_or_said(tmp_path, cell, value, code, said):
    """Nothing is calculated anew, and no cell is passed over."""
    path = _book(tmp_path / "run.xlsx", ROWS)
    _edited(path, SHEET, lambda raw: re.sub(rb'<c r="B5"[^>]*><v>[^<]*</v></c>', cell.replace(b"\\", b"\\\\"), raw))
    found = reading.read(path)
    np.testing.assert_array_equal(found.column("a [g]")[3], value)
    if code in found.codes or code != "not_exact":
        assert said in "; ".join(str(f.message) for f in found.findings if f.code == code)


def test_errors_in_the_first_cell_are_no_comments(tmp_path):
    """A row that begins with #N/A is a row."""
    path = _book(tmp_path / "run.xlsx", [["a", "b"], *([i, i] for i in range(9))])
    _edited(
        path, SHEET, lambda raw: re.sub(rb'<c r="A5"[^>]*><v>[^<]*</v></c>', b"<c r='A5' t='e'><v>#N/A</v></c>", raw)
    )
    assert len(reading.read(path).column("b")) == 9


def test_columns_that_are_empty_throughout_are_no_channels(tmp_path):
    """A table that begins at C3, with a blank column in it; line N is row N."""
    rows = [[], [], [None, None, "t", None, "x"], *([None, None, i, None, i if i != 450 else "?"] for i in range(600))]
    found = reading.read(_book(tmp_path / "run.xlsx", rows))
    assert [c.name for c in found.group().channels] == ["t", "x"]
    assert len(found.column("t")) == 600
    assert "line 454" in found.message("not_a_number")


@pytest.mark.parametrize(("row", "columns", "said"), [(395, 3, []), (402, 2, ["worksheet 'S1'"])])
def test_cells_beside_the_table_are_a_channel_or_said(tmp_path, row, columns, said):
    """Whether there is another column, the first 400 rows tell."""
    rows = [["t", "x"], *([i, i] for i in range(600))]
    found = reading.read(_book(tmp_path / "run.xlsx", rows, edit=lambda book: book["S1"].cell(row, 3, 5.0)))
    assert len(found.group().channels) == columns
    assert [f.where for f in found.findings if f.code == "left_out" and "columns C are" in f.message] == said


def test_options_and_descriptions_are_for_sheets_too(tmp_path):
    """Rows of names that a person states; the order of dates written as text."""
    path = _book(tmp_path / "run.xlsx", [["A", "A"], ["x", "y"], *([i, i] for i in range(9))])
    described = ImportDescription(names=[1, 2])
    recording = open_recording(path, ReadOptions(description=described))
    assert [c.name for c in recording.groups[0].channels] == ["A x", "A y"]


def test_macros_and_other_files_are_never_opened(tmp_path):
    """A workbook with macros is read by its cells."""
    path = _edited(_book(tmp_path / "run.xlsm", ROWS), "xl/vbaProject.bin", lambda raw: b"\xd0\xcf\x11\xe0 no macro")
    assert len(reading.read(path).column("a [g]")) == 20


def _bomb(raw):
    return b'<?xml version="1.0"?><!DOCTYPE x [' + b"".join(
        b'<!ENTITY e%d "%s">' % (i, b"&e%d;" % (i - 1) * 20 if i else b"9" * 99) for i in range(9)
    ) + b"]>" + raw[raw.index(b"<worksheet"):].replace(b"<v>0.1</v>", b"<v>&e8;</v>")  # fmt: skip


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda raw: raw.replace(b"<sheetData>", b"<sheetData>" + b" " * (80 << 20)), "unpacks to more"),
        (_bomb, "cannot be read"),
        (lambda raw: raw.replace(b'<row r="9"', b'<row r="2"'), "row 2 behind row 8"),
        (lambda raw: raw.replace(b'<row r="21"', b'<row r="99999999"'), "row 99999999 behind"),
        (lambda raw: raw.replace(b'r="B5"', b'r="A5"'), "two cells of row 5"),
        (lambda raw: raw.replace(b'r="B5"', b'r="XFE5"'), "no column"),
        (lambda raw: raw[: len(raw) // 2], "cannot be read"),
    ],
    ids=["bomb", "entities", "order", "rows", "twice", "wide", "half"],
)
def test_sheets_made_to_harm_are_refused(tmp_path, edit, said):
    """Within moments, by what is wrong."""
    path = _edited(_book(tmp_path / "run.xlsx", ROWS), SHEET, edit)
    with pytest.raises(RecordingError, match=said):
        reading.read(path)


def test_few_cells_far_apart_do_not_fill_the_disk(tmp_path):
    """Sixteen thousand columns over many rows of one cell."""
    row = "".join(f'<c r="{openpyxl.utils.get_column_letter(i)}1"><v>1</v></c>' for i in range(1, 16_000))
    rows = "".join(f'<row r="{i}"><c r="A{i}"><v>1</v></c></row>' for i in range(2, 9000))
    path = _book(tmp_path / "run.xlsx", ROWS)
    sheet = re.compile(rb"<sheetData>.*</sheetData>", re.S)
    _edited(path, SHEET, lambda raw: sheet.sub(f'<sheetData><row r="1">{row}</row>{rows}</sheetData>'.encode(), raw))
    with pytest.raises(RecordingError, match="more than 64 MiB as text"):
        reading.read(path)


def test_a_cut_workbook_is_cut_and_other_documents_are_none(tmp_path):
    """The list of parts is at the end."""
    path = examples.make(tmp_path, "run.xlsx")
    whole = path.read_bytes()
    path.write_bytes(whole[:-30])
    with pytest.raises(RecordingError, match="list of its parts"):
        reading.read(path)
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("[Content_Types].xml", "_rels/.rels", "word/document.xml"):
            archive.writestr(name, "")
    with pytest.raises(RecordingError, match="a document of Office, no workbook"):
        reading.read(path)


def test_the_texts_are_gone_with_the_recording(tmp_path, monkeypatch):
    """They are in a folder of their own as long as some copy of the recording may be read."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    recording = ImportDescription(normal=["dialect"]).applied(open_recording(_book(tmp_path / "run.xlsx", ROWS)))
    gc.collect()
    assert len(list(tmp_path.glob("counterpoise-*/1.txt"))) == 1
    assert sum(map(len, recording.blocks(lambda finding: None))) == 20
    del recording
    gc.collect()
    assert not list(tmp_path.glob("counterpoise-*"))
    (tmp_path / "broken.xlsx").write_bytes((tmp_path / "run.xlsx").read_bytes()[:-9])
    with pytest.raises(RecordingError):
        open_recording(tmp_path / "broken.xlsx")
    gc.collect()
    assert not list(tmp_path.glob("counterpoise-*"))
