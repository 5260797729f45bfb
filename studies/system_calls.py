"""Every system call of the store and its front doors, failed or killed in turn; losses of power between any two.

A trial runs in a forked process in which Python's own calls are counted that name or use a file of the campaign or a
log: opening, listing, locking, reading, writing, syncing, naming. At one of them it raises EIO, kills itself, or leaves
what a loss of power leaves. The model of that: what was synced is there; of what was not, any page of 4 KB and any name
in a folder is as it was synced, or new. What the process told before is the referee. What HDF5 reads by itself is not
counted.
"""

import json
import os
import random
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any
from unittest import mock

from balance.errors import CounterpoiseError
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.ingestion.recovered_runs import recover
from testbench.ingestion.watch_folder import Watch
from testbench.store import Campaign, append_only_records, atomic_files, open_run, writer
from testbench.store.archive import archive

from .table import Row, all_of

ROWS = 2500
PAGE = 4096
AUDITED = {
    "open", "os.listdir", "os.scandir", "os.rename", "os.link", "os.remove", "os.mkdir", "os.rmdir", "os.truncate",
    "fcntl.flock",
}  # fmt: skip
"""Events that Python raises before a call, with the path or handle first."""
STREAM_CALLS = ("write", "read", "readinto", "truncate")
Tell = Callable[[str, int], None]


class Interposed:
    """The system calls of this process below ``folder``, of which the one with ``number`` goes wrong by ``kind``."""

    def __init__(self, folder: Path, kind: str, number: int, lost: Path, seed: int) -> None:
        self.folder, self.kind, self.number, self.lost = folder, kind, number, lost
        self.count, self.chance = 0, random.Random(seed)
        self.open, self.fsync, self.stat, self._inside = Path.open, os.fsync, os.stat, False
        self.names: dict[Path, dict[str, int]] = {}
        self.content: dict[int, bytes] = {}
        self.kept: list[int] = []  # open handles, so that no number of a file is given again
        for path in (folder, *folder.rglob("*")):
            self._synced(os.open(path, os.O_RDONLY))
        os.fsync, os.stat = self._fsync, self._stat  # type: ignore[assignment]
        Path.open = self._opened_by()  # type: ignore[method-assign]
        sys.addaudithook(self._audited)

    def _step(self, file: object) -> None:
        """Count a call that uses ``file``, a path or a handle, if it is one of the campaign or a log."""
        if self._inside or not isinstance(file, str | int | Path):
            return
        self._inside = True
        try:
            path = Path(os.readlink(f"/proc/self/fd/{file}") if isinstance(file, int) else file)
            if not path.is_relative_to(self.folder.parent):
                return
            self.count += 1
            if self.count == self.number:
                if self.kind == "fails":
                    raise OSError(5, "Input/output error", str(path))
                if self.kind == "power":
                    self._leave_what_was_synced()
                os.kill(os.getpid(), signal.SIGKILL)
        finally:
            self._inside = False

    def _audited(self, event: str, given: tuple[Any, ...]) -> None:
        if event in AUDITED:
            self._step(given[0])

    def _fsync(self, handle: int) -> None:
        self._step(handle)
        self._synced(os.dup(handle))

    def _stat(self, path: Any, **options: Any) -> os.stat_result:  # noqa: ANN401
        self._step(path)
        return self.stat(path, **options)

    def _opened_by(self) -> Callable[..., Any]:
        def opened(path: Path, *given: Any, **options: Any) -> Any:  # noqa: ANN401
            stream = self.open(path, *given, **options)
            for name in STREAM_CALLS:
                if not self._inside and (real := getattr(stream, name, None)):
                    setattr(stream, name, partial(self._used, path, real))
            return stream

        return opened

    def _used(self, path: Path, real: Callable[..., Any], *given: Any) -> Any:  # noqa: ANN401
        self._step(path)
        return real(*given)

    def _synced(self, handle: int) -> None:
        inside, self._inside = self._inside, True
        self.kept.append(handle)
        path = Path(os.readlink(f"/proc/self/fd/{handle}"))
        if path.is_dir():
            self.names[path] = {one.name: one.stat().st_ino for one in path.iterdir()}
        else:
            with self.open(Path(f"/proc/self/fd/{handle}"), "rb") as stream:
                self.content[os.fstat(handle).st_ino] = stream.read()
        self._inside = inside

    def _leave_what_was_synced(self) -> None:
        """Write the folder as it may be found after a loss of power at this moment."""
        now = {path.stat().st_ino: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}
        for folder in (self.folder, *(p for p in self.folder.rglob("*") if p.is_dir())):
            new, old = {p.name: p.stat().st_ino for p in folder.iterdir() if p.is_file()}, self.names.get(folder, {})
            target = self.lost / folder.relative_to(self.folder)
            target.mkdir(parents=True, exist_ok=True)
            for name in sorted(new.keys() | old.keys()):
                if (inode := self.chance.choice([old.get(name), new.get(name)])) in {*now, *self.content}:
                    with self.open(target / name, "wb") as stream:
                        stream.write(self._pages(now.get(inode, b""), self.content.get(inode, b"")))

    def _pages(self, now: bytes, synced: bytes) -> bytes:
        """Each page as it is or as it was synced; zeros where the file has only grown."""
        size = self.chance.choice([len(now), len(synced)]) if now else len(synced)
        pages = []
        for at in range(0, size, PAGE):
            old = synced[at : at + PAGE].ljust(min(PAGE, size - at), b"\0")[: size - at]
            new = (now or synced)[at : at + PAGE].ljust(min(PAGE, size - at), b"\0")[: size - at]
            pages.append(old if old == new or self.chance.random() < 0.5 else new)
        return b"".join(pages)


def _ingest(folder: Path, tell: Tell) -> None:
    (run,) = plan_runs([folder.parent / "log.csv"], None)
    for outcome in Ingest(folder).run(run):
        tell(outcome.status, ROWS)


def _watch(folder: Path, tell: Tell) -> None:
    watch = Watch(folder.parent / "in", Ingest(folder), settle_s=0.0)
    for outcome in chain.from_iterable(watch.look() for _ in range(3)):  # one call that fails does not end it
        tell(outcome.status, ROWS)


def _calibrate(folder: Path, tell: Tell) -> None:
    append_only_records.append_record(folder, "decision", [folder / "first.h5"], {"x": 1})
    tell("recorded", 1)


def _archive(folder: Path, tell: Tell) -> None:
    tell(archive(open_run(folder.parent / "whole" / "log.h5"), folder).status, ROWS)


def _recover(folder: Path, tell: Tell) -> None:
    for one in recover(folder):
        tell(one.status, 0)


WORK = {"ingest": _ingest, "watch": _watch, "calibrate": _calibrate, "archive": _archive, "recover": _recover}


def trial(base: Path, work: str, kind: str, number: int, seed: int = 0) -> tuple[bool, str]:
    """One trial on a copy of ``base``: whether that many calls were made, and what is wrong afterwards, if anything."""
    with tempfile.TemporaryDirectory() as temporary:
        home = Path(temporary) / "home"
        shutil.copytree(base, home)
        campaign, lost = home / "c", Path(temporary) / "lost"
        told, ended = _forked(campaign, work, kind, number, lost, seed)
        reached = ended != "done" or any(status == "reached" for status, _ in told)
        if kind == "power" and lost.exists():
            shutil.rmtree(campaign)
            lost.rename(campaign)
        found = [message for status, message in told if status == "raised"]
        if ended == "done" and {status for status, _ in told} <= {"reached", "synced"}:
            found = ["it came to its end, and nothing was said"]
        with mock.patch.object(atomic_files, "boot_id", return_value="after" if kind == "power" else "before"):
            return reached, "; ".join(map(str, found)) or _judge(base, campaign, told, work)


def _forked(campaign: Path, work: str, kind: str, number: int, lost: Path, seed: int) -> tuple[list[Any], str]:
    """What a process told that did the work with one call gone wrong, and whether it came to its end."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        writer.CHUNK, writer.GATHERED, writer.SYNCED_EVERY_S = 256, 512, 0.0
        atomic_files.boot_id = lambda: "before"

        def tell(status: str, value: object) -> None:
            os.write(writing, json.dumps([status, value]).encode() + b"\n")

        real = writer.RunWriter.acknowledge

        def acknowledged(run: writer.RunWriter, *given: Any) -> None:  # noqa: ANN401
            real(run, *given)
            run.wait_until_synced()
            (left,) = [one for one in atomic_files.leftovers(campaign) if one.part == run.part]
            tell("synced", sum(kept.samples for kept in atomic_files.read_journal(left.journal).groups))

        if work in {"ingest", "watch"}:
            writer.RunWriter.acknowledge = acknowledged  # type: ignore[method-assign, assignment]
        calls = Interposed(campaign, kind, number, lost, seed)
        try:
            WORK[work](campaign, tell)
        except BaseException as error:  # a command says the first two, but a watch has to go on
            said = isinstance(error, CounterpoiseError) or (isinstance(error, OSError) and work != "watch")
            tell("refused" if said else "raised", f"{type(error).__name__}: {error}")
        if calls.count >= number:
            tell("reached", calls.count)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as stream:
        told = [json.loads(line) for line in stream]
    return told, "done" if os.waitpid(child, 0)[1] == 0 else "killed"


def _judge(base: Path, campaign: Path, told: list[Any], work: str) -> str:
    """What is lost or wrong after `testbench recover`; nothing if all is well."""
    for _ in range(3):
        outcomes = recover(campaign)
    if left := [one for one in outcomes if one.status != "failed"]:
        return f"recover is not done: {left[0].status} {left[0].message}"
    known_states = {"intact", "absent"} | ({"unfinished"} if outcomes else set())  # what is left is named
    odd = [state for state in Campaign(campaign).verify() if state.status not in known_states]
    if odd:
        return f"{odd[0].name}: {odd[0].status} {odd[0].message}"
    expected = open_run(base / "whole" / "log.h5")
    samples = 0
    for run in Campaign(campaign).runs:
        if run.name != "first":
            samples = max(samples, run.group().samples)
            for index in range(2):
                whole = expected.channel_at("log", index)[: run.group().samples]
                if run.channel_at(run.group().name, index).tobytes() != whole.tobytes():
                    return f"{run.name}: other values"
    counted = {"stored", "archived"} | (set() if "refused" in dict(told) else {"synced"})
    known = [value for status, value in told if status in counted]
    if known and samples < max(known):
        return f"{max(known)} samples were acknowledged, {samples} are there"
    if ["recorded", 1] in told and len(append_only_records.read_records(campaign)) != 1:
        return "a record that was acknowledged is gone"
    first = campaign / "first.h5"
    return (
        "" if work == "archive" or first.read_bytes() == (base / "c" / "first.h5").read_bytes() else "first.h5 changed"
    )


def prepare(folder: Path, work: str) -> Path:
    """A campaign of one run, a log, its run elsewhere, and for recover what a killed ingest left."""
    for name, rows in (("first", 50), ("log", ROWS)):
        text = "".join(f"{i / 1000:.3f},{(i * 37 % 101) / 50 - 1:.2f}\n" for i in range(rows))
        (folder / f"{name}.csv").write_text("Time (s),AccX (g)\n" + text)
    for name, campaign in (("first", "c"), ("log", "whole")):
        Ingest(folder / campaign).run(plan_runs([folder / f"{name}.csv"], None)[0])
    (folder / "in").mkdir()
    shutil.copy(folder / "log.csv", folder / "in" / "log.csv")
    if work == "recover":
        calls = _calls(folder, "ingest")
        for number in range(calls // 2, calls):
            _forked(folder / "c", "ingest", "killed", number, folder / "lost", 0)
            left = atomic_files.leftovers(folder / "c")
            if any(kept.samples for one in left for kept in atomic_files.read_journal(one.journal).groups):
                break
            recover(folder / "c")
    return folder


def _calls(base: Path, work: str) -> int:
    """How many calls the work makes."""
    number = 1 << 30
    with tempfile.TemporaryDirectory() as temporary:
        shutil.copytree(base, Path(temporary) / "home")
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            writer.CHUNK, writer.GATHERED, writer.SYNCED_EVERY_S = 256, 512, 0.0
            try:
                calls = Interposed(Path(temporary) / "home" / "c", "fails", number, Path(temporary), 0)
                WORK[work](Path(temporary) / "home" / "c", lambda *_: None)
                os.write(writing, str(calls.count).encode())
            finally:
                os._exit(0)
        os.close(writing)
        os.waitpid(child, 0)
        return int(os.read(reading, 20))


def study(count: int, brief: bool) -> Iterator[Row]:
    """Each call of each work failed and killed, in a brief study some of them; ``count`` losses of power."""
    chance = random.Random(3)
    for work in WORK:
        with tempfile.TemporaryDirectory() as temporary:
            base = prepare(Path(temporary), work)
            calls = _calls(base, work)
            for kind in ("fails", "killed"):
                numbers = range(1, calls + 1, max(1, calls // count) if brief else 1)
                yield _row(f"{work}, each of {calls} system calls {kind}", [
                    trial(base, work, kind, number) for number in numbers
                ])  # fmt: skip
            losses = [chance.randint(1, calls) for _ in range(max(1, count // len(WORK)))]
            yield _row(f"{work}, loss of power between calls", [
                trial(base, work, "power", number, seed) for seed, number in enumerate(losses)
            ])  # fmt: skip


def _row(quantity: str, trials: list[tuple[bool, str]]) -> Row:
    wrong = [what for _, what in trials if what]
    return all_of(f"{quantity}: nothing acknowledged lost, nothing wrong read", len(trials) - len(wrong), len(trials),
                  "; ".join(dict.fromkeys(wrong[:3])))  # fmt: skip
