//! Particles sorted by size, in octaves, and those of an octave into cells of their own: what is near a particle is found in `O(1)`
//! cells an octave, however many small ones there are beside large ones and however narrow the box.

use crate::domain::{Domain, Vec2};
use crate::state::Packing;
use core::ops::Range;
use std::collections::BTreeMap;

/// A particle in a cell, with what its distances take.
#[derive(Clone, Copy, Default)]
pub(crate) struct Seat {
    pub(crate) at: Vec2,
    pub(crate) radius: f64,
    pub(crate) particle: u32,
}

/// Particles of about one size in cells no narrower than two of them, whose surfaces are `reach` apart, have from centre to centre: `O(N)`
/// cells at most.
pub(crate) struct Grid {
    domain: Domain,
    columns: usize,
    rows: usize,
    per_length: Vec2,
    seats: Vec<Seat>,
    /// Cell c has `seats[first[c]..first[c + 1]]`.
    first: Vec<u32>,
}

/// The particles of each octave of sizes, the smallest first, for a search of surfaces closer than `reach` (length).
pub(crate) fn by_size(packing: &Packing, reach: f64) -> Vec<Grid> {
    let mut octaves: BTreeMap<u64, Vec<Seat>> = BTreeMap::new();
    let particles = packing.positions().iter().zip(packing.radii());
    for (particle, (&at, &radius)) in (0..).zip(particles) {
        let exponent = radius.to_bits() >> 52;
        octaves.entry(exponent).or_default().push(Seat {
            at,
            radius,
            particle,
        });
    }
    let grid = |seats: &Vec<Seat>| Grid::new(packing.domain(), seats, reach);
    octaves.values().map(grid).collect()
}

impl Grid {
    fn new(domain: Domain, particles: &[Seat], reach: f64) -> Self {
        let largest = particles
            .iter()
            .fold(0.0, |m: f64, seat| m.max(seat.radius));
        let heights = domain.heights();
        // A float too large for the type becomes the largest number there is.
        let count =
            |length: f64, most: usize| ((length / (2.0 * largest + reach)) as usize).clamp(1, most);
        let columns = count(heights.x, particles.len());
        let rows = count(heights.y, particles.len().div_ceil(columns));
        let mut grid = Self {
            domain,
            columns,
            rows,
            per_length: Vec2::new(columns as f64, rows as f64).component_div(&domain.lengths()),
            seats: vec![Seat::default(); particles.len()],
            first: vec![0; columns * rows + 1],
        };
        let cells: Vec<usize> = particles.iter().map(|seat| grid.cell(seat.at)).collect();
        for cell in &cells {
            grid.first[*cell] += 1;
        }
        let mut end = 0;
        for count in &mut grid.first {
            end += *count;
            *count = end;
        }
        for (seat, cell) in particles.iter().zip(cells).rev() {
            grid.first[cell] -= 1;
            grid.seats[grid.first[cell] as usize] = *seat;
        }
        grid
    }

    /// All particles of the octave.
    pub(crate) fn seats(&self) -> &[Seat] {
        &self.seats
    }

    /// Those in the cell of a place and in the cells around it, each once: all of the octave whose surfaces are within reach of one that
    /// stands there and is no larger than the largest of them.
    pub(crate) fn near(&self, at: Vec2) -> impl Iterator<Item = &[Seat]> {
        let (column, row) = self.place(at);
        let rows = beside(row, self.rows).into_iter().flatten();
        rows.flat_map(move |row| {
            beside(column, self.columns).map(|columns| {
                let cells = row * self.columns + columns.start..row * self.columns + columns.end;
                &self.seats[self.first[cells.start] as usize..self.first[cells.end] as usize]
            })
        })
    }

    fn place(&self, at: Vec2) -> (usize, usize) {
        let at = self.domain.upright(at).component_mul(&self.per_length);
        let (column, row) = (at.x as usize, at.y as usize);
        // A product may round up to the number of cells.
        (column.min(self.columns - 1), row.min(self.rows - 1))
    }

    fn cell(&self, at: Vec2) -> usize {
        let (column, row) = self.place(at);
        row * self.columns + column
    }
}

/// A cell and those beside it along a periodic line, each once: one stretch, or two where the line closes.
fn beside(place: usize, cells: usize) -> [Range<usize>; 2] {
    match place {
        _ if cells <= 3 => [0..cells, 0..0],
        0 => [0..2, cells - 1..cells],
        last if last + 1 == cells => [last - 1..cells, 0..1],
        _ => [place - 1..place + 2, 0..0],
    }
}
