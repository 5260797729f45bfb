"""List the benchmarks, or run all of them: ``python -m benchmarks [--list] [--brief]``."""

import argparse
import subprocess
import sys

BENCHMARKS = {
    "dynamics": ("closure, wrench and torque of a trajectory against a loop over Pinocchio", ["--samples", "20000",
                 "--peer-samples", "500", "--rounds", "3"]),
    "designs": ("many designs on one motion against MuJoCo's inverse dynamics", ["--rounds", "3",
                "--peer-designs", "5"]),
    "workers": ("many designs on two Dask workers against one", ["--designs", "100000", "--rounds", "1"]),
    "drive": ("steady state of a motor-driven machine against integrating to it from standstill", ["--rounds", "3"]),
    "store": ("one channel read back against np.copy", ["--samples", "2000000", "--rounds", "3"]),
    "ingest": ("CSV into HDF5 against pandas and h5py", ["--mb", "60", "--rounds", "1"]),
    "tdms": ("TDMS of short segments into HDF5 against npTDMS and h5py", ["--segments", "500", "--rounds", "1"]),
    "spectra": ("power spectral density of a long channel against scipy.signal.welch", ["--samples", "2000000",
                "--rounds", "3"]),
    "startup": ("start of a command against bare Python's", ["--rounds", "3"]),
    "analysis": ("a campaign analysed against scipy on whole channels", ["--runs", "6", "--rounds", "2"]),
    "viewer": ("a long run panned in Chromium: pictures a second, new samples in each", ["--samples", "2000000",
               "--rounds", "1"]),
    "mdf": ("MDF 4 into HDF5 against asammdf, by peak memory", ["--mb", "40", "--rounds", "1"]),
}  # fmt: skip
"""Module of each benchmark, what it measures, and the options of a brief run."""


def main() -> int:
    """Run the benchmarks one after the other, each in its own process; 1 where one fails or falls short."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Run the benchmarks.")
    parser.add_argument("--list", action="store_true", help="list them and stop")
    parser.add_argument("--brief", action="store_true", help="little work, rough ratios")
    options = parser.parse_args()
    codes = []
    for name, (what, brief) in BENCHMARKS.items():
        print(f"benchmarks.{name}: {what}", flush=True)
        if not options.list:
            command = [sys.executable, "-m", f"benchmarks.{name}", *(brief if options.brief else [])]
            codes.append(subprocess.run(command, check=False).returncode)
            print(flush=True)
    return int(any(code not in (0, 1) if options.brief else code for code in codes))


if __name__ == "__main__":
    raise SystemExit(main())
