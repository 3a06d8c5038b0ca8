#!/usr/bin/env python3
"""Reads a softjam .rrd recording into numpy and plots f_max against step and the distribution of contact forces.

usage: read_rrd.py RUN.rrd [-o FIGURE.png] [--bits FILE]
needs: pip install rerun-sdk==0.36.3 numpy matplotlib
"""

from plot import show
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
    show(read, __doc__)
