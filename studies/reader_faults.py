"""Damaged files of every format: each is read to its end, or refused by a message with its name, within seconds.

The damage is what loggers, cables and enemies do; seeded. The files are one small example of each format, and the
public recordings where ``COUNTERPOISE_RECORDINGS`` names their folder.
"""

import os
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from balance.errors import CounterpoiseError
from testbench.quality.group_checks import RecordingCheck
from testbench.readers import open_recording, subprocess_reader
from testbench.recording import MEANING, Block, Recording, Report

from .table import Row, all_of

LONGEST_S = 20.0
"""Processor time, of child processes too, within which a file must be read or refused [s]."""
LARGEST_RECORDING = 4 << 20
"""Public recordings above this are not damaged [bytes]."""


def study(count: int, brief: bool) -> Iterator[Row]:
    """``count`` damaged copies of each example and public recording; briefly of examples alone."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in _examples(Path(folder)):
            yield _damaged(Path(folder, name), content, count)
        for path in () if brief else _public_recordings():
            yield _damaged(Path(folder, path.name), path.read_bytes(), count)


def read_or_refused(path: Path) -> None:
    """Read a file to its end as ``testbench info`` does. Raises whatever else happens, or AssertionError."""
    began = sum(os.times()[:4])
    try:
        recording = open_recording(path)
        check, findings = RecordingCheck(recording), list(recording.findings)
        for block in recording.blocks(findings.append):
            check.update(block)
        findings += check.findings()
        assert {finding.code for finding in findings} <= set(MEANING)
    except CounterpoiseError as error:
        if not str(error).startswith((path.name, "reading ", str(path))):
            raise
    assert sum(os.times()[:4]) - began < LONGEST_S


def read_as_sheet(path: Path) -> None:
    """The same with a file that becomes the sheet of a workbook: an archive's own checks refuse damage before."""
    book = path.with_suffix(".xlsx")
    with zipfile.ZipFile(book, "w") as archive:
        for name, content in _parts_of_a_workbook().items():
            archive.writestr(name, path.read_bytes() if name == "xl/worksheets/sheet1.xml" else content)
    read_or_refused(book)


@cache
def _parts_of_a_workbook() -> dict[str, bytes]:
    """Its other parts, with texts that cells share and formats of times."""
    import openpyxl

    book = openpyxl.Workbook()
    for column, form in enumerate(("General", "yyyy-mm-dd", "h:mm:ss", "yyyy-mm-dd hh:mm:ss.000", "[h]:mm"), 1):
        book.active.cell(1, column, f"name {column} (N)").number_format = form
    book.save(saved := BytesIO())
    with zipfile.ZipFile(saved) as archive:
        return {
            name: archive.read(name) for name in archive.namelist() if not name.startswith(("docProps", "xl/theme"))
        }


def open_here(path: Path, module: str, function: str = "open_library") -> Recording:
    """A recording by a foreign library in this process; what befalls it there is a refusal here too."""

    with _failing(path):
        recording: Recording = getattr(import_module(module), function)(path)

    def blocks(report: Report) -> Iterator[Block]:
        with _failing(path):
            yield from recording.read(report)

    return replace(recording, read=blocks)


def answer_here(path: Path, module: str, function: str, *others: str) -> Any:  # noqa: ANN401
    """What a foreign library makes of a file in this process, likewise."""
    with _failing(path):
        return getattr(import_module(module), function)(path, *others)


@contextmanager
def _failing(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        subprocess_reader.raise_failure(path, subprocess_reader.failure(error))


def failures(path: Path, whole: bytes, count: int, seed: int) -> list[str]:
    """What damaged copies did that are neither read nor refused; each is written to ``path`` in turn."""
    found = []
    for number, content in enumerate(damaged_copies(whole, count, seed)):
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                read_or_refused(path)
            except Exception as error:
                found.append(f"copy {number} of {path.name}, seed {seed}: {error!r}")
    return found


def _damaged(path: Path, whole: bytes, count: int) -> Row:
    found = failures(path, whole, count, seed=1000)
    return all_of(f"{path.name}, damaged copies read or refused", count - len(found), count, "; ".join(found[:3]))


def _examples(folder: Path) -> Iterator[tuple[str, bytes]]:
    """The files that the tests of readers write, by other programs where there are some."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "testbench"))
    from readers import examples  # type: ignore[import-not-found]

    for name in examples.ALL:
        yield name, examples.make(folder, name).read_bytes()


def _public_recordings() -> list[Path]:
    folder = Path(os.environ.get("COUNTERPOISE_RECORDINGS") or os.devnull)
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    return [
        path for path in files if path.is_file() and path.suffix != ".md" and path.stat().st_size < LARGEST_RECORDING
    ]


def damaged_copies(whole: bytes, count: int, seed: int) -> Iterator[bytearray]:
    """``count`` damaged copies, one kind after the other."""
    random = np.random.default_rng(seed)
    kinds = (_cut, _flipped, _flipped_in_head, _spliced, _zeroed, _repeated, _large_numbers, _grown)
    for i in range(count):
        yield kinds[i % len(kinds)](bytearray(whole), random)


def _at(raw: bytearray, random: np.random.Generator, before: int | None = None) -> int:
    return int(random.integers(0, max(1, min(len(raw), before or len(raw)))))


def _cut(raw: bytearray, random: np.random.Generator) -> bytearray:
    return raw[: _at(raw, random)]


def _flipped(raw: bytearray, random: np.random.Generator) -> bytearray:
    for _ in range(int(random.integers(1, 20))):
        raw[_at(raw, random)] ^= 1 << int(random.integers(0, 8))
    return raw


def _flipped_in_head(raw: bytearray, random: np.random.Generator) -> bytearray:
    for _ in range(int(random.integers(1, 4))):
        raw[_at(raw, random, 2000)] = int(random.integers(0, 256))
    return raw


def _spliced(raw: bytearray, random: np.random.Generator) -> bytearray:
    """A piece is missing."""
    begin = _at(raw, random)
    del raw[begin : begin + int(random.integers(1, 200))]
    return raw


def _zeroed(raw: bytearray, random: np.random.Generator) -> bytearray:
    begin, count = _at(raw, random), int(random.integers(1, 600))
    return raw[:begin] + bytes(min(count, len(raw) - begin)) + raw[begin + count :]


def _repeated(raw: bytearray, random: np.random.Generator) -> bytearray:
    """A piece comes again elsewhere."""
    begin, other = _at(raw, random), _at(raw, random)
    return raw[:other] + raw[begin : begin + int(random.integers(1, 600))] + raw[other:]


def _large_numbers(raw: bytearray, random: np.random.Generator) -> bytearray:
    """Lengths and addresses as large as can be."""
    begin, width = _at(raw, random, 4000), (2, 4, 8)[int(random.integers(3))]
    largest = 1 << 8 * width
    value = (largest // 2, largest - 1, largest - 16, 1 << 4 * width)[int(random.integers(4))]
    return raw[:begin] + value.to_bytes(width, "little") + raw[begin + width :]


def _grown(raw: bytearray, random: np.random.Generator) -> bytearray:
    return raw + random.bytes(int(random.integers(1, 3000)))
