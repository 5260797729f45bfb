"""Run every step; pictures and data go to ``demo-output``."""

import shutil
import subprocess
import sys
import time
from pathlib import Path

from demo import campaign, counter_masses


def main() -> None:
    """Run the demonstration in a fresh output folder; the last step beside the others, in a process of its own."""
    out = Path("demo-output")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    started = time.perf_counter()
    with subprocess.Popen([sys.executable, "-m", "demo.arm", out], stdout=subprocess.PIPE, encoding="utf-8") as arm:
        counter_masses.run(out)
        campaign.run(out)
        print(arm.communicate()[0], end="")
    if arm.returncode:
        sys.exit(arm.returncode)
    print(f"\nDone in {time.perf_counter() - started:.0f} s.")


if __name__ == "__main__":
    main()
