"""The archive: small, the same bits through our accessor, readable without a plugin, provably made of its run."""

import json
import shutil
import subprocess
import sys
import warnings

import h5py
import numpy as np
import pytest

import testbench
from testbench.cli.campaign import archive as command
from testbench.errors import StoreError
from testbench.export import export
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.recording import Channel, Group, TimeColumn, UniformClock
from testbench.runs.si_run import physical
from testbench.store import append_only_records, atomic_files, encodings, open_campaign, open_run, writer
from testbench.store import archive as archives
from testbench.store.archive import archive
from testbench.store.writer import RunWriter

from .stored import store

N = writer.GATHERED + 12_345
RANDOM = np.random.default_rng(8)
NOISE = np.round(RANDOM.normal(size=N), 4)
ODD = NOISE.copy()
ODD[[5, 99, N - 1]] = np.nan, -0.0, np.nan
COLUMNS = {
    "Time (s)": np.round(np.arange(N) / 5000, 4),
    "AccX (g)": NOISE,
    "AccY (g)": ODD,
    "counts": RANDOM.integers(-(2**15), 2**15, N).astype(float),
    "full": RANDOM.normal(size=N),
    "inf": np.where(NOISE > 4, np.inf, NOISE),
    "wide": np.round(RANDOM.normal(size=N) * 1e6, 6),
}
CHANNELS = tuple(Channel(name, name.partition("(")[2][:-1] or None, name.partition(" (")[0]) for name in COLUMNS)
GROUP = Group("daq", CHANNELS, TimeColumn(0))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of every kind of channel."""
    return store(tmp_path_factory.mktemp("c"), GROUP, list(COLUMNS.values()), rig="a = 1\n", payload_kg=5.0)


@pytest.fixture(scope="module")
def archived(run, tmp_path_factory):
    """Its archive."""
    return archive(run, tmp_path_factory.mktemp("archive"))


def test_every_channel_comes_back_to_the_bit(run, archived):
    """Missing values, negative zeros, infinities, noise of full precision; and whatever else is known of the run."""
    small = open_run(archived.file)
    for i, (name, column) in enumerate(COLUMNS.items()):
        assert small.channel(name).tobytes() == column.tobytes()
        assert small.channel_at("daq", i).tobytes() == column.tobytes()
    assert small.time().tobytes() == run.time().tobytes()
    assert (small.origin, small.conditions, small.rig, small.findings) == (
        run.origin,
        run.conditions,
        run.rig,
        run.findings,
    )
    assert small.group().channels == run.group().channels
    assert archived.whole_numbers == 5
    assert small.to_pandas().equals(run.to_pandas())


def test_the_archive_names_the_run_that_it_was_made_of(run, archived):
    """SHA-256 of the file and of each channel's values: whoever has either can prove that nothing is lost."""
    import hashlib

    known = open_run(archived.file).provenance["archived_from"]
    assert known["sha256"] == atomic_files.recorded_digest(run.path) == archived.sha256_of_original
    found = [hashlib.sha256(column.tobytes()).hexdigest() for column in COLUMNS.values()]
    assert known["channels_sha256"] == {"daq": found}
    assert [state.status for state in open_campaign(archived.file.parent).verify()] == ["intact"]


@pytest.mark.parametrize(("decimals", "spread"), [(4, 1.0), (6, 0.05), (2, 10.0)])
def test_a_log_of_fixed_decimals_takes_three_tenths(tmp_path, decimals, spread):
    """Of the size as float64, the whole file and not the samples alone: time and two channels of noise from a CSV."""
    rows = 60_000
    noise = RANDOM.normal(size=(2, rows)) * spread
    lines = (f"{t / 2000:.4f},{x:.{decimals}f},{y:.{decimals}f}\n" for t, (x, y) in enumerate(noise.T))
    (tmp_path / "log.csv").write_text("Time (s),AccX (g),AccY (g)\n" + "".join(lines))
    Ingest(tmp_path / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
    (run,) = open_campaign(tmp_path / "c").runs
    found = archive(run, tmp_path / "a")
    assert found.float64_bytes == 8 * 3 * rows
    assert found.file_bytes <= 0.30 * found.float64_bytes
    assert open_run(found.file).channel("AccX").tobytes() == run.channel("AccX").tobytes()


def test_others_read_it_without_a_plugin(run, archived):
    """h5py alone restores the bits by two attributes; xarray decodes to rounding, what is missing is NaN."""
    xarray = pytest.importorskip("xarray")
    code = "import h5py, sys; f = h5py.File(sys.argv[1]); d = f['entry/daq/AccX']; "
    code += "print((d[7:8].astype('i8') + d.attrs['first'])[0] / 10.0 ** d.attrs['decimals']); "
    code += "assert 'hdf5plugin' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code, archived.file], capture_output=True, text=True, check=True)
    assert float(done.stdout) == NOISE[7]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_dataset(archived.file, engine="h5netcdf", group="entry/daq") as data:
            for key, name in zip(run.group().keys, COLUMNS, strict=True):
                tolerance = 4 * np.spacing(np.abs(COLUMNS[name][np.isfinite(COLUMNS[name])]).max())
                np.testing.assert_allclose(data[key].to_numpy(), COLUMNS[name], rtol=0, atol=tolerance)
            assert data["AccX"].dims == ("time",)
            assert data["AccX"].attrs["units"] == "g"
        with xarray.open_datatree(archived.file, engine="h5netcdf") as tree:
            assert tree["entry/daq/AccX"].shape == (N,)


def test_no_filter_but_those_that_every_hdf5_has(archived):
    """Deflate, shuffle and the checksum, on every dataset of values."""
    seen = set()

    def look(name, node):
        if isinstance(node, h5py.Dataset):
            plist = node.id.get_create_plist()
            seen.update(plist.get_filter(n)[0] for n in range(plist.get_nfilters()))
            assert node.fletcher32, name

    with h5py.File(archived.file) as file:
        file.visititems(look)
    assert seen == {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}


@pytest.mark.parametrize("clock", [UniformClock(5120.0, 0.25), UniformClock(1000 / 3), None])
def test_other_clocks(tmp_path, clock):
    """A rate stays a rate, and the time beside it exact; no clock stays none."""
    group = Group("daq", CHANNELS[:2], clock)
    run = store(tmp_path / "c", group, list(COLUMNS.values())[:2])
    small = open_run(archive(run, tmp_path / "a").file)
    assert small.group().clock == clock
    assert small.channel("AccX").tobytes() == NOISE.tobytes()
    if clock is not None:
        with h5py.File(small.path) as file:
            assert file["entry/daq/time"][()].tobytes() == small.time().tobytes()


def test_exports_of_the_archive_are_those_of_the_run(run, archived, tmp_path):
    """Every column of a Parquet file, to the bit."""
    import polars

    tables = [
        polars.read_parquet(export(one, "parquet", tmp_path / str(n))[0].file)
        for n, one in enumerate((run, open_run(archived.file)))
    ]
    assert tables[0].equals(tables[1], null_equal=True)


def test_what_does_not_come_back_is_not_archived(run, tmp_path, monkeypatch):
    """A form that rounds is noticed before the archive has a name, and nothing is left."""
    monkeypatch.setattr(encodings.Decimals, "restored", lambda self, stored, minus=None: stored / 1e4)
    with pytest.raises(StoreError, match=r"channel 'AccX \(g\)' does not come back to the bit"):
        archive(run, tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_a_damaged_run_is_not_archived(tmp_path):
    """A run whose digest does not match gives no archive that would look sound."""
    run = store(tmp_path, GROUP, [column[:500] for column in COLUMNS.values()])
    content = bytearray(run.path.read_bytes())
    content[-7] ^= 1
    run.path.write_bytes(content)
    with pytest.raises(StoreError, match="not what was stored"):
        archive(run, tmp_path / "a")


def test_never_over_a_run_and_never_twice(run, archived, tmp_path):
    """Again: it is there already; another run of the name, the run itself or an archive: refused."""
    assert archive(run, archived.file.parent).status == "already_archived"
    other = store(tmp_path, GROUP, [column[:500] for column in COLUMNS.values()])
    with pytest.raises(StoreError, match="stored runs never change"):
        archive(other, archived.file.parent)
    with pytest.raises(StoreError, match="holds the run itself"):
        archive(run, run.path.parent)
    with pytest.raises(StoreError, match="is an archive already"):
        archive(open_run(archived.file), tmp_path / "b")


def test_an_archive_that_was_stopped_is_made_again(run, tmp_path, monkeypatch):
    """Killed meanwhile: nothing is lost, recover tidies up and says so."""
    from testbench.ingestion.recovered_runs import recover

    with monkeypatch.context() as patch:
        patch.setattr(RunWriter, "__exit__", lambda self, *_: self._journal._stream.close())
        patch.setattr(archives, "_check", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        patch.setattr(RunWriter, "seal", lambda self: self._close())
        with pytest.raises(KeyboardInterrupt):
            archive(run, tmp_path)
    (found,) = recover(tmp_path)
    assert (found.status, found.file) == ("superseded", None)
    assert "archive it again" in found.message
    assert archive(run, tmp_path).status == "archived"


def test_records_about_a_run_hold_for_its_archive(tmp_path, capsys):
    """The command takes them along; they name the run by the SHA-256 that its archive names."""
    run = store(tmp_path / "c", GROUP, [column[:500] for column in COLUMNS.values()])
    append_only_records.append_record(tmp_path / "c", "alignment", [run.path], {"offset_s": 0.5})
    words = [str(tmp_path / "c"), "-o", str(tmp_path / "a"), "--json"]
    assert command.main(words, standalone_mode=False) == 0
    (one,) = json.loads(capsys.readouterr().out)["runs"]
    assert (one["run"], one["status"], one["channels_of_whole_numbers"]) == ("r001", "archived", 6)
    (record,) = append_only_records.about(tmp_path / "a", "alignment", tmp_path / "a" / "r001.h5")
    assert record.content == {"offset_s": 0.5}
    assert {state.status for state in open_campaign(tmp_path / "a").verify()} == {"intact"}
    assert command.main(words, standalone_mode=False) == 0
    assert json.loads(capsys.readouterr().out)["runs"][0]["status"] == "already_archived"


def test_refusals_do_not_keep_other_runs_back(tmp_path, capsys):
    """Exit 1 with the reason; the other run is archived."""
    for name in ("r001", "r002"):
        store(tmp_path / "c", GROUP, [column[:500] for column in COLUMNS.values()], name=name)
    atomic_files.digest_file(tmp_path / "c" / "r001.h5").unlink()
    assert command.main([str(tmp_path / "c"), "-o", str(tmp_path / "a")], standalone_mode=False) == 1
    assert "its digest r001.h5.sha256 is missing" in capsys.readouterr().err
    assert [path.name for path in open_campaign(tmp_path / "a").run_paths] == ["r002.h5"]


def test_a_campaign_is_analysed_from_its_archive(brief, tmp_path, capsys):
    """`testbench analyze` of the archive prints what it prints of the campaign, here of two runs."""
    from testbench.cli.analyze import analyze

    (tmp_path / "c").mkdir()
    for path in brief.campaign.glob("r00[12].*"):
        shutil.copy(path, tmp_path / "c")
    command.main([str(tmp_path / "c"), "-o", str(tmp_path / "a")], standalone_mode=False)
    capsys.readouterr()
    documents = []
    for folder in (tmp_path / "c", tmp_path / "a"):
        analyze.main([str(folder), "--json"], standalone_mode=False)
        documents.append(capsys.readouterr().out.replace(str(folder), "").replace(f'"{folder.name}"', '"campaign"'))
    first, second = map(json.loads, documents)
    assert first.pop("ledgers") != second.pop("ledgers")
    assert first == second
    assert first["reductions"]
    assert len(testbench.open_run(tmp_path / "a" / "r001.h5").groups) == 3


def test_a_calibration_of_a_run_holds_for_its_archive(tmp_path, capsys):
    """What `testbench calibrate` recorded is applied to the archive as it is to the run."""
    from testbench.cli.calibrate import calibrate

    from ..calibration import volts

    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    words = [str(run.path), "acc", "--sensitivity", "90 mV/g", "--offset", "2.5 V", "--reason", "certificate 12"]
    assert calibrate.main(words, standalone_mode=False) == 0
    assert command.main([str(run.path.parent), "-o", str(tmp_path / "a")], standalone_mode=False) == 0
    both = [physical(open_run(folder / "r1.h5")).channel("ch0") for folder in (run.path.parent, tmp_path / "a")]
    assert both[0].tobytes() == both[1].tobytes()
    np.testing.assert_allclose(both[0], volts.ACCELERATION / 0.9, atol=1e-9)


def test_no_archive_without_its_records(tmp_path):
    """A record that is damaged: nothing is archived, for the archive would be calibrated otherwise."""
    run = store(tmp_path / "c", GROUP, [column[:500] for column in COLUMNS.values()])
    append_only_records.append_record(tmp_path / "c", "alignment", [run.path], {"offset_s": 0.5}).write_text("{}")
    with pytest.raises(StoreError, match="not a record"):
        command.main([str(tmp_path / "c"), "-o", str(tmp_path / "a")], standalone_mode=False)
    assert not (tmp_path / "a").exists()
