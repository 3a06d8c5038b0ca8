#!/usr/bin/env python3
"""Checks a softjam recording with nothing of softjam's: only rerun's reader, numpy and the formulas of the paper.

For every recorded state (or every K-th, with --every K):
  eq. (4)        max |A f - delta| relative to max |delta|, A assembled densely from the positions; of disks |f/k - delta|;
                 of droplets that keep their area the gaps of contacts and the areas (foam_law.py)
  contact law    f > 0 on contacts, gap >= 0 for all other pairs
  balance        the largest net force, against the recorded f_max
  pressure, U, Z from forces and distances, against the recorded metrics; stress, coverage and strain in a box that a protocol changes
  contours       every vertex against rho_i(theta) at its own angle; of droplets that keep their area against their arcs, and
                 what these enclose and how long they are against pi R^2 and U, as far as f_max lets them close
  left out       how far the latest contours and contacts are from a state that has none of its own
  beside them    periodic images of contours and contacts, undeformed disks, the numbers of particles and contacts

With --perturb force one contact force is changed by a millionth of itself, with --perturb memory all that droplets remember, with
which no recording may pass.

usage: check_recording.py RUN.rrd [--every K] [--perturb force|memory]      (pip install rerun-sdk==0.36.3 numpy)
"""

import argparse
import sys
import tomllib

import numpy as np
import rerun.experimental as rerun

from foam_law import ARCS, Droplets, dg, g, nearest

STRESS = ("stress_xy", "stress_xx", "stress_yy")

# What stands beside the contours and the contacts, by entity.
BESIDE = {
    "/world/contours/images": ("softjam.Image:particle", "LineStrips2D:strips"),
    "/world/particles": ("Points2D:positions", "softjam.Particle:numbers"),
    "/world/disks": ("Ellipses2D:centers",),
    "/world/contacts": ("softjam.Contact:pair", "softjam.Contact:force", "softjam.Contact:overlap"),
    "/world/contacts/images": ("softjam.Image:contact", "LineStrips2D:strips"),
}


class Recording:
    def __init__(self, path):
        self.states, self.contours, self.metrics, self.stages, self.memory = {}, {}, {}, {}, {}
        self.boxes, self.protocols = {}, {}
        self.beside = {entity: {} for entity in BESIDE}
        for chunk in rerun.RrdReader(path).stream().to_chunks():
            batch = chunk.to_record_batch()
            entity = str(chunk.entity_path)
            if "softjam.Scene:toml" in batch.schema.names:
                scene = tomllib.loads(batch["softjam.Scene:toml"][0][0].as_py())
                self.line_tension = scene["line_tension"]
                self.gradient = scene.get("forces", "central") == "gradient"
                model = scene.get("model", "morse-witten")
                self.model_is_disks, self.keeps_area = model == "disks", model in ("rounded-polygon", "wet-foam")
                self.arcs = model == "wet-foam"
                self.protocol = scene.get("protocol", [])
                self.records_disks = scene.get("disks", {}).get("record", "off") != "off"
                self.first_threshold, self.tolerance = scene["threshold"], scene.get("contact_tolerance", 0.0)
                self.seed_rule = scene.get("contact_rule") in ("saitoh", "seed")
                self.channels = scene["channels"]
            if entity in BESIDE and not chunk.is_static:
                columns = [batch[name] for name in BESIDE[entity]]
                self.beside[entity] |= dict(zip(batch["step"].to_pylist(), zip(*columns)))
            if entity == "/particles":
                self.radii = batch["softjam.Particles:radius"][0].values.to_numpy()
                self.box = self.first_box = batch["softjam.Particles:box"][0].values.to_numpy()
            elif entity == "/state":
                for row in range(batch.num_rows):
                    self.states[batch["step"][row].as_py()] = tuple(
                        flat(batch["softjam.State:" + name][row])
                        for name in ("position", "contact", "force")
                    )
                    for name, found in (("box", self.boxes), ("protocol", self.protocols)):
                        name = "softjam.State:" + name
                        if name in batch.schema.names and batch[name][row].is_valid:
                            found[batch["step"][row].as_py()] = flat(batch[name][row]).copy()
                    if "softjam.State:memory" in batch.schema.names and batch["softjam.State:memory"][row].is_valid:
                        self.memory[batch["step"][row].as_py()] = flat(batch["softjam.State:memory"][row]).copy()
                    if "softjam.State:stage" in batch.schema.names and (stage := batch["softjam.State:stage"][row]).is_valid:
                        self.stages[batch["step"][row].as_py()] = sum(stage.as_py())
            elif entity == "/world/contours" and not chunk.is_static:
                strips = [n for n in batch.schema.names if n.endswith(":strips")][0]
                for row in range(batch.num_rows):
                    self.contours[batch["step"][row].as_py()] = batch[strips][row]
            elif entity.startswith("/metrics/"):
                values = self.metrics.setdefault(entity.removeprefix("/metrics/"), {})
                for row in range(batch.num_rows):
                    values[batch["step"][row].as_py()] = batch["Scalars:scalars"][row][0].as_py()

    def at(self, step):
        """Takes the box and the threshold of a step; its state, with every particle where it is drawn: between the slanted sides."""
        box = self.boxes.get(step, ())
        self.box = box if len(box) else self.first_box
        stage = self.stages.get(step, 0) - self.records_disks
        self.threshold = self.protocol[stage - 1]["threshold"] if stage > 0 else self.first_threshold
        positions, contacts, forces = self.states[step]
        x = positions[:, 0] - self.box[0] * np.floor(straightened(positions, self.box)[:, 0] / self.box[0])
        return np.stack([x, positions[:, 1]], axis=1), contacts, forces

    def disks(self, step):
        """Whether the particles are undeformed disks: all along, or in the first stage of a run that records them."""
        return self.model_is_disks or (self.records_disks and self.stages.get(step, 0) == 0)


def flat(cell):
    """A list of numbers or of pairs as an array of shape (n,) or (n, 2)."""
    values = cell.values
    if hasattr(values, "flatten") and "fixed_size_list" in str(values.type):
        return values.flatten().to_numpy().reshape(-1, 2)
    return values.to_numpy()


def straightened(points, box):
    """Where points of the sheared box are in the upright one."""
    return np.stack([points[:, 0] - sum(box[2:]) * (points[:, 1] / box[1]), points[:, 1]], axis=1)


def check_state(recording, state, gamma, disks):
    """Residuals of one frame: eq. (4), least gap, least force, f_max, pressure, energy."""
    positions, contacts, forces = state
    radii, box = recording.radii, recording.box
    n = len(radii)
    i, j = contacts[:, 0].astype(int), contacts[:, 1].astype(int)
    d = nearest(positions[i] - positions[j], box)
    r = np.hypot(d[:, 0], d[:, 1])
    normal = d / r[:, None]
    delta = radii[i] + radii[j] - r
    # Contacts of each particle: the angle towards the partner and the contact's number.
    angle_i = np.arctan2(-normal[:, 1], -normal[:, 0])
    angle_j = np.arctan2(normal[:, 1], normal[:, 0])
    around = [[] for _ in range(n)]
    matrix = np.zeros((len(forces), len(forces)))
    if disks:
        # f = k delta with k = 4 pi gamma / 3 (R_i + R_j), and nothing bulges.
        np.fill_diagonal(matrix, 3 * (radii[i] + radii[j]) / (4 * np.pi * gamma))
    else:
        for c in range(len(forces)):
            around[i[c]].append((angle_i[c], c))
            around[j[c]].append((angle_j[c], c))
    for p in range(n):
        for a, c in around[p]:
            for b, k in around[p]:
                matrix[c, k] -= radii[p] / (2 * np.pi * gamma) * g(a - b)
    scale = np.abs(delta).max() if len(delta) else 1.0
    residual = np.abs(matrix @ forces - delta).max() / scale if len(delta) else 0.0

    def bulge(p, theta):
        return radii[p] / (2 * np.pi * gamma) * sum(forces[c] * g(theta - a) for a, c in around[p])

    touching = set(zip(i.tolist(), j.tolist()))
    least_gap = np.inf
    for p in range(n):
        away = nearest(positions[p] - positions[p + 1 :], box)
        distance = np.hypot(away[:, 0], away[:, 1])
        # No bulge reaches 0.64 R/(2 pi gamma) times the sum of the forces; twice a radius is far beyond.
        for k in np.flatnonzero(distance < 2 * (radii[p] + radii[p + 1 :])):
            q = p + 1 + int(k)
            if (p, q) not in touching:
                theta = np.arctan2(-away[k, 1], -away[k, 0])
                reach = radii[p] + bulge(p, theta) + radii[q] + bulge(q, theta + np.pi)
                least_gap = min(least_gap, distance[k] - reach)
    net = np.zeros((n, 2))
    np.add.at(net, i, forces[:, None] * normal)
    np.add.at(net, j, -forces[:, None] * normal)
    area, twist, turn = box[0] * box[1], 0.0, 0.0
    if recording.gradient:
        # -dU/dr = f n + (tau / r) t, tau_c = -f_c sum R_p/(2 pi gamma) g'(angle of c less that of k) f_k.
        torque = np.zeros(len(forces))
        for p in range(n):
            for a, c in around[p]:
                for b, k in around[p]:
                    if c != k:
                        torque[c] -= radii[p] / (2 * np.pi * gamma) * dg(a - b) * forces[c] * forces[k]
        push = (torque / r)[:, None] * np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        np.add.at(net, i, push)
        np.add.at(net, j, -push)
        twist = 0.5 * (torque * (normal[:, 0] ** 2 - normal[:, 1] ** 2)).sum() / area
        turn = (torque * normal[:, 0] * normal[:, 1]).sum() / area
    return {
        "eq4": residual,
        "gap": least_gap / scale,
        "force": forces.min() if len(forces) else np.inf,
        "f_max": np.hypot(net[:, 0], net[:, 1]).max(),
        "pressure": (forces * r).sum() / (2 * area),
        "energy": 0.5 * (forces * delta).sum(),
        "stress_xy": -(forces * r * normal[:, 0] * normal[:, 1]).sum() / area - twist,
        "stress_xx": -(forces * r * normal[:, 0] ** 2).sum() / area + turn,
        "stress_yy": -(forces * r * normal[:, 1] ** 2).sum() / area - turn,
        "around": around,
        "scale": scale,
    }


def check_foam(recording, step, state, gamma):
    """`check_state` of droplets that keep their area."""
    positions, contacts, forces = state
    memory = recording.memory[step]
    droplets = Droplets(positions, recording.radii, recording.box, contacts, forces / gamma, memory, recording.arcs)
    found = droplets.residuals(lambda f_max, scale: promised(recording, f_max, scale, False) * scale)
    of_forces = {name: gamma * found[name] for name in ("f_max", "pressure", *STRESS, "energy", "moment")}
    return found | of_forces | {"force": forces.min(initial=np.inf), "droplets": droplets}


def promised(recording, f_max, scale, disks):
    """The residual that a frame keeps to, relative to max |delta|: 16 tolerances; looser far from balance, f_max in units of gamma."""
    tolerance = recording.tolerance
    if disks:
        return 1e-9
    if f_max > recording.threshold and not recording.seed_rule and scale > 0:
        tolerance = max(tolerance, min(3e-4, 1e-2 * f_max * 1.5 / np.pi * recording.radii.min() / scale))
    return max(16 * tolerance, 1e-9)


def check_contours(recording, state, found, strips, gamma):
    """The largest distance of a vertex from rho at its own angle; from the arcs, over how far they miss each other."""
    positions, _, forces = state
    radii = recording.radii
    worst = 0.0
    for p, strip in enumerate(strips.as_py()):
        if not np.array_equal(strip[0], strip[-1]):
            sys.exit(f"contour {p} is not closed")
        v = np.asarray(strip, dtype=float) - positions[p]
        if "droplets" in found:
            droplets = found["droplets"]
            if found["f_max"] <= ARCS * gamma:
                worst = np.maximum(worst, droplets.off_contour(p, v).max() - droplets.pieces(p)[1])
            continue
        theta = np.arctan2(v[:, 1], v[:, 0])
        rho = np.full(len(v), radii[p])
        for a, c in found["around"][p]:
            rho += radii[p] / (2 * np.pi * gamma) * forces[c] * g(theta - a)
        worst = max(worst, np.abs(np.hypot(v[:, 0], v[:, 1]) - rho).max())
    return worst


def periods(points, box, single):
    """Which of the eight shifts bring a point into the box for certain, and which do so if rounding helps."""
    certain, possible = set(), set()
    for x in (-1, 0, 1):
        for y in (-1, 0, 1):
            v = straightened(points + np.array([x * box[0] + y * sum(box[2:]), y * box[1]]), box)
            if x or y:
                sides = box[:2]
                if ((v > single) & (v < sides - single)).all(axis=1).any():
                    certain.add((x, y))
                if ((v > -single) & (v < sides + single)).all(axis=1).any():
                    possible.add((x, y))
    return certain, possible


def images(whole, cell, box, single, dense):
    """Checks images against `whole`, the shapes that they are images of; how many there are."""
    numbers, strips = (c.as_py() for c in cell)
    found = [set() for _ in whole]
    for number, strip in zip(numbers, strips):
        moved = np.asarray(strip) - whole[number]
        rows = np.rint(moved[0, 1] / box[1])
        shift = np.array([np.rint((moved[0, 0] - rows * sum(box[2:])) / box[0]), rows])
        if np.abs(moved - [shift[0] * box[0] + rows * sum(box[2:]), rows * box[1]]).max() > 2 * single:
            sys.exit(f"an image of {number} is not it, moved by a period")
        if tuple(shift) in found[number]:
            sys.exit(f"an image of {number} is there twice")
        found[number].add(tuple(shift))
    for number, shape in enumerate(whole):
        certain, possible = periods(dense(shape), box, single)
        if not certain <= found[number] <= possible:
            sys.exit(f"images of {number}: {found[number]}, not {certain}")
    return len(numbers)


def rattles(n, contacts):
    alive = np.ones(n, dtype=bool)
    while True:
        among = contacts[alive[contacts].all(axis=1)]
        loose = alive & (np.bincount(among.ravel(), minlength=n) < 3)
        if not loose.any():
            return ~alive
        alive &= ~loose


def coordination(n, contacts):
    """Z of the particles that are held, by the contacts among them."""
    held = ~rattles(n, contacts)
    return 2 * held[contacts].all(axis=1).sum() / held.sum() if held.any() else 0.0


def deepest(recording, found, forces, gamma, p):
    """The deepest dent of particle p, in its radius: at its contacts, where the contour of the linear model is deepest."""
    if "droplets" in found:
        ends = [end for film in found["droplets"].contour(p) for end in (film[0], film[1], 0.5 * (film[0] + film[1]))]
        return max([0.0] + [1 - np.hypot(*end) / recording.radii[p] for end in ends])
    at = found["around"][p]
    return max([0.0] + [-sum(forces[k] * g(a - b) for b, k in at) / (2 * np.pi * gamma) for a, _ in at])


def check_beside(recording, step, state, found, gamma, single):
    """What stands beside contours and contacts; the number of images, and the largest relative error of a number."""
    positions, contacts, forces = state
    radii, box, n = recording.radii, recording.box, len(recording.radii)
    cells = {entity: rows[step] for entity, rows in recording.beside.items() if step in rows}
    i, j = contacts[:, 0].astype(int), contacts[:, 1].astype(int)
    d = nearest(positions[i] - positions[j], box)
    count, worst = 0, 0.0
    if "/world/contacts" in cells:
        pair, force, overlap = cells["/world/contacts"]
        if not np.array_equal(flat(pair), contacts):
            sys.exit(f"step {step}: the contacts of the picture are not those of the state")
        delta = radii[i] + radii[j] - np.hypot(d[:, 0], d[:, 1])
        worst = max(np.abs(force.values.to_numpy() / (forces / gamma) - 1).max(initial=0), worst)
        worst = max(np.abs(overlap.values.to_numpy() - delta).max(initial=0), worst)
        ends = list(np.stack([positions[i], positions[i] - d], axis=1))
        along = np.linspace(0, 1, 2001)[:, None]
        dense = lambda s: s[0] + along * (s[1] - s[0])
        count += images(ends, cells["/world/contacts/images"], box, max(single, 1e-3), dense)
    if "/world/particles" in cells:
        drawn, numbers = cells["/world/particles"]
        (centers,) = cells["/world/disks"]
        for places in (drawn, centers):
            if not np.array_equal(flat(places), positions.astype(np.float32)):
                sys.exit(f"step {step}: disks are not at the positions")
        strips = [np.asarray(s) for s in recording.contours[step].as_py()]
        pressure = np.bincount(contacts.ravel(), np.repeat(forces / gamma, 2), n) / (2 * np.pi * radii)
        z = np.bincount(contacts.ravel(), minlength=n)
        for p, (text, rattler) in enumerate(zip(numbers.as_py(), rattles(n, contacts))):
            words = text.replace(",", "").split()
            if words[:5:2] != ["p", "Z", "dent"] or words[3] != str(z[p]) or ("rattler" in words) != rattler:
                sys.exit(f"step {step}, particle {p}: {text!r}; Z is {z[p]}, rattler: {rattler}")
            dent = deepest(recording, found, forces, gamma, p)
            for printed, value, slack in ((words[1], pressure[p], 0), (words[5], dent, 0)):
                # Three digits.
                worst = np.maximum(worst, (abs(float(printed) - value) - 0.00501 * value - slack) / max(value, 1e-300))
        count += images(strips, cells["/world/contours/images"], box, single, lambda s: s)
    return count, worst


def check_left_out(recording, step, state, gamma):
    """How far the pictures shown at a step are from its state, over what `redraw` allows: 0 where they are its own."""
    positions, contacts, forces = state
    worst, redraw = 0.0, recording.channels["redraw"]
    for entity, channel in (("/world/particles", "contours"), ("/world/contacts", "contacts")):
        rows = recording.beside[entity]
        kind, _, k = recording.channels[channel].partition(" ")
        # Of a step that is not on the schedule nothing is said.
        if not rows or step in rows or kind != "every" or step % int(k):
            continue
        drawn = max(k for k in rows if k <= step)
        # States may be thinned more than pictures.
        if drawn not in recording.states:
            continue
        if not np.array_equal(recording.boxes.get(drawn, ()), recording.boxes.get(step, ())):
            continue
        before, pairs, loads = recording.states[drawn]
        moved = np.linalg.norm(nearest(positions - before, recording.box), axis=1)
        worst = max(worst, moved.max() / (redraw * recording.radii.mean()))
        if channel == "contacts":
            change = {tuple(pair): -f for pair, f in zip(pairs.tolist(), loads)}
            for pair, f in zip(contacts.tolist(), forces):
                change[tuple(pair)] = change.get(tuple(pair), 0.0) + f
            change, mean = np.array(list(change.values())), forces.mean()
        else:
            n = len(recording.radii)
            pressure = lambda c, f: np.bincount(c.ravel(), np.repeat(f, 2), n) / recording.radii
            change = pressure(contacts, forces) - pressure(pairs, loads)
            mean = (now := pressure(contacts, forces))[now > 0].mean()
            if list(rattles(n, contacts)) != list(rattles(n, pairs)):
                sys.exit(f"step {step}: a rattler has changed since the picture of step {drawn}")
        worst = max(worst, np.abs(change).max() / (10 * redraw * mean))
    return worst


def off_strain(recording, step):
    """How far coverage and strain are from the recorded ones; the box knows its strain where it is sheared alone, but for whole turns."""
    box, recorded = recording.box, recording.metrics["strain"][step]
    off = abs(np.pi * (recording.radii**2).sum() / (box[0] * box[1]) - recording.metrics["phi"][step])
    if step in recording.protocols and len(recording.protocols[step]):
        off = max(off, abs(recording.protocols[step][0] - recorded))
    if all(stage["act"] != "shear" or stage.get("mode", "simple") == "simple" for stage in recording.protocol):
        turns = (recorded * box[1] - sum(box[2:])) / box[0]
        off = max(off, abs(turns - np.rint(turns)))
    return off


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--perturb", choices=("force", "memory"))
    arguments = parser.parse_args()
    recording = Recording(arguments.path)
    gamma = recording.line_tension
    steps = sorted(recording.states)
    steps = sorted(set(steps[:: arguments.every]) | {steps[-1]})
    checks = "eq4 gap force f_max moment pressure energy stress strain coordination closed enclosed length contour beside left"
    worst = dict.fromkeys(checks.split(), 0.0)
    vertices, count, latest = 0, 0, 0
    # A vertex is a pair of f32 as large as the box: half a unit in the last place of each coordinate.
    sides = [box[:2].max() for box in (recording.first_box, *recording.boxes.values()) if len(box)]
    # A leaning box is drawn up to half a side beyond its upright one.
    lean = 1.5 if recording.boxes else 1.0
    single = float(np.finfo(np.float32).eps) * float(lean * max(sides) + 2 * recording.radii.max())
    for step in steps:
        state = recording.at(step)
        disks = recording.disks(step)
        if arguments.perturb == "force":
            state = *state[:2], state[2] * (1 + 1e-6 * (np.arange(len(state[2])) == 0))
        elif arguments.perturb:
            recording.memory[step] *= 1 + 1e-6
        foam = recording.keeps_area and not disks
        found = check_foam(recording, step, state, gamma) if foam else check_state(recording, state, gamma, disks)
        allowed = promised(recording, found["f_max"] / gamma, found["scale"], disks)
        worst["eq4"] = np.maximum(worst["eq4"], found["eq4"] / allowed)
        worst["gap"] = np.maximum(worst["gap"], -found["gap"] / allowed)
        worst["force"] = np.maximum(worst["force"], -found["force"])
        for name in ("closed", "enclosed", "length"):
            worst[name] = np.maximum(worst[name], found.get(name, 0.0))
        for name in ("f_max", "pressure", "energy") + ("moment",) * foam:
            recorded = recording.metrics[name][step]
            worst[name] = np.maximum(worst[name], abs(found[name] / gamma - recorded))
        for name in STRESS if recording.protocol else STRESS[:1]:
            worst["stress"] = np.maximum(worst["stress"], abs(found[name] / gamma - recording.metrics[name][step]))
        if recording.protocol:
            worst["strain"] = np.maximum(worst["strain"], off_strain(recording, step))
        recorded = recording.metrics["coordination"][step]
        worst["coordination"] = np.maximum(worst["coordination"], abs(coordination(len(recording.radii), state[1]) - recorded))
        if step in recording.contours:
            strips = recording.contours[step]
            vertices += sum(len(s) for s in strips)
            contour = check_contours(recording, state, found, strips, gamma)
            worst["contour"] = np.maximum(worst["contour"], contour)
        more, beside = check_beside(recording, step, state, found, gamma, single)
        count, worst["beside"] = count + more, np.maximum(worst["beside"], beside)
        latest += step not in recording.contours
        worst["left"] = np.maximum(worst["left"], check_left_out(recording, step, state, gamma))
    # Moments are balanced where a run has converged.
    balanced = recording.keeps_area and recording.metrics["f_max"][steps[-1]] <= recording.threshold
    worst["left over"] = found["moment"] / gamma / recording.threshold if balanced else 0.0
    law = "gaps of contacts, and areas," if recording.keeps_area else "eq. (4), |A f - delta|"
    limits = {
        "eq4": (1.0, law + " over what the frame's f_max allows"),
        "gap": (1.0, "overlap of pairs that are not contacts over what f_max allows"),
        "force": (0.0, "negative contact force"),
        "f_max": (1e-9, "net force against the recorded f_max"),
        "pressure": (1e-9, "pressure against the recorded one"),
        "energy": (1e-9, "energy against the recorded one"),
        "stress": (1e-9, "stress against the recorded one"),
        "strain": (1e-11, "coverage and strain of the box against the recorded ones"),
        "coordination": (1e-12, "Z against the recorded one"),
        "contour": (single, f"contour vertex off its contour, {vertices} vertices"),
        "beside": (2e-7, f"numbers of particles and contacts, beside {count} periodic images"),
        "left": (1 + 1e-9, f"the latest picture over what redraw allows, {latest} states without contours of their own"),
    }
    last = steps[-1]
    print(f"{arguments.path}: {len(steps)} states up to step {last}, recorded f_max = {recording.metrics['f_max'][last]:.3e}")
    if recording.keeps_area:
        limits |= {
            "closed": (1.0, "how far arcs miss each other over what f_max allows"),
            "enclosed": (1.0, "what arcs enclose against pi R^2 over what f_max allows"),
            "length": (1.0, "their length against the energy over what f_max allows"),
            "moment": (1e-9, "largest moment against the recorded one"),
            "left over": (1.0, "moments of the last state over the threshold"),
        }
    bad = 0
    for name, (limit, text) in limits.items():
        verdict = "ok" if worst[name] <= limit else "BAD"
        bad += verdict != "ok"
        print(f"  {verdict:3} {worst[name]:9.2e} (limit {limit:.1e})  {text}")
    sys.exit(3 if bad else 0)


if __name__ == "__main__":
    main()
