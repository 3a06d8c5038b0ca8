//! A frame of disks held against `f = k δ`, pair by pair, without the loop that a run takes.

use super::Disks;
use crate::contacts::FrameContacts;
use crate::domain::Vec2;
use crate::models::Check;
use crate::models::check::worse;
use crate::neighbors::NeighborList;
use crate::state::{Frame, Packing};
use core::f64::consts::PI;

impl Disks {
    /// What the frame's forces are worth; see [`Model::check`](crate::models::Model::check).
    pub(super) fn check_frame(&self, packing: &Packing, frame: &Frame) -> Check {
        let contacts = FrameContacts::of(packing, frame);
        let contacts = contacts.view();
        let radii = packing.radii();
        let stiffness_sum = 4.0 * PI * self.line_tension / 3.0;
        let mut net = vec![Vec2::zeros(); packing.len()];
        let (mut residual, mut overlap) = (0.0_f64, 0.0_f64);
        let mut neighbors = NeighborList::new();
        neighbors.update(packing, 0.0, 0.0);
        // Each overlapping pair, ascending; the sums of a run have the same order.
        for pair in neighbors.pairs() {
            let [i, j] = pair.map(|p| p as usize);
            let apart = packing.separation(i, j);
            let distance = apart.norm();
            let sum = radii[i] + radii[j];
            let depth = sum - distance;
            if depth <= 0.0 {
                continue;
            }
            if contacts.pairs.binary_search(pair).is_err() {
                overlap = overlap.max(depth);
            }
            let push = if distance == 0.0 {
                Vec2::new(stiffness_sum, 0.0)
            } else {
                apart * (stiffness_sum * depth / (sum * distance))
            };
            net[i] += push;
            net[j] -= push;
        }
        for (c, &[i, j]) in contacts.pairs.iter().enumerate() {
            let compliance = (radii[i as usize] + radii[j as usize]) / stiffness_sum;
            let off = (contacts.forces[c] * compliance - contacts.overlaps[c].max(0.0)).abs();
            residual = worse(residual, off);
        }
        let largest = net
            .iter()
            .map(Vec2::norm_squared)
            .fold(0.0, f64::max)
            .sqrt();
        let f_max = largest / self.line_tension;
        let found = (residual, overlap);
        Check::of(
            &contacts,
            packing.domain(),
            self.line_tension,
            (0.0, f_max),
            found,
        )
    }
}
