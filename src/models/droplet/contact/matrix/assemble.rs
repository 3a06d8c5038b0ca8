//! The entries of [`ContactMatrix`] at new positions, and its products, by one thread or by two.

use super::blocks::Run;
use super::entries_f32::{BlocksF32, Lanes, Operand, fill_f32, fill_f32_blocks};
use super::entries_f64::{Blocks, fill, fill_blocks};
use super::product::{FirstProducts, Number, Products};
use super::{ContactMatrix, Precision, Units};
use crate::domain::Vec2;
use crate::models::droplet::contact::geometry::{Directions, Geometry, Part};
use crate::models::droplet::kernel::Direction;
use crate::numerics::threads::{are_two_for, both};
use crate::numerics::wide::wide;
use crate::state::Packing;
use core::ops::Range;

/// Room for what is computed of a run and not kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    toward: Vec<Direction>,
    lanes: Vec<Lanes>,
}

/// What blocks are made from.
#[derive(Clone, Copy)]
struct Layout<'a> {
    runs: &'a [Run],
    particle: &'a [u32],
    end: &'a [u32],
    factor: &'a [f64],
    inverse_root: &'a [f64],
    operands: &'a [Operand],
    loads: &'a [f32],
    units: Units,
}

/// Where the entries of blocks go, the first of all being number `first` of the matrix.
struct Filled<'a> {
    first: usize,
    value: &'a mut [f64],
    entries_f32: &'a mut [f32],
    scratch: &'a mut Scratch,
}

/// The precision that entries are computed in, and the column for their products with the forces.
enum Column<'a> {
    Double(&'a mut [f64]),
    Single(&'a mut [f32]),
}

impl ContactMatrix {
    /// Directions and values at the positions of `packing`, and what the off-diagonal entries make of `forces`, as
    /// [`products_into`](Self::products_into) has it; entries and products in this `precision`. The pairs are the contacts by number,
    /// those of `geometry`. Returns the largest `|δ|` (length).
    pub(crate) fn assemble(
        &mut self,
        geometry: &mut Geometry,
        at: (&Packing, &[[u32; 2]], &[f64]),
        products: &mut FirstProducts,
        precision: Precision,
    ) -> f64 {
        self.lacks_values = precision == Precision::Single;
        let n = self.len();
        match (precision, self.is_for_two()) {
            (Precision::Single, false) => {
                let column = Column::Single(products.single.alone(n));
                self.assemble_by_one(geometry, at, column)
            }
            (Precision::Double, false) => {
                let column = Column::Double(products.double.alone(n));
                self.assemble_by_one(geometry, at, column)
            }
            (Precision::Single, true) => {
                let columns = products.single.both(n).map(Column::Single);
                let largest = self.assemble_by_two(geometry, at, columns);
                products.single.add_up();
                largest
            }
            (Precision::Double, true) => {
                let columns = products.double.both(n).map(Column::Double);
                let largest = self.assemble_by_two(geometry, at, columns);
                products.double.add_up();
                largest
            }
        }
    }

    /// The entries in single precision of the directions of `geometry`, and their products with `forces`.
    pub(crate) fn assemble_f32(
        &mut self,
        geometry: &Geometry,
        forces: &[f64],
        products: &mut FirstProducts,
    ) {
        let (contacts, runs) = (self.len(), self.runs.len());
        let mut column = Column::Single(products.single.alone(contacts));
        wide(
            #[inline(always)]
            || {
                self.compute_operands(geometry, forces, 0..contacts);
                self.fill((geometry.directions(), forces), 0..runs, &mut column);
            },
        );
        self.lacks_values = true;
    }

    /// Values of the directions of `geometry`, where they are not there.
    pub(crate) fn complete(&mut self, geometry: &Geometry) {
        if self.is_complete() {
            return;
        }
        let zeros = vec![0.0; self.len()];
        let mut products = vec![0.0; self.len()];
        let column = &mut Column::Double(&mut products);
        let all = 0..self.runs.len();
        wide(
            #[inline(always)]
            || self.fill((geometry.directions(), &zeros), all, column),
        );
        self.lacks_values = false;
    }

    /// Whether all values are of these positions and contacts.
    pub(crate) fn is_complete(&self) -> bool {
        !self.lacks_values
    }

    /// [`add_products`](Self::add_products) to zeros, by two threads if there are two.
    pub(crate) fn products_into<F: Number>(&self, values: &[F], x: &[F], y: &mut Products<F>) {
        let all = self.runs.len();
        let part = |runs: Range<usize>, y: &mut [F]| {
            wide(
                #[inline(always)]
                || self.add_products(values, runs, x, y),
            );
        };
        if self.is_for_two() {
            let middle = self.middle();
            let [one, other] = y.both(self.len());
            both(true, || part(0..middle, one), || part(middle..all, other));
            y.add_up();
        } else {
            part(0..all, y.alone(self.len()));
        }
    }

    /// Whether there are two threads, and work for both.
    pub(crate) fn is_for_two(&self) -> bool {
        are_two_for(self.len())
    }

    /// One stretch of particles after the other, so that what is computed stays near: the directions that a block needs are
    /// those of its own stretch or of one before.
    fn assemble_by_one(
        &mut self,
        geometry: &mut Geometry,
        (packing, pairs, forces): (&Packing, &[[u32; 2]], &[f64]),
        mut column: Column<'_>,
    ) -> f64 {
        let sorted = self.sorted_contacts();
        let in_single = matches!(column, Column::Single(_));
        let stretches = core::mem::take(&mut self.stretches);
        let largest = wide(
            #[inline(always)]
            || {
                let mut largest: f64 = 0.0;
                let [mut run, mut contact] = [0; 2];
                let late = ([0; 2], sorted..pairs.len());
                let ends = stretches.iter().map(|&[runs, contacts]| {
                    let own = core::mem::replace(&mut contact, contacts)..contacts;
                    ([core::mem::replace(&mut run, runs), runs], own)
                });
                for (runs, own) in core::iter::once(late).chain(ends) {
                    let part = geometry.part(own.clone());
                    part.refresh(packing, &pairs[own.clone()]);
                    largest = largest.max(self.largest_overlap(geometry, own.clone()));
                    if in_single {
                        self.compute_operands(geometry, forces, own);
                    }
                    let at = (geometry.directions(), forces);
                    self.fill(at, runs[0]..runs[1], &mut column);
                }
                let all = self.runs.len();
                let at = (geometry.directions(), forces);
                self.fill(at, self.sorted_runs..all, &mut column);
                largest
            },
        );
        self.stretches = stretches;
        largest
    }

    /// What single precision knows of some contacts.
    #[inline(always)]
    fn compute_operands(&mut self, geometry: &Geometry, forces: &[f64], contacts: Range<usize>) {
        let operands = Operands {
            operands: &mut self.operands[contacts.clone()],
            loads: &mut self.loads[contacts.clone()],
        };
        let of = [&self.diagonal[..], &self.inverse_root, forces];
        operands.compute(geometry.directions(), of, contacts, self.units);
    }

    /// [`compute_operands`](Self::compute_operands) at all contacts, the first `half` of them and the others.
    fn compute_operands_by_two(&mut self, geometry: &Geometry, forces: &[f64], half: usize) {
        let (of, units) = ([&self.diagonal[..], &self.inverse_root, forces], self.units);
        let (operands, more_operands) = self.operands.split_at_mut(half);
        let (loads, more_loads) = self.loads.split_at_mut(half);
        let compute = |operands: Operands<'_>, contacts: Range<usize>| {
            wide(
                #[inline(always)]
                || operands.compute(geometry.directions(), of, contacts, units),
            );
        };
        let one = Operands { operands, loads };
        let other = Operands {
            operands: more_operands,
            loads: more_loads,
        };
        let all = of[0].len();
        both(true, || compute(one, 0..half), || compute(other, half..all));
    }

    /// Half of the directions each, then half of the entries each.
    fn assemble_by_two(
        &mut self,
        geometry: &mut Geometry,
        (packing, pairs, forces): (&Packing, &[[u32; 2]], &[f64]),
        [mut column, mut more]: [Column<'_>; 2],
    ) -> f64 {
        let refresh = |part: Part<'_>, pairs: &[[u32; 2]]| {
            wide(
                #[inline(always)]
                || part.refresh(packing, pairs),
            );
        };
        let half = pairs.len() / 2;
        let [one, other] = geometry.halves(half);
        both(
            true,
            || refresh(one, &pairs[..half]),
            || refresh(other, &pairs[half..]),
        );
        let (middle, all, length) = (self.middle(), self.runs.len(), self.len());
        if matches!(column, Column::Single(_)) {
            self.compute_operands_by_two(geometry, forces, half);
        }
        let (layout, [mut one, mut other]) = self.halves(middle);
        let fill = |runs: Range<usize>, out: &mut Filled<'_>, column: &mut Column<'_>| {
            wide(
                #[inline(always)]
                || layout.fill((geometry.directions(), forces), runs, out, column),
            );
        };
        both(
            true,
            || fill(0..middle, &mut one, &mut column),
            || fill(middle..all, &mut other, &mut more),
        );
        wide(
            #[inline(always)]
            || self.largest_overlap(geometry, 0..length),
        )
    }

    /// The run with which the second half of the entries begins.
    fn middle(&self) -> usize {
        let half = self.entries_f32.len() / 2;
        self.runs.partition_point(|run| run.values().start < half)
    }

    /// What the blocks are made from, and where they go: those of the first `middle` runs, and the others.
    fn halves(&mut self, middle: usize) -> (Layout<'_>, [Filled<'_>; 2]) {
        let all = self.entries_f32.len();
        let first = self.runs.get(middle).map_or(all, |run| run.values().start);
        let layout = Layout {
            runs: &self.runs,
            particle: &self.particle,
            end: &self.end,
            factor: &self.factor,
            inverse_root: &self.inverse_root,
            operands: &self.operands,
            loads: &self.loads,
            units: self.units,
        };
        let (entries_f32, more_entries) = self.entries_f32.split_at_mut(first);
        let (value, more_values) = self.value.split_at_mut(first);
        let [scratch, more_scratch] = &mut self.scratch;
        let one = Filled {
            first: 0,
            value,
            entries_f32,
            scratch,
        };
        let other = Filled {
            first,
            value: more_values,
            entries_f32: more_entries,
            scratch: more_scratch,
        };
        (layout, [one, other])
    }

    /// The values of some runs, in both precisions, and their products with the forces.
    #[inline(always)]
    fn fill(&mut self, at: (Directions<'_>, &[f64]), runs: Range<usize>, column: &mut Column<'_>) {
        let all = self.runs.len();
        let (layout, [mut all, _]) = self.halves(all);
        layout.fill(at, runs, &mut all, column);
    }

    /// The largest `|δ|` (length) of some contacts, leaving out the inactive ones.
    #[inline(always)]
    pub(crate) fn largest_overlap(&self, geometry: &Geometry, contacts: Range<usize>) -> f64 {
        let larger = |m: f64, x: f64| if x > m { x } else { m };
        let in_contact = |d: f64, s: f64| if s > 0.0 { d.abs() } else { 0.0 };
        let (d8, d_rest) = geometry.overlaps()[contacts.clone()].as_chunks::<8>();
        let (s8, s_rest) = self.inverse_root[contacts].as_chunks::<8>();
        let mut largest = [0.0; 8];
        for (d, s) in d8.iter().zip(s8) {
            for k in 0..8 {
                largest[k] = larger(largest[k], in_contact(d[k], s[k]));
            }
        }
        let rest = d_rest.iter().zip(s_rest).map(|(d, s)| in_contact(*d, *s));
        rest.chain(largest).fold(0.0, larger)
    }
}

/// Columns of what single precision knows of some contacts.
struct Operands<'a> {
    operands: &'a mut [Operand],
    loads: &'a mut [f32],
}

impl Operands<'_> {
    /// From the directions of the `contacts`, and the columns of diagonal, inverse root and forces of all.
    #[inline(always)]
    fn compute(
        self,
        Directions { normals, angles }: Directions<'_>,
        of: [&[f64]; 3],
        contacts: Range<usize>,
        units: Units,
    ) {
        let [diagonal, roots, forces] = of.map(
            #[inline(always)]
            |column| &column[contacts.clone()],
        );
        let inverse = 1.0 / units.load;
        let columns = self.loads.iter_mut().zip(diagonal);
        for ((load, a), (s, f)) in columns.zip(roots.iter().zip(forces)) {
            *load = (f * (a * s * inverse)) as f32;
        }
        let directions = normals[contacts.clone()].iter().zip(&angles[contacts]);
        for ((operand, s), (n, angle)) in self.operands.iter_mut().zip(roots).zip(directions) {
            *operand = Operand::of((-n.x, -n.y), *angle, s * units.root);
        }
    }
}

impl Layout<'_> {
    /// The entries of some runs, and their products with the forces.
    #[inline(always)]
    fn fill(
        self,
        at: (Directions<'_>, &[f64]),
        runs: Range<usize>,
        out: &mut Filled<'_>,
        column: &mut Column<'_>,
    ) {
        match column {
            Column::Double(products) => self.assemble_f64(at, runs, out, products),
            Column::Single(products) => self.assemble_f32(runs, out, products),
        }
    }

    #[inline(always)]
    fn assemble_f64(
        self,
        (directions, forces): (Directions<'_>, &[f64]),
        runs: Range<usize>,
        out: &mut Filled<'_>,
        products: &mut [f64],
    ) {
        let toward = &mut out.scratch.toward;
        for run in &self.runs[runs] {
            let ends = &self.end[run.ends()];
            // Nothing that is called here may be left to a function of its own, which would not be compiled for wide vectors.
            if toward.len() < ends.len() {
                toward.resize(ends.len(), Direction::of(Vec2::x()));
            }
            for (toward, end) in toward.iter_mut().zip(ends) {
                *toward = directions.toward(*end);
            }
            let own = run.values().start - out.first..run.values().end - out.first;
            let blocks = Blocks {
                toward,
                ends,
                values: &mut out.value[own.clone()],
                entries_f32: &mut out.entries_f32[own],
                inverse_root: self.inverse_root,
                forces,
                products,
            };
            let particles = &self.particle[run.blocks()];
            let factors = particles.iter().map(|p| self.factor[*p as usize]);
            match run.size {
                1 => {}
                2 => fill::<2, 1>(blocks, factors),
                3 => fill::<3, 3>(blocks, factors),
                4 => fill::<4, 6>(blocks, factors),
                5 => fill::<5, 10>(blocks, factors),
                6 => fill::<6, 15>(blocks, factors),
                7 => fill::<7, 21>(blocks, factors),
                z => fill_blocks(z, blocks, factors),
            }
        }
    }

    #[inline(always)]
    fn assemble_f32(self, runs: Range<usize>, out: &mut Filled<'_>, products: &mut [f32]) {
        let per_radius = 1.0 / (self.units.root * self.units.root);
        for run in &self.runs[runs] {
            let own = run.values().start - out.first..run.values().end - out.first;
            let blocks = BlocksF32 {
                ends: &self.end[run.ends()],
                operands: self.operands,
                loads: self.loads,
                entries_f32: &mut out.entries_f32[own],
                products,
                scratch: &mut out.scratch.lanes,
            };
            let particles = &self.particle[run.blocks()];
            let radii = particles
                .iter()
                .map(|p| (self.factor[*p as usize] * per_radius) as f32);
            match run.size {
                1 => {}
                2 => fill_f32::<2, 1>(blocks, radii),
                3 => fill_f32::<3, 3>(blocks, radii),
                4 => fill_f32::<4, 6>(blocks, radii),
                5 => fill_f32::<5, 10>(blocks, radii),
                6 => fill_f32::<6, 15>(blocks, radii),
                7 => fill_f32::<7, 21>(blocks, radii),
                z => fill_f32_blocks(z, blocks, radii),
            }
        }
    }
}
