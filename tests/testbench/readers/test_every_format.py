"""What holds for every format: the contract, numbers of all types to the bit, blocks of any size, missing libraries."""

import ast
import importlib.metadata
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import polars
import pytest
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat, wavfile

from testbench.errors import RecordingError
from testbench.readers import Reader, contract, find_reader, open_recording, readers, registry
from testbench.recording import Block, Channel, Group, Recording

from . import examples, reading
from .reading import in_process  # noqa: F401

KINDS = ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8")
WIDE = np.array([5, 2**53 + 1, -(2**53) - 1])


@pytest.mark.parametrize("reader", readers(), ids=lambda reader: reader.name)
def test_every_reader_keeps_the_contract_by_itself(reader):
    """Built-in or from an entry point: a name, extensions, and a judgement of any bytes."""
    assert contract.violations(reader) == []


@pytest.mark.parametrize("name", examples.ALL)
@pytest.mark.usefixtures("in_process")
def test_every_format_keeps_the_contract(tmp_path, name):
    """Names, clocks, blocks, findings, repeatability, and clear errors on damaged copies."""
    path = examples.make(tmp_path, name)
    assert contract.violations(find_reader(path), path) == []


@pytest.mark.parametrize(
    "name", ["run.h5", "run.mat", "run.parquet", "run.mcap", "run.bag", "run.db3", "run.ulg", "run.xlsx"]
)
def test_a_process_of_its_own_gives_the_same(tmp_path, request, name):
    """Each library reads there as it does here: the same bits, groups, findings and settings."""
    path = examples.make(tmp_path, name)
    apart = reading.read(path)
    request.getfixturevalue("in_process")
    here = reading.read(path)
    assert replace(apart.recording, read=None) == replace(here.recording, read=None)
    assert apart.findings == here.findings
    for group, columns in here.data.items():
        np.testing.assert_array_equal(apart.data[group], columns)


def test_every_built_in_reader_has_an_example(tmp_path):
    """But enDAQ's, which no public program writes; content goes before extension."""
    known = set()
    for name in examples.ALL:
        path = examples.make(tmp_path, name)
        known.add(found := find_reader(path).name)
        assert find_reader(path.rename(tmp_path / "renamed.csv")).name == found
    assert {reader.name for reader in readers()} - known == {"enDAQ IDE"}


@pytest.mark.parametrize("suffix", sorted({Path(name).suffix for name in examples.ALL}))
def test_what_has_nothing_in_it_is_refused_by_any_name(tmp_path, suffix):
    """Empty files, NUL bytes and archives called otherwise are refused by what they are."""
    for content, said in ((b"", "empty"), (b"PK\x03\x04" + bytes(100), "ZIP"), (bytes(5000), "run")):
        path = tmp_path / f"run{suffix}"
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=said):
            reading.read(path)


def _tdms(path, values):
    """Segments of different lengths."""
    cuts = [0, 10, 20, 30, 40, 300, 301, len(values)]
    with TdmsWriter(path) as writer:
        for i, j in zip(cuts[:-1], cuts[1:], strict=True):
            writer.write_segment([ChannelObject("DAQ", "a", values[i:j])])


def _mdf(version):
    def write(path, values):
        with MDF(version=version) as file:
            file.append([Signal(values, np.arange(len(values)) / 128, name="a")])
            file.save(path, overwrite=True)

    return write


def _hdf5(path, values):
    with h5py.File(path, "w") as file:
        file["a"] = values


WRITERS = {
    "tdms": (_tdms, KINDS),
    "mf4": (_mdf("4.10"), KINDS), "40.mf4": (_mdf("4.00"), KINDS),
    "mdf": (_mdf("3.30"), KINDS), "30.mdf": (_mdf("3.00"), KINDS),
    "h5": (_hdf5, (*KINDS, "f2", ">f8", ">i2", "?")),
    "mat": (lambda path, values: savemat(path, {"a": values}), KINDS),
    "packed.mat": (lambda path, values: savemat(path, {"a": values[:, None]}, do_compression=True), KINDS),
    "old.mat": (lambda path, values: savemat(path, {"a": values}, format="4"), ("u1", "i2", "u2", "i4", "f4", "f8")),
    "parquet": (lambda path, values: polars.DataFrame({"a": values}).write_parquet(path, row_group_size=7), KINDS),
    "wav": (lambda path, values: wavfile.write(path, 64, values), ("u1", "i2", "i4", "f4", "f8")),
}  # fmt: skip
"""How other programs write an array as channel ``a``, and the types of numbers that each format has."""


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.usefixtures("in_process")
def test_numbers_of_every_type_are_read_to_the_bit(tmp_path, suffix):
    """The values are those that were written."""
    write, kinds = WRITERS[suffix]
    for kind in kinds:
        values = np.random.default_rng(9).integers(0, 2 if kind == "?" else 100, 400).astype(kind)
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.{suffix}"
        write(path, values)
        found = reading.read(path)
        np.testing.assert_array_equal(found.column("channel 1" if suffix == "wav" else "a"), values)
        assert "not_exact" not in found.codes


@pytest.mark.parametrize("suffix", [suffix for suffix, (_, kinds) in WRITERS.items() if "i8" in kinds])
@pytest.mark.usefixtures("in_process")
def test_integers_that_float64_rounds_are_a_finding(tmp_path, suffix):
    """2**53 + 1 has no float64: the channel is named."""
    WRITERS[suffix][0](tmp_path / f"run.{suffix}", np.resize(WIDE, 400))
    found = reading.read(tmp_path / f"run.{suffix}")
    assert [finding.channel for finding in found.findings if finding.code == "not_exact"] == ["a"]


SIZES = {"byte_source.BLOCK_BYTES": 200, "csv.text_blocks.BLOCK_BYTES": 64, "uff._TEXT_BYTES": 100,
         "tdms.metadata._WINDOW": 64, "ros_topics._ROWS": 7, "mdf.version3.BLOCK_BYTES": 56,
         "mdf.version4.BLOCK_BYTES": 56}  # fmt: skip
"""What bounds a piece that is read, or given, at once."""


@pytest.mark.parametrize(
    "name", [*examples.ALL, pytest.param("05_slamstick_SSX66115.IDE", marks=pytest.mark.recordings)]
)
@pytest.mark.usefixtures("in_process")
def test_blocks_of_any_size_give_the_same(tmp_path, monkeypatch, name):
    """Reading in small pieces gives more blocks, the same bits and the same findings."""
    path = examples.make(tmp_path, name) if name in examples.ALL else reading.real(name)
    whole = reading.read(path)
    for place, size in SIZES.items():
        size = size if name in examples.ALL else 1 << 16
        monkeypatch.setattr(f"testbench.readers.{place}", size)
    pieces = reading.read(path)
    assert pieces.count > whole.count
    assert pieces.groups == whole.groups
    assert pieces.codes == whole.codes
    for group, columns in whole.data.items():
        np.testing.assert_array_equal(pieces.data[group], columns)


class _Entry:
    """An entry point of another package."""

    name = "acme"

    def load(self):
        def open_acme(path, options):
            group = Group("run", (Channel("a", "N"),))
            values = np.frombuffer(path.read_bytes()[4:], dtype="<f8")
            return Recording(path, "Acme", "acme", (group,), lambda report: iter([Block(group, (values,), 0)]))

        return Reader("Acme logger", (".acme",), lambda head: head.startswith(b"ACME"), open_acme)


def test_another_package_adds_a_format(tmp_path, monkeypatch):
    """One file and an entry point, of the documented group; it goes before the built-in ones."""
    assert registry.ENTRY_POINTS == "counterpoise.readers"
    assert importlib.metadata.entry_points(group=registry.ENTRY_POINTS) is not None
    monkeypatch.setattr(registry, "entry_points", lambda group: [_Entry()] if group == registry.ENTRY_POINTS else [])
    path = tmp_path / "run.acme"
    path.write_bytes(b"ACME" + np.arange(5.0).tobytes())
    assert reading.read(path).column("a").tolist() == [0, 1, 2, 3, 4]
    assert "Acme logger" in {reader.name for reader in readers()}
    said = contract.violations(replace(find_reader(path), extensions=("ACME",)), path)
    assert any("expected a point and lower case" in text for text in said)
    assert any("ValueError" in text for text in said), "damaged copies of this careless reader fail"


@pytest.mark.parametrize(
    ("name", "extra"),
    [
        ("run.mcap", "mcap"),
        ("run.bag", "rosbag"),
        ("run.parquet", "parquet"),
        ("run.ulg", "ulog"),
        ("run.xlsx", "excel"),
    ],
)
def test_a_missing_library_is_said_in_one_line(tmp_path, monkeypatch, name, extra):
    """What to install, as pip takes it."""
    path = examples.make(tmp_path, name)
    monkeypatch.setattr(registry, "find_spec", lambda name: None)
    with pytest.raises(RecordingError, match=rf"pip install 'counterpoise\[{extra}\]'"):
        open_recording(path)


def _imported(folder):
    """The top names of all modules that the files of a folder import, but those of the language and our own."""
    names = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names.add(node.module.partition(".")[0])
    return names - sys.stdlib_module_names - {"testbench", "balance"}


def test_extras_name_what_is_imported_and_nothing_more():
    """Each module that a reader imports is required by the distribution, or by the extra that its format names."""
    root = Path(registry.__file__).parents[2]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    optional = {
        extra: {re.match(r"[\w-]+", text)[0].casefold() for text in texts}
        for extra, texts in project["optional-dependencies"].items()
    }
    always = {re.match(r"[\w-]+", text)[0].casefold() for text in project["dependencies"]}
    distributions = {"google": "protobuf", "llvmlite": "numba", "ebmlite": "idelib"}  # under another name
    named = _imported(root / "testbench" / "readers") | {"nptdms"}  # loaded by its name
    needed = {distributions.get(name, name) for name in named} - always
    others = {"numba", *optional["can"]}
    assert needed == others | {name for extra in registry.EXTRAS for name in optional[extra]}
    for extra, modules in registry.EXTRAS.items():
        tops = (module.partition(".")[0] for module in modules)
        assert optional[extra] == {distributions.get(top, top) for top in tops}
    stated = {reader.needs.partition(" ")[0] for reader in readers() if reader.needs}
    assert stated == {f"counterpoise[{extra}]" for extra in registry.EXTRAS}
    assert optional["loggers"] == {"counterpoise"}
    (loggers,) = project["optional-dependencies"]["loggers"]
    assert loggers == f"counterpoise[{','.join(sorted(registry.EXTRAS))}]"
