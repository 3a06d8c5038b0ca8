#!/usr/bin/env python3
"""Looks on at `softjam record` through rerun's own programs, on loopback.

1. A receiver (`rerun --save`) gets every row that the file holds, bit for bit.
2. A viewer (`rerun --headless`) shows it: the colours of particles and force chains are in its screenshot.
3. `--spawn` starts that viewer; what it shows is looked at too.
4. A viewer that is killed midway costs the run neither its file nor its time.

usage: live.py [--no-pictures] SOFTJAM [FOLDER]
--no-pictures leaves 2 and 3 out, which need a machine that can draw.    (pip install rerun-sdk==0.36.3 numpy matplotlib; mesa-vulkan-drivers, or a GPU)
"""

import atexit
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import matplotlib.image
import numpy as np
import rerun.experimental as rerun

pictures = "--no-pictures" not in sys.argv
arguments = [a for a in sys.argv[1:] if a != "--no-pictures"]
softjam = Path(arguments[0]).resolve()
folder = Path(arguments[1] if len(arguments) > 1 else tempfile.mkdtemp()).resolve()
os.chdir(folder)


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def address(port):
    return f"rerun+http://127.0.0.1:{port}/proxy"


def wait_for(port, seconds=60):
    for _ in range(10 * seconds):
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError(f"nothing listens on port {port}")


def start(*arguments):
    """rerun and what it starts in turn form a group, which `stop` ends."""
    # A shell ignores SIGINT for what it runs in the background, and its children inherit that.
    listen = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(["rerun", *arguments], start_new_session=True, preexec_fn=listen,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    groups.add(process.pid)
    return process


def stop(process, how=signal.SIGKILL):
    os.killpg(process.pid, how)
    process.wait(30)
    groups.discard(process.pid)


groups = set()
atexit.register(lambda: [os.killpg(group, signal.SIGKILL) for group in groups])


def record(*arguments, env=None):
    begin = time.monotonic()
    done = subprocess.run([softjam, "record", "-f", *arguments], capture_output=True, text=True, env=env, timeout=300)
    took = time.monotonic() - begin
    assert done.returncode == 0, done.stderr
    return done, took


def rows(path):
    """Every row of the recording, by entity and step (None: static), as the bytes of its columns."""
    found = {}
    kinds = ("softjam.", "LineStrips2D:", "Points2D:", "Ellipses2D:", "Scalars:", "TextDocument:", "Transform3D:")
    for chunk in rerun.RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        names = [n for n in batch.schema.names if n.startswith(kinds)]
        steps = batch["step"].to_pylist() if "step" in batch.schema.names else [None] * batch.num_rows
        for name in names:
            for step, cell in zip(steps, batch[name].to_pylist()):
                if cell is not None:
                    found[str(chunk.entity_path), step, name] = repr(cell)
    return found


def screenshot(port, name):
    """A screenshot; the viewer is asked for it and writes it some time later."""
    Path(name).unlink(missing_ok=True)
    client = rerun.ViewerClient.connect(address(port))
    client.save_screenshot(str(folder / name))
    for _ in range(300):
        time.sleep(0.1)
        if Path(name).exists() and b"IEND" in Path(name).read_bytes()[-12:]:
            return matplotlib.image.imread(name)[..., :3]
    raise AssertionError(f"{name} was not written")


def colours(port, name):
    """The coloured share of a screenshot; a viewer draws a little later than it is sent something."""
    for _ in range(10):
        picture = screenshot(port, name)
        # Left of the plots, below the title bar.
        picture = picture[60:-60, : int(0.6 * picture.shape[1])]
        saturated = picture.max(axis=2) - picture.min(axis=2) > 0.25
        share = saturated.mean()
        if share > 0.05:
            break
    assert share > 0.05, f"{name}: {share:.2%} of the picture is coloured"
    # Contours and chains are everywhere in the box, not in a corner of it.
    blocks = [b.any() for half in np.array_split(saturated, 8) for b in np.array_split(half, 8, axis=1)]
    assert np.mean(blocks) > 0.6, f"{name}: colours in {np.mean(blocks):.0%} of the picture"
    return share


# Every picture is drawn, so that there is much to compare.
every = ["--redraw", "0"]
record("-o", "alone.rrd", *every)
alone = Path("alone.rrd").read_bytes()

# 1. A receiver that keeps what it gets.
port = free_port()
receiver = start("--port", str(port), "--save", "received.rrd")
wait_for(port)
done, _ = record("-o", "run.rrd", *every, "--connect", address(port))
assert Path("run.rrd").read_bytes() == alone, "the file differs"
assert "live view" in done.stdout, done.stdout + done.stderr
time.sleep(1)
stop(receiver, signal.SIGINT)
sent, received = rows("run.rrd"), rows("received.rrd")
assert len(sent) > 10_000 and sent.keys() == received.keys(), f"{len(sent)} cells, {len(received)} received"
assert sent == received, [k for k in sent if sent[k] != received[k]][:5]
print(f"received: all {len(received)} cells of {len({k[0] for k in received})} entities, bit for bit")

if pictures:
    # 2. A viewer, into which two runs go.
    port = free_port()
    viewer = start("--headless", "--port", str(port))
    wait_for(port)
    for _ in range(2):
        record("-o", "run.rrd", *every, "--connect", address(port))
        print(f"viewer: {colours(port, 'connect.png'):.1%} of the picture is coloured")
    stop(viewer)

    # 3. A viewer that softjam starts: `rerun` on its PATH, here without a window.
    real = subprocess.run(["sh", "-c", "command -v rerun"], capture_output=True, text=True, check=True).stdout.strip()
    Path("bin").mkdir(exist_ok=True)
    Path("bin/rerun").write_text(f'#!/bin/sh\necho $$ >"{folder}/spawned"\nexec "{real}" --headless "$@"\n')
    Path("bin/rerun").chmod(0o755)
    port = free_port()
    done, took = record("-o", "run.rrd", *every, f"--spawn={port}", env={**os.environ, "PATH": f"{folder}/bin:{os.environ['PATH']}"})
    assert Path("run.rrd").read_bytes() == alone, "the file differs"
    assert "live view" in done.stdout, done.stdout + done.stderr
    groups.add(int(Path("spawned").read_text()))
    print(f"--spawn: {took:.1f} s with the viewer's start, {colours(port, 'spawn.png'):.1%} of the picture is coloured")

# 4. A viewer that is killed in the middle of a longer run.
longer = ["-N", "512", "--phi", "0.86", "--every", "1", *every]
_, usual = record("-o", "alone.rrd", *longer)
port = free_port()
viewer = start("--port", str(port), "--save", "killed.rrd")
wait_for(port)
begin = time.monotonic()
run = subprocess.Popen([softjam, "record", "-f", "-o", "run.rrd", *longer, "--connect", address(port)],
                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
time.sleep(0.4 * usual)
assert run.poll() is None, "the run was over before the viewer was killed"
stop(viewer)
out, errors = run.communicate(timeout=300)
took = time.monotonic() - begin
assert run.returncode == 0 and "was lost" in errors, out + errors
assert Path("run.rrd").read_bytes() == Path("alone.rrd").read_bytes(), "the file differs"
assert took < 3 * usual + 2, f"{took:.1f} s, {usual:.1f} s without a viewer"
print(f"killed midway: {took:.1f} s, {usual:.1f} s without a viewer; {errors.strip()}")
