"""The compiled loop over rows: the bits of ``float()`` or nothing, and the same findings as the usual way."""

import random
import shutil
import subprocess
import sys
import threading
import time
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from balance import compiled_kernels
from balance.user_cache import cache_folder
from testbench.readers.csv import row_parser, table, text_blocks
from testbench.readers.csv.dialect import Dialect
from testbench.readers.csv.row_parser import ROWS, FastParser, RowParser

from .. import reading

HEADER = "Time (s);AccX (g);AccY (g)\n"
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
WRITTEN = st.one_of(
    st.builds("{:.{}f}".format, st.floats(-2e9, 2e9), st.integers(0, 9)),
    st.builds("{:+.{}e}".format, FLOATS, st.integers(0, 25)),
    st.builds(repr, FLOATS),
    st.builds("{:.4G}".format, FLOATS),
    st.from_regex(r"[+-]?(0{0,3}[0-9]{1,22}\.?|[0-9]{0,12}\.[0-9]{1,12})([eE][+-]?0{0,2}[0-9]{1,3})?", fullmatch=True),
)
ODD = st.sampled_from(
    ["", "nan", "NaN", "inf", "-", ".", "+", "e5", "1e", "1.2.3", "1,5", "1 2", "0x1", "1_0", "--", "\x1a"]
)


@pytest.fixture(scope="module", autouse=True)
def _kept():
    """The loop, kept for the next run of the tests."""
    assert ROWS.loop() is not None


def parsed(rows, separator=";", decimal=".", end="\n", kept=None):
    """Rows of written cells by the loop."""
    fields = len(rows[0])
    text = "".join(separator.join(row) + end for row in rows).encode()
    loop = FastParser(RowParser(Dialect(separator, decimal), fields), kept or tuple(range(fields)))
    loop._compiled.thread.join()
    return loop.columns(text)


def as_floats(rows):
    """What Python makes of them."""
    return np.array([[float(cell) for cell in row] for row in rows]).T


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(1, 5).flatmap(lambda n: st.lists(st.lists(WRITTEN, min_size=n, max_size=n), min_size=1)),
    end=st.sampled_from(["\n", "\r\n"]),
    comma=st.booleans(),
)
@example([["9007199254740993.0", "0.3"]] * 9, "\n", False)
@example([["-0.0", "-0"], ["-0.00000000", "00.10"]] * 9, "\r\n", True)
@example([["12345678.12345678", "1234567.12345678"], ["-1234567.1", "-123456.12345678"]] * 9, "\n", False)
def test_numbers_have_the_bits_of_float_or_are_left(rows, end, comma):
    """Signs, exponents, leading zeros, long mantissas: the bits of ``float()``, or the block is left."""
    expected = as_floats(rows)
    written = [[cell.replace(".", ",") for cell in row] if comma else row for row in rows]
    found = parsed(written, decimal="," if comma else ".", end=end)
    if found is not None:
        assert np.array(found).tobytes() == expected.tobytes()


@settings(max_examples=40, deadline=None)
@given(
    places=st.lists(st.integers(0, 8), min_size=1, max_size=6),
    seed=st.integers(0, 2**32),
    scale=st.sampled_from([1e-3, 1.0, 1e3, 9e6]),
    end=st.sampled_from(["\n", "\r\n"]),
)
def test_what_loggers_write_is_never_left(places, seed, scale, end):
    """Numbers of fixed decimals, the common case: always by the loop, to the bit."""
    rng = random.Random(seed)
    rows = [[f"{rng.gauss(0, scale):.{k}f}" for k in places] for _ in range(60)]
    found = parsed(rows, end=end)
    assert found is not None
    assert np.array(found).tobytes() == as_floats(rows).tobytes()


@settings(max_examples=60, deadline=None)
@given(odd=ODD, row=st.integers(0, 39), field=st.integers(0, 2), end=st.sampled_from(["\n", "\r\n"]))
def test_a_block_with_one_odd_cell_is_left(odd, row, field, end):
    """Whatever is no plain number is for the usual way to judge; blanks round a number are not."""
    rows = [[f"{i}.5", f"-{i}.25", f"{i / 7:.6f}"] for i in range(40)]
    rows[row][field] = odd
    assert parsed(rows, end=end) is None
    rows[row][field] = "  -2.5 "
    assert np.array(parsed(rows, end=end)).tobytes() == as_floats(rows).tobytes()


@pytest.mark.parametrize(
    "line", ["1;2\n", "1;2;3;4\n", "\n", "1;2;3;\n", ";;\n", "# 1;2;3\n", "1;2;3\r\r\n", "1;2;3\r4\n"]
)
@pytest.mark.parametrize("place", [0, 20, 39])
def test_a_block_with_one_odd_line_is_left(line, place):
    """Too few fields, too many, none, a comment, a return alone."""
    rows = ["0.5;1.25;-3.125\n"] * 40
    rows[place] = line
    loop = FastParser(RowParser(Dialect(";", "."), 3), (0, 1, 2))
    loop._compiled.thread.join()
    assert loop.columns("".join(rows).encode()) is None
    for count in (40, 39, 200):  # more rows in a block than those of the block before let expect
        assert len(loop.columns(b"0.5;1.25;-3.125\n" * count)[2]) == count
    assert len(loop.columns(b"0;1;2\n" * 200)[2]) == 200


def test_fields_that_are_not_kept_are_passed_over():
    """A column of text, and the empty one behind a delimiter at the end of each line."""
    rows = [[f"{i}.5", "a b" if i % 2 else "", f"{i}.25", ""] for i in range(50)]
    found = parsed(rows, kept=(0, 2))
    assert [list(found[j]) for j in (0, 2)] == [[i + 0.5 for i in range(50)], [i + 0.25 for i in range(50)]]
    assert np.isnan(found[1]).all()
    assert np.isnan(found[3]).all()


def both_ways(path, monkeypatch, options=None):
    """The same file by the usual way, and with the loop wherever it can; how many blocks the loop took."""
    taken = []
    with monkeypatch.context() as patch:
        patch.setattr(text_blocks, "BLOCK_BYTES", 20_000)
        patch.setattr(table, "LONG_BYTES", 1 << 60)
        usual = reading.read(path, options)
        patch.setattr(table, "LONG_BYTES", 0)
        patch.setattr(row_parser, "_PATIENCE_S", 60.0)
        columns = FastParser.columns
        patch.setattr(FastParser, "columns", lambda *a: (c := columns(*a), taken.append(c is not None))[0])
        compiled = reading.read(path, options)
    assert (compiled.groups, compiled.findings) == (usual.groups, usual.findings)
    for group, columns in usual.data.items():
        assert np.array(compiled.data[group]).tobytes() == np.array(columns).tobytes()
    return sum(taken)


def odd_log(rng):
    """A log of a logger that has a bad day."""
    separator, decimal = rng.choice([";", "\t", ";"]), rng.choice(".,")
    rows = [f"{i / 1000:.4f};{rng.gauss(0, 3):.{rng.choice([2, 6])}f};{rng.randrange(9)}" for i in range(3000)]
    for _ in range(rng.randrange(4)):
        i = rng.randrange(40, len(rows))
        rows[i] = rng.choice([
            "", HEADER.strip(), "# pause", rows[i] + ";1", rows[i].rpartition(";")[0], rows[i].replace(".", ",", 1),
            rows[i].replace(";", "; "), rows[i] + " ", "1.0;;3", "2.5;1.234.567;4", "3.5;nan;1", "4.5;1e999;2", "end",
            rows[i] + "\r", "5.5;1e-400;2", "6.5;123456789012345678901234567890;1", "\x00\x00;1;2",
        ])  # fmt: skip
    text = HEADER + "\n".join(rows) + rng.choice(["\n", "", "\n\n"])
    if decimal == ",":
        text = text.replace(".", "#").replace(",", ".").replace("#", ",")
    return text.replace("\n", rng.choice(["\n", "\r\n"])).replace(";", separator).encode()


@pytest.mark.parametrize("seed", range(12))
def test_odd_logs_are_read_the_same_either_way(seed, tmp_path, monkeypatch):
    """The same bits, the same findings, the same places: whatever is odd in a log."""
    path = tmp_path / "log.csv"
    path.write_bytes(odd_log(random.Random(seed)))
    both_ways(path, monkeypatch)


def test_the_loop_takes_what_is_regular(tmp_path, monkeypatch):
    """So that the comparison compares something: every block of a log without oddities, all but one with one."""
    path = tmp_path / "log.csv"
    rows = [f"{i / 1000:.4f};{i % 7}.25;{i}\n" for i in range(6000)]
    path.write_text(HEADER + "".join(rows))
    whole = both_ways(path, monkeypatch)
    assert whole >= 4
    rows[3000] = "3.0;n/a;7\n"
    path.write_text(HEADER + "".join(rows))
    assert both_ways(path, monkeypatch) == whole - 1


@pytest.mark.recordings
@pytest.mark.parametrize("folder", [".", "../bad"])
def test_recordings_are_read_the_same_either_way(monkeypatch, folder):
    """The short texts among the recordings, good ones and damaged ones beside them."""
    for path in sorted(reading.real(folder).glob("*.*")):
        if path.suffix in (".csv", ".txt") and path.name != "manifest.csv" and 0 < path.stat().st_size < 1 << 20:
            both_ways(path, monkeypatch)


def test_it_is_compiled_once_and_again_where_damaged(tmp_path, monkeypatch):
    """What is kept is taken as it is; a flipped bit is noticed; where nothing can be kept, the usual way is left."""
    own = tmp_path / "counterpoise"
    own.mkdir()
    for kept in cache_folder().glob("rows-*.o"):
        shutil.copy(kept, own)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compiled_kernels.Kernel, "compiled", lambda self, path: "anew")
    assert ROWS.loop() != "anew"
    for kept in own.iterdir():
        content = kept.read_bytes()
        kept.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert ROWS.loop() == "anew"
    monkeypatch.undo()
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert ROWS.loop() is None


def test_while_it_is_compiled_the_usual_way_is_taken(tmp_path, monkeypatch):
    """No log waits for a compiler."""
    go_on = threading.Event()
    monkeypatch.setattr(compiled_kernels.Kernel, "kept", lambda self, path: None)
    monkeypatch.setattr(compiled_kernels.Kernel, "compiled", lambda self, path: go_on.wait(30) and None)
    monkeypatch.setattr(table, "LONG_BYTES", 0)
    monkeypatch.setattr(row_parser, "_PATIENCE_S", 60.0)
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "0.0;1;2\n0.1;3;4\n")
    assert reading.read(path).column("AccX (g)").tolist() == [1.0, 3.0]
    go_on.set()


def test_logs_that_are_read_at_once_start_one_compiler(monkeypatch):
    """The others wait for it, and find what it kept."""
    made = []
    monkeypatch.setattr(compiled_kernels.Kernel, "kept", lambda self, path: made[0] if made else None)
    monkeypatch.setattr(
        compiled_kernels.Kernel, "compiled", lambda self, path: time.sleep(0.05) or made.append(len) or len
    )
    threads = [threading.Thread(target=ROWS.loop) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == [len]


@pytest.mark.parametrize("nowhere", [RuntimeError("no locator"), OSError("disk full")])
def test_loops_that_cannot_be_kept(nowhere):
    """They are compiled for this process."""
    njit = Mock(side_effect=[nowhere, lambda loop: (loop, "compiled")])
    assert compiled_kernels.compiled_by(njit, "void()")(print) == (print, "compiled")
    assert [call.kwargs for call in njit.call_args_list] == [{"nogil": True, "cache": True}, {"nogil": True}]


def test_reading_imports_no_compiler():
    """What is kept runs without numba, and a short log without LLVM."""
    code = "import sys, testbench.ingestion; from testbench.readers.csv import reader, row_parser; "
    code += "assert 'llvmlite' not in sys.modules; assert row_parser.ROWS.loop(); assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, timeout=60)
