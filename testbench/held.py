"""A stored run with some of its channels in memory, read in one opening of its file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

from .recording import Samples
from .store import safe
from .store.run import Run, StoredGroup

if TYPE_CHECKING:
    import h5py

    from .rig import Column


@dataclass(frozen=True)
class HeldRun(Run):
    """The same run; what is not held is read from the file as ever."""

    held: Mapping[tuple[str, int], Samples] = field(default_factory=dict)
    """By group and index of the channel."""

    def _read(self, group: StoredGroup, index: int) -> Samples:
        found = self.held.get((group.name, index))
        return super()._read(group, index) if found is None else found


def held(run: Run, columns: "Iterable[Column]") -> Run:
    """The run with these channels held; a run that is no plain file, such as one in SI, as it is."""
    places = [run.find(column.channel) for column in columns]
    if type(run) is not Run:
        return run
    with safe.open_for_reading(run.path) as file:
        nodes = {group.path: safe.member(file, group.path) for group, _ in places}
        found = {(g.name, i): _samples(file, nodes[g.path], g, i) for g, i in places}
    return HeldRun(**{f.name: getattr(run, f.name) for f in fields(Run)}, held=found)


def _samples(file: "h5py.File", node: "h5py.Group", group: StoredGroup, index: int) -> Samples:
    """As the group reads them; values that are stored as they are without going down to the group once more."""
    if group.whole and group.whole[index] is not None:
        return group.samples_of(file, index)
    return safe.numbers(node, group.keys[index])
