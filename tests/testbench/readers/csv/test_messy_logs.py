"""Logs as loggers, phones and spreadsheets write them: right untold, or with an import description of a few lines."""

import hashlib
import json
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from balance import datasets
from testbench.errors import RecordingError
from testbench.readers import ReadOptions
from testbench.readers.import_description import ImportDescription
from testbench.recording import (
    MEANING,
    Block,
    Channel,
    Group,
    Recording,
    TimeColumn,
    UniformClock,
    refusing_findings,
)
from testbench.store import open_run

from .. import reading

N = 60
FORCE = [i % 7 + 0.5 for i in range(N)]
WITH_GAPS = [np.nan if i in (9, 31) else value for i, value in enumerate(FORCE)]
MOST_LINES = 5


@dataclass
class Log:
    """A log of a force [N] at 100 Hz: its head, each row, what a person states, and the start that it has."""

    head: str
    row: object
    description: str = ""
    start: str | None = None
    units: tuple = ("N",)
    rate_hz: float | None = 100.0
    force: list = None
    name: str = "F"
    encoding: str = "utf-8"
    tail: str = ""
    within: float = 1e-9

    def write(self, path):
        """The file."""
        text = self.head + "".join(self.row(i, value) + "\n" for i, value in enumerate(FORCE)) + self.tail
        path.write_bytes(text.encode(self.encoding))
        return path


def seconds(i):
    """The time of a sample as text."""
    return f"{i / 100:.2f}"


def comma(number):
    """A number with a decimal comma."""
    return str(number).replace(".", ",")


def gaps(i, value, *words):
    """A value, or in two rows a word or number for none."""
    return words[(i > 9) % len(words)] if i in (9, 31) else value


def clock(i):
    """A time of day: minutes, seconds and the hundredths of sample ``i`` from noon on."""
    return f"12:{i // 6000:02}:{i // 100 % 60:02}", i % 100 * 10


LOGS = {
    "plain": Log("Time (s),F (N)\n", lambda i, v: f"{seconds(i)},{v}"),
    "semicolon and decimal comma": Log("Time (s);F (N)\n", lambda i, v: f"{comma(seconds(i))};{comma(v)}"),
    "tab": Log("Time (s)\tF (N)\n", lambda i, v: f"{seconds(i)}\t{v}"),
    "bars": Log("Time (s)|F (N)\n", lambda i, v: f"{seconds(i)}|{v}"),
    "fixed width": Log("Time[s]     F[N]\n", lambda i, v: f"{seconds(i):>8}{v:>9}"),
    "units behind blanks, as the delimiter": Log("Time (s)  F (N)\n", lambda i, v: f"{seconds(i)} {v}"),
    "units behind blanks, as NumPy saves": Log("# Time (s) F (N)\n", lambda i, v: f"{seconds(i)} {v}"),
    "quoted decimal commas": Log('"Time (s)","F (N)"\n', lambda i, v: f'"{comma(seconds(i))}","{comma(v)}"'),
    "units in their own row": Log("Time,F\ns,N\n", lambda i, v: f"{seconds(i)},{v}"),
    "units in brackets in their own row": Log("Time,F\n[s],[N]\n", lambda i, v: f"{seconds(i)},{v}"),
    "units behind a comma": Log("Time, s;F, N\n", lambda i, v: f"{seconds(i)};{v}"),
    "units behind a comma, decimal comma": Log("Zeit, s\tF, N\n", lambda i, v: f"{comma(seconds(i))}\t{comma(v)}"),
    "milliseconds": Log("Time (ms),F (N)\n", lambda i, v: f"{10 * i},{v}"),
    "unit behind an underscore": Log("time_us,F (N)\n", lambda i, v: f"{10000 * i},{v}"),
    "preamble": Log("Logger X\nSerial: 12\n\nTime (s),F (N)\n", lambda i, v: f"{seconds(i)},{v}"),
    "start above": Log("Date: 2024-05-01\nTime: 12:00:00\n\nTime (s),F (N)\n", lambda i, v: f"{seconds(i)},{v}",
                       start="2024-05-01T12:00:00"),
    "rate above": Log("Sample rate: 100 Hz\nF (N),G (N)\n", lambda i, v: f"{v},{v}", units=("N",)),
    "sep= of Excel, with a mark": Log("sep=;\nTime (s);F (N)\n", lambda i, v: f"{comma(seconds(i))};{comma(v)}",
                                      encoding="utf-8-sig"),
    "UTF-16": Log("Time (s)\tF (N)\n", lambda i, v: f"{seconds(i)}\t{v}", encoding="utf-16"),
    "Latin-1": Log("Größe;m\nTime (s);F (N)\n", lambda i, v: f"{comma(seconds(i))};{comma(v)}", encoding="latin-1"),
    "trailing commas": Log("Time (s),F (N),\n", lambda i, v: f"{seconds(i)},{v},"),
    "times with a zone": Log("Time,F (N)\n", lambda i, v: f"2024-05-01T{clock(i)[0]}.{clock(i)[1]:03}+03:00,{v}",
                             start="2024-05-01T12:00:00+03:00"),
    "times of day with colons": Log("Time,F (N)\n", lambda i, v: f"{clock(i)[0]}:{clock(i)[1]:03},{v}"),
    "AM and PM": Log("Time,F (N)\n", lambda i, v: f"5/13/2024 {clock(i)[0]}.{clock(i)[1]:03} PM,{v}",
                     start="2024-05-13T12:00:00"),
    "date and time apart": Log("Date;Time;F (N)\n",
        lambda i, v: f"01.05.2024;{clock(i)[0]},{clock(i)[1]:03};{comma(v)}",
                               start="2024-05-01T12:00:00"),
    "two rows of names": Log("Time,Plate,\ns,F (N),G (N)\n", lambda i, v: f"{seconds(i)},{v},{-v}", name="Plate F"),
    "two rows of names, told": Log("Run,Plate 1,,Plate 2,\nTime (s),F (N),G (N),F (N),G (N)\n",
                                   lambda i, v: f"{seconds(i)},{v},1,2,3", 'names = [1, 2]\ntime = "Run Time"',
                                   name="Plate 1 F"),
    "three rows of names and units": Log("Force plates\nTime,Plate,\n,F,G\ns,N,N\n",
        lambda i, v: f"{seconds(i)},{v},{-v}",
                                         "names = [2, 3]\nunits = 4", name="Plate F"),
    "units above the names": Log("s,N\nTime,F\n", lambda i, v: f"{seconds(i)},{v}", "names = 2\nunits = 1\ndata = 3"),
    "notes between names and data": Log("Time,F\nn/a,calibrated 2024\ns,N\n", lambda i, v: f"{seconds(i)},{v}",
                                        "names = 1\nunits = 3"),
    "no names": Log("", lambda i, v: f"{seconds(i)},{v}",
                    'time = "col0"\ntime_unit = "s"\n[channels]\ncol1 = "F (N)"'),
    "a rate that is told": Log("F (N),G (N)\n", lambda i, v: f"{v},{v}", 'rate = "100 Hz"'),
    "a rate that is told beside times": Log("Time (s),F (N)\n", lambda i, v: f"{seconds(i)},{v}", 'rate = "50 Hz"'),
    "microseconds that wrap": Log("micros,F\n", lambda i, v: f"{(4294700000 + 10000 * i) % 2**32},{v}",
                                  'time = "micros"\ntime_unit = "us"\ntime_wraps = 4294967296\n'
                                  'channels = {F = "F (N)"}'),
    "milliseconds that wrap at 65536": Log("tick,F (N)\n", lambda i, v: f"{(65400 + 10 * i) % 65536},{v}",
                                           'time = "tick"\ntime_unit = "ms"\ntime_wraps = 65536'),
    "serial days": Log("Time;F (N)\n", lambda i, v: f"{comma(f'{45413.5 + i / 8640000:.12f}')};{comma(v)}",
                       'time = "Time"\ntime_unit = "day since 1899-12-30"', start="2024-05-01T12:00:00",
                       within=1e-6),
    "days of MATLAB": Log("t,F (N)\n", lambda i, v: f"{739373.5 + i / 8640000:.12f},{v}",
                          'time = "t"\ntime_unit = "day"', within=1e-5),  # float64 holds such days to 1e-10
    "time of day and milliseconds": Log("Time,ms,F (N)\n", lambda i, v: f"{clock(i)[0]},{clock(i)[1]},{v}",
                                        'time = ["Time", "ms"]\ntime_unit = ["s", "ms"]'),
    "date, time and milliseconds": Log("Date,Time,ms,F (N)\n",
        lambda i, v: f"2024-05-01,{clock(i)[0]},{clock(i)[1]},{v}",
                                       'time = ["Time", "ms"]\ntime_unit = ["s", "ms"]\ntime_zone = "Europe/Berlin"',
                                       start="2024-05-01T12:00:00+02:00"),
    "seconds and microseconds since 1970": Log("sec,usec,F (N)\n",
        lambda i, v: f"{1714564800 + i // 100},{i % 100 * 10000},{v}",
                                               'time = ["sec", "usec"]\ntime_unit = ["s since 1970", "us"]',
                                               start="2024-05-01T12:00:00Z", within=3e-7),  # float64 holds 0.24 µs
    "milliseconds since 1970": Log("timestamp,F (N)\n", lambda i, v: f"{1714564800000 + 10 * i},{v}",
                                   'time = "timestamp"\ntime_unit = "ms since 1970"', start="2024-05-01T12:00:00Z",
                                   within=3e-7),
    "nanoseconds since 1970": Log("timestamp,F (N)\n", lambda i, v: f"{1714564800000000000 + 10**7 * i},{v}",
                                  'time = "timestamp"\ntime_unit = "ns since 1970"', start="2024-05-01T12:00:00Z"),
    "words for no value": Log("Time (s),F (N)\n", lambda i, v: f"{seconds(i)},{gaps(i, v, 'OVERFLOW', 'dead')}",
                              'missing = ["OVERFLOW", "dead"]', force=WITH_GAPS),
    "numbers for no value": Log("Time (s),F (N)\n", lambda i, v: f"{seconds(i)},{gaps(i, v, '-9999', '9.9E37')}",
                                "missing = [-9999, 9.9e37]", force=WITH_GAPS),
    "numbers with decimal commas for no value": Log("Time (s);F (N)\n",
        lambda i, v: f"{comma(seconds(i))};{comma(gaps(i, v, -999.25))}",
                                                    "missing = [-999.25]", force=WITH_GAPS),
    "names in a comment": Log("# Time (s),F (N)\n", lambda i, v: f"{seconds(i)},{v}"),
    "data line": Log("Rig 3\nTime (s),F (N)\n7,8\n\n", lambda i, v: f"{seconds(i)},{v}", "names = 2\ndata = 5"),
    "another name and unit": Log("Time (s),Dev1/ai0\n", lambda i, v: f"{seconds(i)},{v}",
                                 '[channels]\n"Dev1/ai0" = "F (N)"'),
    "a mean under the data": Log("Time (s),F (N)\n", lambda i, v: f"{seconds(i)},{v}", 'normal = ["text_row"]',
                                 tail="Average;3.4\n"),
}  # fmt: skip


def described(text):
    """Options with a description of this text."""
    if not text:
        return ReadOptions()
    return ReadOptions(description=ImportDescription.model_validate(tomllib.loads(text)))


@pytest.mark.parametrize("name", LOGS)
def test_messy_logs_are_right(tmp_path, name):
    """Names, units, rate, times, values, start: as they are, with at most five lines; nothing to accept."""
    log = LOGS[name]
    assert len(log.description.splitlines()) <= MOST_LINES
    options = described(log.description)
    found = reading.read(log.write(tmp_path / "log.csv"), options)
    (check,) = found.checks.values()
    channels, columns = found.group().channels, found.data[found.group().name]
    at = next(i for i, c in enumerate(channels) if c.label == log.name)
    assert channels[at].unit == "N"
    np.testing.assert_array_equal(columns[at], FORCE if log.force is None else log.force)
    assert check.rate_hz == pytest.approx(log.rate_hz, rel=1e-4)
    if isinstance(clock_of := found.group().clock, TimeColumn):
        times = columns[clock_of.index] * clock_of.seconds_per_unit
        np.testing.assert_allclose(times - times[0], np.arange(N) / 100, rtol=0, atol=log.within)
    if log.start is not None:
        start = check.start_time.time
        assert start[:19] + start[19:].lstrip(".0123456789") == log.start
    judged = found.findings if options.description is None else options.description.with_normal_as_notes(found.findings)
    assert not refusing_findings(judged)


def test_what_was_detected_can_be_given_back(tmp_path, command):
    """The description that ``describe`` writes reads the log as before; a run keeps the one that it was read by."""
    path = LOGS["numbers for no value"].write(tmp_path / "log.csv")
    logger = tmp_path / "logger.toml"
    assert command("describe", path, "-o", logger)[0] == 0
    assert tomllib.loads(logger.read_text())["missing"] == ["-9999", "9.9e+37"]
    assert command("describe", path, "-o", logger)[0] == 1
    code, out, err = command("info", path, "--as", logger, "--stats", "--json")
    assert (code, err) == (0, "")
    (group,) = json.loads(out)["groups"]
    assert (group["channels"][1]["nan"], group["channels"][1]["max"]) == (2, 6.5)
    assert command("ingest", path, "--as", logger, "-o", tmp_path / "c")[0] == 0
    (source,) = open_run(tmp_path / "c" / "log.h5").provenance["sources"]
    assert source["settings"]["import_description"] == logger.read_text()


@pytest.mark.parametrize("name", [name for name, log in LOGS.items() if not log.description])
def test_every_detected_form_can_be_stated(tmp_path, command, name):
    """What ``describe`` writes of a log that is right untold gives the same names, units and numbers."""
    path = LOGS[name].write(tmp_path / "log.csv")
    written = command("describe", path)[1]
    (tmp_path / "logger.toml").write_text(written, encoding="utf-8")
    untold, told = reading.read(path), reading.read(path, described(written))
    for group, other in zip(untold.groups.values(), told.groups.values(), strict=True):
        assert [(c.name, c.unit) for c in group.channels] == [(c.name, c.unit) for c in other.channels]
        assert (group.clock, group.zero) == (other.clock, other.zero)
        np.testing.assert_array_equal(untold.data[group.name], told.data[other.name])


def test_normal_findings_are_notes(tmp_path, command):
    """They are said, and change neither exit code nor whether a log is stored."""
    path = LOGS["a mean under the data"].write(tmp_path / "log.csv")
    (tmp_path / "logger.toml").write_text('normal = ["text_row"]\n')
    code, _, err = command("info", path)
    assert (code, "would be refused for text_row" in err) == (1, True)
    assert command("info", path, "--as", tmp_path / "logger.toml")[0] == 0
    assert command("ingest", path, "--as", tmp_path / "logger.toml", "-o", tmp_path / "c")[0] == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tme = 'Time'", "tme: unknown key; did you mean 'time'"),
        ("time = 'Zeit'", "no column 'Zeit'"),
        ("time = ['Time (s)', 'ms']", "no column 'ms'"),
        ("time = ['Time (s)', 'tick']", "'tick' has no unit of time, and is one of a sum: state time_unit"),
        ("time = 'Time (s)'\ntime_unit = 'parsec'", "'parsec' is no unit of time"),
        ("time = 'Time (s)'\ntime_unit = 's since when'", "expected a date after since"),
        ("time = 'Time (s)'\ntime_unit = ['s', 'ms']", "2 units for 1 columns"),
        ("[channels]\nrate = '1 kHz'", "channels.rate: the setting rate stands below .*: write it above"),
        ("[channels]\nnames = [1]", "channels.names: the setting names stands below .*: write it above"),
        ("time_zone = 'Mars/Olympus'", "expected an offset such as"),
        ("normal = ['bad_luck']", "no code of a finding"),
        ("names = 70", "no row of number"),
        ("text = 'x'", "unknown key"),
        ("delimiter = 'colon'", "delimiter"),
    ],
)
def test_what_a_description_cannot_say(tmp_path, text, said):
    """The key and what was expected, or the column that is not there."""
    (tmp_path / "logger.toml").write_text(text)
    path = LOGS["plain"].write(tmp_path / "log.csv")
    path.write_text(
        "".join(f"{row},{'tick' if i == 0 else i}\n" for i, row in enumerate(path.read_text().splitlines()))
    )
    with pytest.raises(RecordingError, match=said):
        reading.read(path, ReadOptions(description=ImportDescription.load(str(tmp_path / "logger.toml"))))


BESIDE_A_RATE = {
    "samples counted": ("t,F (N)", lambda i: i, "", 100.0, {"time_set_aside"}),
    "no unit of time": ("time (ticks),F (N)", lambda i: i, "", 100.0, {"unit_unknown", "time_set_aside"}),
    "a temperature": ("T,F (N)", lambda i: 20 + i % 3, "", 100.0, {"time_set_aside"}),
    "a dead clock": ("time (s),F (N)", lambda i: 0, "", 100.0, {"time_set_aside", "constant_channel"}),
    "a coarse clock": ("time (s),F (N)", lambda i: f"{i // 10 / 10:.1f}", "", 100.0, {"time_set_aside"}),
    "no numbers": ("time (s),F (N)", lambda i: "nan" if i else 0, "", 100.0, {"time_set_aside", "not_a_number"}),
    "none by word": ("t,F (N)", lambda i: i, "time = []", 100.0, set()),
    "none of two by word": ("t,F (N),t 2,G (N)", lambda i: f"{i},{i % 5},{i}", "time = []", 100.0, set()),
    "renamed": ("T,F (N)", lambda i: 20 + i % 3, '[channels]\nT = "temperature (degC)"', 100.0, set()),
    "renamed to another time": ("T,F (N)", seconds, '[channels]\nT = "stamp (s)"', 100.0, set()),
    "told by its new name": ("T,tick,F (N)", lambda i: f"1,{40 * i}", '[channels]\ntick = "Zeit (ms)"', 25.0,
                             {"rate_contradiction", "constant_channel"}),
    "a gap": ("time (s),F (N)", lambda i: seconds(i + 9 * (i > 30)), "", 100.0, {"time_gap"}),
    "a fall": ("time (s),F (N)", lambda i: seconds(i - 9 * (i > 30)), "", 100.0, {"time_not_increasing"}),
    "another rate": ("time (s),F (N)", lambda i: f"{i / 50:.2f}", "", 50.0, {"rate_contradiction"}),
    "no rate": ("time (s),F (N)", lambda i: f"{i / 100 + i * i % 7 / 900:.5f}", "", None, {"time_irregular"}),
    "another rate in the header": ("# rate: 200 Hz\nG (N),F (N)", lambda i: i % 3, "", 100.0, {"rate_contradiction"}),
    "another rate in the header, and times": ("# rate: 200 Hz\ntime (s),F (N)", seconds, "", 100.0,
                                              {"rate_contradiction"}),
    "the same rate in the header": ("# rate: 100 Hz\nG (N),F (N)", lambda i: i % 3, "", 100.0, set()),
}  # fmt: skip


@pytest.mark.parametrize("name", BESIDE_A_RATE)
def test_a_rate_and_a_column_that_is_called_time(tmp_path, name):
    """Times that run are what was recorded; what else is called time is none. What contradicts the rate is said."""
    head, first, more, rate_hz, codes = BESIDE_A_RATE[name]
    path = Log(head + "\n", lambda i, v: f"{first(i)},{v}").write(tmp_path / "log.csv")
    found = reading.read(path, described(f'rate = "100 Hz"\n{more}'))
    (check,) = found.checks.values()
    assert check.rate_hz == (rate_hz and pytest.approx(rate_hz))
    assert {f.code for f in found.findings} - {"dialect", "unit_missing", "clipping_suspected"} == codes
    said = [f.message for f in found.findings if f.code in ("time_set_aside", "rate_contradiction", "time_irregular")]
    assert all("import description" in message and "100 Hz" in message for message in said)


@pytest.mark.parametrize(
    ("text", "clocks"),
    [
        ('time = "ms"', [TimeColumn(0, 1e-3), TimeColumn(0)]),
        ('time = "ms"\nrate = "5 Hz"', [TimeColumn(0, 1e-3), TimeColumn(0)]),
        ('rate = "5 Hz"', [UniformClock(5.0), TimeColumn(0)]),
        ("time = []", [None, None]),
    ],
)
def test_time_of_one_group_of_several(text, clocks):
    """What is stated is of the group that has the column; the other keeps its own, unless none is time."""
    groups = tuple(Group(n, (Channel(n, n), Channel("F", "N"))) for n in ("ms", "s"))
    groups = groups[0], replace(groups[1], clock=TimeColumn(0))
    read = [Block(group, (np.arange(9.0), np.ones(9)), 0) for group in groups]
    log = Recording(Path("log"), "made", "made", groups, lambda report: iter(read))
    assert [group.clock for group in described(text).description.applied(log).groups] == clocks


def test_a_channel_that_is_described_and_not_there(tmp_path, command):
    """A log that lacks it is refused, for the name may be mistyped; of several that share a description one has it."""
    both, one = "Time (s),Fx,PlatX\n", "Time (s),Fx,G\n"
    for name, head in (("a_daq", both), ("b_forces", one)):
        Log(head, lambda i, v: f"{seconds(i)},{v},{i % 5}").write(tmp_path / f"{name}.csv")
    logs, logger = (tmp_path / "a_daq.csv", tmp_path / "b_forces.csv"), tmp_path / "logger.toml"
    text = '[channels]\nPlatX = "Acc (g)"\nFx = "F (N)"\n'
    logger.write_text(text)

    def found(*words):
        code, out, _ = command(*words, "--as", logger, "--json")
        document = json.loads(out)
        said = [f for run in document.get("runs", [document]) for f in run["findings"]]
        return code, [(f["code"], f["channel"]) for f in said if f["code"].startswith("channel_")], str(said)

    code, said, message = found("info", logs[1])
    assert (code, said) == (1, [("channel_not_found", "PlatX")])
    assert "channels.PlatX: the log has no channel of this name; there are Time, Fx, G" in message.replace(" (s)", "")
    assert found("ingest", logs[1], "-o", tmp_path / "one")[:2] == (1, [("channel_not_found", "PlatX")])
    for n, runs in enumerate(("", "file,run\na_daq.csv,r\nb_forces.csv,r\n", "file\na_daq.csv\nb_forces.csv\n")):
        (tmp_path / "runs.csv").write_text(runs)
        table = ("--runs", tmp_path / "runs.csv") if runs else ()
        assert found("ingest", *logs[::-1], *table, "-o", tmp_path / f"c{n}")[1] == [("channel_elsewhere", "PlatX")]
        assert (tmp_path / f"c{n}" / ("r.h5" if "run" in runs else "b_forces.h5")).exists()
    logger.write_text(text.replace("PlatX", "PlatY"))
    code, said, message = found("ingest", *logs, "-o", tmp_path / "none")
    assert (code, said) == (1, [("channel_not_found", "PlatY")] * 2)
    assert "did you mean 'PlatX'" in message
    logger.write_text('normal = ["channel_not_found"]\n' + text)
    assert found("ingest", logs[1], "-o", tmp_path / "normal")[:2] == (0, [])


def test_a_log_is_stored_by_the_rate_that_is_stated(tmp_path, command):
    """Whole, though its beginning is read before, and with its texts and digest."""
    path = Log("time (s),F (N),note\n", lambda i, v: f"0,{v},{'on' if i > 30 else 'off'}").write(tmp_path / "log.csv")
    (tmp_path / "logger.toml").write_text('rate = "100 Hz"\n')
    assert command("ingest", path, "--as", tmp_path / "logger.toml", "-o", tmp_path / "c")[0] == 3
    run = open_run(tmp_path / "c" / "log.h5")
    assert run.rate_hz == 100.0
    np.testing.assert_array_equal(run.channel("F"), FORCE)
    assert [text.texts for text in run.texts] == [["off", "on"]]
    (source,) = run.provenance["sources"]
    assert source["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("name", datasets.dataset_names("loggers", ".toml"))
def test_shipped_descriptions_are_whole(name):
    """Each is read, and names its logger; codes are known ones."""
    found = ImportDescription.load(name)
    assert found.name
    assert set(found.normal) <= set(MEANING)
