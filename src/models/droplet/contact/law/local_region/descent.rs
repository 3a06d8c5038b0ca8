//! The correction of the forces on a region: conjugate gradients, while the region grows.

use super::{LocalRegion, Whole};

/// Iterations that are tried.
const ITERATIONS: usize = 40;

impl LocalRegion {
    /// The residual next to a contact whose force was changed by `change`.
    pub(in crate::models::droplet::contact::law) fn disturb(
        &mut self,
        whole: Whole<'_>,
        contact: usize,
        change: f64,
    ) {
        for p in self.pair(whole, contact) {
            self.take_in(whole, p);
            let Some(own) = self.direction_at(whole, p, contact) else {
                continue;
            };
            let factor = -whole.packing.radii()[p as usize] * whole.per_radius;
            let block = self.block[p as usize] as usize;
            let first = if block == 0 { 0 } else { self.ends[block - 1] };
            for k in first..self.ends[block] {
                let place = self.member[k];
                if self.contacts[place as usize] as usize != contact {
                    let entry = factor * own.g_between(self.toward[k]);
                    self.rows[place as usize].residual -= entry * change;
                }
            }
        }
    }

    /// Adds the correction to the forces; returns the iterations and the largest residual left. Does nothing if the region
    /// outgrows `most` contacts or the iterations do not end.
    pub(in crate::models::droplet::contact::law) fn descend(
        &mut self,
        whole: Whole<'_>,
        tolerance: f64,
        most: usize,
    ) -> Option<(usize, f64)> {
        let (mut rz, mut largest) = (0.0, 0.0f64);
        for row in &self.rows {
            rz += row.residual * row.residual * row.inverse;
            largest = largest.max(row.residual.abs());
        }
        let (mut beta, mut grown) = (0.0, 0);
        for iteration in 0..ITERATIONS {
            // A NaN hides from the largest entry, but not from the sum.
            if largest <= tolerance && f64::is_finite(rz) {
                for (row, &c) in self.rows.iter().zip(&self.contacts) {
                    self.forces[c as usize] += row.correction;
                }
                return Some((iteration, largest));
            }
            let reached = self.rows.len();
            for row in &mut self.rows {
                row.direction = row.residual * row.inverse + beta * row.direction;
            }
            for place in grown..reached {
                for p in self.pair(whole, self.contacts[place] as usize) {
                    self.take_in(whole, p);
                }
            }
            grown = reached;
            if self.rows.len() > most {
                return None;
            }
            self.product();
            let curvature: f64 = self.rows.iter().map(|row| row.direction * row.image).sum();
            if curvature.is_nan() || curvature <= 0.0 {
                return None;
            }
            let alpha = rz / curvature;
            let mut next = 0.0;
            largest = 0.0;
            for row in &mut self.rows {
                row.correction += alpha * row.direction;
                row.residual -= alpha * row.image;
                next += row.residual * row.residual * row.inverse;
                largest = largest.max(row.residual.abs());
            }
            beta = next / rz;
            rz = next;
        }
        None
    }

    /// The images of the directions.
    fn product(&mut self) {
        let rows = &mut self.rows[..];
        for row in &mut *rows {
            row.image = row.diagonal * row.direction;
        }
        let (mut first, mut values) = (0, self.value.iter());
        for &end in &self.ends {
            let members = &self.member[first..end];
            first = end;
            for (b, &cb) in members.iter().enumerate() {
                let at = rows[cb as usize].direction;
                let mut sum = 0.0;
                for (&ca, entry) in members[..b].iter().zip(&mut values) {
                    let row = &mut rows[ca as usize];
                    row.image += entry * at;
                    sum += entry * row.direction;
                }
                rows[cb as usize].image += sum;
            }
        }
    }
}
