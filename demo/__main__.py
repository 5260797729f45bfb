"""Run every step; pictures and data go to ``demo-output``."""

import shutil
import time
from pathlib import Path

from demo import arm, campaign, counter_masses


def main() -> None:
    """Run the demonstration in a fresh output folder."""
    out = Path("demo-output")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    started = time.perf_counter()
    counter_masses.run(out)
    campaign.run(out)
    arm.run(out)
    print(f"\nDone in {time.perf_counter() - started:.0f} s.")


if __name__ == "__main__":
    main()
