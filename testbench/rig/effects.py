"""What a real bench has and an ideal one has not: tables of ``[bench]``, each left out unless the rig states it.

Levels and scatter stand in the rig, as on data sheets. What was drawn from them is written with the truth of a
simulated campaign and nowhere else.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from balance.input_files import Table

from . import schema

Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Direction = tuple[float, float, float]
FloorLevel = Literal["workshop", "office", "residential", "operating theatre", "VC-A", "VC-B", "VC-C", "VC-D", "VC-E"]


class Rotor(Table):
    """The rotor of a motor on the base, and the gear between it and its joint."""

    inertia: schema.Inertia
    """About its own axis, brake and first gear stage included [kg m2]."""
    ratio: float = Field(default=1.0, allow_inf_nan=False)
    """Turns of the rotor per turn of the joint; negative where the gear reverses."""
    axis: Direction = (0.0, 0.0, 1.0)
    """Of the rotor in the base frame, of any length; with a positive ratio it turns with the joint about it."""

    @model_validator(mode="after")
    def _has_direction(self) -> "Rotor":
        if not any(self.axis):
            raise ValueError("axis: expected a direction, found 0, 0, 0")
        return self


class Roughness(Table):
    """Residual broadband wrench of drives, gears and joints on the base: flat within a band, each axis for itself."""

    force: schema.Forces | None = None
    """Root mean square [N]."""
    moment: schema.Moments | None = None
    """Root mean square, about the origin of the base frame [N m]."""
    band: tuple[schema.Frequency, schema.Frequency] = (20.0, 500.0)
    """[Hz]"""

    @model_validator(mode="after")
    def _rises(self) -> "Roughness":
        if not self.band[0] < self.band[1]:
            raise ValueError(
                f"band: expected a lower and a higher frequency, found {self.band[0]:g}, {self.band[1]:g} Hz"
            )
        return self


class Mode(Table):
    """An elastic mode of the frame on top of its motion as a rigid body, excited by what the mechanism exerts on it."""

    frequency: schema.Frequency
    """Natural frequency [Hz]."""
    damping: float = Field(gt=0.0, lt=1.0)
    """Share of critical damping."""
    mass: schema.Mass
    """Modal mass, for the shape as it is written here [kg]."""
    translation: Direction = (0.0, 0.0, 0.0)
    """Shape where the mechanism stands, at the origin of the base frame."""
    rotation: Direction = (0.0, 0.0, 0.0)
    """Its rotation there [rad/m]."""
    at: dict[str, Direction]
    """Shape at accelerometers on the base, by sensor."""


class SensorErrors(Table):
    """How far a sensor is from its data sheet: standard deviations, from which one value a campaign is drawn."""

    sensitivity: Share = 0.0
    """Of the calibration factor of each channel: true, and unknown to the analysis."""
    cross: Share = 0.0
    """Of what a channel sees of each other channel of its sensor; between unlike units as a share of the ranges."""
    offset: Share = 0.0
    """Preload or zero offset, as a share of the range."""
    drift_per_minute: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)
    """Of the zero, as a share of the range, from the reset when the loggers start: a charge amplifier's."""
    high_pass: schema.Frequency | None = None
    """Corner of an AC-coupled sensor, first order [Hz]; None: it sees what stands still."""
