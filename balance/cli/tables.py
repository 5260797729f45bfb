"""How numbers are printed for people."""


def mass(kilograms: float) -> str:
    """Mass to 0.1 g."""
    return f"{kilograms:.4f}"


def first_moment(value: float) -> str:
    """First moment of mass with its unit."""
    return f"{value:.4g} kg m"


def per_cent(value: float | None) -> str:
    """Per cent, or a dash where there is nothing to compare with."""
    return "-" if value is None else f"{value:.3g} %"
