"""What witnesses state about a run, and what the run table or the other runs state about it."""

from dataclasses import dataclass
from typing import Annotated

from balance.results import Key

from ..recording import Finding

WITHHOLDING = {
    "counter_mass_contradiction": "counter-masses",
    "axis_contradiction": "axis",
    "gain_contradiction": "gain",
    "flat_channel": "dead",
    "copied_run": "copy",
}
"""Contradictions after which a number is withheld, and their subjects."""
MARKING = {
    "payload_contradiction": "payload",
    "acceleration_contradiction": "acceleration",
    "motion_contradiction": "axis",
    "encoder_contradiction": "axis",
    "level_drift": "rest",
    "sign_contradiction": "sign",
    "force_sign": "sign",
    "torque_contradiction": "gain",
}
"""Contradictions after which a number is marked: it is right, but of another condition, or of a sensor to look at."""
SUBJECTS = WITHHOLDING | MARKING
ADVICE = {
    "counter_mass_contradiction": "check which runs had counter-masses, correct the run table and ingest again",
    "axis_contradiction": "check which channel is which axis in the rig and the log, and whether the sensor was turned",
    "gain_contradiction": "check the sensor's sensitivity and the amplifier's range; testbench calibrate corrects them",
    "flat_channel": "check the sensor, its cable and its supply; repeat the run",
    "level_drift": "check the sensor's zero and its supply; amplitudes leave it out unless --band starts at 0",
    "copied_run": "it counts once; remove the copy from the campaign, or ingest the log that was meant",
    "payload_contradiction": "weigh what the platform carried, correct the run table and ingest again",
    "acceleration_contradiction": "correct {column} in the run table and ingest again",
    "motion_contradiction": "correct the motion in the run table and ingest again",
    "encoder_contradiction": "check in rig and log which channel is which encoder, their signs, zeros and units",
    "sign_contradiction": "check the direction in which the sensor is mounted and the sign of its sensitivity",
    "force_sign": "check its sign in the rig and the wiring, and whether it is exchanged with another channel",
    "torque_contradiction": "check units in rig and log, payload and counter-masses in the run table",
}
"""What to do about each contradiction."""


@dataclass(frozen=True)
class Statement:
    """One statement about a run, by one kind of witness."""

    run: Annotated[str, Key("", "run")]
    subject: Annotated[str, Key("", "about")]
    """``payload``, ``acceleration``, ``axis``, ``sign``, ``gain``, ``copy``, ``rest``, ``dead``, ``counter-masses``."""
    channel: Annotated[str | None, Key("", "channel", lambda channel: channel or "-")]
    """The channel that it is about; None: the whole run."""
    stated: Annotated[str, Key("", "stated")]
    """By the run table, the rig or the other runs."""
    witnessed: Annotated[str, Key("", "witnessed")]
    """By the witness, with its interval where it has one."""
    witness: Annotated[str, Key("", "by")]
    code: Annotated[str | None, Key("", "finding", lambda code: code or "-")] = None
    """Of the contradiction; None where both agree."""
    others: Annotated[tuple[str, ...], Key(None, "")] = ()
    """Other runs that it is about, such as the one that was copied."""
    column: Annotated[str, Key(None, "")] = ""
    """Column of the run table to correct, where the code has several."""

    @property
    def advice(self) -> Annotated[str | None, Key("", "what to do", lambda advice: advice or "-")]:
        """What to do about a contradiction."""
        return None if self.code is None else ADVICE[self.code].format(column=self.column)

    @property
    def finding(self) -> Finding:
        """The contradiction as a finding."""
        assert self.code is not None
        about = f"{self.channel}: {self.subject}" if self.channel else self.subject
        message = f"{self.run}: {about}: {self.stated}, but {self.witness}: {self.witnessed}; {self.advice}"
        return Finding(self.code, self.channel, " ".join((self.run, *self.others)), message)
