//! How long what was recorded may wait, in moves of a particle: the same in every run, and a time all the same.

use super::Header;
use crate::scene::{Channels, Schedule};

/// When what was gathered has waited long enough. A move of a particle takes some 100 ns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    channels: Channels,
    particles: u64,
    moves: u64,
}

impl Patience {
    /// Of a recording; what was gathered waits for so many moves at most.
    pub fn of(header: &Header, moves: u64) -> Self {
        Self {
            channels: header.scene.channels,
            particles: header.packing.len() as u64,
            moves,
        }
    }

    /// Whether what was gathered from step `first` to `last` may not wait for the next snapshot.
    pub fn ends(&self, first: u64, last: u64) -> bool {
        let schedules = self.channels.named();
        let next = schedules.iter().filter_map(|(_, s)| s.after(last)).min();
        // When the next relaxed state of a protocol comes is not known; that some come is.
        let relaxed = schedules.iter().any(|(_, s)| *s == Schedule::Relaxed);
        let next = next.or(relaxed.then_some(last));
        // Without a schedule nothing more is sure to come.
        next.is_none_or(|next| {
            next.saturating_sub(first).saturating_mul(self.particles) >= self.moves
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_is_bounded_by_the_moves_until_the_next_snapshot() {
        let off = Schedule::Off;
        let patience = |state, metrics| Patience {
            channels: Channels {
                contours: off,
                contacts: off,
                metrics,
                state,
                ..Channels::default()
            },
            particles: 100,
            moves: 1000,
        };
        let each = patience(off, Schedule::Every(1));
        assert!(!each.ends(0, 8) && each.ends(0, 9));
        // The next is too far away, so even one does not wait for it.
        assert!(patience(Schedule::Every(50), off).ends(50, 50));
        assert!(!patience(Schedule::Every(50), Schedule::Every(1)).ends(50, 50));
        assert!(patience(off, off).ends(7, 7));
        let relaxed = patience(Schedule::Relaxed, off);
        assert!(!relaxed.ends(700, 709) && relaxed.ends(700, 710));
    }
}
