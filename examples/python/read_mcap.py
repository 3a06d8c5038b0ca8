#!/usr/bin/env python3
"""Reads a softjam .mcap recording into numpy and plots f_max against step and the distribution of contact forces.

usage: read_mcap.py RUN.mcap [-o FIGURE.png] [--bits FILE]
needs: pip install mcap mcap-protobuf-support numpy matplotlib
"""

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from plot import show


def read(path):
    """Metrics {name: {step: value}}, states {step: {name: array}} and what does not change: {"radius": the undeformed
    radii, "box": its two sides, "scene": the scene as TOML}.

    A recording without metrics or states gives empty dictionaries of them. Net forces and stress of a state: net_forces.py.
    """
    metrics, states, packing = {}, {}, {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for _, channel, _, message in reader.iter_decoded_messages(topics=["/metrics", "/state", "/particles"]):
            if channel.topic == "/metrics":
                for field, value in message.ListFields():
                    if field.name not in ("step", "sim_time_ns"):
                        metrics.setdefault(field.name, {})[message.step] = value
            elif channel.topic == "/particles":
                packing["radius"] = np.array(message.radius)
                packing["box"] = np.array(message.box)
            else:
                states[message.step] = {
                    "position": np.array(message.position).reshape(-1, 2),
                    "velocity": np.array(message.velocity).reshape(-1, 2),
                    "contact": np.array(message.contact, dtype=np.uint32).reshape(-1, 2),
                    "force": np.array(message.force),
                    "minimizer": np.array(message.minimizer),
                }
        for attachment in reader.iter_attachments():
            if attachment.name == "scene.toml":
                packing["scene"] = attachment.data.decode()
    return metrics, states, packing


if __name__ == "__main__":
    show(read, __doc__)
