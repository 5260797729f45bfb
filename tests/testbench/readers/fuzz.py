"""A long campaign of damaged files, seed after seed: ``python tests/testbench/readers/fuzz.py --minutes 5``.

Each copy must be read to its end, or be refused by a message with its name, within seconds. Public recordings are
damaged too where ``COUNTERPOISE_RECORDINGS`` names their folder. Exit code 1 if any copy did otherwise.
"""

import argparse
import itertools
import os
import shutil
import sys
import tempfile
import time
import warnings
from pathlib import Path

COPIES = 16


def main():
    """Damage and read until the time is up; print what failed with what makes it again."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--minutes", type=float, default=1.0, help="how long [min]")
    options.add_argument("--seed", type=int, default=1000, help="the first seed")
    options.add_argument("--only", default="", help="files whose name contains this")
    given = options.parse_args()
    sys.path.insert(0, str(Path(__file__).parents[1]))
    with tempfile.TemporaryDirectory() as folder:
        failures, copies = campaign(Path(folder), time.monotonic() + 60 * given.minutes, given.seed, given.only)
    sys.stdout.write(f"{copies} damaged copies, {len(failures)} failures\n")
    return 1 if failures else 0


def campaign(folder, until, first_seed, only):
    """Failures as texts, and the number of copies read."""
    from readers import damage

    failures, copies = [], 0
    wholes = {name: content for name, content in _files(folder) if only in name}
    for seed in itertools.count(first_seed):
        for name, whole in wholes.items():
            for i, content in enumerate(damage.copies(whole, COPIES, seed)):
                if time.monotonic() > until:
                    return failures, copies
                copies += 1
                if error := _failure(folder / name, content):
                    failures.append(f"{name}, seed {seed}, copy {i}: {error}")
                    sys.stdout.write(f"{failures[-1]}\n")
                    sys.stdout.flush()
    return failures, copies


def _files(folder):
    """Examples of every format, and the public recordings that are short enough."""
    from readers import examples

    for name in examples.ALL:
        yield name, examples.make(folder, name).read_bytes()
    real = Path(os.environ.get("COUNTERPOISE_RECORDINGS", folder / "none"))
    for path in sorted(real.glob("*")) if real.is_dir() else ():
        if path.is_file() and path.suffix != ".md" and path.stat().st_size < 4 << 20:
            shutil.copy(path, folder)
            yield path.name, path.read_bytes()


def _failure(path, content):
    from readers import test_fuzz

    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            test_fuzz._read(path)
        except Exception as error:
            return repr(error)
    return ""


if __name__ == "__main__":
    sys.exit(main())
