"""Steps 2 and 3: a simulated campaign of the published test conditions, as logs, into HDF5, to reductions."""

import json
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from .__main__ import show, step
from .console import command, heading, saved


def run(out: Path) -> None:
    """Simulate, ingest, verify, analyse, compare, draw."""
    heading("2. The 26 published conditions, with and without counter-masses: simulated logs into HDF5")
    command(["testbench", "simulate", "--plan", "kiper2019", "--rig", "parallelogram-6bar", "-o", "logs"], out)
    logs = sorted(path.relative_to(out) for path in (out / "logs").glob("r*_*.csv"))
    sheet = ["--rig", "parallelogram-6bar", "--runs", "logs/runs.csv", "-o", "campaign", "--json"]
    printed = command(
        ["testbench", "ingest", *logs, *sheet], out, shown=f"testbench ingest logs/r*_*.csv {' '.join(sheet)}"
    )
    _summarise(json.loads(printed)["runs"])
    command(["testbench", "verify", "campaign", "-q"], out)

    heading("3. How much the base's vibration fell: analysed from the logs, simulated anew, published")
    with step("pictures", out) as pictures:
        command(["testbench", "report", "campaign", "--published", "kiper2019", "-o", "report.html", "-q"], out)
        saved(out / "report.html", "all 78 reductions beside those simulated and published (simulated logs)")
        show(pictures)


def _summarise(stored: list[dict]) -> None:
    """How many logs were stored, of which origin, with which findings."""
    for what in ("status", "origin"):
        print(f"   {what}: {_counted(log[what] for log in stored)}")
    print(f"   findings: {_counted(finding['code'] for log in stored for finding in log['findings'])}")


def _counted(words: Iterable[str]) -> str:
    return ", ".join(f"{word} {count}" for word, count in Counter(words).most_common()) or "none"


if __name__ == "__main__":
    run(Path(sys.argv[1]))
