"""Files and names as people give them by mistake: one clear message, and never a traceback."""

import gzip
import json
import os
import sys
import zipfile

import pytest

from ..store.stored import names_in

ROWS = "Time (s),F [N]\n" + "".join(f"{i / 100:.2f},{i * 1.5:.2f}\n" for i in range(200))


@pytest.fixture(autouse=True)
def _in_an_empty_folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


def workbook(path):
    """What a spreadsheet saves."""
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("[Content_Types].xml", "")
        file.writestr("xl/workbook.xml", "")


def archive(path):
    """An archive with a log in it."""
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("run.csv", ROWS)


CONTENTS = {
    "a workbook of empty parts": (workbook, "cannot be read"),
    "a ZIP archive": (archive, "unpack it and give the log inside"),
    "gzip": (lambda path: path.write_bytes(gzip.compress(ROWS.encode())), "unpack it and give the log inside"),
    "NUL bytes": (lambda path: path.write_bytes(bytes(5000)), "nothing but NUL bytes"),
    "a header alone": (
        lambda path: path.write_text("Time (s),F [N]\n"),
        "no row of numbers in its first 1 line with text; expected",
    ),
    "a web page": (lambda path: path.write_text("<html><body>404</body></html>\n"), "no row of numbers"),
    "nothing": (lambda path: path.write_bytes(b""), "the file is empty"),
    "a folder": (lambda path: path.mkdir(), "is a folder; expected log files"),
    "one endless line": (lambda path: path.write_bytes(b"1" * 50_000_000), "longer than 4 MiB"),
    "an endless line below rows": (lambda path: path.write_bytes(ROWS.encode() + b"1," * 25_000_000), "line 202"),
}


@pytest.mark.parametrize("name", CONTENTS)
def test_what_is_no_log_is_refused_by_what_it_is(command, tmp_path, name):
    """One line that names the file and says what to do; exit code 1; as JSON one document."""
    make, said = CONTENTS[name]
    make(tmp_path / "run.csv")
    code, out, err = command("info", "run.csv")
    assert (code, out) == (1, "")
    assert err.startswith("testbench: run.csv")
    assert said in err
    assert err.count("\n") == 1
    if name != "a folder":
        code, out, _ = command("info", "run.csv", "--json")
        assert (code, len(json.loads(out)["findings"])) == (1, 1)


def test_rows_before_a_power_failure(command, tmp_path):
    """A small text that ends in more NUL bytes than letters is a text, found cut by the failure."""
    (tmp_path / "run.csv").write_bytes(ROWS.encode() + bytes(8192))
    code, out, _ = command("info", "run.csv", "--json")
    found = json.loads(out)
    assert code == 1
    assert found["groups"][0]["samples"] == 200
    assert [f["where"] for f in found["findings"] if f["code"] == "nul_bytes"] == ["line 202"]


def names_of(path):
    """Names that no run can have, beside a good one; bytes that are no UTF-8 among them."""
    bad = ["two\nlines.csv", "red\x1b[31m.csv", "-rf.csv", "l" * 200 + ".csv", "half\udcff.csv"]
    for i, name in enumerate(["good.csv", *bad]):
        (path / name).write_text(ROWS + f"2.00,{i}.00\n", encoding="utf-8")
    return ["good.csv", *(f"./{name}" for name in bad)]


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone")
def test_one_odd_name_keeps_no_other_log_out(command, tmp_path):
    """Files whose names no run can have are refused by name, the others are stored; as JSON one document of UTF-8."""
    words = ["ingest", *names_of(tmp_path), "-o", "campaign"]
    code, out, err = command(*words, "--json")
    runs = json.loads(out.encode("utf-8"))["runs"]
    assert (code, [run["status"] for run in runs]) == (1, ["stored", *["refused"] * 5])
    assert all("is no name for a stored run" in line for line in err.splitlines())
    assert "\x1b" not in out + err
    assert names_in(tmp_path / "campaign") == ["good.h5", "good.h5.sha256"]


def test_files_of_one_name_keep_no_other_log_out(command, tmp_path):
    """Two files that would be one run are refused, both by name, and the third is stored."""
    for i, name in enumerate(["a.csv", "a.txt", "b.csv"]):
        (tmp_path / name).write_text(ROWS + f"2.00,{i}.00\n")
    code, out, _ = command("ingest", "a.csv", "a.txt", "b.csv", "-o", "campaign", "--json")
    found = json.loads(out)["runs"]
    assert (code, [run["status"] for run in found]) == (1, ["refused", "refused", "stored"])
    assert "a.csv, a.txt: would all be stored as run 'a'" in found[0]["findings"][0]["message"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders")
@pytest.mark.parametrize("words", [["info"], ["ingest", "-o", "campaign"]])
def test_a_pipe_is_no_log(command, tmp_path, words):
    """It is refused at once, and not waited for."""
    os.mkfifo(tmp_path / "log.csv")
    code, _, err = command(*words, "log.csv")
    assert (code, "is a pipe or device" in err) == (1, True)
