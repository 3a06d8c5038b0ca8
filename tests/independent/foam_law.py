"""Droplets that keep their area, from positions, radii, contacts, forces and what a frame remembers, with numpy alone.

With gamma = 1, g the kernel of eq. (2), F = sum f, K = -sum f g / 2 pi and M = sum f g' / 2 pi over the contacts of a droplet:

  Y      (1 + F/2pi)^2 - f K/2pi
  r      corner radius: R/sqrt(Y) of rounded polygons; of wet foam such that r^2 (pi Y + sum psi) = pi R^2
  delta  bend of a film: 0 of rounded polygons; of wet foam sin delta = f (r_j - r_i)/2(r_j + r_i)
  rho    r (F/2pi - K + cos delta), distance of a contact's chord; m = r M, its midpoint along the tangent
  gap    n dx - rho_i - rho_j;   T = |dx| sin tau + m_i + m_j, with n the line of centres turned by the tilt tau
  U      sum pi (r (Y - 1) + (R - r)^2/r) + sum C - sum f n dx, which is sum perimeter - 2 pi R in balance
"""

import numpy as np

# A frame has a tilt of every pair nearer than this, in sums of radii; beyond FAR no two droplets touch.
REACH, FAR = 1.3, 2.0
# The net force up to which arcs are looked at; far from balance they run backwards.
ARCS = 0.5


def g(theta):
    """The kernel of eq. (2), even and 2 pi periodic."""
    t = np.mod(np.abs(theta), 2 * np.pi)
    return (np.pi - t) * np.sin(t) - 0.5 * np.cos(t) - 1.0


def dg(theta):
    """The slope of g, with 0 where it jumps."""
    t = np.mod(theta, 2 * np.pi)
    return np.where(np.minimum(t, 2 * np.pi - t) < 1e-12, 0.0, (np.pi - t) * np.cos(t) - 0.5 * np.sin(t))


def nearest(d, box):
    """The nearest image of a difference in a box of sides `box[:2]`, whose upper period leans by `box[2]` where there is one."""
    rows = np.rint(d[..., 1] / box[1])
    x = d[..., 0] - rows * sum(box[2:])
    return np.stack([x - box[0] * np.rint(x / box[0]), d[..., 1] - rows * box[1]], axis=-1)


def unit(angle):
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def longer(delta):
    """delta/sin delta - 1."""
    return np.where(np.abs(delta) < 1e-3, delta**2 / 6 + 7 * delta**4 / 360, delta / np.where(delta == 0, 1, np.sin(delta)) - 1)


def odd(delta):
    """h = (2 delta - sin 2 delta)/sin^2 delta."""
    few = 4 * delta / 3 + 8 * delta**3 / 45
    return np.where(np.abs(delta) < 1e-3, few, (2 * delta - np.sin(2 * delta)) / np.where(delta == 0, 1, np.sin(delta)) ** 2)


class Droplets:
    """What a frame's droplets are. Lines are all pairs i < j nearer than REACH, ascending; those with a force are contacts."""

    def __init__(self, positions, radii, box, contacts, forces, memory, arcs):
        self.positions, self.radii, self.arcs = positions, radii, arcs
        self.volume, n = box[0] * box[1], len(radii)
        i, j = np.triu_indices(n, 1)
        between = nearest(positions[j] - positions[i], box)
        distance, sums = np.hypot(*between.T), radii[i] + radii[j]
        near, far = distance < REACH * sums, (distance >= REACH * sums) & (distance < FAR * sums)
        self.far = i[far], j[far], between[far]
        self.i, self.j, self.between, self.distance = i[near], j[near], between[near], distance[near]
        lines, dents = near.sum(), n if arcs else 0
        if not lines + dents <= len(memory) <= lines + dents + 1:
            raise SystemExit(f"a memory of {len(memory)} numbers is not that of {lines} pairs and {n} droplets")
        self.tilt, self.give = memory[:lines], sum(memory[lines + dents :])
        place = {pair: c for c, pair in enumerate(zip(self.i.tolist(), self.j.tolist()))}
        self.force = np.zeros(lines)
        self.force[[place[tuple(pair)] for pair in contacts.tolist()]] = forces
        self.angle = np.arctan2(self.between[:, 1], self.between[:, 0]) + self.tilt
        self.normal = unit(self.angle)
        self.load(n)
        self.corner = radii - memory[lines : lines + dents] if arcs else radii / np.sqrt(self.y + 1)
        self.chords()

    def load(self, n):
        """F, K, M and Y - 1."""
        ends = np.concatenate([self.i, self.j])
        angles, forces = np.concatenate([self.angle, self.angle + np.pi]), np.concatenate([self.force, self.force])
        self.total, self.second = np.zeros(n), np.zeros(n)
        k, m = np.zeros(len(ends)), np.zeros(len(ends))
        self.around = []
        for p in range(n):
            sides = np.flatnonzero(ends == p)
            pressed = sides[forces[sides] > 0]
            f = forces[pressed]
            differences = angles[sides][:, None] - angles[pressed][None, :]
            k[sides], m[sides] = -g(differences) @ f / (2 * np.pi), dg(differences) @ f / (2 * np.pi)
            self.total[p] = f.sum()
            self.second[p] = f.sum() ** 2 / (4 * np.pi) - 0.5 * f @ k[pressed]
            self.around.append((angles[pressed], f))
        self.k, self.m = k.reshape(2, -1), m.reshape(2, -1)
        self.y = (self.total + self.second) / np.pi

    def chords(self):
        """The films: bend, distance and midpoint of each chord as either droplet sees them."""
        ends = np.stack([self.i, self.j])
        r_i, r_j = self.corner[ends]
        self.bend = np.arcsin(0.5 * self.force * (r_j - r_i) / (r_j + r_i)) if self.arcs else np.zeros(len(self.force))
        self.rho = self.corner[ends] * (self.total[ends] / (2 * np.pi) - self.k + np.cos(self.bend))
        self.middle = self.corner[ends] * self.m
        self.length = np.stack([2 * self.force * r_i * r_j / (r_i + r_j)] * 2 if self.arcs else [self.force * r_i, self.force * r_j])
        self.along = (self.normal * self.between).sum(axis=1)
        self.gap = self.along - self.rho.sum(axis=0) + self.give * self.force
        self.arm = self.distance * np.sin(self.tilt) + self.middle.sum(axis=0)

    def reach(self, p, angle):
        """How far the contour of droplet p reaches in a direction."""
        at, f = self.around[p]
        return self.corner[p] * (1 + (self.total[p] + f @ g(angle - at)) / (2 * np.pi))

    def far_gap(self):
        """The least gap between droplets that are too far for a line."""
        gaps = []
        for i, j, d in zip(*self.far):
            angle = np.arctan2(d[1], d[0])
            gaps.append(np.hypot(*d) - self.reach(i, angle) - self.reach(j, angle + np.pi))
        return min(gaps, default=np.inf)

    def areas(self):
        """r^2 (pi Y + sum psi) - pi R^2 of each droplet."""
        even, uneven = self.force * longer(self.bend), self.force**2 * odd(self.bend) / 8
        psi = np.bincount(self.i, even + uneven, len(self.radii)) + np.bincount(self.j, even - uneven, len(self.radii))
        return self.corner**2 * (np.pi * self.y + np.pi + psi) - np.pi * self.radii**2

    def energy(self):
        """The stationary value of the Lagrangian."""
        sums = self.corner[self.i] + self.corner[self.j]
        film = sums * self.force * (0.5 * (longer(self.bend) + 1 + np.cos(self.bend)) - 1)
        droplet = np.pi * (self.corner * self.y + (self.radii - self.corner) ** 2 / self.corner)
        return droplet.sum() + film.sum() - self.force @ self.along - 0.5 * self.give * (self.force**2).sum()

    def net(self):
        """Force on each droplet."""
        net, push = np.zeros((len(self.radii), 2)), self.force[:, None] * self.normal
        np.add.at(net, self.i, -push)
        np.add.at(net, self.j, push)
        return net

    def stress(self):
        """-(1/V) sum f n (x) dx, made symmetric, tension positive."""
        moment = np.einsum("c,ca,cb->ab", self.force, self.normal, self.between)
        return -0.5 * (moment + moment.T) / self.volume

    def contour(self, p):
        """Droplet p anticlockwise, seen from its centre: films as (from, to, normal angle, bend) in the order of their angles."""
        films = []
        for end, who in enumerate((self.i, self.j)):
            for c in np.flatnonzero((who == p) & (self.force > 0)):
                angle, bend = (self.angle[c] + np.pi, -self.bend[c]) if end else (self.angle[c], self.bend[c])
                angle = np.arctan2(np.sin(angle), np.cos(angle))
                n = unit(angle)
                t, half = np.array([-n[1], n[0]]), 0.5 * self.length[end, c]
                at = n * self.rho[end, c] + t * self.middle[end, c]
                films.append((at - half * t, at + half * t, angle, bend))
        return sorted(films, key=lambda film: film[2])

    def pieces(self, p):
        """The arcs of droplet p: (from, to, normal angle at from, at to); a straight film has the same angle twice.

        Free arcs go to where the next film begins. How far they miss it is the second answer, 0 in balance.
        """
        films, r, arcs, missed = self.contour(p), self.corner[p], [], 0.0
        for (first, last, angle, bend), (after, _, then, curve) in zip(films, films[1:] + films[:1]):
            arcs.append((first, last, angle - bend, angle + bend))
            begin, end = angle + bend, then - curve
            end += 2 * np.pi if then <= angle else 0.0
            missed = np.maximum(missed, np.hypot(*(last + r * (unit(end) - unit(begin)) - after)))
            arcs.append((last, after, begin, end))
        return arcs, missed

    def contour_area(self, p):
        """The area within the arcs of droplet p, exactly: the polygon of their ends and a circular segment on each."""
        arcs, area = self.pieces(p)[0], 0.0
        if not arcs:
            return np.pi * self.radii[p] ** 2
        for a, b, begin, end in arcs:
            half, chord = 0.5 * (end - begin), np.hypot(*(b - a))
            area += 0.5 * (a[0] * b[1] - a[1] * b[0]) + (chord**2 / 8 * odd(half) if half else 0.0)
        return area

    def contour_length(self, p):
        """The length of the arcs of droplet p: free ones of its corner radius, films over their chords."""
        films, r = self.contour(p), self.corner[p]
        turned = 2 * np.pi - sum(2 * bend for *_, bend in films)
        return r * turned + sum(np.hypot(*(b - a)) * (longer(bend) + 1) for a, b, _, bend in films)

    def off_contour(self, p, points):
        """How far points, seen from the centre, are from the arcs of droplet p."""
        arcs = self.pieces(p)[0]
        if not arcs:
            return np.abs(np.hypot(*points.T) - self.radii[p])
        best = np.full(len(points), np.inf)
        for a, b, begin, end in arcs:
            middle, half, chord = 0.5 * (begin + end), 0.5 * (end - begin), b - a
            for corner in (a, b):
                best = np.minimum(best, np.hypot(*(points - corner).T))
            if abs(half) < 1e-9:
                share = ((points - a) @ chord) / max(chord @ chord, 1e-300)
                off = np.hypot(*(points - a - share[:, None] * chord).T)
                best = np.where((share > 0) & (share < 1), np.minimum(best, off), best)
            else:
                radius = np.hypot(*chord) / (2 * np.sin(half))
                centre = 0.5 * (a + b) - radius * np.cos(half) * unit(middle)
                seen = (points - centre) * np.sign(half)
                turned = np.arctan2(seen[:, 1], seen[:, 0]) - middle
                within = np.abs(np.arctan2(np.sin(turned), np.cos(turned))) <= abs(half)
                best = np.where(within, np.minimum(best, np.abs(np.hypot(*seen.T) - abs(radius))), best)
        return best

    def residuals(self, promised):
        """What there is to compare; what arcs are against what they should be, over what `promised(f_max, scale)`, a length, and f_max allow."""
        radii, force, pressed, stress = self.radii, self.force, self.force > 0, self.stress()
        depth = np.abs(radii[self.i] + radii[self.j] - self.distance)
        scale = depth[pressed].max(initial=0.0) or 1.0
        law = np.abs(np.concatenate([self.gap[pressed], self.areas() / (2 * np.pi * radii)])).max()
        f_max = np.hypot(*self.net().T).max()
        found = {
            "eq4": law / scale,
            "gap": np.append(self.gap[~pressed], self.far_gap()).min() / scale,
            "f_max": f_max,
            "pressure": -0.5 * np.trace(stress),
            "stress_xy": stress[0, 1],
            "stress_xx": stress[0, 0],
            "stress_yy": stress[1, 1],
            "energy": self.energy(),
            "scale": scale,
            "moment": np.abs(force * self.arm).max(initial=0.0),
        }
        if f_max > ARCS:
            return found
        # Arcs close but for the net force; what they enclose and how long they are is wrong by less. Soft contacts overlap by give f.
        allowed, droplets = promised(f_max, scale) + 1e-13, range(len(radii))
        missed = np.max([self.pieces(p)[1] for p in droplets])
        enclosed = [self.contour_area(p) for p in droplets] - np.pi * radii**2
        length = sum(self.contour_length(p) - 2 * np.pi * radii[p] for p in droplets)
        off = length - self.energy() + 0.5 * self.give * (force**2).sum()
        found["closed"] = missed / (radii.max() * f_max + allowed)
        found["enclosed"] = np.abs(enclosed / (2 * np.pi * radii)).max() / (0.1 * radii.max() * f_max + allowed)
        found["length"] = abs(off) / (0.01 * radii.sum() * f_max + (1 + force.sum()) * allowed)
        return found
