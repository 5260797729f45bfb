"""Step 4: the measured logs of a two-joint arm, recorded and published by others."""

import sys
from pathlib import Path

from testbench import public_recordings

from .console import command, heading, saved

ARMS = {"two-joint-arm-a0": "09_double_pendulum_A0_061705.csv", "two-joint-arm-c1": "10_double_pendulum_C1_154548.csv"}
"""The mechanism and rig of each recording."""


def run(out: Path) -> None:
    """Ingest each log that is at hand, identify first moments, and say which counter-masses would balance the arm."""
    heading("4. A real arm's logs: first moments from torque, and the counter-masses that would balance it")
    for arm, file in ARMS.items():
        path = public_recordings.local_recording(file)
        if path is None:
            print(f"   {file} is not at hand: name its folder in COUNTERPOISE_RECORDINGS. Left out.")
        else:
            _identify(out, arm, path)
    print("   Without -q: each first moment beside what those who recorded the logs published for their design.")


def _identify(out: Path, arm: str, log: Path) -> None:
    recording = public_recordings.recording_named(log.name)
    print(f"   {log.name}: measured by others, {recording.credit}")
    sheet = out / f"{arm}.csv"
    sheet.write_text(f"file,origin\n{log.name},measured\n", encoding="utf-8")
    options = ["--rig", arm, "--runs", sheet.name, "-o", arm]
    command(["testbench", "ingest", log, *options], out, shown=f"testbench ingest {log.name} {' '.join(options)}")
    command(["testbench", "identify", arm, f"{arm}/{log.stem}.h5", "--figure", f"{arm}.png", "-q"], out)
    saved(out / f"{arm}.png", "measured torque beside the model's")


if __name__ == "__main__":
    run(Path(sys.argv[1]))
