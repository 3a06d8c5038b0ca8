"""Undeformed harmonic disks in LAMMPS: f = k_ij delta_ij with k_ij = 4 pi gamma / 3 (R_i + R_j), gamma = 1."""

import math
import time

from lammps import lammps


def version():
    return quiet().version()


def quiet(extra=()):
    return lammps(cmdargs=["-log", "none", "-screen", "none", *extra])


def relax(start, tolerance, settings):
    """Relaxes the disks to a largest net force of `tolerance`; the clock runs over `minimize` alone.

    settings: dt_max (the bound of FIRE's time step), skin (of the neighbour list), suffix ("" or "omp"), threads.
    """
    (lx, ly), centres, radii = start
    kinds = sorted(set(radii))
    number = {radius: k + 1 for k, radius in enumerate(kinds)}
    extra = {"": (), "opt": ("-sf", "opt"), "omp": ("-sf", "omp", "-pk", "omp", str(settings["threads"]))}
    l = quiet(extra[settings["suffix"]])
    l.commands_string(f"""
        units lj
        dimension 2
        boundary p p p
        atom_style atomic
        region box block 0 {lx!r} 0 {ly!r} -0.5 0.5
        create_box {len(kinds)} box
        mass * 1.0
        pair_style harmonic/cut
        neighbor {settings["skin"]} bin
        fix plane all enforce2d
        thermo_style custom step pe
        thermo 1000000000
    """)
    for a, r in enumerate(kinds, 1):
        for b, q in enumerate(kinds[a - 1:], a):
            # LAMMPS: E = k (r_c - r)^2, without a factor 1/2.
            l.command(f"pair_coeff {a} {b} {0.5 * 4 * math.pi / (3 * (r + q))!r} {r + q!r}")
    x = [c for point in centres for c in (*point, 0.0)]
    made = l.create_atoms(len(radii), list(range(1, len(radii) + 1)), [number[r] for r in radii], x)
    assert made == len(radii), "LAMMPS lost a particle"
    # FIRE 2.0 with its published parameters; the time step grows to tmax x timestep.
    l.commands_string(f"""
        timestep {0.1 * settings["dt_max"]!r}
        min_style fire
        min_modify tmax 10 dmax 0.5 norm max
    """)
    before = time.perf_counter()
    l.command(f"minimize 0 {tolerance!r} 1000000 1000000")
    seconds = time.perf_counter() - before
    flat = l.gather_atoms("x", 1, 3)
    positions = [(flat[3 * p], flat[3 * p + 1]) for p in range(len(radii))]
    steps = l.extract_global("ntimestep")
    l.close()
    return {"seconds": seconds, "steps": steps, "positions": positions}
