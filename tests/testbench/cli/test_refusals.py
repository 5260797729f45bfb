"""What a person gets wrong on a command line: one message with what was expected, and never a traceback."""

import re

import pytest

WRONG = [
    ("info nowhere.csv", 1, r"nowhere\.csv: no such file"),
    ("info lgo", 1, r"lgo: no such file; expected a log file; did you mean 'log'\?"),
    ("info .", 1, r"is a folder; expected log files"),
    ("info *.csv", 1, r"^testbench: \*\.csv: no file matches; expected a log file\n$"),
    ("ingest *.csv -o c", 1, r"^testbench: \*\.csv: no file matches; expected a log file\n$"),
    ("info log --encoding klingon", 1, r"'klingon' is no encoding"),
    ("info log --encoding base64", 1, r"'base64' is no encoding"),
    ("info log --as a.toml --as b.toml", 2, r"--as: is of all logs; .* name each in the rig: loggers\.NAME\.read_as"),
    ("info log --decimal dot", 2, r"^testbench: Invalid .* 'dot': expected .*\nTry 'testbench info --help'"),
    ("info EMPTY", 2, r"an empty argument"),
    ("ingest log -o EMPTY", 2, r"an empty argument"),
    ("list BLANK", 2, r"an empty argument"),
    ("ingest log -o c --accept everything", 2, r"--accept everything: no such code"),
    ("ingest log -o c --rig nowhere.toml", 1, r"nowhere\.toml"),
    ("ingest log -o c --runs nowhere.csv", 1, r"nowhere\.csv"),
    ("ingest log -o c --runs dir", 1, r"dir: is a folder; expected a file"),
    ("ingest log -o c --rig dir", 1, r"dir: is a folder; expected a file \(\.toml\), or a shipped"),
    ("ingest log", 2, r"Missing option '-o'"),
    ("list nowhere", 1, r"nowhere: no such folder"),
    ("list log", 1, r"log: is a file; expected a campaign's folder"),
    ("recover log", 1, r"log: is a file; expected a campaign's folder"),
    ("watch log -o c", 1, r"log: is a file; expected a folder that logs arrive in"),
    ("verify .", 1, r"holds no run"),
    ("vectors dir", 1, r"dir: is a folder; expected one stored run"),
    ("speed dir --pulses 60", 1, r"dir: is a folder; expected"),
    ("analyze CAMPAIGN --band 200..1", 2, r"low < high"),
    ("analyze CAMPAIGN --band slow", 2, r"1\.\.200"),
    ("analyze CAMPAIGN --metric mean", 2, r"peak_to_peak"),
    ("analyze CAMPAIGN --band 0..4000", 1, r"8000 samples a second"),
    ("analyze dir", 1, r"holds no run"),
    ("compare CAMPAIGN --published kiper2020", 1, r"kiper2019"),
    ("simulate --plan nothing --rig parallelogram-6bar -o c", 1, r"kiper2019-brief"),
    ("simulate --plan kiper2019 --rig parallelogram-6bar -o CAMPAIGN", 1, r"not empty"),
]  # fmt: skip
"""Words, exit code and message, where a log and a folder are, a campaign of simulated runs, and nothing else."""


@pytest.mark.parametrize(("words", "code", "message"), WRONG, ids=[words for words, *_ in WRONG])
def test_one_clear_message(command, brief, tmp_path, monkeypatch, words, code, message):
    """The right exit code, nothing on stdout, and nothing new in the folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dir").mkdir()
    (tmp_path / "log").write_text("t (s),a (g)\n0,1\n1,2\n2,3\n")
    meant = {"CAMPAIGN": brief.campaign, "EMPTY": "", "BLANK": " "}
    found, out, err = command(*(meant.get(word, word) for word in words.split()))
    assert (found, out, "Traceback" in err) == (code, "", False)
    assert re.search(message, err)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dir", "log"]
