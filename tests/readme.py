"""Runs what README.md and the pages of commands tell a newcomer to paste, as it stands and in order.

    python tests/readme.py [FOLDER]

The fenced `sh` blocks of a page are one session of bash, in an empty folder of its own (FOLDER/readme, FOLDER/tour, …), that ends at the
first command that fails. `softjam` is the release build of this clone; `cargo` works on this clone from wherever the session is; `cargo test`
is left to those who call this.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CLONE = Path(__file__).resolve().parent.parent
PAGES = ("README.md", "docs/tour.md", "docs/paper.md")
PRELUDE = f"""
set -euo pipefail
cargo() {{
    if [ "$1" = test ]; then return; fi
    command cargo "$1" --quiet --manifest-path '{CLONE}/Cargo.toml' "${{@:2}}"
}}
"""


def blocks(page):
    text = (CLONE / page).read_text()
    return re.findall(r"^```sh\n(.*?)^```$", text, flags=re.M | re.S)


def run(page, folder, path):
    """Runs the blocks of a page and returns the exit status of its session."""
    found = blocks(page)
    if len(found) < 2:
        sys.exit(f"{page} has lost its blocks of commands")
    session = PRELUDE
    for k, block in enumerate(found, 1):
        # What is run is what is shown, with each command line said first.
        session += f"echo '== {page}, block {k}'\nset -x\n{block}set +x\n"
    folder.mkdir()
    begun = time.time()
    status = subprocess.run(["bash", "-c", session], cwd=folder, env={**os.environ, "PATH": path}).returncode
    print(f"{page}: {len(found)} blocks, {time.time() - begun:.0f} s, exit status {status}, in {folder}", flush=True)
    return status


def main():
    target = Path(os.environ.get("CARGO_TARGET_DIR", CLONE / "target"))
    path = f"{(target / 'release').resolve()}:{os.environ['PATH']}"
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="softjam-readme-"))
    if any(folder.iterdir()):
        sys.exit(f"{folder} is not empty")
    for page in PAGES:
        status = run(page, folder / Path(page).stem.lower(), path)
        if status != 0:
            sys.exit(status)


main()
