"""Universal files, written by pyuff and by hand."""

import gc
import warnings

import numpy as np
import pytest
import pyuff

from testbench.recording import TimeColumn, UniformClock

from . import reading

N = 37
RANDOM = np.random.default_rng(58)


def _function(name, values, **changes):
    fields = {
        "type": 58, "binary": 1, "func_type": 1, "id1": name, "id2": "NONE", "id3": "21-Nov-26 10:00:00",
        "rsp_node": 4, "rsp_dir": -2, "ref_node": 0, "ref_dir": 0, "data": values, "x": np.arange(len(values)) / 512,
        "ord_data_type": 6 if np.iscomplexobj(values) else 4, "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17, "abscissa_axis_lab": "Time", "abscissa_axis_units_lab": "s",
        "ordinate_spec_data_type": 12, "ordinate_axis_lab": "Acc", "ordinate_axis_units_lab": "m/s^2",
        "orddenom_spec_data_type": 0,
    }  # fmt: skip
    return fields | changes


def _write(tmp_path, *sets):
    path = tmp_path / "run.uff"
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the file open when it has written binary data
        for each in sets:
            pyuff.UFF(str(path)).write_sets(each, "add", force_double=False)
        gc.collect(1)
    return path


@pytest.mark.parametrize(("unit", "rate_hz"), [("s", 512), ("ms", 512e3), ("min", 512 / 60), ("NONE", 512)])
def test_the_step_is_in_the_unit_of_the_abscissa(tmp_path, unit, rate_hz):
    """Steps of 1/512 ms are 512 kHz; without a unit they are seconds, as the format says."""
    found = reading.read(_write(tmp_path, _function("Acc 1", np.arange(9.0), abscissa_axis_units_lab=unit)))
    assert found.group().clock.rate_hz == pytest.approx(rate_hz, rel=1e-5)


def test_a_time_of_unknown_unit_is_a_channel_without_rate(tmp_path):
    """Steps in blorps are no steps in seconds."""
    found = reading.read(_write(tmp_path, _function("Acc 1", np.arange(9.0), abscissa_axis_units_lab="blorp")))
    assert found.group().clock == TimeColumn(0, None)
    assert found.column("Time")[1] == pytest.approx(1 / 512, rel=1e-5)
    assert "time_unit_unknown" in found.codes


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
@pytest.mark.parametrize("padded", ["letters", "bytes"])
def test_units_and_names_are_in_utf_8_or_latin_1(tmp_path, encoding, padded):
    """The format knows ASCII alone; other programs write UTF-8, and count columns in letters or in bytes."""
    path = _write(tmp_path, _function("Schwingung ü", np.arange(9.0), ordinate_axis_lab="Beschl_ü_lang", binary=0,
                                      ordinate_axis_units_lab="m/s²"))  # fmt: skip
    text = path.read_text(encoding="utf-8")
    if padded == "bytes" and encoding == "utf-8":
        text = text.replace("Beschl_ü_lang ", "Beschl_ü_lang")
    path.write_bytes(text.encode(encoding))
    found = reading.read(path)
    assert found.unit("Schwingung ü") == "m/s²"
    assert found.recording.metadata["Schwingung ü: quantity"] == "Beschl_ü_lang"


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("kind", [2, 4])
def test_real_functions_are_what_another_program_wrote(tmp_path, binary, kind):
    """Binary numbers come back to the bit, text ones to its decimals.

    pyuff writes doubles where it declares single precision: they are read as doubles, and the contradiction is said.
    """
    values = RANDOM.normal(size=N)
    found = reading.read(_write(tmp_path, _function("Acc 1", values, binary=binary, ord_data_type=kind)))
    if binary:
        np.testing.assert_array_equal(found.column("Acc 1"), values)
    else:
        np.testing.assert_allclose(found.column("Acc 1"), values, rtol=1e-5 if kind == 2 else 1e-11)
    assert ("header_contradiction" in found.codes) == (binary == 1 and kind == 2)
    assert found.unit("Acc 1") == "m/s^2"
    assert found.group().clock == UniformClock(1 / 1.95312e-03, 0.0)
    assert "rate_rounded" in found.codes


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("kind", [5, 6])
def test_complex_functions_are_two_channels(tmp_path, binary, kind):
    """Real and imaginary part are channels, the frequency beside them; a ratio has a ratio's unit."""
    values = RANDOM.normal(size=N) + 1j * RANDOM.normal(size=N)
    path = _write(tmp_path, _function(
        "FRF", values, binary=binary, ord_data_type=kind, func_type=4, abscissa_spec_data_type=18,
        abscissa_axis_lab="Frequency", abscissa_axis_units_lab="Hz", x=np.arange(N) / 2,
        orddenom_spec_data_type=13, orddenom_axis_lab="Force", orddenom_axis_units_lab="N",
    ))  # fmt: skip
    found = reading.read(path)
    np.testing.assert_allclose(found.column("FRF (real)"), values.real, rtol=1e-5)
    np.testing.assert_allclose(found.column("FRF (imag)"), values.imag, rtol=1e-5)
    np.testing.assert_array_equal(found.column("Frequency"), np.arange(N) / 2)
    assert (found.unit("Frequency"), found.unit("FRF (real)")) == ("Hz", "m/s^2/N")
    assert found.group().clock is None


@pytest.mark.parametrize("order", [1, 2])
def test_single_precision_is_read_in_either_byte_order(tmp_path, order):
    """Real and complex numbers of four bytes, in little- and big-endian."""
    numbers = RANDOM.normal(size=2 * N).astype("<f4" if order == 1 else ">f4")
    for kind, name in ((2, "a"), (5, "a (real)")):
        path = _write(tmp_path, _function("a", np.ones(N), binary=0))
        head = path.read_text().splitlines()[2:13]
        head[6] = f"{kind:10d}{len(numbers) // (1 if kind == 2 else 2):10d}" + head[6][20:]
        first = f"    -1\n    58b{order:6d}{2:6d}{11:12d}{numbers.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
        path.write_bytes((first + "\n".join(head) + "\n").encode() + numbers.tobytes() + b"    -1\n")
        found = reading.read(path)
        np.testing.assert_array_equal(found.column(name), numbers if kind == 2 else numbers[::2])
        assert "header_contradiction" not in found.codes


def test_uneven_functions_bring_their_time(tmp_path):
    """Recorded abscissae are a time column, in text of the standard's widths."""
    x = np.cumsum(RANDOM.uniform(0.5, 1, N))
    values = RANDOM.normal(size=N)
    rows = [(f"{a:13.5E}{b:20.12E}") for a, b in zip(x, values, strict=True)]
    lines = ["".join(rows[i : i + 2]) for i in range(0, N, 2)]
    path = _write(tmp_path, _function("Acc 1", values, binary=0))
    text = path.read_text().splitlines()
    text[8] = f"{4:10d}{N:10d}{0:10d}" + text[8][30:]
    path.write_text("\n".join([*text[:13], *lines, "    -1", ""]))
    found = reading.read(path)
    assert found.group().clock == TimeColumn(0, 1.0)
    np.testing.assert_allclose(found.time(), x, rtol=1e-5)
    np.testing.assert_allclose(found.column("Acc 1"), values, rtol=1e-11)


def test_numbers_that_touch_are_parted_by_their_width():
    """Fortran leaves no blank before a negative number of full width."""
    from testbench.readers.uff import parsed_numbers

    text = b" -1.00000E+00-2.50000E+00 3.00000D+00\n-4.00000E-10\n"
    assert parsed_numbers(text, (13,) * 6).tolist() == [-1.0, -2.5, 3.0, -4e-10]


def test_functions_of_one_abscissa_share_a_group(tmp_path):
    """Same start, step, length and time of measurement make one group, another length another; a node twice is said."""
    one, two, three = (RANDOM.normal(size=n) for n in (N, N, 2 * N))
    found = reading.read(_write(tmp_path, _function("a", one), _function("b", two), _function("c", three, rsp_node=6)))
    sizes = {name: len(columns) for name, columns in found.data.items()}
    assert sizes == {"run Time response": 2, "run Time response 2": 1}
    np.testing.assert_array_equal(found.column("b"), two)
    assert "node 4 -Y is that of a, b" in found.message("duplicate_dof")


def test_mode_shapes_are_rows_by_node(tmp_path):
    """Dataset 55 gives a node a row, complex values in two columns."""
    nodes = np.arange(1, 9)
    shape = RANDOM.normal(size=8) + 1j * RANDOM.normal(size=8)
    zero = np.zeros(8)
    fields = {
        "type": 55, "model_type": 1, "id1": "Mode 1", "id2": "NONE", "id3": "NONE", "id4": "NONE", "id5": "NONE",
        "analysis_type": 3, "data_ch": 2, "spec_data_type": 8, "data_type": 5, "n_data_per_node": 3,
        "r1": shape, "r2": zero + 0j, "r3": zero + 0j, "load_case": 0, "mode_n": 1, "eig": 1j,
        "modal_a": 1j, "modal_b": 0j,
        "node_nums": nodes,
    }  # fmt: skip
    found = reading.read(_write(tmp_path, fields))
    assert found.column("node").tolist() == nodes.tolist()
    np.testing.assert_allclose(found.column("x (real)"), shape.real, rtol=1e-4)
    np.testing.assert_allclose(found.column("x (imag)"), shape.imag, rtol=1e-4)
    assert found.recording.metadata["run dataset 55 1: line 1"] == "Mode 1"


@pytest.mark.parametrize("binary", [0, 1])
def test_a_cut_and_a_wrong_count(tmp_path, binary):
    """A function that is cut is left out, by its place, the one before it is whole; 38 samples for 37 are refused."""
    numbers = RANDOM.normal(size=N)
    path = _write(tmp_path, _function("a", numbers, binary=binary), _function("b", numbers, binary=binary))
    path.write_bytes(path.read_bytes()[:-60])
    found = reading.read(path)
    assert "the file ends inside dataset 2, of kind 58" in found.message("cut_file")
    np.testing.assert_allclose(found.column("a"), numbers, rtol=1e-11)
    assert len(found.group().channels) == 1
    path = _write(tmp_path, _function("a", numbers, binary=binary))
    path.write_bytes(path.read_bytes().replace(b"        37", b"        38", 1))
    assert ("its samples take 304 bytes" if binary else "declares 38 samples, 37") in reading.said(path)


def test_a_text_shorter_than_declared_is_read_to_its_end(tmp_path):
    """What is there is read, and that more is declared is an error that a person may accept."""
    path = _write(tmp_path, _function("Acc 1", np.arange(20.0), binary=0))
    path.write_text(path.read_text().replace("        20 ", "   2508876 ", 1))
    found = reading.read(path)
    assert found.data[found.group().name][-1].tolist() == list(range(20))
    assert "declares 2508876 samples, 20 are there" in found.message("count_contradiction")
