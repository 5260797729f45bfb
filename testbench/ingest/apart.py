"""Several logs in one run: groups that are called alike in two files get the name of their file in front."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from ..recording import Block, Group, Recording, Report


def apart(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings, with no group's name in two of them."""
    names = Counter(name for recording in recordings for name in {group.name for group in recording.groups})
    stems = Counter(recording.path.stem for recording in recordings)
    found = []
    for i, recording in enumerate(recordings, 1):
        stem = recording.path.stem
        front = stem if stems[stem] == 1 else f"{stem} {i}"
        shared = any(names[group.name] > 1 for group in recording.groups)
        found.append(_renamed(recording, front) if shared else recording)
    return found


def _renamed(recording: Recording, front: str) -> Recording:
    """The recording with ``front`` before the name of each group, also of those that come while it is read."""

    def renamed(group: Group) -> Group:
        return replace(group, name=f"{front} {group.name}")

    def read(report: Report) -> Iterator[Block]:
        for block in recording.blocks(report):
            yield replace(block, group=renamed(block.group))

    return replace(recording, groups=tuple(map(renamed, recording.groups)), read=read)
