"""The header of dataset 58: a function at a node, of time, frequency or another abscissa."""

from dataclasses import dataclass

from ..stream import ByteSource, damaged
from .index import Dataset, line_at

TIME = 17
"""Specific data type of an abscissa of time."""
NAMES = {
    0: "General", 1: "Time response", 2: "Auto spectrum", 3: "Cross spectrum", 4: "Frequency response",
    5: "Transmissibility", 6: "Coherence", 7: "Auto correlation", 8: "Cross correlation",
    9: "Power spectral density", 10: "Energy spectral density", 11: "Probability density", 12: "Spectrum",
    13: "Cumulative frequency distribution", 14: "Peaks valley", 15: "Stress per cycles", 16: "Strain per cycles",
    17: "Orbit", 18: "Mode indicator function", 19: "Force pattern", 20: "Partial power", 21: "Partial coherence",
    22: "Eigenvalue", 23: "Eigenvector", 24: "Shock response spectrum", 25: "Finite impulse response filter",
    26: "Multiple coherence", 27: "Order function", 28: "Phase compensation",
}  # fmt: skip
_AXES = {17: "Time", 18: "Frequency", 16: "Temperature", 20: "Order"}
_DIRECTIONS = {0: "scalar", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


@dataclass(frozen=True)
class Axis:
    """Specific data type, label and unit of an axis, as written; None where the file says NONE."""

    kind: int
    label: str | None
    unit: str | None


@dataclass(frozen=True)
class Function:
    """The header of one function; ``step_text`` is the abscissa's step as written, ``data`` where the numbers begin."""

    ids: tuple[str, ...]
    kind: int
    node: tuple[str, int, int]
    reference: tuple[str, int, int]
    is_complex: bool
    is_double: bool
    samples: int
    even: bool
    start: float
    step: float
    step_text: str
    abscissa: Axis
    ordinate: Axis
    denominator: Axis
    dataset: Dataset
    data: int

    @property
    def name(self) -> str:
        """The first line of identification, or node and direction if there is none."""
        return self.ids[0] if self.ids[0] and self.ids[0] != "NONE" else self.dof

    @property
    def dof(self) -> str:
        """Node and direction of the response, such as ``node 1 +Z``."""
        _, node, direction = self.node
        sign = _DIRECTIONS.get(abs(direction), str(direction))
        return f"node {node} {sign.replace('+', '-') if direction < 0 else sign}"

    @property
    def unit(self) -> str | None:
        """Unit of the ordinate, over that of its denominator if there is one."""
        if self.ordinate.unit is None or self.denominator.unit is None:
            return self.ordinate.unit
        return f"{self.ordinate.unit}/{self.denominator.unit}"

    @property
    def axis_name(self) -> str:
        """The abscissa's name."""
        return self.abscissa.label or _AXES.get(self.abscissa.kind, "Abscissa")


def parse(source: ByteSource, dataset: Dataset) -> Function:
    """The header of the dataset 58 that ``dataset`` is."""
    lines, offset = [], dataset.begin
    for _ in range(11):
        lines.append(line_at(source, offset).decode("latin-1").rstrip("\r\n"))
        offset += len(line_at(source, offset))
    try:
        return _parsed(lines, dataset, offset)
    except (ValueError, IndexError) as error:
        raise damaged(source.path, f"dataset 58 at byte {dataset.begin}: header cannot be read ({error})") from error


def _parsed(lines: list[str], dataset: Dataset, offset: int) -> Function:
    dof, form = lines[5], lines[6].split()
    kind, count, even = int(form[0]), int(form[1]), int(form[2]) != 0
    if kind not in (2, 4, 5, 6) or not 0 <= count < 1 << 40:
        raise ValueError(f"data type {kind} with {count} values")
    start, step = (float(text.replace("D", "E")) for text in form[3:5])
    return Function(
        ids=tuple(line.strip() for line in lines[:5]),
        kind=_integer(dof[0:5]),
        node=(dof[31:41].strip(), _integer(dof[41:51]), _integer(dof[51:55])),
        reference=(dof[56:66].strip(), _integer(dof[66:76]), _integer(dof[76:80])),
        is_complex=kind in (5, 6),
        is_double=kind in (4, 6),
        samples=count,
        even=even,
        start=start,
        step=step,
        step_text=form[4],
        abscissa=_axis(lines[7]),
        ordinate=_axis(lines[8]),
        denominator=_axis(lines[9]),
        dataset=dataset,
        data=offset,
    )


def _axis(line: str) -> Axis:
    return Axis(_integer(line[0:10]), _said(line[26:46]), _said(line[47:67]))


def _said(text: str) -> str | None:
    return None if text.strip() in ("", "NONE") else text.strip()


def _integer(text: str) -> int:
    return int(text) if text.strip() else 0
