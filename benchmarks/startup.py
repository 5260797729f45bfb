"""Start of a command: processor time of a whole process against bare Python's, in turn, the least of each.

    python -m benchmarks.startup [--rounds 9]

A command answers within its imports: what each may not import is held by ``tests/test_architecture.py``.
"""

import argparse
import resource
import subprocess
import sys

REQUIRED = {
    ("balance", "--help"): 2.5,
    ("testbench", "--help"): 2.5,
    ("balance", "size", "parallelogram-6bar"): 12.0,
}
"""By command, how many times bare Python's start it may cost."""


def processor_time(*arguments: str) -> float:
    """Of one call of Python [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Print the ratios; 1 where one is above what is required."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.startup", description="Start of a command.")
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    calls = {
        words: f"import sys; sys.argv = {list(words)}; from {words[0]}.cli import main; main()" for words in REQUIRED
    }
    times = [[processor_time("-c", call) for call in ("pass", *calls.values())] for _ in range(rounds)]
    bare, *costs = map(min, zip(*times, strict=True))
    ratios = dict(zip(calls, (cost / bare for cost in costs), strict=True))
    for words, ratio in ratios.items():
        print(f"{' '.join(words):32s} {ratio:5.1f} times bare Python's {1e3 * bare:.0f} ms; at most {REQUIRED[words]}")
    return int(any(ratio > REQUIRED[words] for words, ratio in ratios.items()))


if __name__ == "__main__":
    raise SystemExit(main())
