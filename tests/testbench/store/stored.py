"""Runs stored by hand, for tests of what is stored."""

from testbench.recording import Channel, Group
from testbench.store import open_run
from testbench.store.writer import RunWriter

ACC = Group("log", (Channel("AccX (g)", "g", "AccX"),))
"""One channel without a clock."""


def fill(writer, groups, origin="simulated", conditions=None, findings=(), provenance=None, rig=None, **how):
    """Give a run its groups, each with its columns in blocks, and what is known of it."""
    block, rate = how.get("block", 10**6), how.get("rate", (None, None))
    for group, columns in groups.items():
        for start in range(0, len(columns[0]), block):
            writer.group(group).append([column[start : start + block] for column in columns])
        writer.group(group).finish(*rate)
    writer.describe(origin, conditions or {}, findings, provenance or {"sources": []}, rig)


def store_groups(folder, groups, name="r001", **known):
    """Store a run of groups, each with its columns."""
    with RunWriter(folder, name) as writer:
        fill(writer, groups, **known)
        return open_run(writer.commit())


def store(folder, group, columns, name="r001", block=1000, rig=None, rate=(None, None), **conditions):
    """Store a run of one group of a log."""
    provenance = {"sources": [{"name": "log.csv", "sha256": "0" * 64, "size_bytes": 1}]}
    known = {"conditions": conditions, "provenance": provenance, "rig": rig, "block": block, "rate": rate}
    return store_groups(folder, {group: columns}, name, **known)


def names_in(folder):
    """The names of the files in a campaign, its ledger and its lock apart."""
    return sorted({path.name for path in folder.iterdir()} - {"ledger.jsonl", ".lock"})
