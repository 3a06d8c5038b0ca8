#!/usr/bin/env python3
"""Shows a softjam .mcap recording in the rerun viewer: contours at the left, log10 f_max, Z, pressure and energy at the right.

The viewer opens the file without this script too, but draws the vertices of the contours only and none of the metrics:
they are fields of one message, which a plot has to be told to take apart. Log time is the step in milliseconds.
Contacts are not drawn; `softjam convert RUN.mcap RUN.rrd` and `rerun RUN.rrd` show those as well.

usage: view_mcap.py RUN.mcap [--connect URL]
needs: pip install rerun-sdk==0.36.3
"""

import argparse

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.datatypes import ComponentSourceKind, VisualizerComponentMapping
from rerun.experimental import McapReader


def take(component, message, selector):
    """The mapping that fills `component` of a visualizer with a part of a protobuf message."""
    return VisualizerComponentMapping(
        component, ComponentSourceKind.SourceComponent, source_component=message + ":message", selector=selector
    )


def plot(title, *fields):
    """A plot of these fields of /metrics over the whole run."""
    lines = [
        rr.SeriesLines(names=field).visualizer(mappings=[take("Scalars:scalars", "softjam.v1.Metrics", "." + field)])
        for field in fields
    ]
    return rrb.TimeSeriesView(origin="/metrics", contents=["/metrics"], name=title, overrides={"/metrics": lines})


def packing(l_x, l_y):
    """The contours from above: grey lines, and their vertices coloured by the pressure on the particle."""
    polygons = ".entities[].lines[].points | map(pack(.x!, .y!, .z!))"
    outlines = rr.LineStrips3D.from_fields(colors=[0x909090FF], radii=[rr.Radius.ui_points(0.5)])
    vertices = rr.Points3D.from_fields(radii=[rr.Radius.ui_points(1.5)])
    middle = (l_x / 2, l_y / 2)
    return rrb.Spatial3DView(
        origin="/world",
        name="Packing",
        contents=["/world/contours", "/world/vertices"],
        overrides={
            "/world/contours": outlines.visualizer(
                mappings=[take("LineStrips3D:strips", "foxglove.SceneUpdate", polygons)]
            ),
            "/world/vertices": vertices,
        },
        background=[0, 0, 0],
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind="Orbital", position=(*middle, 1.15 * max(l_x, l_y)), look_target=(*middle, 0), eye_up=(0, 1, 0)
        ),
    )


def box(path):
    """Sides of the periodic box."""
    for chunk in McapReader(path, include_topic_regex=["^/particles$"], recover=True).stream().to_chunks():
        batch = chunk.to_record_batch()
        if "softjam.v1.Particles:message" in batch.schema.names:
            return batch["softjam.v1.Particles:message"][0].as_py()[0]["box"]
    raise SystemExit(f"{path} is not a softjam recording: it has no /particles")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("recording")
    arguments.add_argument("--connect", metavar="URL", help="a viewer that runs already, instead of a new one")
    arguments = arguments.parse_args()
    plots = rrb.Vertical(
        plot("log10 f_max", "log10_f_max"),
        plot("Coordination number Z", "coordination"),
        plot("Pressure and energy", "pressure", "energy"),
    )
    view = rrb.Horizontal(packing(*box(arguments.recording)), plots, column_shares=[3, 2])
    blueprint = rrb.Blueprint(view, collapse_panels=True)
    stream = rr.RecordingStream("softjam_mcap")
    if arguments.connect:
        stream.connect_grpc(arguments.connect)
    else:
        stream.spawn()
    stream.send_blueprint(blueprint)
    # The vertices name the frame of reference they are in; the other topics have to be put into the same one.
    stream.log("/world/contours", rr.CoordinateFrame("world"), static=True)
    # A recording that was cut off is shown as far as it goes.
    stream.send_chunks(McapReader(arguments.recording, recover=True).stream())
    stream.flush()
