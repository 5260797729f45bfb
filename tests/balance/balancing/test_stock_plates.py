"""Stock plates: mass and inertia as drawn against sums over small pieces, densities; wrong rows are named."""

import math
from pathlib import Path

import numpy as np
import pytest

from balance.balancing import stock_plates
from balance.balancing.stock_plates import Hole, Rectangle, Ring, plate_section
from balance.errors import DataError


def test_the_described_densities_are_those_shipped() -> None:
    """Where the key of a stock list is described, so also in the docs."""
    text = stock_plates.StockRow.model_fields["material"].description
    for material, density in stock_plates.load_densities().items():
        assert f"{material} {density:g}" in " ".join(text.split())


def test_shipped_stock() -> None:
    """Four plates, two of each."""
    plates = stock_plates.load_stock("kiper2019")
    assert plates[0] == stock_plates.Plate("M1", 5.02746, 2)
    assert len(plates) == 4
    assert stock_plates.plates_mass(["M1", "M2", "M4"], plates) == pytest.approx(17.24375)


def test_a_file_as_spreadsheets_write_it(tmp_path: Path) -> None:
    """A byte-order mark, CRLF and blanks do not matter; the columns may stand in any order."""
    path = tmp_path / "plates.csv"
    path.write_bytes("\ufeffquantity,name,mass_kg\r\n3, small ,0.5\r\n".encode())
    assert stock_plates.load_stock(path) == [stock_plates.Plate("small", 0.5, 3)]
    path.write_bytes(b"name;mass_kg;quantity\r\n2,5er;2,5;3\r\nlarge;5;1\r\n")
    assert stock_plates.load_stock(path) == [stock_plates.Plate("2,5er", 2.5, 3), stock_plates.Plate("large", 5.0, 1)]
    path.write_text("name;mass_kg;quantity\n2,5;2,5;3\n", encoding="utf-8")
    assert stock_plates.load_stock(path) == [stock_plates.Plate("2,5", 2.5, 3)]


def test_other_units_stand_in_the_header(tmp_path: Path) -> None:
    """Grams, inches, and the density of a material that is not shipped is stated."""
    path = tmp_path / "plates.csv"
    for header in (
        "name;mass (g);quantity",
        "name;mass_g;quantity",
        "name;mass [g];quantity",
        "Name;Mass (g);Quantity",
    ):
        path.write_text(f"{header}\n1,5;1250,5;3\n", encoding="utf-8")
        assert stock_plates.load_stock(path) == [stock_plates.Plate("1,5", 1.2505, 3)]
    sizes = "name,quantity,shape,material,thickness_in,length (in),width_in"
    path.write_text(f"{sizes}\nP,1,rectangle,steel,0.25,6,4\n", encoding="utf-8")
    assert stock_plates.load_stock(path)[0].mass == pytest.approx(7830 * 6 * 0.0254**3)
    path.write_text(f"{sizes},density_g_per_cm3\nP,1,rectangle,brass,0.25,6,4,8.5\n", encoding="utf-8")
    assert stock_plates.load_stock(path)[0].mass == pytest.approx(8500 * 6 * 0.0254**3)


WRONG = {
    "no rows": ("name,mass_kg,quantity\n", "at least one plate"),
    "other columns": ("name,mass,quantity\nM1,5,2\n", "column 'mass': is not expected; did you mean 'mass_kg'"),
    "unlike any": ("name,weigh,quantity\nM1,5,2\n", r"'weigh': .*, holes_mm \(or in another unit, such as mass_g\)"),
    "empty": ("", "no column 'name': expected name of the plate"),
    "decimal comma": ('name,mass_kg,quantity\nM1,"5,02",2\n', "line 2 .M1.: mass_kg: '5,02': expected a number"),
    "half a plate": (
        "name,mass_kg,quantity\nM1,5,2\nM2,5,1.5\n",
        "line 3 .M2.: quantity: '1.5': expected a whole number",
    ),
    "two marks": ("name;mass_kg;quantity\nM1;5,5;2\nM2;5.5;1", r"decimal commas \(line 2\) and .* points \(line 3\)"),
    "negative mass": ("name,mass_kg,quantity\nM1,-5,2\n", "mass_kg: '-5': expected more than zero"),
    "no mass": ("name,mass_kg,quantity\nM1,nan,2\n", "mass_kg: 'nan': expected a number"),
    "grams": ("name,mass_kg,quantity\nM1,5027 g,2\n", "mass_kg: '5027 g': expected a number"),
    "negative quantity": ("name,mass_kg,quantity\nM1,5,-2\n", "quantity: '-2': expected zero or more"),
    "nameless": ("name,mass_kg,quantity\n ,5,2\n", "name: missing: expected name of the plate"),
    "short row": ("name,mass_kg,quantity\nM1,5\n", "line 2 .M1.: quantity: missing"),
    "long row": ("name,mass_kg,quantity\nM1,5,2,7\n", "line 2: 4 cells, the header has 3 columns"),
    "long second row": ("name,mass_kg,quantity\nM1,5,2\nM2,6,2,7\n", "line 3: 4 cells, the header has 3 columns"),
    "another unit": ("name,mass_mm,quantity\nM1,5,2\n", "column 'mass_mm': 'mm' is not a unit of mass: .* 'kg'"),
    "no unit": ("name,mass (q!),quantity\nM1,5,2\n", "column 'mass .q!.': 'q!' is not a known unit: expected mass"),
    "two units": (
        "name,mass_kg,mass_g,quantity\nM1,5,5,2\n",
        "columns 'mass_kg' and 'mass_g': state mass_kg more than once: keep one",
    ),
    "a unit besides": (
        "name,mass_kg (g),quantity\nM1,5,2\n",
        r"column 'mass_kg \(g\)': .*: write 'mass_kg', or 'mass \(g\)'",
    ),
    "a unit of a number": ("name,mass_kg,quantity (pcs)\nM1,5,2\n", r"column 'quantity \(pcs\)': .*: write 'quantity'"),
    "negative grams": ("name,mass_g,quantity\nM1,-5,2\n", "column 'mass_g', '-5' as mass_kg: '-0.005': expected more"),
    "grams with a unit": ("name,mass_g,quantity\nM1,5 g,2\n", "column 'mass_g': '5 g': expected a number"),
    "underscore in grams": ("name,mass_g,quantity\nM1,5_00,2\n", "column 'mass_g': '5_00': expected a number"),
    "underscore": ("name,mass_kg,quantity\nM1,5_00,2\n", "mass_kg: '5_00': expected a number"),
    "underscore in quantity": ("name,mass_kg,quantity\nM1,5,2_0\n", "quantity: '2_0': expected a number"),
    "weighed, of a material": ("name,mass_kg,quantity,material\nM1,5,2,steel\n", "material is given: .* was weighed"),
    "weighed, of a density": (
        "name,mass_kg,quantity,density_g_per_cm3\nM1,5,2,7.8\n",
        "density_g_per_cm3 is given: .* was weighed",
    ),
    "weighed, with holes": ("name,mass_kg,quantity,holes_mm\nM1,5,2,0 0 5\n", "holes_mm is given: .* was weighed"),
    "twice": ("name,mass_kg,quantity\nM1,5,2\nM1,6,2\n", "'M1' is there twice"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_stock_is_refused(tmp_path: Path, case: str) -> None:
    """File, row, what was found and what was expected."""
    content, message = WRONG[case]
    (tmp_path / "plates.csv").write_text(content, encoding="utf-8")
    with pytest.raises(DataError, match=rf"plates\.csv.*{message}"):
        stock_plates.load_stock(tmp_path / "plates.csv")


def test_not_text_and_not_there(tmp_path: Path) -> None:
    """A file in another encoding, and a stock that is not shipped."""
    (tmp_path / "plates.csv").write_bytes("name,mass_kg,quantity\nÇelik,5,2\n".encode("cp1254"))
    with pytest.raises(DataError, match=r"plates\.csv: not UTF-8 at byte"):
        stock_plates.load_stock(tmp_path / "plates.csv")
    with pytest.raises(DataError, match=r"shelf: no such file.*kiper2019"):
        stock_plates.load_stock("shelf")


def test_unknown_plates_are_listed() -> None:
    """A plate that is not in stock."""
    with pytest.raises(DataError, match="no plate 'M9' in stock: there are M1, M2, M3, M4"):
        stock_plates.plates_mass(["M1", "M9"], stock_plates.load_stock("kiper2019"))


HEADER = "name,quantity,shape,material,thickness_mm,length_mm,width_mm,diameter_mm,bore_mm,holes_mm\n"


def test_plates_as_drawn(tmp_path: Path) -> None:
    """A steel block of 160 x 100 x 40 mm weighs 5.0112 kg; a ring is a disc less its bore; columns not needed go."""
    (tmp_path / "drawn.csv").write_text(
        HEADER + "block,2,rectangle,steel,40,160,100,,,\nring,1,ring,7075 aluminium,10,,,100,60,\n", encoding="utf-8"
    )
    block, ring = stock_plates.load_stock(tmp_path / "drawn.csv")
    assert (block.mass, block.quantity) == (pytest.approx(5.0112), 2)
    assert block.inertia == pytest.approx(5.0112 * (0.16**2 + 0.1**2) / 12)
    assert ring.mass == pytest.approx(2810 * 0.01 * math.pi * (0.05**2 - 0.03**2))
    assert ring.inertia == pytest.approx(ring.mass * (0.05**2 + 0.03**2) / 2)
    (tmp_path / "discs.csv").write_text(
        "name,quantity,shape,material,thickness_mm,diameter_mm\nd,1,disc,5000 aluminium,10,100\n", encoding="utf-8"
    )
    assert stock_plates.load_stock(tmp_path / "discs.csv")[0].mass == pytest.approx(2647.27 * 0.01 * math.pi * 0.05**2)


def test_the_shipped_example_can_be_read() -> None:
    """Every plate of it has mass and inertia."""
    plates = stock_plates.load_stock("example-plates")
    assert len(plates) == 4
    assert all(plate.inertia is not None and plate.inertia > 0.0 for plate in plates)


DRAWN_WRONG = {
    "shape": ("p,1,hexagon,steel,10,,,50,,", "shape: 'hexagon': expected 'rectangle', 'disc' or 'ring'"),
    "material": ("p,1,disc,gold,10,,,50,,", "material 'gold': expected 7075 aluminium, steel.* density_kg_per_m3"),
    "size missing": ("p,1,rectangle,steel,10,50,,,,", "width_mm is empty: expected a number above zero"),
    "size for another shape": ("p,1,disc,steel,10,50,,50,,", "length_mm is nothing of a disc"),
    "bore too wide": ("p,1,ring,steel,10,,,50,50,", "bore_mm is not smaller"),
    "no thickness": ("p,1,disc,steel,0,,,50,,", "thickness_mm: '0': expected more than zero"),
    "not a number": ("p,1,disc,steel,10,,,5O,,", "diameter_mm: '5O': expected a number"),
    "hole outside": ("p,1,disc,steel,10,,,50,,22 0 8", "hole 1 is not within the plate"),
    "holes that meet": ("p,1,disc,steel,10,,,50,,0 0 8; 5 0 8", "holes 1 and 2 overlap"),
    "hole in the bore": ("p,1,ring,steel,10,,,50,20,11 0 8", "hole 1 is not within the plate"),
    "half a hole": ("p,1,disc,steel,10,,,50,,5 0", "holes_mm: '5 0': expected 'x y diameter"),
    "a hole of nothing": ("p,1,disc,steel,10,,,50,,5 0 0", "a diameter above zero"),
    "density of a shipped material": (
        "7850,p,1,disc,steel,10,,,50,,",
        "density_kg_per_m3 is given, though steel has 7830",
    ),
    "size in inches": ("p,1,rectangle,steel,10,50,,,,", "width_in is empty: expected a number above zero"),
    "holes in inches": ("p,1,disc,steel,10,,,50,,0 0 1", "column 'holes_in': is in mm alone: write 'holes_mm'"),
    "quantity": ("p,half,disc,steel,10,,,50,,", "quantity: 'half': expected a whole number"),
}


OTHER_HEADERS = {
    "density of a shipped material": f"density_kg_per_m3,{HEADER}",
    "size in inches": HEADER.replace("_mm,", "_in,"),
    "holes in inches": HEADER.replace("holes_mm", "holes_in"),
}


@pytest.mark.parametrize("case", DRAWN_WRONG)
def test_wrong_plates_as_drawn_are_refused(tmp_path: Path, case: str) -> None:
    """File, row, what was found and what was expected."""
    row, message = DRAWN_WRONG[case]
    (tmp_path / "drawn.csv").write_text(f"{OTHER_HEADERS.get(case, HEADER)}{row}\n", encoding="utf-8")
    with pytest.raises(DataError, match=rf"drawn\.csv.*: .*{message}"):
        stock_plates.load_stock(tmp_path / "drawn.csv")


def test_a_stock_has_masses_or_drawings_not_both(tmp_path: Path) -> None:
    """A mass together with a drawing could contradict it."""
    (tmp_path / "both.csv").write_text(HEADER.strip() + ",mass_kg\nboth,1,disc,steel,10,,,50,,,3\n", encoding="utf-8")
    with pytest.raises(
        DataError, match=r"both\.csv, line 2 .both.: expected either mass_kg, of a plate weighed, or shape, as drawn"
    ):
        stock_plates.load_stock(tmp_path / "both.csv")
    (tmp_path / "thick.csv").write_text("name,mass_kg,quantity,thickness_mm\nt,1,1,10\n", encoding="utf-8")
    with pytest.raises(DataError, match="thickness_mm is given: a plate that was weighed has no sizes"):
        stock_plates.load_stock(tmp_path / "thick.csv")


DENSITY, THICKNESS = 7830.0, 0.012


def _by_pieces(inside, reach: float, holes: list[Hole]) -> tuple[float, float, np.ndarray]:
    """Mass, inertia about the centre of mass, and centre, of 1500 x 1500 small squares."""
    side = np.linspace(-reach, reach, 1501)
    x, y = np.meshgrid(*[0.5 * (side[1:] + side[:-1])] * 2)
    there = inside(x, y)
    for hole in holes:
        there &= np.hypot(x - hole.x, y - hole.y) > hole.diameter / 2
    piece = DENSITY * THICKNESS * (side[1] - side[0]) ** 2
    centre = np.array([x[there].mean(), y[there].mean()])
    return piece * there.sum(), piece * ((x[there] - centre[0]) ** 2 + (y[there] - centre[1]) ** 2).sum(), centre


@pytest.mark.parametrize("seed", range(4))
def test_a_rectangle_with_holes(seed: int) -> None:
    """Off-centre holes of random size: mass, inertia and centre as summed over small pieces."""
    rng = np.random.default_rng(seed)
    holes = [Hole(x, rng.uniform(-0.01, 0.01), rng.uniform(0.01, 0.03)) for x in (-0.05, 0.0, 0.045)]
    found = plate_section(Rectangle(0.16, 0.08), THICKNESS, DENSITY, holes)
    mass, inertia, centre = _by_pieces(lambda x, y: (abs(x) < 0.08) & (abs(y) < 0.04), 0.08, holes)
    assert found.mass == pytest.approx(mass, rel=2e-3)
    assert found.inertia == pytest.approx(inertia, rel=3e-3)
    assert found.centre == pytest.approx(centre, abs=2e-5)
    assert found.radius_of_gyration == pytest.approx((inertia / mass) ** 0.5, rel=2e-3)


def test_a_ring_with_holes() -> None:
    """The same for a ring."""
    holes = [Hole(0.04, 0.0, 0.01), Hole(0.0, 0.04, 0.02)]
    found = plate_section(Ring(0.12, 0.05), THICKNESS, DENSITY, holes)
    mass, inertia, centre = _by_pieces(lambda x, y: (np.hypot(x, y) < 0.06) & (np.hypot(x, y) > 0.025), 0.06, holes)
    assert found.mass == pytest.approx(mass, rel=2e-3)
    assert found.inertia == pytest.approx(inertia, rel=3e-3)
    assert found.centre == pytest.approx(centre, abs=2e-5)


def test_a_bore_is_a_hole_in_the_middle() -> None:
    """A ring equals a disc with one hole."""
    ring = plate_section(Ring(0.1, 0.04), THICKNESS, DENSITY)
    bored = plate_section(Ring(0.1), THICKNESS, DENSITY, [Hole(0.0, 0.0, 0.04)])
    assert (ring.mass, ring.inertia) == pytest.approx((bored.mass, bored.inertia), rel=1e-12)


def test_holes_may_touch_but_not_meet() -> None:
    """Rims that touch are allowed; a micrometre more is an area that would count twice."""
    plate_section(
        Rectangle(0.1, 0.1), THICKNESS, DENSITY, [Hole(-0.01, 0, 0.02), Hole(0.01, 0, 0.02), Hole(0, 0.045, 0.01)]
    )
    with pytest.raises(DataError, match="holes 1 and 2 overlap"):
        plate_section(Rectangle(0.1, 0.1), THICKNESS, DENSITY, [Hole(-0.01, 0, 0.02), Hole(0.01 - 1e-6, 0, 0.02)])
    with pytest.raises(DataError, match="hole 1 is not within the plate"):
        plate_section(Rectangle(0.1, 0.1), THICKNESS, DENSITY, [Hole(0, 0.045 + 1e-6, 0.01)])


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
