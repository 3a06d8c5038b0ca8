//! How much memory there is, and how much of it a file may take.

use softjam::budget::Budget;

#[derive(clap::Args)]
pub struct MemoryFlag {
    /// Memory that a recording may ask for, as 2G, 500M or bytes; what would take more is refused before it is read or run
    /// [default: half of the machine's].
    #[arg(long, value_name = "SIZE")]
    memory: Option<Budget>,
}

impl MemoryFlag {
    /// The budget for files; where the system does not tell its memory, the library's.
    pub fn budget(&self) -> Budget {
        let half = || match all() {
            0 => Budget::default(),
            bytes => Budget::of(bytes / 2),
        };
        self.memory.unwrap_or_else(half)
    }

    /// Bytes that a run may take: what is free, if the flag does not say less; `None` where the system does not tell.
    pub fn free(&self) -> Option<u64> {
        let free = Some(free()).filter(|bytes| *bytes > 0);
        let said = self.memory.map(Budget::bytes);
        said.into_iter().chain(free).min()
    }
}

/// Bytes of the machine, or of the share of it that this program is confined to.
fn all() -> u64 {
    let system = system();
    let limit = system.cgroup_limits().map(|c| c.total_memory);
    let limit = limit.filter(|bytes| *bytes > 0).unwrap_or(u64::MAX);
    system.total_memory().min(limit)
}

/// Bytes that are free.
fn free() -> u64 {
    let system = system();
    let limit = system.cgroup_limits().map(|c| c.free_memory);
    system.available_memory().min(limit.unwrap_or(u64::MAX))
}

fn system() -> sysinfo::System {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    system
}
