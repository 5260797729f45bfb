"""Pictures of the mechanics."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def panels(
    width: float,
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    grid: bool = True,
    **how: Any,  # noqa: ANN401
) -> "tuple[Figure, Any]":
    """A figure of a width and height [inch] and its axes (rows, columns), with a light grid unless told otherwise.

    ``how`` goes to ``Figure.subplots``.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **how)
    for one in axes.flat if grid else ():
        one.grid(alpha=0.25)
    return figure, axes
