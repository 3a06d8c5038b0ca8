"""Equilibrium, computed anew from positions: nothing here is shared with softjam or LAMMPS."""

import numpy as np


def read_packing(path):
    table = np.loadtxt(path)
    return (float(table[0, 0]), float(table[0, 1])), table[1:, :2].tolist(), table[1:, 2].tolist()


def separations(box, positions):
    """All r_i - r_j, nearest image, as an N x N x 2 array."""
    x = np.asarray(positions)
    d = x[:, None, :] - x[None, :, :]
    return d - np.asarray(box) * np.round(d / np.asarray(box))


def disks(start, positions):
    """The largest net force of harmonic disks."""
    box, _, radii = start
    radii = np.asarray(radii)
    d = separations(box, positions)
    r = np.linalg.norm(d, axis=2)
    np.fill_diagonal(r, np.inf)
    reach = radii[:, None] + radii[None, :]
    f = np.where(r < reach, 4 * np.pi / (3 * reach) * (reach - r), 0.0)
    return float(np.linalg.norm((f[:, :, None] * d / r[:, :, None]).sum(axis=1), axis=1).max())


def g(theta):
    """The kernel, from its definition, for -2 pi <= theta <= 2 pi."""
    theta = np.abs(theta)
    return (np.pi - theta) * np.sin(theta) - 0.5 * np.cos(theta) - 1


def droplets(folder):
    """The largest net force of the Morse-Witten packing in `folder`, and how far its forces are from the contact law.

    Contour radii are summed up at every neighbour, touching or not: a contact must have no gap, no other pair an overlap.
    """
    box, positions, radii = read_packing(folder / "end.txt")
    radii, n = np.asarray(radii), len(radii)
    table = np.loadtxt(folder / "contacts.txt", ndmin=2)
    f = np.zeros((n, n))
    i, j = table[:, 0].astype(int), table[:, 1].astype(int)
    f[i, j] = f[j, i] = table[:, 2]
    d = separations(box, positions)
    r = np.linalg.norm(d, axis=2)
    np.fill_diagonal(r, np.inf)
    toward = np.arctan2(-d[:, :, 1], -d[:, :, 0])  # the direction from i to j
    reach = radii[:, None] + radii[None, :]
    near = r < reach + radii.max()
    contour = np.zeros((n, n))
    for p in range(n):
        there, pushed = np.flatnonzero(near[p]), np.flatnonzero(f[p])
        bulge = g(toward[p, there][:, None] - toward[p, pushed][None, :]) @ f[p, pushed]
        contour[p, there] = radii[p] * (1 + bulge / (2 * np.pi))
    gap = np.where(near, r - contour - contour.T, np.inf)
    law = max(np.abs(gap[f > 0]).max(initial=0.0), -min(gap[f == 0].min(), 0.0), -min(f.min(), 0.0))
    net = (f[:, :, None] * d / r[:, :, None]).sum(axis=1)
    return {"f_checked": float(np.linalg.norm(net, axis=1).max()), "law": float(law)}
