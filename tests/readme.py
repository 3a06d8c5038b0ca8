"""Runs what README.md tells a newcomer to paste, as it stands and in order, in an empty folder.

    python tests/readme.py [FOLDER]

The fenced `sh` blocks are one session of bash that ends at the first command that fails. `softjam` is the release build of this
clone; `cargo` works on this clone from wherever the session is; `cargo test` is left to those who call this.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CLONE = Path(__file__).resolve().parent.parent
PRELUDE = f"""
set -euo pipefail
cargo() {{
    if [ "$1" = test ]; then return; fi
    command cargo "$1" --quiet --manifest-path '{CLONE}/Cargo.toml' "${{@:2}}"
}}
"""


def blocks():
    text = (CLONE / "README.md").read_text()
    return re.findall(r"^```sh\n(.*?)^```$", text, flags=re.M | re.S)


def main():
    target = Path(os.environ.get("CARGO_TARGET_DIR", CLONE / "target"))
    path = f"{(target / 'release').resolve()}:{os.environ['PATH']}"
    folder = sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="softjam-readme-")
    if any(Path(folder).iterdir()):
        sys.exit(f"{folder} is not empty")
    found = blocks()
    if len(found) < 4:
        sys.exit("README.md has lost its blocks of commands")
    session = PRELUDE
    for k, block in enumerate(found, 1):
        # What is run is what is shown, with each command line said first.
        session += f"echo '== block {k}'\nset -x\n{block}set +x\n"
    begun = time.time()
    result = subprocess.run(["bash", "-c", session], cwd=folder, env={**os.environ, "PATH": path})
    print(f"{len(found)} blocks, {time.time() - begun:.0f} s, exit status {result.returncode}, in {folder}")
    sys.exit(result.returncode)


main()
