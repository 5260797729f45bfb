"""Coverage of the intervals of ``testbench identify``: base parameters of the simulated bench, from torques and forces.

A campaign is the triangle with two payloads; the value in the mechanism's file is the truth.
"""

from collections.abc import Iterator

from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.identification import identify
from testbench.identification.records import By, assemble

from .simulated_runs import MANIPULATOR, Scene, aligned, scene
from .table import Row, Tally, covered

PAYLOADS_KG = (3.4116, 5.0)


def study(count: int, brief: bool) -> Iterator[Row]:
    """Coverage over all base parameters, by what they are identified from."""
    mechanism, scenes = load_mechanism(MANIPULATOR), [scene("triangle", payload=payload) for payload in PAYLOADS_KG]
    tallies: dict[By, Tally] = {"torque": Tally(), "wrench": Tally()}
    for seed in range(count):
        for by, tally in tallies.items():
            for hit in _hits(scenes, mechanism, by, seed):
                tally.add(hit)
    for by, tally in tallies.items():
        note = f"{count} campaigns" + ("; the torques' scale and the simulated motion widen" if by == "torque" else "")
        yield covered(f"by {by}, all base parameters", tally.hits, tally.count, note, conservative=by == "torque")


def _hits(scenes: list[Scene], mechanism: Mechanism, by: By, seed: int) -> list[bool]:
    """Whether each base parameter's value in the file lies in its interval."""
    runs = [one.run(1000 * seed + k) for k, one in enumerate(scenes)]
    assembled = assemble(aligned(runs, mechanism), by)
    found = identify(assembled.records, assembled.mechanism, "ls", others=False)
    return [value.interval[0] <= value.in_file <= value.interval[1] for value in found.base_values()]
