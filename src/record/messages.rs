//! The messages of `proto/softjam/v1/recording.proto`, and the topics they come under.

use crate::analysis::Metrics;
use crate::domain::{Domain, Vec2};
use crate::protocol::StageEnd;
use crate::state::Frame;

/// The schemas of the messages below: a `FileDescriptorSet`, made by `proto/regenerate`.
pub(crate) fn descriptors(format: u32) -> &'static [u8] {
    match format {
        1 => include_bytes!("../../proto/format-1/softjam.v1.bin"),
        _ => include_bytes!("../../proto/softjam.v1.bin"),
    }
}

/// `softjam.v1.Particles`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct ParticlesMessage {
    #[prost(double, repeated, tag = "1")]
    pub radius: Vec<f64>,
    /// Named `box` in the schema.
    #[prost(double, repeated, tag = "2")]
    pub sides: Vec<f64>,
}

impl ParticlesMessage {
    pub fn of(radii: &[f64], domain: Domain) -> Self {
        let l = domain.lengths();
        Self {
            radius: radii.to_vec(),
            sides: vec![l.x, l.y],
        }
    }
}

/// `softjam.v1.Metrics`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct MetricsMessage {
    #[prost(uint64, tag = "1")]
    pub step: u64,
    #[prost(int64, optional, tag = "2")]
    pub sim_time_ns: Option<i64>,
    #[prost(double, optional, tag = "3")]
    pub f_max: Option<f64>,
    #[prost(double, optional, tag = "4")]
    pub log10_f_max: Option<f64>,
    #[prost(double, optional, tag = "5")]
    pub energy: Option<f64>,
    #[prost(double, optional, tag = "6")]
    pub pressure: Option<f64>,
    #[prost(double, optional, tag = "7")]
    pub coordination: Option<f64>,
    #[prost(double, optional, tag = "8")]
    pub contacts: Option<f64>,
    #[prost(double, optional, tag = "9")]
    pub rattlers: Option<f64>,
    #[prost(double, optional, tag = "10")]
    pub dt: Option<f64>,
    #[prost(double, optional, tag = "11")]
    pub stress_xy: Option<f64>,
    #[prost(double, optional, tag = "12")]
    pub moment: Option<f64>,
    #[prost(double, optional, tag = "13")]
    pub phi: Option<f64>,
    #[prost(double, optional, tag = "14")]
    pub strain: Option<f64>,
    #[prost(double, optional, tag = "15")]
    pub stress_xx: Option<f64>,
    #[prost(double, optional, tag = "16")]
    pub stress_yy: Option<f64>,
}

impl MetricsMessage {
    pub fn of(step: u64, nanoseconds: i64, metrics: Metrics) -> Self {
        let [
            f_max,
            log10_f_max,
            energy,
            pressure,
            coordination,
            contacts,
            rattlers,
            dt,
            stress_xy,
            moment,
            phi,
            strain,
            stress_xx,
            stress_yy,
        ] = metrics;
        Self {
            step,
            sim_time_ns: Some(nanoseconds),
            f_max,
            log10_f_max,
            energy,
            pressure,
            coordination,
            contacts,
            rattlers,
            dt,
            stress_xy,
            moment,
            phi,
            strain,
            stress_xx,
            stress_yy,
        }
    }

    /// The values in the order of [`METRICS`](crate::analysis::METRICS).
    pub fn values(&self) -> Metrics {
        [
            self.f_max,
            self.log10_f_max,
            self.energy,
            self.pressure,
            self.coordination,
            self.contacts,
            self.rattlers,
            self.dt,
            self.stress_xy,
            self.moment,
            self.phi,
            self.strain,
            self.stress_xx,
            self.stress_yy,
        ]
    }
}

/// `softjam.v1.Protocol`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct ProtocolMessage {
    #[prost(uint64, tag = "1")]
    pub step: u64,
    #[prost(string, tag = "2")]
    pub act: String,
    #[prost(double, optional, tag = "3")]
    pub phi: Option<f64>,
    #[prost(double, optional, tag = "4")]
    pub strain: Option<f64>,
    #[prost(double, optional, tag = "5")]
    pub pressure: Option<f64>,
    #[prost(double, repeated, tag = "6")]
    pub stress: Vec<f64>,
    #[prost(double, optional, tag = "7")]
    pub coordination: Option<f64>,
    #[prost(double, optional, tag = "8")]
    pub phi_j: Option<f64>,
}

impl ProtocolMessage {
    pub fn of(step: u64, end: &StageEnd) -> Self {
        Self {
            step,
            act: end.act.to_owned(),
            phi: Some(end.phi),
            strain: Some(end.strain),
            pressure: Some(end.pressure),
            stress: end.stress.to_vec(),
            coordination: Some(end.coordination),
            phi_j: end.jamming.map(|jamming| jamming.phi_j),
        }
    }
}

/// `softjam.v1.State`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct StateMessage {
    #[prost(uint64, tag = "1")]
    pub step: u64,
    #[prost(double, repeated, tag = "2")]
    pub position: Vec<f64>,
    #[prost(double, repeated, tag = "3")]
    pub velocity: Vec<f64>,
    #[prost(uint32, repeated, tag = "4")]
    pub contact: Vec<u32>,
    #[prost(double, repeated, tag = "5")]
    pub force: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    pub minimizer: Vec<f64>,
    #[prost(bytes = "vec", tag = "7")]
    pub digest: Vec<u8>,
    #[prost(string, tag = "8")]
    pub solver: String,
    #[prost(double, repeated, tag = "9")]
    pub memory: Vec<f64>,
    #[prost(double, repeated, tag = "10")]
    pub r#box: Vec<f64>,
    #[prost(uint32, tag = "11")]
    pub stage: u32,
    #[prost(double, repeated, tag = "12")]
    pub protocol: Vec<f64>,
}

impl StateMessage {
    /// As recordings of `format` have it: the first knew no names.
    pub fn of(frame: &Frame, digest: &[u8; 32], format: u32) -> Self {
        let flat = |v: &[Vec2]| v.iter().flat_map(|p| [p.x, p.y]).collect();
        Self {
            step: frame.step,
            position: flat(&frame.positions),
            velocity: flat(&frame.velocities),
            contact: frame.contacts.iter().flatten().copied().collect(),
            force: frame.forces.clone(),
            minimizer: frame.minimizer.values().to_vec(),
            digest: digest.to_vec(),
            solver: match format {
                1 => String::new(),
                _ => frame.minimizer.name().to_owned(),
            },
            memory: frame.memory.clone(),
            r#box: frame.domain.map_or(Vec::new(), |d| d.values().to_vec()),
            stage: frame.stage,
            protocol: frame.protocol.clone(),
        }
    }
}

/// The topics of a recording.
pub(crate) mod topic {
    pub const PARTICLES: &str = "/particles";
    pub const CONTOURS: &str = "/world/contours";
    pub const VERTICES: &str = "/world/vertices";
    pub const CONTACTS: &str = "/world/contacts";
    pub const METRICS: &str = "/metrics";
    pub const PROTOCOL: &str = "/protocol";
    pub const STATE: &str = "/state";
}

/// Name of the metadata record that says what the file is; written first.
pub(crate) const ABOUT: &str = "softjam";
/// Name of the metadata record with the outcome; written last, its absence means an unfinished run.
pub(crate) const RESULT: &str = "softjam.result";
/// Name of the attachment that holds the scene.
pub(crate) const SCENE: &str = "scene.toml";

/// Nanoseconds of log time a step: MCAP wants a clock, and steps are the only one that two machines agree on.
pub(crate) const STEP_NANOSECONDS: u64 = 1_000_000;
