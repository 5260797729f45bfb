"""Mass and inertia of plates against sums over small pieces, and what holes may be."""

import numpy as np
import pytest

from balance.balancing.plate_geometry import Hole, Rectangle, Ring, plate_section
from balance.errors import DataError

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
    with pytest.raises(DataError, match="holes 1 and 2 meet"):
        plate_section(Rectangle(0.1, 0.1), THICKNESS, DENSITY, [Hole(-0.01, 0, 0.02), Hole(0.01 - 1e-6, 0, 0.02)])
    with pytest.raises(DataError, match="hole 1 leaves the plate"):
        plate_section(Rectangle(0.1, 0.1), THICKNESS, DENSITY, [Hole(0, 0.045 + 1e-6, 0.01)])
