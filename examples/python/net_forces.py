#!/usr/bin/env python3
"""Net forces and stress of the recorded states, from positions, contacts and contact forces alone, in either form.

usage: net_forces.py RUN.rrd|RUN.mcap
needs: what read_rrd.py or read_mcap.py needs

Prints, for each state, the largest net force (units of the line tension) beside the recorded f_max, and the stress; ends
with an error if they do not agree. `net_forces` is what to take from here: one vector a particle.
"""

import sys
import tomllib

import numpy as np


def net_forces(state, radius, box, line_tension=1.0, form="central"):
    """Net force on each particle (N x 2), and the stress [[xx, xy], [xy, yy]], tension positive (force/length).

    central:   F_i = sum_j f_ij n_ij
    gradient:  F_i = sum_j (f_ij n_ij + tau_ij/r_ij t_ij), with t_ij the unit vector n_ij turned by a quarter and
               tau_c = -sum_d (R_p / 2 pi gamma) f_c f_d g'(phi_c - phi_d) over the other contacts d of both particles p of c,
               g'(x) = (pi - x) cos x - sin(x)/2 for 0 < x < 2 pi
    """
    i, j = state["contact"].astype(int).T
    f = state["force"]
    apart = state["position"][i] - state["position"][j]
    apart -= box * np.round(apart / box)
    r = np.hypot(*apart.T)
    n = apart / r[:, None]
    t = np.column_stack((-n[:, 1], n[:, 0]))
    torque = np.zeros(len(f))
    if form == "gradient":
        phi = np.arctan2(n[:, 1], n[:, 0])
        for p in range(len(radius)):
            own = np.flatnonzero((i == p) | (j == p))
            # Directions from p: n points from j to i.
            angle = np.where(i[own] == p, phi[own] + np.pi, phi[own])
            x = np.mod(angle[:, None] - angle[None, :], 2 * np.pi)
            slope = (np.pi - x) * np.cos(x) - np.sin(x) / 2
            np.fill_diagonal(slope, 0.0)
            torque[own] -= radius[p] / (2 * np.pi * line_tension) * f[own] * (slope @ f[own])
    force = f[:, None] * n + (torque / r)[:, None] * t
    net = np.zeros_like(state["position"])
    np.add.at(net, i, force)
    np.add.at(net, j, -force)
    stress = -np.einsum("ca,cb->ab", force, apart) / np.prod(box)
    return net, (stress + stress.T) / 2


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    path = sys.argv[1]
    if path.endswith(".mcap"):
        from read_mcap import read
    else:
        from read_rrd import read
    metrics, states, packing = read(path)
    scene = tomllib.loads(packing["scene"])
    gamma, form = scene["line_tension"], scene["forces"]
    recorded = metrics.get("f_max", {})
    worst = 0.0
    for step, state in sorted(states.items()):
        net, stress = net_forces(state, packing["radius"], packing["box"], gamma, form)
        f_max, stress = np.hypot(*net.T).max(initial=0.0) / gamma, stress / gamma
        line = f"step {step}: f_max = {f_max:.6e}"
        if step in recorded:
            line += f", recorded {recorded[step]:.6e}"
            worst = max(worst, abs(f_max - recorded[step]), abs(stress[0, 1] - metrics["stress_xy"][step]))
        print(f"{line}; stress xx {stress[0, 0]:.6e}, yy {stress[1, 1]:.6e}, xy {stress[0, 1]:.6e}")
    print(f"{form} forces: off the recorded f_max and stress_xy by {worst:.1e} at most")
    if worst > 1e-12:
        sys.exit("that is more than rounding")
