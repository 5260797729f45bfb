"""What the tests of readers share: a recording read to its end, the public recordings, and their known values."""

import json
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from studies.reader_faults import answer_here, open_here
from testbench.errors import RecordingError
from testbench.public_recordings import FOLDER_VARIABLE
from testbench.quality.group_checks import RecordingCheck
from testbench.readers import open_recording
from testbench.recording import Group, Recording, Refusal, TimeColumn

KNOWN = Path(__file__).with_name("known_values.json")
"""What other people's libraries give of the public recordings, by file."""


@dataclass
class Read:
    """A recording read to its end: data by group and channel, findings, clocks as checked, the number of blocks."""

    recording: Recording
    groups: dict[str, Group]
    data: dict[str, list[np.ndarray]]
    findings: list
    checks: dict
    count: int

    @property
    def codes(self):
        """The codes of all findings."""
        return {finding.code for finding in self.findings}

    def message(self, code):
        """The message of the first finding of this code."""
        return next(str(finding.message) for finding in self.findings if finding.code == code)

    def group(self, name=None):
        """The group of this name, or the first one."""
        return self.groups[name] if name else next(iter(self.groups.values()))

    def column(self, channel, group=None):
        """The samples of the one channel of this name."""
        found = [
            self.data[g.name][i]
            for g in self.groups.values()
            if group in (None, g.name)
            for i, c in enumerate(g.channels)
            if c.name == channel
        ]
        assert len(found) == 1, f"{len(found)} channels are named {channel!r}"
        return found[0]

    def unit(self, channel):
        """The unit of the channels of this name."""
        return {c.unit for g in self.groups.values() for c in g.channels if c.name == channel}.pop()

    def time(self, group=None):
        """The recorded time of a group."""
        where = self.group(group)
        assert isinstance(where.clock, TimeColumn)
        return self.data[where.name][where.clock.index]


def read(path, options=None) -> Read:
    """Read a file to its end, checking that blocks follow one another."""
    recording = open_recording(path, options)
    check = RecordingCheck(recording)
    findings = list(recording.findings)
    groups, parts = {g.name: g for g in recording.groups}, {g.name: [] for g in recording.groups}
    for block in recording.blocks(findings.append):
        groups.setdefault(block.group.name, block.group)
        so_far = parts.setdefault(block.group.name, [])
        assert block.start == sum(len(b) for b in so_far), "blocks follow one another"
        so_far.append(block)
        check.update(block)
    data = {
        name: [
            np.concatenate([b.columns[i] for b in blocks] or [np.empty(0)]) for i in range(len(groups[name].channels))
        ]
        for name, blocks in parts.items()
    }
    count = sum(map(len, parts.values()))
    return Read(recording, groups, data, findings + check.findings(), check.groups, count)


def said(path, options=None):
    """Code and message of every finding, one a line; or of the refusal."""
    try:
        return "\n".join(f"{f.code}: {f.message}" for f in read(path, options).findings)
    except RecordingError as error:
        return f"{error.finding.code if isinstance(error, Refusal) else 'error'}: {error}"


@pytest.fixture
def in_process(monkeypatch):
    """Libraries read in this process, which is faster; what befalls them there is a refusal here too."""
    monkeypatch.setattr("testbench.readers.registry.open_in_subprocess", open_here)
    monkeypatch.setattr("testbench.readers.xlsx.answer_in_subprocess", answer_here)


def real(name) -> Path:
    """A public recording, for tests that are marked ``recordings``."""
    return Path(os.environ[FOLDER_VARIABLE]) / name


@cache
def read_real(name) -> Read:
    """A public recording read to its end, once for all tests."""
    return read(real(name))


def malformed(name) -> Path:
    """A malformed one beside them, for tests that are marked ``recordings("malformed")``."""
    return real(".").parent / "bad" / name


def known(name):
    """The known values of a public recording, by what they are of."""
    return json.loads(KNOWN.read_text(encoding="utf-8"))[name]


def assert_values(column, expected, exact=True):
    """Counts, extremes and ends exactly, or to 1e-9 where a unit was converted; the mean to 1e-9."""
    finite = column[np.isfinite(column)]
    assert len(column) == expected["n"]
    assert len(column) - len(finite) == expected["nan"]
    values = {"min": finite.min(), "max": finite.max(), "first": column[0], "last": column[-1]}
    for key, value in values.items():
        assert value == (expected[key] if exact else pytest.approx(expected[key], rel=1e-9)), key
    assert finite.mean() == pytest.approx(expected["mean"], rel=1e-9, abs=1e-15)


def assert_clock(time, expected):
    """First and last time and the steps between, in the unit of the column."""
    steps = np.diff(time)
    found = {"t_first": time[0], "t_last": time[-1], "dt_min": steps.min(), "dt_median": np.median(steps)}
    found |= {"dt_max": steps.max(), "non_increasing": int((steps <= 0).sum())}
    for key, value in found.items():
        assert value == pytest.approx(expected[key], rel=1e-9), key
