"""`testbench ingest lg/* -o lg`: logs that lie in the campaign's own folder, beside the runs made of them."""

import pytest

from testbench.cli import main

from ...commands import call

PATTERN = "lg/*"


@pytest.fixture
def ingest(tmp_path, monkeypatch):
    """Two logs in a folder; `testbench ingest` of what the shell makes of a pattern: exit code, statuses, stderr."""
    folder = tmp_path / "lg"
    folder.mkdir()
    for name, first in (("a", 0.1), ("b", 0.2)):
        rows = "".join(f"{i / 100:.2f},{first + i % 7:.3f}\n" for i in range(200))
        (folder / f"{name}.csv").write_text("Time (s),AccX (g)\n" + rows)
    monkeypatch.chdir(tmp_path)

    def run(*words, output="lg"):
        given = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.glob(PATTERN))
        files = [file for word in words for file in (given if word == PATTERN else [word])]
        done = call(main, "testbench", "ingest", *files, "-o", output, "--json")
        return done.code, {one["source"]: one["status"] for one in done.json["runs"]}, done.err

    return run


def test_a_second_time_each_log_is_stored_already(ingest, tmp_path):
    """The campaign's runs, digests and records are left alone, and that is said; no byte of the folder changes."""
    assert ingest(PATTERN) == (0, {"a.csv": "stored", "b.csv": "stored"}, "")
    (tmp_path / "lg" / "records").mkdir()
    before = {path.name: path.read_bytes() for path in (tmp_path / "lg").glob("*.*")}
    for output in ("lg", "./lg/"):
        code, found, err = ingest(PATTERN, output=output)
        assert (code, found) == (3, {"a.csv": "already_stored", "b.csv": "already_stored"})
        assert "lg: 7 of the files given are the campaign's own runs and no logs; they are left alone" in err
    assert {path.name: path.read_bytes() for path in (tmp_path / "lg").glob("*.*")} == before


def test_a_new_log_beside_them_is_stored(ingest, tmp_path):
    """As logs go on to arrive in the folder."""
    ingest(PATTERN)
    (tmp_path / "lg" / "c.csv").write_text("Time (s),AccX (g)\n0.00,1\n0.01,3\n0.02,2\n")
    code, found, _ = ingest(PATTERN)
    assert (code, found) == (3, {"a.csv": "already_stored", "b.csv": "already_stored", "c.csv": "stored"})


def test_with_the_sheet_in_the_folder(ingest, tmp_path):
    """The sheet names the logs alone, and is no log itself."""
    (tmp_path / "lg" / "runs.csv").write_text("file,run,payload_kg\na.csv,r1,5\nb.csv,r2,5\n")
    words = (PATTERN, "--runs", "lg/runs.csv")
    assert ingest(*words)[:2] == (0, {"a.csv": "stored", "b.csv": "stored"})
    assert ingest(*words)[:2] == (3, {"a.csv": "already_stored", "b.csv": "already_stored"})


def test_a_run_that_is_meant_is_refused_as_before(ingest):
    """Runs alone, or runs of another campaign, are no logs."""
    ingest(PATTERN)
    code, found, err = ingest("lg/a.h5")
    assert (code, found, "is a stored run and no log" in err) == (1, {"a.h5": "refused"}, True)
    code, found, err = ingest("lg/a.h5", "lg/b.csv", output="other")
    assert (code, found) == (1, {"a.h5": "refused", "b.csv": "stored"})
