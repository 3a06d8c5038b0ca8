#!/usr/bin/env python3
"""Reads a softjam .rrd recording into numpy and plots f_max against step and the distribution of contact forces.

usage: read_rrd.py RUN.rrd [-o FIGURE.png] [--bits FILE]
needs: pip install rerun-sdk==0.36.3 numpy matplotlib
"""

import numpy as np
from plot import show
from rerun.experimental import RrdReader


def flat(cell):
    """The numbers of a cell, pairs in turn."""
    values = cell.values
    if "fixed_size_list" in str(values.type):
        values = values.flatten()
    return values.to_numpy()


def read(path):
    """Metrics {name: {step: value}}, states {step: {name: array}} and what does not change: {"radius": the undeformed
    radii, "box": its two sides, "scene": the scene as TOML}.

    A recording without metrics or states gives empty dictionaries of them. Net forces and stress of a state: net_forces.py.
    """
    metrics, states, packing = {}, {}, {}
    for chunk in RrdReader(path).stream().to_chunks():
        entity, batch = str(chunk.entity_path), chunk.to_record_batch()
        if entity.startswith("/metrics/"):
            # An entity may have chunks that say how it is drawn, and no values.
            if "Scalars:scalars" not in batch.schema.names:
                continue
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
        elif "softjam.Particles:radius" in batch.schema.names:
            for name in ("radius", "box"):
                packing[name] = np.array(flat(batch["softjam.Particles:" + name][0]))
        elif "softjam.Scene:toml" in batch.schema.names:
            packing["scene"] = batch["softjam.Scene:toml"][0][0].as_py()
    return metrics, states, packing


if __name__ == "__main__":
    show(read, __doc__)
