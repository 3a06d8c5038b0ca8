//! What stands beside the pictures for whoever points at one of them: numbers of particles and of contacts.
//!
//! The viewer lists the values of an instance where it is hovered, if the entity has no more than three columns with a
//! value for each instance, and else when it is selected. It cuts lists of numbers short, but no text. A particle therefore
//! has its numbers in one line of text, beside its place and its colour; in full they follow from the state.

use super::cells::{Cells, Texts, own};
use super::columns::{Column, rgba};
use super::pictures::{Particles, Rgb, dimmed};
use crate::contacts::Contacts;
use crate::domain::Vec2;
use rerun::{Ellipses2D, Points2D};
use std::io;

/// How bright the middle of a particle is beside its contour: force chains run across it.
const BRIGHTNESS: f64 = 0.5;

/// Rows of particles in the making, each a point at its centre.
#[derive(Default)]
pub(super) struct ParticleRows {
    centres: Cells<f32, 2>,
    colors: Cells<u32, 1>,
    numbers: Texts,
}

impl ParticleRows {
    /// Adds the next particle, number `p`, at `centre`, with the colour of its contour and its deepest dent relative to its
    /// undeformed radius: `p 0.125, Z 5, dent 0.0346`; `line_tension` is γ.
    pub fn particle(
        &mut self,
        (particles, p): (&Particles, usize),
        (centre, color): (Vec2, Rgb),
        deepest: f64,
        line_tension: f64,
    ) {
        self.centres.push([centre.x as f32, centre.y as f32]);
        self.colors.push([rgba(dimmed(color, BRIGHTNESS))]);
        let numbers = &mut self.numbers;
        numbers.push("p ");
        numbers.push_number(particles.pressure[p] / line_tension);
        numbers.push(", Z ");
        numbers.push_count(particles.contacts[p]);
        numbers.push(", dent ");
        numbers.push_number(deepest);
        if !particles.held[p] {
            numbers.push(", rattler");
        }
        numbers.end_cell();
    }

    /// Closes the row at hand.
    pub fn end_row(&mut self) {
        self.centres.end_row();
        self.colors.end_row();
        self.numbers.end_row();
    }

    /// The components of `/world/particles`, and those of `/world/disks`.
    pub fn into_columns(self) -> io::Result<(Vec<Column>, Vec<Column>)> {
        let (points, centres) = self.centres.into_column(Points2D::descriptor_positions())?;
        let disks = vec![(Ellipses2D::descriptor_centers(), centres.clone())];
        let particles = vec![
            (points, centres),
            self.colors.into_column(Points2D::descriptor_colors())?,
            self.numbers.into_column(own("softjam.Particle:numbers"))?,
        ];
        Ok((particles, disks))
    }
}

/// Rows of the numbers of contacts in the making, in the order of the contacts.
#[derive(Default)]
pub(super) struct ContactRows {
    pairs: Cells<u32, 2>,
    forces: Cells<f32, 1>,
    overlaps: Cells<f32, 1>,
}

impl ContactRows {
    /// Adds a row; `line_tension` is γ.
    pub fn row(&mut self, contacts: &Contacts<'_>, line_tension: f64) {
        for (c, &pair) in contacts.pairs.iter().enumerate() {
            self.pairs.push(pair);
            self.forces
                .push([(contacts.forces[c] / line_tension) as f32]);
            self.overlaps.push([contacts.overlaps[c] as f32]);
        }
        self.pairs.end_row();
        self.forces.end_row();
        self.overlaps.end_row();
    }

    /// The components that stand beside those of `/world/contacts`.
    pub fn into_columns(self) -> io::Result<[Column; 3]> {
        Ok([
            self.pairs.into_column(own("softjam.Contact:pair"))?,
            self.forces.into_column(own("softjam.Contact:force"))?,
            self.overlaps.into_column(own("softjam.Contact:overlap"))?,
        ])
    }
}
