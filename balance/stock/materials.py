"""Materials and their densities, from a small TOML file."""

from collections.abc import Mapping
from pathlib import Path

from .. import datasets
from ..errors import DataError
from ..sheet import Sheet

SHIPPED = "kiper2019"
"""The shipped materials: those of the source's plates."""
_KG_PER_M3_IN_G_PER_MM3 = 1e6


def load(name: str | Path = SHIPPED) -> Mapping[str, float]:
    """Densities by material [kg/m3], from shipped materials by name or a TOML file with ``[density_g_per_mm3]``.

    Raises DataError, naming the material, for a density that is no number above zero.
    """
    sheet = Sheet.load(datasets.find(name, "materials", ".toml"))
    table = sheet.sheet("density_g_per_mm3")
    found = {material: table.number(material) * _KG_PER_M3_IN_G_PER_MM3 for material in table.keys()}  # noqa: SIM118
    sheet.text("source", "")
    sheet.finish()
    if wrong := [material for material, density in found.items() if not 0.0 < density < 1e5]:
        raise DataError(f"{sheet.where}: density of {wrong[0]!r}: expected a number above zero, in g/mm3")
    return found
