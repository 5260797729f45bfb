"""What is shipped is listed, each file with a line, and copied for editing; nothing is overwritten."""

import json

import pytest
from click.testing import CliRunner

import testbench.cli.files
from balance import datasets
from balance.cli import files
from balance.errors import DataError

PROGRAMS = {"balance": files, "testbench": testbench.cli.files}


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_shipped_file_is_listed_with_a_line(program):
    """All files of the program's folders, and what each is."""
    kinds = files.MECHANICS if program == "balance" else testbench.cli.files.LABORATORY
    listed = json.loads(CliRunner().invoke(PROGRAMS[program].files, ["--json"]).stdout)["files"]
    there = [path.name for folder, suffix in kinds.values() for path in (datasets.ROOT / folder).glob(f"*{suffix}")]
    assert sorted(one["file"] for one in listed) == sorted(there)
    assert all(5 < len(one["about"]) < 400 for one in listed)


def test_every_kind_of_shipped_file_is_in_one_of_the_lists():
    """No folder of datasets is left out."""
    folders = {folder for folder, _ in (files.MECHANICS | testbench.cli.files.LABORATORY).values()}
    assert folders == {path.name for path in datasets.ROOT.iterdir() if path.is_dir()}


def test_a_copy_is_the_file_and_overwrites_none(tmp_path):
    """Byte by byte; a second copy into the same folder is refused."""
    words = ["--copy", "mechanism/five-bar", "-o", str(tmp_path / "mine")]
    assert CliRunner().invoke(files.files, words).exit_code == 0
    original = datasets.find_dataset("five-bar", "mechanisms", ".xml")
    assert (tmp_path / "mine" / "five-bar.xml").read_bytes() == original.read_bytes()
    with pytest.raises(DataError, match=r"five-bar\.xml: is there already; name another folder, -o FOLDER"):
        CliRunner().invoke(files.files, words, catch_exceptions=False)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("five-ba", "no shipped file has this name; did you mean 'five-bar'"),
        (
            "kiper2019",
            "several files have this name: expected plan/kiper2019 or stock/kiper2019 or published/kiper2019",
        ),
    ],
)
def test_names_that_are_not_clear(name, message, tmp_path):
    """The nearest name, or how to tell several apart."""
    words = ["--copy", name, "-o", str(tmp_path)]
    with pytest.raises(DataError, match=message):
        CliRunner().invoke(testbench.cli.files.files, words, catch_exceptions=False)
