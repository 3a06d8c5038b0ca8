//! The entries of [`ContactMatrix`] at new positions, and its products, by one thread or by two.

use super::blocks::Run;
use super::fill::{Blocks, fill, fill_blocks};
use super::geometry::{Directions, Geometry, Part};
use super::matrix::{ContactMatrix, Known};
use super::product::{Number, Products};
use crate::domain::Vec2;
use crate::droplet::kernel::Direction;
use crate::packing::Packing;
use crate::threads::{are_two_for, both};
use crate::wide::wide;
use core::ops::Range;

/// Room for what is computed of a run and not kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    toward: Vec<Direction>,
    values: Vec<f64>,
}

/// What blocks are made from.
#[derive(Clone, Copy)]
struct Layout<'a> {
    runs: &'a [Run],
    particle: &'a [u32],
    end: &'a [u32],
    scale: &'a [f64],
    scaling: &'a [f64],
}

/// Where the entries of blocks go, the first of all being number `first` of the matrix; the values themselves only where they are
/// to be kept.
struct Filled<'a> {
    first: usize,
    value: Option<&'a mut [f64]>,
    scaled: &'a mut [f32],
    room: &'a mut Room,
}

impl ContactMatrix {
    /// Directions and scaled values at the positions of `packing`, and what the off-diagonal entries make of `forces`, as
    /// [`products_into`](Self::products_into) has it. The pairs are the contacts by number, those of `geometry`. Returns the
    /// largest `|δ|` (length).
    pub(crate) fn refresh(
        &mut self,
        geometry: &mut Geometry,
        at: (&Packing, &[[u32; 2]], &[f64]),
        products: &mut Products<f64>,
    ) -> f64 {
        self.known = if self.keeps_values {
            self.kept += 1;
            Known::All
        } else {
            Known::Scaled
        };
        if self.is_for_two() {
            self.refresh_by_two(geometry, at, products)
        } else {
            self.refresh_by_one(geometry, at, products.alone(self.len()))
        }
    }

    /// Values and scaled values of the directions of `geometry`, where they are not there.
    pub(crate) fn complete(&mut self, geometry: &Geometry) {
        if self.is_complete() {
            return;
        }
        let zeros = vec![0.0; self.len()];
        let products = &mut vec![0.0; self.len()];
        let all = 0..self.runs.len();
        wide(
            #[inline(always)]
            || self.fill((geometry.directions(), &zeros), all, products, true),
        );
        self.known = Known::All;
        self.kept += 1;
    }

    /// Whether all values are of the present positions and contacts.
    pub(crate) fn is_complete(&self) -> bool {
        self.known == Known::All
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
    pub(super) fn is_for_two(&self) -> bool {
        are_two_for(self.len())
    }

    /// One stretch of particles after the other, so that what is computed stays near: the directions that a block needs are
    /// those of its own stretch or of one before.
    fn refresh_by_one(
        &mut self,
        geometry: &mut Geometry,
        (packing, pairs, forces): (&Packing, &[[u32; 2]], &[f64]),
        products: &mut [f64],
    ) -> f64 {
        let (sorted, keep) = (self.sorted_contacts(), self.keeps_values);
        let stretches = core::mem::take(&mut self.stretches);
        let largest = wide(
            #[inline(always)]
            || {
                let late = sorted..pairs.len();
                let part = geometry.part(late.clone());
                part.refresh(packing, &pairs[late.clone()]);
                let mut largest = self.largest_overlap(geometry, late);
                let [mut run, mut contact] = [0; 2];
                for &[runs, contacts] in &stretches {
                    let own = contact..contacts;
                    let part = geometry.part(own.clone());
                    part.refresh(packing, &pairs[own.clone()]);
                    largest = largest.max(self.largest_overlap(geometry, own));
                    let at = (geometry.directions(), forces);
                    self.fill(at, run..runs, products, keep);
                    [run, contact] = [runs, contacts];
                }
                let all = self.runs.len();
                let at = (geometry.directions(), forces);
                self.fill(at, run..all, products, keep);
                largest
            },
        );
        self.stretches = stretches;
        largest
    }

    /// Half of the directions each, then half of the entries each.
    fn refresh_by_two(
        &mut self,
        geometry: &mut Geometry,
        (packing, pairs, forces): (&Packing, &[[u32; 2]], &[f64]),
        products: &mut Products<f64>,
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
        let keep = self.keeps_values;
        let (layout, [mut one, mut other]) = self.halves(middle, keep);
        let fill = |runs: Range<usize>, out: &mut Filled<'_>, products: &mut [f64]| {
            wide(
                #[inline(always)]
                || layout.fill((geometry.directions(), forces), runs, out, products),
            );
        };
        let [y, more] = products.both(length);
        both(
            true,
            || fill(0..middle, &mut one, y),
            || fill(middle..all, &mut other, more),
        );
        products.add_up();
        wide(
            #[inline(always)]
            || self.largest_overlap(geometry, 0..length),
        )
    }

    /// The run with which the second half of the entries begins.
    fn middle(&self) -> usize {
        let half = self.scaled.len() / 2;
        self.runs.partition_point(|run| run.value < half)
    }

    /// What the blocks are made from, and where they go: those of the first `middle` runs, and the others.
    fn halves(&mut self, middle: usize, keep: bool) -> (Layout<'_>, [Filled<'_>; 2]) {
        let all = self.scaled.len();
        let first = self.runs.get(middle).map_or(all, |run| run.value);
        let layout = Layout {
            runs: &self.runs,
            particle: &self.particle,
            end: &self.end,
            scale: &self.scale,
            scaling: &self.scaling,
        };
        let (scaled, more_scaled) = self.scaled.split_at_mut(first);
        let (value, more_values) = keep.then(|| self.value.split_at_mut(first)).unzip();
        let [room, more_room] = &mut self.rooms;
        let one = Filled {
            first: 0,
            value,
            scaled,
            room,
        };
        let other = Filled {
            first,
            value: more_values,
            scaled: more_scaled,
            room: more_room,
        };
        (layout, [one, other])
    }

    /// The values of some runs, scaled and not, and their products with the forces.
    #[inline(always)]
    fn fill(
        &mut self,
        at: (Directions<'_>, &[f64]),
        runs: Range<usize>,
        products: &mut [f64],
        keep: bool,
    ) {
        let all = self.runs.len();
        let (layout, [mut all, _]) = self.halves(all, keep);
        layout.fill(at, runs, &mut all, products);
    }

    /// The largest `|δ|` (length) of some contacts, leaving out those at rest.
    #[inline(always)]
    pub(crate) fn largest_overlap(&self, geometry: &Geometry, contacts: Range<usize>) -> f64 {
        let larger = |m: f64, x: f64| if x > m { x } else { m };
        let in_contact = |d: f64, s: f64| if s > 0.0 { d.abs() } else { 0.0 };
        let (d8, d_rest) = geometry.overlaps()[contacts.clone()].as_chunks::<8>();
        let (s8, s_rest) = self.scaling[contacts].as_chunks::<8>();
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

impl Layout<'_> {
    /// The entries of some runs, and their products with the forces.
    #[inline(always)]
    fn fill(
        self,
        (directions, forces): (Directions<'_>, &[f64]),
        runs: Range<usize>,
        out: &mut Filled<'_>,
        products: &mut [f64],
    ) {
        let Room { toward, values } = &mut *out.room;
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
            if values.len() < own.len() {
                values.resize(own.len(), 0.0);
            }
            let blocks = Blocks {
                toward,
                ends,
                values: match &mut out.value {
                    Some(value) => &mut value[own.clone()],
                    None => &mut values[..own.len()],
                },
                scaled: &mut out.scaled[own],
                scaling: self.scaling,
                forces,
                products,
            };
            let particles = &self.particle[run.block..run.block + run.count];
            let scales = particles.iter().map(|p| self.scale[*p as usize]);
            match run.size {
                1 => {}
                2 => fill::<2, 1>(blocks, scales),
                3 => fill::<3, 3>(blocks, scales),
                4 => fill::<4, 6>(blocks, scales),
                5 => fill::<5, 10>(blocks, scales),
                6 => fill::<6, 15>(blocks, scales),
                7 => fill::<7, 21>(blocks, scales),
                z => fill_blocks(z, blocks, scales),
            }
        }
    }
}
