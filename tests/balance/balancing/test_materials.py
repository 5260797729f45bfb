"""Densities of materials."""

from pathlib import Path

import pytest

from balance.balancing import stock_plates
from balance.errors import DataError


def test_shipped_materials() -> None:
    """The source's, read as g/mm3: steel is 7830 kg/m3."""
    assert stock_plates.load_densities() == pytest.approx(
        {"7075 aluminium": 2810.0, "steel": 7830.0, "5000 aluminium": 2647.27}
    )


def test_wrong_densities_are_refused(tmp_path: Path) -> None:
    """Zero, and a density typed in kg/m3, name the material."""
    for value, expected in (("0.0", "more than zero"), ("7830", "less than 0.1")):
        (tmp_path / "m.toml").write_text(f"[density_g_per_mm3]\niron = {value}\n", encoding="utf-8")
        with pytest.raises(DataError, match=rf"m\.toml: density_g_per_mm3\.iron: .*: expected {expected}"):
            stock_plates.load_densities(tmp_path / "m.toml")
