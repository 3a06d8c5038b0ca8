#!/usr/bin/env python3
"""Recorded packings of wet foam against K. Brakke's Surface Evolver, which knows lengths and areas and no forces.

The last state gives who touches whom, and the shapes from which the minimisation starts. Evolver then minimises the energy of edges that
are arcs, of tension 2 between two droplets and 1 elsewhere, whose ends slide, with areas pi R^2 in the periodic box.

At a contact angle of 0 the foam is no isolated minimum of this energy, because Evolver lets droplets overlap: where a film gets shorter
than it is in the foam, the energy falls with the third power. So films have the tension 2 cos(angle) with small angles. Energies,
pressures and chords are analytic in the angle and are extrapolated to 0 by the polynomial through seven of them.

Compared, to the limits that are printed, in units of gamma: energy (sum of perimeters less 2 pi R), osmotic pressure (2 sum p pi R^2 -
energy of all edges)/2V, pressure of each droplet against 1/r, force of each contact against mean pressure times chord.

The largest contact angle is --angle (radians). Newton's method starts from shapes that must be right to a part of it: 0.008 suits wet foam;
a packing of rounded polygons, which this check refuses, needs 0.04.

usage: evolver.py [--angle X] RUN.rrd ...      (apt-get install evolver; pip install rerun-sdk==0.36.3 numpy)
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from check_recording import Recording, nearest, rattles
from foam_law import Droplets

# By how much the box is stretched and shrunk.
STRETCH = 1e-5


class Foam:
    """Edges of the droplets that are held: films between two of them, free arcs from film to film."""

    def __init__(self, recording, angle):
        last = max(recording.states)
        positions, contacts, forces = recording.states[last]
        self.radii, self.box = recording.radii, recording.box
        droplets = self.droplets = Droplets(
            positions, self.radii, self.box, contacts, forces / recording.line_tension, recording.memory[last], recording.arcs)
        pairs = np.stack([droplets.i, droplets.j], axis=1)
        # Rattlers rest on others with a force below f_max.
        pressed = droplets.force > 1e-6
        self.held = ~rattles(len(self.radii), pairs[pressed])
        self.films = np.flatnonzero(pressed & self.held[pairs].all(axis=1))
        # Vertices: both ends of each film as its first droplet has them, farther along it by what the angle asks for, and middles of edges.
        self.vertices, self.edges, self.loops = [], [], {p: [] for p in np.flatnonzero(self.held)}
        ends, bends = {}, {}
        for c in self.films:
            i, j = pairs[c]
            n, r = droplets.normal[c], droplets.corner
            t = np.array([-n[1], n[0]])
            middle = positions[i] + n * droplets.rho[0, c] + t * droplets.middle[0, c]
            half, curved = 0.5 * droplets.length[0, c], 0.5 / r[i] - 0.5 / r[j]
            highest = half * np.tan(0.5 * droplets.bend[c])
            half += angle * 2 * r[i] * r[j] / (r[i] + r[j])
            bends[c] = np.arcsin(curved * half)
            sagitta = half * np.tan(0.5 * bends[c])
            middle = middle + (highest - sagitta) * n
            first, last = self.vertex(middle - half * t), self.vertex(middle + half * t)
            edge = self.edge(first, last, sagitta * n, 2)
            # The second droplet goes along it the other way.
            ends[i, c], ends[j, c] = (first, last, edge), (last, first, -edge)
        for p in self.loops:
            around = [(droplets.angle[c] + (np.pi if pairs[c][1] == p else 0), c) for c in self.films if p in pairs[c]]
            around = sorted((np.mod(a, 2 * np.pi), c) for a, c in around)
            for (begin, c), (end, after) in zip(around, around[1:] + around[:1]):
                a, b = ends[p, c][1], ends[p, after][0]
                turned = np.mod(end - begin, 2 * np.pi) or 2 * np.pi
                bend = [bends[k] * (1 if pairs[k][0] == p else -1) for k in (c, after)]
                turned -= sum(bend) + 2 * angle
                chord = nearest(self.vertices[b] - self.vertices[a], self.box)
                outward = np.array([chord[1], -chord[0]]) / np.hypot(*chord)
                arc = self.edge(a, b, 0.5 * np.hypot(*chord) * np.tan(0.25 * turned) * outward, 1)
                self.loops[p] += [ends[p, c][2], arc]

    def vertex(self, at):
        self.vertices.append(np.mod(at, self.box))
        return len(self.vertices) - 1

    def edge(self, a, b, sagitta, tension):
        """An edge from vertex a to vertex b; the number that Evolver has for it, from 1."""
        across = nearest(self.vertices[b] - self.vertices[a], self.box)
        wraps = np.rint((self.vertices[a] + across - self.vertices[b]) / self.box).astype(int)
        # The middle lies where the first end is, whatever side of the box that is.
        self.vertices.append(self.vertices[a] + 0.5 * across + sagitta)
        self.edges.append((a, b, len(self.vertices) - 1, wraps, tension))
        return len(self.edges)

    def datafile(self, scale=1.0):
        """What Evolver reads, in a box that is `scale` as long."""
        lines = ["STRING", "SPACE_DIMENSION 2", "QUADRATIC", "TORUS"]
        lines += ['length_method_name "circular_arc_length"', 'area_method_name "circular_arc_area"']
        box = scale * self.box
        lines += ["PERIODS", f"{box[0]!r} 0", f"0 {box[1]!r}", "define edge attribute film integer", "VERTICES"]
        lines += [f"{k} {scale * x!r} {scale * y!r}" for k, (x, y) in enumerate(np.array(self.vertices).tolist(), 1)]
        lines.append("EDGES")
        for k, (a, b, middle, wraps, tension) in enumerate(self.edges, 1):
            signs = " ".join("*+-"[w] for w in wraps)
            lines.append(f"{k} {a + 1} {b + 1} {middle + 1} {signs} tension {tension} film {tension - 1}")
        lines.append("FACES")
        lines += [f"{k} " + " ".join(map(str, loop)) for k, loop in enumerate(self.loops.values(), 1)]
        lines.append("BODIES")
        lines += [f"{k} {k} VOLUME {np.pi * self.radii[p] ** 2!r}" for k, p in enumerate(self.loops, 1)]
        return "\n".join(line.replace("np.float64(", "").replace(")", "") for line in lines) + "\n"


def minimise(foam, angles, scale=1.0):
    """Energy of all edges with their full tension, pressure of each droplet, chord of each film: an array with a row an angle."""
    tension = lambda angle: f"set edge tension {2 * np.cos(angle):.17g} where film == 1"
    # Down into the basin; with a step of no length pressures are told, from which Newton's method begins.
    commands = ["augmented_hessian on", "fix vertex[1]", tension(angles[0]), "g 40", "m 1e-9"]
    for angle in angles:
        commands += [tension(angle), "g", "{hessian} 7"]
        commands += [r'printf "FOUND %.16g", total_energy + sum(edge where film == 1, length*(2 - tension))']
        commands += [r'foreach body bb do printf " %.16g", bb.pressure']
        commands += [r'foreach edge ee where ee.film == 1 do printf " %.16g %.16g %.16g %.16g", '
                     r'ee.vertex[1].x, ee.vertex[1].y, ee.vertex[2].x, ee.vertex[2].y; printf "\n"']
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "foam.fe")
        path.write_text(foam.datafile(scale))
        Path(folder, "commands").write_text("\n".join(commands + ["q", "q", ""]))
        done = subprocess.run(["evolver", "-x", "-f", str(Path(folder, "commands")), str(path)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300)
    said = done.stdout + done.stderr
    # Commands are repeated between what they print.
    printed = re.sub(r"Enter command: .*\n", "", said).splitlines()
    rows = [[float(x.strip("()")) for x in line.split()[1:]] for line in printed if line.startswith("FOUND")]
    if len(rows) != len(angles) or "WARNING" in said:
        sys.exit(f"{said[-300:]}\nEvolver found no minimum; its start may be too far away for such small contact angles")
    found, droplets = np.array(rows), len(foam.loops)
    ends = found[:, 1 + droplets :].reshape(len(angles), -1, 2, 2)
    chords = np.linalg.norm(nearest(ends[:, :, 1] - ends[:, :, 0], scale * foam.box), axis=2)
    return np.concatenate([found[:, : 1 + droplets], chords], axis=1)


def extrapolated(angles, rows):
    """The values at angle 0 of polynomials through the rows, and how far they are from those without the largest angle."""
    at_zero = lambda x, y: np.array([np.prod([x[l] / (x[l] - x[k]) for l in range(len(x)) if l != k]) for k in range(len(x))]) @ y
    all_of, without = at_zero(angles, rows), at_zero(angles[1:], rows[1:])
    return all_of, np.abs(all_of - without)


def check(path, largest):
    """Limits and what was found of one recording, by what is compared."""
    angles = largest * np.cos(np.pi * (2 * np.arange(7) + 1) / 30)
    foam = Foam(Recording(path), angles[0])
    droplets, held, films, volume = foam.droplets, foam.held, foam.films, foam.box.prod()
    found, slack = extrapolated(angles, minimise(foam, angles))
    areas, n = np.pi * foam.radii[held] ** 2, len(foam.loops)
    energy, p, chords = found[0], found[1 : 1 + n], found[1 + n :]
    # By how much the energy changes with the box, which has nothing to do with pressures of droplets.
    larger, smaller = (extrapolated(angles, minimise(foam, angles, 1 + x))[0][0] for x in (STRETCH, -STRETCH))
    slope = (larger - smaller) / (4 * STRETCH * volume)
    pressure = -0.5 * np.trace(droplets.stress())
    place = np.cumsum(held) - 1
    mean = 0.5 * (p[place[droplets.i[films]]] + p[place[droplets.j[films]]])
    print(f"{path}: {n} of {len(held)} droplets, {len(films)} films, phi = {np.pi * (foam.radii**2).sum() / volume:.3f}, Evolver to {slack.max():.0e}")
    return [
        (1e-9, abs(energy - 2 * np.pi * foam.radii[held].sum() - droplets.energy()), f"energy, {droplets.energy():.9f}"),
        (1e-9, abs((2 * p @ areas - energy) / (2 * volume) - pressure), f"osmotic pressure, {pressure:.9f}"),
        (1e-7 + 1e-6 * pressure, abs(slope + pressure), "osmotic pressure as a slope of the energy"),
        (1e-8, np.abs(p * droplets.corner[held] - 1).max(), "pressures of droplets, relative"),
        (1e-8, np.abs(mean * chords - droplets.force[films]).max(), "forces of contacts"),
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+")
    parser.add_argument("--angle", type=float, default=0.008)
    arguments = parser.parse_args()
    bad = 0
    for path in arguments.paths:
        for limit, off, text in check(path, arguments.angle):
            verdict = "ok" if off <= limit else "BAD"
            bad += verdict != "ok"
            print(f"  {verdict:3} {off:9.2e} (limit {limit:.1e})  {text}")
    sys.exit(3 if bad else 0)


if __name__ == "__main__":
    main()
