//! Rows of lossless states, gathered component by component.

use super::cells::{Cells, Texts, own};
use super::columns::Column;
use crate::domain::{Domain, Vec2};
use crate::state::Frame;
use std::io;

/// `softjam.State` rows in the making.
#[derive(Default)]
pub(super) struct StateRows {
    /// Step and simulated time in nanoseconds of each row.
    pub times: Vec<(u64, i64)>,
    positions: Cells<f64, 2>,
    velocities: Cells<f64, 2>,
    contacts: Cells<u32, 2>,
    forces: Cells<f64, 1>,
    minimizers: Cells<f64, 1>,
    digests: Cells<u8, 1>,
    solvers: Texts,
    memories: Cells<f64, 1>,
    boxes: Cells<f64, 1>,
    stages: Cells<u32, 1>,
    protocols: Cells<f64, 1>,
}

impl StateRows {
    /// Adds the state of a frame and its digest, as recordings of `format` have it: the first knew no names.
    pub fn row(&mut self, nanoseconds: i64, frame: &Frame, digest: &[u8; 32], format: u32) {
        let components = |v: &Vec2| [v.x, v.y];
        self.times.push((frame.step, nanoseconds));
        self.positions
            .extend(frame.positions.iter().map(components));
        self.velocities
            .extend(frame.velocities.iter().map(components));
        self.contacts.extend(frame.contacts.iter().copied());
        self.forces.extend(frame.forces.iter().map(|f| [*f]));
        self.minimizers
            .extend(frame.minimizer.values().iter().map(|x| [*x]));
        self.digests.extend(digest.map(|byte| [byte]));
        self.positions.end_row();
        self.velocities.end_row();
        self.contacts.end_row();
        self.forces.end_row();
        self.minimizers.end_row();
        self.digests.end_row();
        if format > 1 {
            self.solvers.push(frame.minimizer.name());
            self.solvers.end_cell();
        }
        self.solvers.end_row();
        self.memories.extend(frame.memory.iter().map(|x| [*x]));
        self.memories.end_row();
        let values = frame.domain.iter().flat_map(Domain::values);
        self.boxes.extend(values.map(|x| [x]));
        self.boxes.end_row();
        self.stages
            .extend((frame.stage > 0).then_some([frame.stage]));
        self.stages.end_row();
        (self.protocols).extend(frame.protocol.iter().map(|x| [*x]));
        self.protocols.end_row();
    }

    /// The components of all rows.
    pub fn into_columns(self) -> io::Result<Vec<Column>> {
        let mut columns = vec![
            self.positions.into_column(own("softjam.State:position"))?,
            self.velocities.into_column(own("softjam.State:velocity"))?,
            self.contacts.into_column(own("softjam.State:contact"))?,
            self.forces.into_column(own("softjam.State:force"))?,
            self.minimizers
                .into_column(own("softjam.State:minimizer"))?,
            self.digests.into_column(own("softjam.State:digest"))?,
        ];
        // What no row has is no column.
        if !self.solvers.is_empty() {
            columns.push(self.solvers.into_column(own("softjam.State:solver"))?);
        }
        if !self.memories.is_empty() {
            columns.push(self.memories.into_column(own("softjam.State:memory"))?);
        }
        if !self.boxes.is_empty() {
            columns.push(self.boxes.into_column(own("softjam.State:box"))?);
        }
        if !self.stages.is_empty() {
            columns.push(self.stages.into_column(own("softjam.State:stage"))?);
        }
        if !self.protocols.is_empty() {
            columns.push(self.protocols.into_column(own("softjam.State:protocol"))?);
        }
        Ok(columns)
    }
}
