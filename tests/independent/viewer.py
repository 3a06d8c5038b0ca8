#!/usr/bin/env python3
"""Opens recordings in the real rerun viewer and looks at what it draws.

What should be seen where is computed from the recorded states with nothing of softjam's: numpy, and matplotlib's colour
maps. The box gives the scale; then the pixels of every particle, contour, contact and periodic image are compared with the
colours that they should have. The same checks are held against pictures that are wrong (empty, upside down, colours
exchanged), which have to fail.

usage: viewer.py FOLDER RUN.rrd...       writes FOLDER/RUN.png for each recording
       viewer.py --same A.png B.png      whether two pictures show the same, but for what differs between two machines
(pip install rerun-sdk numpy matplotlib, 0.36.3 or 0.41.0; mesa-vulkan-drivers, or a GPU)
"""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rerun.experimental as rerun
from matplotlib import colormaps
from PIL import Image

SIZE = (1600, 900)
# The packing takes 6 of 11 shares of the width; a title bar is above, the time line below.
LEFT, TOP, BOTTOM = int(SIZE[0] * 6 / 11) - 4, 55, 865
EDGE, RATTLER = (200, 200, 200), (170, 170, 170)
CURVES = {"log10_f_max": (255, 170, 60), "coordination": (100, 190, 255), "pressure": (80, 220, 120), "energy": (250, 220, 80)}
# What a protocol has beside them.
PROTOCOL = {"phi": (220, 150, 255), "strain": (90, 220, 210), "stress_xy": (255, 120, 120)}


class Recording:
    """The last frame of a recording that has contours, and how many steps have metrics."""

    def __init__(self, path):
        states, boxes, self.contours, self.curves = {}, {}, {}, {}
        for chunk in rerun.RrdReader(path).stream().to_chunks():
            batch, entity = chunk.to_record_batch(), str(chunk.entity_path)
            if entity == "/particles":
                self.radii = batch["softjam.Particles:radius"][0].values.to_numpy()
                self.box = batch["softjam.Particles:box"][0].values.to_numpy()
            if chunk.is_static:
                continue
            steps = batch["step"].to_pylist()
            if entity == "/state":
                columns = [batch["softjam.State:" + name] for name in ("position", "contact", "force")]
                states |= {step: [cell.as_py() for cell in row] for step, *row in zip(steps, *columns)}
                if "softjam.State:box" in batch.schema.names:
                    boxes |= dict(zip(steps, batch["softjam.State:box"].to_pylist()))
            elif entity == "/world/contours":
                self.contours |= dict(zip(steps, batch["LineStrips2D:strips"]))
            elif entity.startswith("/metrics/"):
                values = batch["Scalars:scalars"].to_pylist()
                self.curves.setdefault(entity.removeprefix("/metrics/"), {}).update(zip(steps, [v[0] for v in values]))
        self.tilt = 0
        if self.contours:
            # Where a file breaks off, the last picture need not have a state.
            self.last = max(self.contours)
            self.step = max(set(states) & set(self.contours))
            self.positions, self.contacts, self.forces = (np.array(a) for a in states[self.step])
            if boxes.get(self.step):
                *self.box, self.tilt = np.array(boxes[self.step])
                self.box = np.array(self.box)
            # Particles are drawn between the slanted sides of a sheared box.
            self.positions[:, 0] -= self.box[0] * np.floor(self.upright(self.positions)[:, 0] / self.box[0])
            self.strips = [np.array(s) for s in self.contours[self.step].as_py()]

    def upright(self, points):
        """Where points of a sheared box would be in the upright one."""
        return points - np.multiply.outer(points[:, 1] / self.box[1], [self.tilt, 0])

    def nearest(self, d):
        """The differences of the nearest images."""
        d = d - np.multiply.outer(np.rint(d[..., 1] / self.box[1]), [self.tilt, self.box[1]])
        return d - np.multiply.outer(np.rint(d[..., 0] / self.box[0]), [self.box[0], 0])


def shades(name, places):
    return np.array([colormaps[name](p)[:3] for p in places]).reshape(-1, 3) * 255


def held(n, contacts):
    """Particles with fewer than three contacts are taken away until none is left."""
    alive = np.ones(n, dtype=bool)
    while True:
        among = contacts[alive[contacts].all(axis=1)]
        number = np.bincount(among.ravel(), minlength=n)
        if not (alive & (number < 3)).any():
            return alive
        alive &= number >= 3


def expected(r):
    """What should be seen: name -> (places, colours, tolerance, share that is not covered by something else)."""
    n, box = len(r.radii), r.box
    i, j = r.contacts.T
    pressure = np.bincount(r.contacts.ravel(), np.repeat(r.forces, 2), n) / (2 * np.pi * r.radii)
    relative = pressure / pressure[pressure > 0].mean()
    color = shades("viridis", 0.25 + 0.75 * np.clip(relative / 2, 0, 1))
    color[~held(n, r.contacts)] = RATTLER
    force = np.clip(r.forces / r.forces.mean(), 0, 3)
    line = shades("inferno", 0.45 + 0.5 * force / 3)
    # Around the centre, where fewest contacts run.
    ring = 0.6 * r.radii.min() * np.array([[np.cos(a), np.sin(a)] for a in np.arange(24) * np.pi / 12])
    discs = (r.positions[:, None] + ring).reshape(-1, 2)
    outline = np.concatenate([0.5 * (s[1:] + s[:-1]) for s in r.strips] + [s[:-1] for s in r.strips])
    outline_color = np.concatenate([np.repeat(color, [len(s) - 1 for s in r.strips], axis=0)] * 2)
    shifts = [np.array([x * box[0] + y * r.tilt, y * box[1]]) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
    inside = lambda v: ((r.upright(v) > 0.01 * box) & (r.upright(v) < 0.99 * box)).all(axis=1)
    images = [(outline + s)[inside(outline + s)] for s in shifts]
    image_color = [0.65 * outline_color[inside(outline + s)] for s in shifts]
    d = r.nearest(r.positions[i] - r.positions[j])
    # Off the middle, where contours cross.
    parts = np.array([0.3, 0.35, 0.4, 0.6, 0.65, 0.7])
    chain = (r.positions[i][:, None] - parts[:, None] * d[:, None]).reshape(-1, 2)
    chain_color = np.repeat(line, len(parts), axis=0)
    crossing = [(chain + s)[inside(chain + s)] for s in shifts]
    crossing_color = [0.65 * chain_color[inside(chain + s)] for s in shifts]
    return {
        "particles": (discs, np.repeat(0.5 * color, 24, axis=0), 0.68),
        "contours": (outline, outline_color, 0.8),
        "contours across the edge": (np.concatenate(images), np.concatenate(image_color), 0.7),
        "contacts": (chain, chain_color, 0.8),
        "contacts across the edge": (np.concatenate(crossing), np.concatenate(crossing_color), 0.7),
    }


def near(picture, color, tolerance=14):
    return (np.abs(picture - np.array(color)) <= tolerance).all(axis=-1)


def find_box(picture, r):
    """Left and right end of the lower side of the box, its top and its bottom, in pixels."""
    gray = near(picture[TOP:BOTTOM, :LEFT], EDGE)
    columns, rows = np.flatnonzero(gray.sum(axis=0) > 200), np.flatnonzero(gray.sum(axis=1) > 200)
    if r.tilt and len(rows):
        columns = np.flatnonzero(gray[rows[-1]])
    assert len(columns) > 1 and len(rows) > 1, "no box is seen"
    return columns[0], columns[-1], TOP + rows[0], TOP + rows[-1]


def look(picture, r):
    """Compares a picture with what should be in it; the shares of places that look as they should."""
    left, right, top, bottom = find_box(picture, r)
    scale = (right - left) / r.box[0], (bottom - top) / r.box[1]
    assert abs(scale[0] / scale[1] - 1) < 0.01, f"axes are not equal: {scale}"
    assert right - left > 0.5 * LEFT or bottom - top > 0.5 * (BOTTOM - TOP), "the box is small"
    found = {}
    for name, (places, colors, share) in expected(r).items():
        x = np.rint(left + scale[0] * places[:, 0]).astype(int)
        y = np.rint(bottom - scale[1] * places[:, 1]).astype(int)
        seen = (x > 2) & (x < LEFT - 2) & (y > TOP + 2) & (y < BOTTOM - 2)
        x, y, colors = x[seen], y[seen], colors[seen]
        assert len(x) > 10 or not len(places), f"{name}: out of sight"
        # Thin lines fall between pixels: the best of a neighbourhood counts.
        off = [np.abs(picture[y + b, x + a] - colors).max(axis=1) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        found[name] = np.mean(np.min(off, axis=0) < 36) if len(x) else 1.0
        assert found[name] >= share, f"{name}: {found[name]:.0%} of {len(x)} places have their colour, not {share:.0%}"
    return found


def look_at_shapes(picture, r):
    """The last picture of a file that breaks off, whose state is lost: something bright on every contour."""
    left, right, top, bottom = find_box(picture, r)
    outline = np.concatenate([np.array(s) for s in r.contours[r.last].as_py()])
    x = np.rint(left + (right - left) / r.box[0] * outline[:, 0]).astype(int)
    y = np.rint(bottom - (bottom - top) / r.box[1] * outline[:, 1]).astype(int)
    share = np.mean([picture[b - 1 : b + 2, a - 1 : a + 2].max() > 100 for a, b in zip(x, y)])
    assert share > 0.95, f"{share:.0%} of the contours are seen"
    return {"contours": share}


def look_at_nothing(picture, r):
    """A recording without pictures: the box, and nothing coloured in it."""
    left, right, top, bottom = find_box(picture, r)
    inside = picture[top + 4 : bottom - 4, left + 4 : right - 4]
    assert (inside.max(axis=-1) < 30).all(), "something is in a box of which nothing was recorded"
    return {}


def look_aside(picture, r):
    """The plots, each with a curve that fills it, and the scene as text."""
    aside = picture[:, LEFT + 10 :]
    protocol = "strain" in r.curves
    # A protocol has a row of plots more.
    text, upper, lower = (690, 235, 145) if protocol else (560, 270, 170)
    for name, color in (CURVES | (PROTOCOL if protocol else {})).items():
        # A run that is over at once has no curve to speak of, and what does not change has none that fills a plot.
        values = r.curves.get(name, {}).values()
        if len(values) < 20 or max(values) - min(values) < 1e-12:
            continue
        rows, columns = np.nonzero(near(aside[:text], color, 30))
        assert len(rows) > 100, f"the curve of {name} has {len(rows)} pixels"
        # The fall has the upper plot for its own, the others share the row below it.
        room = np.array([upper, aside.shape[1]] if name == "log10_f_max" else [lower, aside.shape[1] / 3])
        filled = np.array([np.ptp(rows), np.ptp(columns)]) / room
        assert (filled > 0.7).all(), f"the curve of {name} fills {filled[0]:.0%} of its plot's height, {filled[1]:.0%} of its width"
    letters = (aside[text:860] > 120).all(axis=-1).mean()
    assert letters > 0.01, f"{letters:.2%} of the text's place is bright"


def screenshot(path, png):
    """Opens `path` in a viewer of its own until its picture no longer changes."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    png.unlink(missing_ok=True)
    size = "x".join(map(str, SIZE))
    arguments = ["rerun", str(path), "--headless", "--port", str(port), "--window-size", size]
    viewer = subprocess.Popen(arguments, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        last, stands, end = None, 0, time.monotonic() + 90
        while time.monotonic() < end:
            time.sleep(0.7)
            try:
                rerun.ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy").save_screenshot(str(png))
            except ConnectionError:
                continue
            for _ in range(100):
                time.sleep(0.1)
                if png.exists() and b"IEND" in png.read_bytes()[-12:]:
                    break
            else:
                continue
            picture = np.array(Image.open(png).convert("RGB")).astype(int)
            png.unlink()
            # Buttons light up and notes fade; the packing and the plots are what is waited for.
            same = last is not None and (np.abs(picture - last)[TOP:BOTTOM].max(axis=-1) > 20).sum() < 50
            stands, last = stands + 1 if same else 0, picture
            if stands == 2 and near(picture[TOP:BOTTOM, :LEFT], EDGE).sum() > 800:
                return picture
        raise AssertionError(f"{path}: the viewer's picture is empty, or does not come to rest")
    finally:
        os.killpg(viewer.pid, signal.SIGKILL)
        viewer.wait(30)


def must_fail(what, picture, r, check=look):
    try:
        found = check(picture, r)
    except AssertionError as reason:
        print(f"{what}: refused, as it should be ({reason})")
        return
    raise AssertionError(f"{what} passes: {found}")


def whole_messages(path, folder):
    """The recording up to its last whole message: newer viewers open no file that breaks off within one."""
    data, end = path.read_bytes(), 12
    # What ends with its footer is whole.
    if data[-12:-4] == b"RRF2FOOT":
        return path
    while end + 16 <= len(data):
        length = int.from_bytes(data[end + 8 : end + 16], "little")
        if end + 16 + length > len(data):
            break
        end += 16 + length
    if end == len(data):
        return path
    (folder / path.name).write_bytes(data[:end])
    return folder / path.name


def same(one, other):
    """Fonts and lines are drawn a shade differently on another machine; a wrong picture differs in thousands of places."""
    one, other = (np.array(Image.open(p).convert("RGB")).astype(int) for p in (one, other))
    assert one.shape == other.shape, f"{one.shape} and {other.shape}"
    differ = (np.abs(one - other)[TOP:BOTTOM].max(axis=-1) > 60).mean()
    assert differ < 0.004, f"{differ:.2%} of the places differ"
    print(f"{differ:.3%} of the places differ")


def main():
    if sys.argv[1] == "--same":
        return same(*sys.argv[2:])
    folder, paths = Path(sys.argv[1]).resolve(), [Path(p) for p in sys.argv[2:]]
    folder.mkdir(exist_ok=True)
    seen = []
    for path in paths:
        begin = time.monotonic()
        with tempfile.TemporaryDirectory() as rest:
            whole = whole_messages(path, Path(rest))
            r = Recording(str(whole))
            picture = screenshot(whole, folder / f"{path.stem}.png")
        # So many colours are enough for the eye and a third of the bytes.
        small = Image.fromarray(picture.astype(np.uint8)).quantize(224, kmeans=1, dither=Image.Dither.NONE)
        small.save(folder / f"{path.stem}.png", optimize=True)
        check = look_at_nothing if not r.contours else look if r.step == r.last else look_at_shapes
        found = check(picture, r)
        look_aside(picture, r)
        seen.append((picture, r, check, path))
        what = ", ".join(f"{share:.0%} of the {name}" for name, share in found.items())
        kilobytes = (folder / f"{path.stem}.png").stat().st_size // 1000
        print(f"{path}: {what or 'box and plots'}; {kilobytes} kB, {time.monotonic() - begin:.1f} s", flush=True)
    # These checks can fail: the same expectations against pictures that are wrong.
    full = [s for s in seen if s[2] is look]
    assert full, "no recording with contours and contacts"
    for picture, r, *_ in full:
        left, right, top, bottom = find_box(picture, r)
        upside_down, shuffled, empty = picture.copy(), picture.copy(), picture.copy()
        part = np.s_[top + 4 : bottom - 4, left + 4 : right - 4]
        upside_down[part] = picture[part][::-1]
        shuffled[part] = picture[part][..., ::-1]
        empty[part] = 0
        # A crystal is its own mirror image.
        if not mirror_image(r):
            must_fail("upside down", upside_down, r)
        must_fail("red and blue exchanged", shuffled, r)
        must_fail("empty", empty, r)
    picture, r, _, path = full[-1]
    no_curves = picture.copy()
    no_curves[60:690, LEFT + 10 :] = 0
    must_fail("without curves", no_curves, r, look_aside)
    with tempfile.TemporaryDirectory() as rest:
        for entity in ("contours", "contours/images", "particles", "contacts", "contacts/images"):
            smaller = without(f"/world/{entity}", path, Path(rest))
            must_fail(f"without {entity}", screenshot(smaller, Path(rest) / "without.png"), r)


def without(entity, path, folder):
    """The recording with an entity left out."""
    rest = folder / "without.rrd"
    subprocess.run(["rerun", "rrd", "filter", "--drop-entity", entity, str(path), "-o", str(rest)], check=True, capture_output=True)
    return rest


def mirror_image(r):
    """Whether the packing looks the same upside down."""
    if r.tilt:
        return False
    mirrored = r.positions * [1, -1]
    d = r.positions[:, None] - mirrored
    d -= r.box * np.rint(d / r.box)
    # By any shift: that which brings the first particle onto its image.
    return any(
        (np.hypot(*np.moveaxis((e := d - s) - r.box * np.rint(e / r.box), -1, 0)).min(axis=1) < 0.05).all() for s in d[0]
    )


if __name__ == "__main__":
    main()
