#!/usr/bin/env python3
"""Reads a softjam .rrd recording into numpy and plots f_max against step and the distribution of contact forces.

usage: read_rrd.py RUN.rrd [-o FIGURE.png] [--bits FILE]
needs: pip install rerun-sdk==0.36.3 numpy matplotlib
"""

import argparse

from plot import plot, write_bits
from rerun.experimental import RrdReader


def flat(cell):
    """The numbers of a cell, pairs in turn."""
    values = cell.values
    if "fixed_size_list" in str(values.type):
        values = values.flatten()
    return values.to_numpy()


def read(path):
    """Metrics {name: {step: value}} and states {step: {name: array}} of a recording."""
    metrics, states = {}, {}
    for chunk in RrdReader(path).stream().to_chunks():
        entity, batch = str(chunk.entity_path), chunk.to_record_batch()
        if entity.startswith("/metrics/"):
            column = metrics.setdefault(entity.removeprefix("/metrics/"), {})
            for step, value in zip(batch["step"], batch["Scalars:scalars"]):
                column[step.as_py()] = value[0].as_py()
        elif entity == "/state":
            for row, step in enumerate(batch["step"]):
                names = ("position", "velocity", "contact", "force", "minimizer")
                state = {name: flat(batch["softjam.State:" + name][row]) for name in names}
                for pairs in ("position", "velocity", "contact"):
                    state[pairs] = state[pairs].reshape(-1, 2)
                states[step.as_py()] = state
    return metrics, states


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("recording")
    arguments.add_argument("-o", "--output", default="recording.png")
    arguments.add_argument("--bits", help="write every number read as little-endian bytes, to compare readers")
    arguments = arguments.parse_args()
    metrics, states = read(arguments.recording)
    last = max(states)
    f = states[last]["force"]
    print(f"{len(states)} states, {len(metrics['f_max'])} steps of metrics")
    print(f"step {last}: f_max = {metrics['f_max'][last]!r}, {len(f)} contacts, mean force {f.mean():.6e}")
    plot(metrics["f_max"], f, arguments.output)
    if arguments.bits:
        write_bits(metrics, states, arguments.bits)
