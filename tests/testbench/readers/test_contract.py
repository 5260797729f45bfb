"""The contract of readers, on every one of them; and how others add theirs."""

import importlib.metadata
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.readers import Reader, contract, extras, find_reader, open_recording, readers, registry
from testbench.recording import Block, Channel, Group, Recording

from . import examples, reading


@pytest.mark.parametrize("reader", readers(), ids=lambda reader: reader.name)
def test_every_reader_keeps_the_contract_by_itself(reader):
    """Built-in or from an entry point: a name, extensions, and a judgement of any bytes."""
    assert contract.violations(reader) == []


@pytest.mark.parametrize("name", examples.ALL)
def test_every_format_keeps_the_contract(tmp_path, name):
    """Names, clocks, blocks, findings, repeatability, and clear errors on damaged copies."""
    path = examples.make(tmp_path, name)
    assert contract.violations(find_reader(path), path) == []


def test_every_built_in_reader_has_an_example(tmp_path):
    """But enDAQ's, which no public program writes."""
    known = {find_reader(examples.make(tmp_path, name)).name for name in examples.ALL}
    assert {reader.name for reader in readers()} - known == {"enDAQ IDE"}


@pytest.mark.parametrize("name", examples.ALL)
def test_content_goes_before_extension(tmp_path, name):
    """A file that is called otherwise is read all the same."""
    path = examples.make(tmp_path, name)
    expected = find_reader(path).name
    assert find_reader(path.rename(tmp_path / "renamed.csv")).name == expected


@pytest.mark.parametrize("name", examples.ALL)
def test_what_has_nothing_in_it_is_refused_by_any_name(tmp_path, name):
    """Empty files, NUL bytes and archives called otherwise are refused by what they are."""
    suffix = f".{name.rpartition('.')[2]}"
    for content, said in ((b"", "empty"), (b"PK\x03\x04" + bytes(100), "ZIP"), (bytes(5000), "run")):
        path = tmp_path / f"run{suffix}"
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=said):
            reading.read(path)


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
    """One file and an entry point; it goes before the built-in ones."""
    monkeypatch.setattr(registry, "entry_points", lambda group: [_Entry()] if group == registry.ENTRY_POINTS else [])
    path = tmp_path / "run.acme"
    path.write_bytes(b"ACME" + np.arange(5.0).tobytes())
    assert reading.read(path).column("a").tolist() == [0, 1, 2, 3, 4]
    assert "Acme logger" in {reader.name for reader in readers()}
    reader = find_reader(path)
    said = contract.violations(replace(reader, extensions=("ACME",)), path)
    assert any("expected a point and lower case" in text for text in said)
    assert any("ValueError" in text for text in said), "damaged copies of this careless reader fail"


def test_the_entry_point_group_is_the_documented_one():
    """Other packages rely on its name."""
    assert registry.ENTRY_POINTS == "counterpoise.readers"
    assert importlib.metadata.entry_points(group=registry.ENTRY_POINTS) is not None


@pytest.mark.parametrize(
    ("name", "extra", "missing"),
    [("run.mcap", "mcap", "mcap.stream_reader"), ("run.bag", "rosbag", "rosbags.rosbag1")],
)
def test_a_missing_library_is_said_in_one_line(tmp_path, monkeypatch, name, extra, missing):
    """What to install, as pip takes it."""
    path = examples.make(tmp_path, name)
    module = import_module(f"testbench.readers.{extra}.library")

    def import_nothing(name):
        raise ModuleNotFoundError(name=name.partition(".")[0])

    monkeypatch.setattr(extras, "import_module", import_nothing)
    with pytest.raises(RecordingError, match=rf"pip install 'counterpoise\[{extra}\]'"):
        list(module.open_library(path).blocks(lambda finding: None))


def test_what_is_installed_is_known():
    """Of each extra, without importing anything of it."""
    assert all(extras.installed(extra) for extra in ("tdms", "ide", "mcap", "rosbag"))
    assert extras.needs("ide") == "counterpoise[ide]"


def test_opening_reads_no_data(tmp_path):
    """A recording that is opened and dropped leaves nothing open."""
    for name in examples.IN_PROCESS:
        assert open_recording(examples.make(tmp_path, name)).groups
