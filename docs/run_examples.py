"""Run every command of the pages named, in the order shown, each page in a fresh folder; stop at the first that fails.

    python docs/run_examples.py docs/start.md docs/how-to/*.md

Blocks marked ``sh`` are run by the shell. Exit codes 0 (done) and 3 (done, with findings) are fine.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path


def main(pages: list[str]) -> int:
    """Run the pages; the number of commands that failed."""
    for page in pages:
        with tempfile.TemporaryDirectory() as folder:
            for block in re.findall(r"^```sh\n(.*?)^```", Path(page).read_text("utf-8"), re.DOTALL | re.MULTILINE):
                for line in block.replace("\\\n", " ").splitlines():
                    done = subprocess.run(["bash", "-c", line], cwd=folder, capture_output=True, text=True, check=False)
                    sys.stdout.write(f"{done.returncode} {page}: {line}\n")
                    if done.returncode not in (0, 3):
                        sys.stdout.write(done.stdout + done.stderr)
                        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
