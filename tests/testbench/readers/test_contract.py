"""The contract of readers, on every one of them; and how others add theirs."""

import ast
import importlib.metadata
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.readers import Reader, contract, find_reader, open_recording, readers, registry
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


@pytest.mark.parametrize(("name", "extra"), [("run.mcap", "mcap"), ("run.bag", "rosbag"), ("run.parquet", "parquet")])
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
    assert needed == {"numba", *(name for extra in registry.EXTRAS for name in optional[extra])}
    for extra, modules in registry.EXTRAS.items():
        tops = (module.partition(".")[0] for module in modules)
        assert optional[extra] == {distributions.get(top, top) for top in tops}
    stated = {reader.needs.partition(" ")[0] for reader in readers() if reader.needs}
    assert stated == {f"counterpoise[{extra}]" for extra in registry.EXTRAS}
    assert optional["loggers"] == {"counterpoise"}
    (loggers,) = project["optional-dependencies"]["loggers"]
    assert loggers == f"counterpoise[{','.join(sorted(registry.EXTRAS))}]"


def test_opening_reads_no_data(tmp_path):
    """A recording that is opened and dropped leaves nothing open."""
    for name in examples.IN_PROCESS:
        assert open_recording(examples.make(tmp_path, name)).groups
