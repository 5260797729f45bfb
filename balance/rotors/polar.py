"""Vectors of a rotor as complex numbers: magnitude, angle from the rotor's mark."""

import cmath
import math


def angle_deg(vector: complex) -> float:
    """Angle of a vector from the mark, 0 up to 360 [deg]; 0 for a vector of no length."""
    turned = math.degrees(cmath.phase(vector)) % 360.0
    return 0.0 if turned == 360.0 else turned + 0.0


def polar(vector: complex, factor: float = 1.0, digits: int = 6, unit: str = "") -> str:
    """``133.752 g @ 348.041 deg`` for people, the magnitude times ``factor``; below 1e-9 it is 0."""
    named = f" {unit}" if unit else ""
    if factor * abs(vector) < 1e-9:
        return f"0{named}"
    return f"{factor * abs(vector):.{digits}g}{named} @ {round(angle_deg(vector), 3) % 360.0:.3f} deg"


def document(vector: complex, unit: str, factor: float = 1.0) -> dict[str, float]:
    """A vector for JSON: magnitude, angle and components, the magnitude's unit in the keys."""
    return {
        f"magnitude_{unit}": factor * abs(vector),
        "angle_deg": angle_deg(vector),
        f"x_{unit}": factor * vector.real,
        f"y_{unit}": factor * vector.imag,
    }
