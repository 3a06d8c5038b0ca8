#!/usr/bin/env python3
"""Checks what the rerun viewer gets of a softjam MCAP file: `rerun mcap convert RUN.mcap -o X.rrd`, then this on both.

Every vertex of the contours has to arrive as a point with its colour, every metric as an f64 with the bits of the message.

usage: check_mcap_in_rerun.py RUN.mcap X.rrd    (pip install rerun-sdk==0.36.3 mcap mcap-protobuf-support numpy)
"""

import sys

import numpy as np
import rerun.experimental as rerun
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

clouds, metrics = {}, {}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
    for _, channel, raw, message in reader.iter_decoded_messages(topics=["/world/vertices", "/metrics"]):
        if channel.topic == "/metrics":
            metrics[raw.log_time] = {f.name: v for f, v in message.ListFields()}
        else:
            points = np.frombuffer(message.data, dtype="<f4").reshape(-1, message.point_stride // 4)
            clouds[raw.log_time] = points[:, :2]

points_seen = metrics_seen = 0
for chunk in rerun.RrdReader(sys.argv[2]).stream().to_chunks():
    entity, batch = str(chunk.entity_path), chunk.to_record_batch()
    if entity == "/world/vertices" and "Points3D:positions" in batch.schema.names:
        assert "Points3D:colors" in batch.schema.names
        for time, cell in zip(batch["message_log_time"], batch["Points3D:positions"]):
            found = cell.values.flatten().to_numpy().reshape(-1, 3)
            assert np.array_equal(found[:, :2], clouds[time.value]), f"{time}: the vertices differ"
            points_seen += 1
    if entity == "/metrics" and "softjam.v1.Metrics:message" in batch.schema.names:
        for time, cell in zip(batch["message_log_time"], batch["softjam.v1.Metrics:message"]):
            row = cell[0]
            for name, expected in metrics[time.value].items():
                value = row[name]
                assert name in ("step", "sim_time_ns") or str(value.type) == "double", f"{name} is {value.type}"
                assert value.as_py() == expected, f"{time}: {name} is {value.as_py()}, not {expected}"
            metrics_seen += 1

assert points_seen == len(clouds) > 0, f"{points_seen} of {len(clouds)} clouds"
assert metrics_seen == len(metrics) > 0, f"{metrics_seen} of {len(metrics)} rows of metrics"
print(f"{points_seen} clouds as Points3D, {metrics_seen} rows of metrics as f64")
