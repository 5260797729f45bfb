"""Public files of all formats against the field's libraries, whole and cut: nothing lost, nothing other without a word.

``conformance.toml`` lists the files; they lie in the folder ``conformance`` beside the recordings, or are fetched.
A channel that a library gives must be here with its numbers, unit, time and start, or a finding must name it.
"""

import tomllib
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

from balance.errors import CounterpoiseError
from testbench.errors import RecordingError
from testbench.public_recordings import PublicRecording, checked, fetch, folder
from testbench.quality.group_checks import RecordingCheck
from testbench.readers import open_recording, registry, xlsx
from testbench.recording import Finding, Group, Recording, Samples, Severity, UniformClock, refusing_findings

from .conformance_libraries import LIBRARIES, Library, Series
from .reader_faults import answer_here, open_here
from .table import Row, all_of

MOST_ACCEPTED = 0.02
"""Of the files that a library reads, so many may need a person to accept a finding."""
LIBRARY_ERRS = {
    "type1.C3D": "ezc3d mixes numbers of other points in, with markers that jump by metres",
    "shd01.c3d": "ezc3d takes the unsigned offset 0x8010, 32784, for 32752: -32752 without its sign",
    "561xxa01_anonym.C3D": "ezc3d mixes numbers of other points in, with markers that jump by metres",
}
"""Files of which a library gives what is not in them."""
REFUSED = {
    "PDSinfoCOP.txt": "a table of persons",
    "delta_byte_array_expect.csv": "a table of persons",
    "user.csv": "a table of persons",
    "Probfunnel0.05-60.csv": "two names over sixty columns",
    "test-8000Hz-le-1ch-1byte-ulaw.wav": "a code of telephones, no samples as recorded",
    "test-8000Hz-le-3ch-5S-24bit-inconsistent.wav": "its header contradicts itself",
    "PDSinfo.xlsx": "a table of persons",
    "no-header.xlsx": "a number behind another word on each line, as in notes",
    "temperature-fallible.xlsx": "a number behind another word on each line, as in notes",
    "inlineStr_with_value.xlsx": "a table of requirements",
    "issue_174.xlsx": "a form of a parcel service",
    "strict_iso_paths.xlsx": "Strict Open XML, which openpyxl does not read",
    "rewriter_a_0.db3": "messages of a type that neither the bag nor rosbags describes",
    "rewriter_b_0.db3": "the same",
    "wrong_rmw_test_0.db3": "the same",
    "test_bag_for_seek_0.db3": "the same",
    "talker.db3": "its descriptions are not those of its messages",
    "only_services.mcap": "events of a service, which its description leaves out",
    "wrong_rmw_test_0.mcap": "an encoding that nobody knows",
    "ref_no_ncproperty.nc": "its only number was never written",
    "ref_hdf5_compat1.nc": "none of its numbers was ever written",
    "f03tst_open_mem.nc": "none of its numbers was ever written",
}
"""Files that are no logs, or whose numbers nobody can know, and must be refused."""
EXCUSES = {"left_out", "text_channel", "empty_group", "no_data", "too_large", "outside_reference", "cut_file",
           "damaged_file", "count_contradiction", "ragged_row", "not_exact", "invalid_samples", "not_a_number",
           "time_resolution", "time_as_text", "number_notation", "several_clocks", "repeated_header"}  # fmt: skip
"""Findings that say that the numbers of the channel they name are not there, or otherwise than written."""
LARGEST_CUT = 1 << 20
"""Files above this are not cut [bytes]."""


@dataclass(frozen=True)
class Here:
    """What our reader makes of a file: columns by group and channel, findings; or why it is refused."""

    recording: Recording | None
    columns: dict[tuple[str, int], Samples]
    findings: list[Finding]
    refused: str = ""

    @property
    def rows(self) -> int:
        """Samples of all groups."""
        return sum({group: len(values) for (group, _), values in self.columns.items()}.values())

    @property
    def is_silent(self) -> bool:
        """Whether nothing is said that a person would stop at."""
        return not self.refused and all(finding.severity is Severity.NOTE for finding in self.findings)


def study(count: int, brief: bool) -> Iterator[Row]:
    """Each file as its library gives it, and ``count`` times cut; briefly three files a format."""
    groups = groupby(sorted(manifest(), key=lambda file: file.what), key=lambda file: file.what)
    listed = [file for _, files in groups for file in list(files)[: 3 if brief else None]]
    there, away = [], ""
    for file in listed:
        try:
            there.append((file, _at_hand(file, not away)))
        except RecordingError as error:
            away = away or f"{error}"
    yield Row("files at hand", len(there), f"of {len(listed)}", note=away[:200])
    # readers of foreign libraries in this process too: a process for each of thousands of cut files takes hours
    with (
        patch.object(registry, "open_in_subprocess", open_here),
        patch.object(xlsx, "answer_in_subprocess", answer_here),
    ):
        for name, files in groupby(there, key=lambda pair: pair[0].what):
            yield from _of_format(name, list(files), count)


def manifest() -> list[PublicRecording]:
    """The files, each with its format for what it is."""
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    return [
        PublicRecording(
            file=f"conformance/{digest[:8]}-{Path(path).name}", what=kind, path=path, bytes=size, sha256=digest, **place
        )
        for repository in table["repository"]
        for place in [{key: value for key, value in repository.items() if key != "files"}]
        for kind, path, size, digest in repository["files"]
    ]


def _at_hand(file: PublicRecording, may_fetch: bool) -> Path:
    path = folder() / file.file
    if path.is_file():
        return checked(path, file)
    if not may_fetch:
        raise RecordingError(f"{file.file}: not fetched")
    return fetch(file)


def _of_format(kind: str, files: list[tuple[PublicRecording, Path]], count: int) -> Iterator[Row]:
    """The rows of one format."""
    given = LIBRARIES[kind]
    readable, refused, accepted, other, cuts, bad_cuts = 0, [], [], [], 0, []
    for file, path in files:
        expected = [] if Path(file.path).name in LIBRARY_ERRS else _library(given.read, path)
        found = read_here(path)
        if any(not isinstance(series.values, list) for series in expected):
            readable += 1
            if bool(found.refused) != (Path(file.path).name in REFUSED):
                refused.append(f"{file.path} ({found.refused})")
            elif errors := refusing_findings(found.findings):
                accepted.append(f"{file.path} ({errors[0].code})")
        if not found.refused:
            other += [f"{file.path}: {fault}" for fault in differences(expected, found)]
        if path.stat().st_size <= LARGEST_CUT and not found.refused:
            with TemporaryDirectory() as where:
                faults = list(_cut(path, Path(where, path.name), found, given, count))
            cuts += count
            bad_cuts += [f"{file.path}: {fault}" for fault in faults]
    note = f"{len(files)} files against {given.name}"
    yield all_of(
        f"{kind}: read, of those with series in {given.name}, or rightly refused",
        readable - len(refused),
        readable,
        _few(refused),
    )
    most = max(1, int(MOST_ACCEPTED * readable))
    yield Row(f"{kind}: need `--accept`", len(accepted), f"of {readable}", None, most, _few(accepted))
    yield Row(f"{kind}: channels otherwise than there, without a finding", len(other), "", 0, 0, _few(other) or note)
    yield all_of(f"{kind}: cut, never silent nor less than the library", cuts - len(bad_cuts), cuts, _few(bad_cuts))


def _few(texts: list[str]) -> str:
    more = f"; and {len(texts) - 6} more" if len(texts) > 6 else ""
    return ("; ".join(text[:160] for text in texts[:6]) + more).replace("|", "/").replace("\n", " ")


def _library(read: Callable[[Path], list[Series]], path: Path) -> list[Series]:
    """What the library gives; nothing where it fails."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return [series for series in read(path) if len(series.values)]
        except Exception:
            return []


def read_here(path: Path) -> Here:
    """What our reader makes of a file."""
    columns: dict[tuple[str, int], list[Samples]] = {}
    try:
        recording = open_recording(path)
        check, findings, groups = RecordingCheck(recording), list(recording.findings), list(recording.groups)
        for block in recording.blocks(findings.append):
            check.update(block)
            if block.group not in groups:
                groups.append(block.group)
            for i, column in enumerate(block.columns):
                columns.setdefault((block.group.name, i), []).append(column)
        whole = {key: np.concatenate(parts) for key, parts in columns.items()}
        return Here(replace(recording, groups=tuple(groups)), whole, findings + check.findings())
    except CounterpoiseError as error:
        return Here(None, {}, [], str(error).partition(": ")[2][:120] or str(error))


def differences(expected: list[Series], found: Here) -> Iterator[str]:
    """What the library gives otherwise, and no finding tells."""
    assert found.recording is not None
    for series in expected:
        if _is_excused(series, found):
            continue
        if isinstance(series.values, list):
            kept = found.recording.texts.kept
            is_coded = f"{series.name}: meaning" in found.recording.metadata  # numbers are kept, with what they mean
            if not is_coded and not any(set(one.texts) & set(series.values) for one in kept):
                yield f"text {series.name!r} is not there"
        else:
            yield from _of_numbers(series, found, found.recording)


def _is_excused(series: Series, found: Here) -> bool:
    """Whether a finding says that the numbers of a series are not there, or otherwise."""
    said = (f"{f.channel} {f.message}" for f in found.findings if f.code in EXCUSES)
    return bool(series.name) and any(_is_named(series.name, text) for text in said)


def _of_numbers(series: Series, found: Here, recording: Recording) -> Iterator[str]:
    """A channel of numbers: by its values and name, then its unit, clock and start."""
    values = np.asarray(series.values, dtype=np.float64)
    same = [
        (group, channel)
        for group in recording.groups
        for i, channel in enumerate(group.channels)
        if (column := found.columns.get((group.name, i))) is not None and _same(column, values)
    ]
    if not same and np.array_equal(_joined(series.name, found, recording), values, equal_nan=True):
        return  # in several groups, one behind the other
    named = [pair for pair in same if _is_named(series.name, f"{pair[1].name} {pair[0].name}")] if series.name else same
    if not named:
        others = ", ".join(sorted({channel.name for _, channel in same})[:3])
        yield f"{series.name!r} ({len(values)}): {f'named {others}' if same else 'no channel has its numbers'}"
        return
    if series.unit is not None and not any((channel.unit or "") == series.unit for _, channel in named):
        yield f"{series.name!r}: unit {named[0][1].unit!r}, there {series.unit!r}"
    if series.rate_hz and not any(_rate(group, found, series.rate_hz) for group, _ in named):
        yield f"{series.name!r}: not {series.rate_hz:g} Hz but {named[0][0].clock}"
    if series.start_ns is not None:
        starts = [start for group, _ in named if (start := _start_ns(group, found)) is not None]
        if not any(abs(start - series.start_ns) <= 2000 for start in starts):
            yield f"{series.name!r}: starts at {starts[:1]} ns, there {series.start_ns}"


def _joined(name: str, found: Here, recording: Recording) -> Samples:
    """The samples of the channels of this name, group behind group."""
    channels = ((g.name, i) for g in recording.groups for i, c in enumerate(g.channels) if c.name == name)
    return np.concatenate([found.columns[key] for key in channels if key in found.columns] or [np.empty(0)])


def _same(ours: Samples, theirs: Samples) -> bool:
    return ours.shape == theirs.shape and bool(np.allclose(ours, theirs, rtol=1e-6, atol=0, equal_nan=True))


def _rate(group: Group, found: Here, rate_hz: float) -> bool:
    if isinstance(group.clock, UniformClock):
        return bool(abs(group.clock.rate_hz / rate_hz - 1) < 1e-5)
    if group.clock is None or group.clock.seconds_per_unit is None:
        return False
    time = found.columns[group.name, group.clock.index] * group.clock.seconds_per_unit
    return len(time) < 2 or bool(abs(np.median(np.diff(time)) * rate_hz - 1) < 1e-3)


def _start_ns(group: Group, found: Here) -> int | None:
    """The first sample's time since 1970, as the group states it."""
    if group.zero is None:
        return None
    if isinstance(group.clock, UniformClock):
        return int(group.zero.nanoseconds + round(1e9 * group.clock.start_s))
    if group.clock is None or group.clock.seconds_per_unit is None:
        return int(group.zero.nanoseconds)
    first = found.columns[group.name, group.clock.index][0] * group.clock.seconds_per_unit
    return int(group.zero.nanoseconds + round(1e9 * first))


def _is_named(name: str, text: str) -> bool:
    """Whether a text names a channel of the library, which may have parts of a path before it."""
    last = name.replace("\0", "").strip().rpartition("/")[2]
    return not last or last in text


def _cut(path: Path, copy: Path, whole: Here, library: Library, count: int) -> Iterator[str]:
    """``count`` copies, each shorter: what was lost is told, and never more is lost than the library recovers."""
    content = path.read_bytes()
    for i in range(1, count + 1):
        at = len(content) * i // (count + 1)
        at += content[at - 1 : at] == b"\n"  # of whole lines nobody can know that more came
        copy.write_bytes(content[:at])
        found = read_here(copy)
        if found.is_silent and found.rows < whole.rows:
            yield f"cut at byte {at}: {found.rows} of {whole.rows} rows, and not a word"
        theirs = [] if library.torn is None else _library(library.read, copy)
        numbers = (
            one
            for one in theirs
            if not isinstance(one.values, list) and not (found.recording and _is_excused(one, found))
        )
        most = max((len(series.values) for series in numbers), default=0)
        if found.rows + (library.torn or 0) < most:
            yield f"cut at byte {at}: {found.rows} rows, {library.name} has {most} ({found.refused})"
