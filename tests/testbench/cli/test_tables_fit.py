"""Tables of all commands fit 80 and 200 columns, and break no number."""

import shlex
import shutil

import click
import pytest
from rich.cells import cell_len

from balance import cli as balance
from balance.cli import printing
from testbench import cli as testbench

from ...commands import assert_fits, call, held_to_widths
from ..conftest import PAIR, conditions

LINES = [
    "balance conditions four-bar --moment",
    "balance assemble five-bar",
    "balance size parallelogram-6bar -p platform=5kg --stock kiper2019 --best 3",
    "balance check four-bar -c counter_A0A=1kg",
    "balance simulate four-bar --motion four-bar --rate 1kHz",
    "balance sweep four-bar --motion four-bar --vary counter_A0A.mass=0kg:2kg:3 --vary counter_B0B.mass=0kg:2kg:3",
    "balance tolerance four-bar --motion four-bar -c counter_A0A=1kg --tolerance counter_A0A.mass=20g",
    "balance tradeoff four-bar --motion four-bar --points 10",
    "balance linkage two-levels",
    "balance rotor correct three-masses",
    "balance rotor influence feese-2004",
    "balance rotor tolerance --mass 20kg --speed 3000rpm --grade G6.3",
    "balance rotor split '30 g @ 10 deg' --holes 8",
    "balance engine free v4-72-offset",
    "balance engine table",
    "balance engine single single",
    "balance drive four-bar-dc",
    "balance static serial-3r",
    "balance methods serial-1r",
    "balance files",
    "testbench formats",
    "testbench recordings list",
    "testbench files",
    "testbench info log.csv --stats",
    "testbench list campaign",
    "testbench verify campaign",
    "testbench ledger campaign",
    "testbench check campaign",
    "testbench calibrate campaign --list",
    "testbench calibrate campaign/r001.h5 base_acc --sensitivity 'x=1.02 g/g' --sensitivity 'y=0.993 g/g'"
    " --sensitivity 'z=1 g/g' --date 2026-01-02 --uncertainty '1 %' --coverage-factor 2"
    " --reference 'D-K-15183-01-00 2026-01' --reason 'certificate of March'; testbench calibrate campaign --list",
    "testbench archive campaign -o arch",
    "testbench align campaign/r002.h5",
    "testbench analyze campaign --budget",
    "testbench compare campaign --published kiper2019",
    "testbench report campaign/r001.h5",
    "testbench identify parallelogram-6bar campaign/r002.h5 --by wrench --budget",
    "testbench trim parallelogram-6bar campaign/r002.h5 --by wrench",
    "testbench plan next campaign",
    "testbench ingest log.csv -o other",
    "testbench speed edges.csv --pulses 60",
    "testbench calibrate campaign/r001.h5 base_acc --sensitivity '-1 g/g' --reason test; testbench doctor campaign",
]
SENTENCES = [
    "balance report four-bar --motion four-bar -o four-bar.html",
    "balance animate four-bar --motion four-bar -o four-bar.html",
    "balance view four-bar --no-browser --idle 0",
    "testbench new trial --from four-bar",
    "testbench simulate --plan one-run.toml --rig parallelogram-6bar -o logs",
    "testbench watch arrived --once -o other",
    "testbench recover campaign",
    "testbench remove campaign/r001.h5 --by 'A. Kaya' --reason 'a cable was loose'",
    "testbench export campaign/r001.h5 --to csv -o tables",
    "testbench view campaign --no-browser --idle 0",
]
"""They print sentences and write files."""
OTHERS = {"balance": {"schema"}, "testbench": {"describe", "schema", "vectors", "predict"}}
"""They print a document, or (``vectors``, ``predict``) have their tables held to the same widths by their own tests."""


@pytest.fixture
def folder(shared, tmp_path, monkeypatch):
    """A campaign and two logs."""
    shutil.copytree(shared(PAIR).campaign, tmp_path / "campaign")
    (tmp_path / "one-run.toml").write_text(conditions((5.0, 0.0, ("x",))), encoding="utf-8")
    (tmp_path / "log.csv").write_text("t (s),a (m/s^2)\n0.0,0.5\n0.1,0.25\n0.2,0.75\n", encoding="utf-8")
    (tmp_path / "arrived").mkdir()
    shutil.copy(tmp_path / "log.csv", tmp_path / "arrived")
    edges = "".join(f"{0.01 * k:.6f}\n" for k in range(300))
    (tmp_path / "edges.csv").write_text(f"t (s)\n{edges}", encoding="utf-8")
    monkeypatch.chdir(tmp_path)


def printed(line):
    """What the last of some commands prints, at 80 columns."""
    for one in line.split("; "):
        name, *words = shlex.split(one)
        done = call({"balance": balance, "testbench": testbench}[name].main, name, *words, "--all")
        assert done.code in {0, 3}, done.err
    return done.out


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("line", LINES)
def test_tables_fit(line, monkeypatch):
    """No line is wider, no number broken, nothing cut short; the first line is the answer."""
    titles = held_to_widths(monkeypatch)
    text = printed(line)
    assert_fits(text)
    if line.endswith("calibrate campaign --list"):
        assert "Too wide" not in text
    assert titles


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("line", SENTENCES)
def test_sentences_fit(line, monkeypatch):
    """Words alone are broken at."""
    held_to_widths(monkeypatch)
    assert_fits(printed(line))


@pytest.mark.parametrize("width", [40, 80, 200])
def test_characters_that_are_two_wide(width):
    """In title, header, cells and note, words between spaces or without any: no line takes more of the terminal."""
    name, words = "平衡質量の位置" * 3, "上の 腕の 反対側 " * 15
    rows = [[name, f"{i}.25", words, "-"] for i in range(2)]
    lines = printing.table_lines(words, ["位置", "質量 [kg]", name, "他"], rows, "注" * 150, width)
    assert max(cell_len(click.unstyle(line)) for line in lines) <= width
    assert "注" * (width // 2) in lines


def test_no_command_is_left_out():
    """Each is above, or is said to be held elsewhere."""
    for name, package in (("balance", balance), ("testbench", testbench)):
        shown = {one.split()[1] for line in LINES + SENTENCES for one in line.split("; ") if one.startswith(f"{name} ")}
        assert shown | OTHERS[name] == set(package.COMMANDS)
        assert not shown & OTHERS[name]
