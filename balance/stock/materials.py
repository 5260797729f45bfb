"""Materials and their densities, from a small TOML file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field

from .. import datasets
from ..input_files import Positive, Table, load_model

SHIPPED = "kiper2019"
"""The shipped materials: those of the source's plates."""
_KG_PER_M3_IN_G_PER_MM3 = 1e6


class MaterialsTable(Table):
    """Densities of materials."""

    source: str = ""
    """Where they are from."""
    density_g_per_mm3: dict[str, Annotated[Positive, Field(lt=0.1)]]
    """Densities by material [g/mm3]: steel has 0.00783."""


def load(name: str | Path = SHIPPED) -> Mapping[str, float]:
    """Densities by material [kg/m3], from shipped materials by name or a TOML file with ``[density_g_per_mm3]``.

    Raises DataError, naming the material, for a density that is no number above zero.
    """
    table = load_model(MaterialsTable, datasets.find(name, "materials", ".toml"))
    return {material: density * _KG_PER_M3_IN_G_PER_MM3 for material, density in table.density_g_per_mm3.items()}
