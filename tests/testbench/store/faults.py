"""Kills an ingest at random moments, flips bits and cuts files; by hand: python tests/testbench/store/faults.py."""

import argparse
import contextlib
import io
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from testbench.cli.recover import recover
from testbench.errors import StoreError
from testbench.store import archive, digest, open_campaign, open_run

ROWS = 400_000
CHILD = """
import sys
import time
from pathlib import Path
from testbench.store import groups, journal
groups.CHUNK, groups.GATHERED = 4096, 8192
real = journal.JournalWriter.acknowledge
def told(self, number, pieces):
    real(self, number, pieces)
    print(sum(piece.count for piece in pieces[0]), flush=True)
    time.sleep(0.002)
journal.JournalWriter.acknowledge = told
whole = groups.GroupWriter.append
def in_pieces(self, columns):
    for begin in range(0, len(columns[0]), 8192):
        whole(self, [column[begin : begin + 8192] for column in columns])
groups.GroupWriter.append = in_pieces
from testbench.ingest import Ingest
from testbench.ingest.runsheet import plan
work, (run,) = Ingest(Path(sys.argv[2])), plan([Path(sys.argv[1])], None)
print("ready", flush=True)
outcomes = work.run(run)
print("end", *(outcome.status for outcome in outcomes), flush=True)
"""
"""An ingest that says each time how many samples it has acknowledged, in small chunks so that there are many."""
ARCHIVING = """
import sys
from pathlib import Path
from testbench.store import archive, open_run
run = open_run(sys.argv[1])
print("ready", flush=True)
print("end", archive.archive(run, Path(sys.argv[2])).status, flush=True)
"""
"""An archive of one run."""


def write_log(path, rows=ROWS):
    """A log of time and two channels; returns what it holds."""
    columns = [np.arange(rows) / 5000.0, *np.round(np.random.default_rng(5).normal(size=(2, rows)), 4)]
    lines = "".join(f"{t:.4f},{x:.4f},{y:.4f}\n" for t, x, y in zip(*columns, strict=True))
    path.write_text("Time (s),AccX (g),AccY (g)\n" + lines)
    return columns


def start(log, campaign, code=CHILD):
    """An ingest, or an archive, in a process of its own, about to begin."""
    child = subprocess.Popen([sys.executable, "-c", code, str(log), str(campaign)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    return child


def duration(log, folder, code=CHILD):
    """How long it takes where nobody kills it [s]."""
    child = start(log, folder, code)
    begin = time.perf_counter()
    assert child.communicate()[0].endswith(("end stored\n", "end archived\n"))
    return time.perf_counter() - begin


def kill(log, campaign, chance, whole):
    """Kill an ingest at a random moment, half of them amid its data; returns how many samples it had acknowledged."""
    child = start(log, campaign)
    lines = []
    try:
        if chance.random() < 0.5:
            lines = [child.stdout.readline() for _ in range(chance.randint(1, ROWS // 8192))]
            time.sleep(chance.uniform(0, 0.01))
        else:
            time.sleep(chance.uniform(0, whole))
    finally:
        child.kill()
    lines += child.communicate()[0].splitlines()
    return sum(int(line) for line in lines if line.strip().isdigit())


def recovered(campaign, acknowledged, columns):
    """Recover, and check that all that was acknowledged is there, to the bit, in a file that is whole.

    Returns the exit code of ``testbench recover``.
    """
    for path in campaign.glob("*.h5"):
        assert digest.recorded(path) == digest.sha256_of(path), "a half file has a final name"
    with contextlib.redirect_stdout(io.StringIO()):
        code = recover.main([str(campaign), "--json"], standalone_mode=False)
    held = 0
    for run in open_campaign(campaign).runs if list(campaign.glob("*.h5")) else ():
        group = run.group()
        for i, column in enumerate(columns):
            assert run.channel_at(group.name, i).tobytes() == column[: group.samples].tobytes()
        held = max(held, group.samples)
    assert held >= acknowledged, f"{acknowledged} samples were acknowledged, {held} are there"
    assert not [p for p in campaign.glob(".*")], "something is left"
    if list(campaign.iterdir()):
        assert {state.status for state in open_campaign(campaign).verify()} == {"intact"}
    return code


def kill_archive(run, folder, chance, whole):
    """Kill an archive at a random moment; returns what ``testbench recover`` makes of it, and archives again.

    The run stays as it was, no half file has a final name, and the archive then holds every bit.
    """
    child = start(run, folder, ARCHIVING)
    time.sleep(chance.uniform(0, whole))
    child.kill()
    child.communicate()
    folder.mkdir(exist_ok=True)
    original = open_run(run)
    columns = [original.channel_at(original.group().name, i) for i in range(len(original.group().channels))]
    code = recovered(folder, 0, columns)
    assert archive.archive(original, folder).status in {"archived", "already_archived"}
    assert recovered(folder, original.group().samples, columns) == 0
    assert digest.recorded(run) == digest.sha256_of(run)
    return code


def flipped(run, random_numbers):
    """Flip one bit of a run or its digest; whether verify names the run, and then flip it back."""
    sizes = {path: path.stat().st_size for path in (run, digest.beside(run))}
    at = random_numbers.randrange(sum(sizes.values()) + 2000)
    path = run if at < sizes[run] else digest.beside(run)
    whole = path.read_bytes()
    place = at if path == run else at % len(whole)
    bit = 1 << random_numbers.randrange(8)
    path.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1 :])
    found = [state.status for state in open_campaign(run.parent).verify()]
    path.write_bytes(whole)
    return found == ["damaged"]


def cut(run, random_numbers):
    """Cut a run at a random byte; whether verify says so, and no more samples than there are are read from it."""
    whole = run.read_bytes()
    run.write_bytes(whole[: random_numbers.randrange(len(whole))])
    damaged = [state.status for state in open_campaign(run.parent).verify()] == ["damaged"]
    try:
        opened = open_run(run)
        [opened.channel(channel.name) for channel in opened.groups[0].channels]
        silent = True
    except StoreError:
        silent = False
    run.write_bytes(whole)
    return damaged and not silent


def main():
    """The counts of a long run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--flips", type=int, default=1000)
    parser.add_argument("--cuts", type=int, default=1000)
    parser.add_argument("--archive-kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        columns = write_log(folder / "log.csv")
        whole = duration(folder / "log.csv", folder / "whole")
        codes = []
        for number in range(given.kills):
            campaign = folder / f"c{number}"
            acknowledged = kill(folder / "log.csv", campaign, chance, whole)
            campaign.mkdir(exist_ok=True)
            codes.append(recovered(campaign, acknowledged, columns))
            if sys.stderr.isatty() or number % 50 == 49:
                print(f"{number + 1} kills", file=sys.stderr)  # noqa: T201
        print(f"kills: {given.kills}, all acknowledged samples there; exit codes "  # noqa: T201
              + ", ".join(f"{code}: {codes.count(code)}" for code in sorted(set(codes))))  # fmt: skip
        (run,) = open_campaign(folder / "whole").run_paths
        whole = duration(run, folder / "a", ARCHIVING)
        codes = [kill_archive(run, folder / f"a{n}", chance, whole) for n in range(given.archive_kills)]
        print(f"archives killed: {len(codes)}, all made again; exit codes of recover "  # noqa: T201
              + ", ".join(f"{code}: {codes.count(code)}" for code in sorted(set(codes))))  # fmt: skip
        write_log(folder / "small.csv", 5000)
        start(folder / "small.csv", folder / "small").wait()
        stored = folder / "small" / "small.h5"
        small = archive.archive(open_run(stored), folder / "archive").file
        for kind, run in (("run", stored), ("archive", small)):
            flips, cuts = ([test(run, chance) for _ in range(n)]
                           for test, n in ((flipped, given.flips), (cut, given.cuts)))  # fmt: skip
            print(f"{kind}: flips found: {sum(flips)} of {len(flips)}; cuts found: {sum(cuts)} of {len(cuts)}")  # noqa: T201


if __name__ == "__main__":
    main()
