"""Z and p against φ, from recordings: a line a coverage, mean over its samples with the standard error; -o draws it.

    for phi in 0.85 0.87 0.90; do
        for seed in $(seq 1 10); do softjam record --phi $phi --seed $seed --channels metrics -o z-$phi-$seed.rrd; done
    done
    python z_against_phi.py z-*.rrd -o z.png

Takes its numbers from `softjam info --json`; runs that did not converge, or came apart, are counted and left out.
"""

import argparse
import json
import statistics
import subprocess
import sys

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("recordings", nargs="+", help=".rrd or .mcap, with the channel metrics")
parser.add_argument("-o", "--output", help="the picture to draw (needs matplotlib)")
parser.add_argument("--softjam", default="softjam", help="the program")
arguments = parser.parse_args()

samples = {}
for path in arguments.recordings:
    found = subprocess.run([arguments.softjam, "info", path, "--json"], capture_output=True, text=True)
    if found.returncode not in (0, 3):  # 3: not converged
        sys.exit(found.stderr)
    info = json.loads(found.stdout)
    if "coordination" not in info["metrics"]:
        print(f"{path} holds no metrics, and is left out", file=sys.stderr)
        continue
    samples.setdefault(round(info["phi"], 6), []).append(info)

points = []
print("   phi        Z     +/-  p (gamma/length)  samples")
for phi, runs in sorted(samples.items()):
    jammed = [r["metrics"] for r in runs if r["converged"] and r["metrics"]["coordination"] > 0]
    if not jammed:
        print(f"{phi:6.3f}  none of {len(runs)} jammed")
        continue
    z = [m["coordination"] for m in jammed]
    error = statistics.stdev(z) / len(z) ** 0.5 if len(z) > 1 else float("nan")
    p = statistics.fmean(m["pressure"] for m in jammed)
    print(f"{phi:6.3f} {statistics.fmean(z):8.4f} {error:7.4f} {p:17.6f}  {len(z)} of {len(runs)}")
    points.append((phi, statistics.fmean(z), error))

if arguments.output:
    if not points:
        sys.exit("nothing to draw")

    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    x, y, error = zip(*points)
    plt.errorbar(x, y, yerr=error, fmt="o", capsize=3)
    plt.xlabel("coverage φ of the undeformed disks")
    plt.ylabel("coordination Z")
    plt.savefig(arguments.output, dpi=150, bbox_inches="tight")
