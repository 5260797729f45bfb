"""Ingests killed at random moments; chunks displaced, bits flipped, files cut or removed; appends all at once."""

import contextlib
import io
import multiprocessing
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from multiprocessing.synchronize import Barrier
from pathlib import Path

import h5py
import numpy as np

from testbench.cli.campaign import recover
from testbench.errors import StoreError
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.store import Campaign, append_only_records, archive, atomic_files, open_campaign, open_run
from testbench.store.ledger import FILE, read_ledger

from .table import Row, all_of

ROWS = 400_000
CHILD = """
import sys
import time
from pathlib import Path
from testbench.store import atomic_files, writer
writer.CHUNK, writer.GATHERED = 4096, 8192
real = atomic_files.JournalWriter.acknowledge
def told(self, number, pieces):
    real(self, number, pieces)
    print(sum(piece.count for piece in pieces[0]), flush=True)
    time.sleep(float(sys.argv[3]))
atomic_files.JournalWriter.acknowledge = told
whole = writer.GroupWriter.append
def in_pieces(self, columns):
    for begin in range(0, len(columns[0]), 8192):
        whole(self, [column[begin : begin + 8192] for column in columns])
writer.GroupWriter.append = in_pieces
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
work, (run,) = Ingest(Path(sys.argv[2])), plan_runs([Path(sys.argv[1])], None)
print("ready", flush=True)
outcomes = work.run(run)
print("end", *(outcome.status for outcome in outcomes), flush=True)
"""
"""An ingest that says each time how many samples it has acknowledged, in small chunks so that there are many.

After each it waits for so many seconds.
"""


def write_log(path: Path, rows: int = ROWS) -> list[np.ndarray]:
    """A log of time and two channels; returns what it holds."""
    columns = [np.arange(rows) / 5000.0, *np.round(np.random.default_rng(5).normal(size=(2, rows)), 4)]
    lines = "".join(f"{t:.4f},{x:.4f},{y:.4f}\n" for t, x, y in zip(*columns, strict=True))
    path.write_text("Time (s),AccX (g),AccY (g)\n" + lines)
    return columns


def start(log: Path, campaign: Path, pause_s: float = 0.002) -> subprocess.Popen[str]:
    """An ingest in a process of its own, about to begin."""
    command = [sys.executable, "-c", CHILD, str(log), str(campaign), str(pause_s)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    return child


def duration(log: Path, folder: Path) -> float:
    """How long it takes where nobody kills it [s]."""
    child = start(log, folder)
    begin = time.perf_counter()
    assert child.communicate()[0].endswith("end stored\n")
    return time.perf_counter() - begin


def kill(log: Path, campaign: Path, pieces: int, wait_s: float = 0.0, pause_s: float = 0.002) -> int:
    """Kill an ingest that long after it acknowledged so many pieces; returns how many samples it had acknowledged."""
    child = start(log, campaign, pause_s=pause_s)
    lines = []
    try:
        lines = [next(child.stdout or iter(()), "") for _ in range(pieces)]
        time.sleep(wait_s)
    finally:
        child.kill()
    lines += child.communicate()[0].splitlines()
    return sum(int(line) for line in lines if line.strip().isdigit())


def recovered(campaign: Path, acknowledged: int, columns: Sequence[np.ndarray]) -> int:
    """Recover, and check that all that was acknowledged is there, to the bit, in a file that is whole.

    Returns the exit code of ``testbench recover``.
    """
    for path in campaign.glob("*.h5"):
        assert atomic_files.recorded_digest(path) == atomic_files.sha256_of(path), "a half file has a final name"
    with contextlib.redirect_stdout(io.StringIO()):
        code = recover.main([str(campaign), "--json"], standalone_mode=False)
    held = 0
    for run in open_campaign(campaign).runs if list(campaign.glob("*.h5")) else ():
        group = run.group()
        for i, column in enumerate(columns):
            assert run.channel_at(group.name, i).tobytes() == column[: group.samples].tobytes()
        held = max(held, group.samples)
    assert held >= acknowledged, f"{acknowledged} samples were acknowledged, {held} are there"
    assert {p.name for p in campaign.glob(".*")} <= {".lock"}, "something is left"
    if list(campaign.iterdir()):
        assert {state.status for state in open_campaign(campaign).verify()} == {"intact"}
    return code


def flipped(run: Path, chance: random.Random) -> bool:
    """Flip one bit of a run or its digest; whether verify names the run, and then flip it back."""
    sizes = {path: path.stat().st_size for path in (run, atomic_files.digest_file(run))}
    at = chance.randrange(sum(sizes.values()) + 2000)
    path = run if at < sizes[run] else atomic_files.digest_file(run)
    whole = path.read_bytes()
    place = at if path == run else at % len(whole)
    bit = 1 << chance.randrange(8)
    path.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1 :])
    found = [state.status for state in open_campaign(run.parent).verify()]
    path.write_bytes(whole)
    return found == ["damaged"]


def misread(run: Path, chance: random.Random) -> bool:
    """Flip up to three bits of a run, and flip them back; whether another number was read, and not an error."""
    whole = run.read_bytes()
    expected = _channels(run)
    content = bytearray(whole)
    for _ in range(chance.randrange(1, 4)):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    run.write_bytes(content)
    try:
        return _channels(run) != expected
    except StoreError:
        return False
    finally:
        run.write_bytes(whole)


def displaced(run: Path, chance: random.Random) -> bool:
    """Zero a chunk of a channel, or put another one in its place, and undo it; whether reading the channel says so."""
    whole, content = run.read_bytes(), bytearray(run.read_bytes())
    with h5py.File(run) as file:
        names = [key for key in file["entry/log"] if key.startswith("Acc")]
        channels = [file[f"entry/log/{name}"].id for name in names]
        places = [
            (c.get_chunk_info(n).byte_offset, c.get_chunk_info(n).size)
            for c in channels
            for n in range(c.get_num_chunks())
        ]
    place, other = chance.sample(range(len(places)), 2)
    (at, size), (source, _) = places[place], places[other]
    content[at : at + size] = bytes(size) if chance.random() < 0.5 else whole[source : source + size]
    if chance.random() < 0.3:
        content[source : source + size] = whole[at : at + size]
    run.write_bytes(content)
    try:
        _channels(run)
    except StoreError as error:
        return "samples " in str(error) and "channel 'Acc" in str(error)
    finally:
        run.write_bytes(whole)
    return False


def _channels(run: Path) -> list[bytes]:
    opened = open_run(run)
    return [opened.channel(channel.name).tobytes() for channel in opened.groups[0].channels]


def cut(run: Path, chance: random.Random) -> bool:
    """Cut a run at a random byte; whether verify says so, and no more samples than there are are read from it."""
    whole = run.read_bytes()
    run.write_bytes(whole[: chance.randrange(len(whole))])
    damaged = [state.status for state in open_campaign(run.parent).verify()] == ["damaged"]
    try:
        _channels(run)
        silent = True
    except StoreError:
        silent = False
    run.write_bytes(whole)
    return damaged and not silent


def removed(campaign: Path, work: Path, chance: random.Random) -> str:
    """Remove files from a copy of a campaign, or lines of its ledger; what of that verify does not name, if anything.

    Whoever takes away files and with them the last lines of the ledger is found out by its head, noted elsewhere.
    """
    shutil.copytree(campaign, work)
    ledger = work / FILE
    lines = ledger.read_bytes().splitlines(keepends=True)
    entered = read_ledger(work).entries
    if chance.random() < 0.3:
        first, count = chance.randrange(len(lines)), chance.randint(1, len(lines))
        ledger.write_bytes(b"".join(lines[:first] + lines[first + count :]))
        at_the_end = first + count >= len(lines)
        expected = {entry.file for entry in entered[first:]} if at_the_end and first else {FILE}
        if chance.random() < 0.2:
            ledger.unlink()
            expected = {FILE}
    else:
        expected = {entry.file for entry in chance.sample(entered, chance.randint(1, len(entered)))}
        for name in expected:
            digest = atomic_files.digest_file(work / name)
            gone = chance.choice([[digest], [work / name], [work / name, digest]]) if digest.exists() else [work / name]
            for path in gone:
                path.unlink()
    found = {state.name for state in Campaign(work).verify() if state.status not in {"intact", "extra"}}
    shutil.rmtree(work)
    return "" if found == expected else f"of {sorted(expected)} verify names {sorted(found)}"


def _append_one(campaign: Path, log: Path, name: str, ready: Barrier) -> None:
    """Store a run, or a record for odd names, once all others are ready."""
    ready.wait()
    if log.exists():
        (outcome,) = Ingest(campaign).run(plan_runs([log], None)[0])
        assert outcome.status == "stored", outcome.message
    else:
        append_only_records.append_record(campaign, "decision", [], {"name": name})


def appended_at_once(folder: Path, count: int) -> str:
    """``count`` runs and records, appended by as many processes at once; what is wrong with the campaign then."""
    campaign, context = folder / "c", multiprocessing.get_context("fork")
    campaign.mkdir(parents=True)
    for number in range(0, count, 2):
        write_log(folder / f"r{number}.csv", 100 + number)
    ready = context.Barrier(count)
    names = [f"r{number}" for number in range(count)]
    work = [context.Process(target=_append_one, args=(campaign, folder / f"{n}.csv", n, ready)) for n in names]
    for process in work:
        process.start()
    for process in work:
        process.join()
    failed = sum(process.exitcode != 0 for process in work)
    numbers = [record.number for record in append_only_records.read_records(campaign)]
    odd = [state for state in Campaign(campaign).verify() if state.status != "intact"]
    entries = len(read_ledger(campaign).entries)
    right = (failed, numbers, odd, entries) == (0, [*range(1, count // 2 + 1)], [], count)
    return "" if right else f"{failed} failed, numbers {numbers}, {entries} entries, {odd[:3]}"


def study(count: int, brief: bool) -> Iterator[Row]:
    """``count`` ingests killed, a third of that appends at once, two thirds removals.

    Ten thirds of it chunks displaced, bits flipped, and files cut.
    """
    many = -(-10 * count // 3)
    chance = random.Random(1)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        columns = write_log(folder / "log.csv")
        whole = duration(folder / "log.csv", folder / "whole")
        kills = (partial(_ingest_killed, folder, f"c{n}", columns, chance, whole) for n in range(count))
        yield _tried("ingests killed: every acknowledged sample recovered to the bit", kills)
        (run,) = open_campaign(folder / "whole").run_paths
        found = sum(displaced(run, chance) for _ in range(many))
        yield all_of(
            "run, chunks zeroed, swapped or repeated: refused on reading, channel and samples named", found, many
        )
        write_log(folder / "small.csv", 5000)
        start(folder / "small.csv", folder / "small").wait()
        stored = folder / "small" / "small.h5"
        small = archive.archive(open_run(stored), folder / "archive").file
        for kind, file in (("run", stored), ("archive", small)):
            for what, trial in (("bits flipped", flipped), ("cuts", cut)):
                found = sum(trial(file, chance) for _ in range(many))
                yield all_of(f"{kind}, {what}: found by verify", found, many)
            wrong = sum(misread(file, chance) for _ in range(many))
            yield all_of(f"{kind}, bits flipped: an error or the numbers as stored", many - wrong, many)
        appends = max(2, count // 6 * 2)
        wrong_then = appended_at_once(folder / "appends", appends)
        quantity = "runs and records appended at once: numbers without gaps, ledger whole, verify intact"
        yield all_of(quantity, 0 if wrong_then else appends, appends, wrong_then)
        trials = [removed(folder / "appends" / "c", folder / "removed", chance) for _ in range(2 * count // 3)]
        odd = sorted(filter(None, trials))
        quantity = "runs, digests, records and lines of the ledger removed: verify names these and no other"
        yield all_of(quantity, len(trials) - len(odd), len(trials), "; ".join(odd[:3]))


def _ingest_killed(
    folder: Path, name: str, columns: Sequence[np.ndarray], chance: random.Random, whole: float
) -> int:  # fmt: skip
    """At a random moment, half of them amid the data."""
    amid = chance.random() < 0.5
    pieces, wait_s = (chance.randint(1, ROWS // 8192), 0.01) if amid else (0, whole)
    acknowledged = kill(folder / "log.csv", folder / name, pieces, chance.uniform(0, wait_s))
    (folder / name).mkdir(exist_ok=True)
    return recovered(folder / name, acknowledged, columns)


def _tried(quantity: str, kills: Iterable[Callable[[], int]]) -> Row:
    """How many went as they must; a note with the exit codes of recover, and with what failed."""
    codes: list[int] = []
    failures: list[str] = []
    for one in kills:
        try:
            codes.append(one())
        except AssertionError as error:
            failures.append(str(error))
    counts = ", ".join(f"{code}: {codes.count(code)}" for code in sorted(set(codes)))
    note = "; ".join([f"exit codes of recover {counts}", *failures[:3]])
    return all_of(quantity, len(codes), len(codes) + len(failures), note)
