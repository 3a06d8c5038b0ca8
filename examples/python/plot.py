"""What both readers do with what they read: the figure, and the bytes by which they are compared with softjam."""

import argparse

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

# Those behind stress_xy are there in some runs.
METRICS = (
    "f_max",
    "log10_f_max",
    "energy",
    "pressure",
    "coordination",
    "contacts",
    "rattlers",
    "dt",
    "stress_xy",
    "moment",
    "phi",
    "strain",
    "stress_xx",
    "stress_yy",
)


def plot(f_max, forces, path):
    """f_max {step: value} on a logarithmic axis beside the distribution of forces, in units of their mean."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    steps = sorted(f_max)
    if steps:
        left.semilogy(steps, [max(f_max[step], 1e-18) for step in steps], lw=1, color="#21618c")
        left.set(xlim=(0, max(steps[-1], 1)))
    left.set(xlabel="step", ylabel=r"$f_\mathrm{max}\,/\,\gamma$")
    if len(forces):
        right.hist(forces / forces.mean(), bins=40, range=(0, 4), density=True, color="#5d9cbf")
    right.set(xlabel=r"$f\,/\,\langle f\rangle$", ylabel=r"$P(f\,/\,\langle f\rangle)$", xlim=(0, 4))
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=160)


def write_bits(metrics, states, path):
    """Every number, little-endian: a row of metrics a step, then step, r, v, contacts, f, minimiser a state."""
    with open(path, "wb") as file:
        for step in sorted(metrics.get("f_max", ())):
            file.write(np.uint64(step).astype("<u8").tobytes())
            row = [metrics[name][step] for name in METRICS if step in metrics.get(name, {})]
            file.write(np.array(row, dtype="<f8").tobytes())
        for step in sorted(states):
            state = states[step]
            file.write(np.uint64(step).astype("<u8").tobytes())
            for name, kind in (
                ("position", "<f8"),
                ("velocity", "<f8"),
                ("contact", "<u4"),
                ("force", "<f8"),
                ("minimizer", "<f8"),
            ):
                file.write(state[name].astype(kind).tobytes())


def show(read, about):
    """Reads the recording that the command line names with `read` and draws it."""
    arguments = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("recording")
    arguments.add_argument("-o", "--output", default="recording.png")
    arguments.add_argument("--bits", help="write every number read as little-endian bytes, to compare readers")
    arguments = arguments.parse_args()
    metrics, states, packing = read(arguments.recording)
    f_max, f = metrics.get("f_max", {}), np.array([])
    print(f"{len(packing['radius'])} particles in a box of {packing['box'][0]:.6g} x {packing['box'][1]:.6g}")
    print(f"{len(states)} states, {len(f_max)} steps of metrics")
    if states:
        last = max(states)
        f = states[last]["force"]
        mean = f.mean() if len(f) else 0.0
        known = f"f_max = {f_max[last]!r}, " if last in f_max else ""
        print(f"step {last}: {known}{len(f)} contacts, mean force {mean:.6e}")
    elif f_max:
        print(f"step {max(f_max)}: f_max = {f_max[max(f_max)]!r}; the recording has no states, and so no contact forces")
    plot(f_max, f, arguments.output)
    if arguments.bits:
        write_bits(metrics, states, arguments.bits)
