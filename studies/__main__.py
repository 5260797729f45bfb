"""Run the statistical and fault studies: ``python -m studies [--brief] [--only NAME ...] [--commit-table]``."""

import argparse
import importlib
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: more threads cost more than they bring

from .table import Origin, Row, write_table

ROOT = Path(__file__).parents[1]
TABLE = Path("docs", "validation")
BRIEF_TABLE = Path("study-output")


@dataclass(frozen=True)
class Study:
    """A module of this package with ``study(count, brief)``, which yields rows."""

    what: str
    counted: str
    full: int
    brief: int


STUDIES = {
    "bench_effects": Study("what each effect of the deep bench does to a reduction", "campaigns", 1, 1),
    "clocks": Study("intervals of `testbench align`", "seeds", 200, 4),
    "conformance": Study("public files of all formats against the field's libraries, whole and cut", "cuts", 10, 2),
    "encoder_speed": Study("intervals of `testbench speed`", "seeds", 200, 6),
    "fuzz": Study("inputs guided by coverage are read or refused; with --corpus", "inputs a format", 100_000, 2000),
    "identification": Study("intervals of `testbench identify`", "seeds", 50, 1),
    "joint_records": Study("verdicts of `testbench identify`", "records of either kind", 1000, 16),
    "kiper2019": Study("errors of `testbench predict kiper2019`", "tables", 1, 1),
    "laboratories": Study(
        "intervals of `testbench analyze` in laboratories drawn at random", "campaigns a family", 200, 2
    ),
    "lies": Study("lies about runs are found, honest campaigns are not suspected", "campaigns a bench", 40, 1),
    "order_vectors": Study("intervals of `testbench vectors`", "seeds", 200, 6),
    "reader_faults": Study("damaged files are read to their end or refused", "copies a file", 200, 4),
    "store_faults": Study("ingests killed, bits flipped, files cut or removed, appends at once", "kills", 300, 4),
    "system_calls": Study("system calls of the store failed and killed, power lost", "losses of power", 200, 5),
    "trim": Study("intervals of `testbench trim`", "seeds", 200, 4),
}
"""What each holds, what its count counts, and how many in a full and in a brief run."""


def main(arguments: list[str] | None = None) -> int:
    """Run the studies; 1 where a figure is not as required."""
    options = _parser().parse_args(arguments)
    if options.commit_table and options.brief:
        _parser().error("--commit-table is for full runs: leave out --brief")
    folder = BRIEF_TABLE if options.brief else TABLE
    failed = 0
    if options.corpus:
        os.environ["COUNTERPOISE_CORPUS"] = options.corpus
    for name in options.only or [name for name in STUDIES if name != "fuzz" or options.corpus]:
        began, commit = _processor_s(), _commit()
        count = options.count or (STUDIES[name].brief if options.brief else STUDIES[name].full)
        print(f"{name}: {STUDIES[name].what}, {count} {STUDIES[name].counted}", flush=True)
        rows: list[Row] = []
        for row in importlib.import_module(f"studies.{name}").study(count, options.brief):
            rows.append(row)
            print(f"  {row.line}", flush=True)
        command = f"python -m studies --only {name} --count {count}{' --brief' if options.brief else ''}"
        write_table(ROOT / folder, Origin(name, command, commit, time.strftime("%Y-%m-%d"), options.brief), rows)
        failed += sum(not row.passed for row in rows)
        print(f"  {len(rows)} figures, {_processor_s() - began:.0f} s of processor time\n", flush=True)
    print(f"{failed} figures are not as required. The table: {folder / 'results.md'}")
    if options.commit_table:
        files = [str(TABLE / "results.json"), str(TABLE / "results.md")]
        _git("add", *files)
        _git("commit", "--quiet", "-m", f"Results of the studies at {_commit()}", "--", *files)
    return int(failed > 0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m studies",
        description="Run the statistical and fault studies; figures are written to docs/validation.",
        epilog="Studies: " + "; ".join(f"{name}: {study.what}" for name, study in STUDIES.items()),
    )
    parser.add_argument("--brief", action="store_true", help=f"little of each, written to {BRIEF_TABLE}")
    parser.add_argument("--only", nargs="+", choices=list(STUDIES), metavar="NAME", help="these studies alone")
    parser.add_argument("--count", type=int, metavar="N", help="another number of seeds, copies or kills")
    parser.add_argument("--corpus", metavar="FOLDER", help="inputs that fuzzing keeps, outside of the checkout")
    parser.add_argument("--commit-table", action="store_true", help="and commit the table of a full run")
    return parser


def _processor_s() -> float:
    """Processor time of this process and those that it started and that have ended [s]."""
    return sum(os.times()[:4])


def _commit() -> str:
    """The commit of the checkout; a mark behind it where the packages or studies differ from it."""
    if not (ROOT / ".git").exists():
        return "no commit"
    changed = _git("status", "--porcelain", "--", "balance", "testbench", "studies", "datasets")
    return _git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
