//! Two recordings, frame by frame.

use super::{Difference, ReadError, Recording};

/// What a comparison of two recordings found.
///
/// See the example of [`compare`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Steps recorded on both sides.
    pub common: u64,
    /// Steps recorded in the first only.
    pub only_here: u64,
    /// Steps recorded in the second only.
    pub only_there: u64,
    /// The first common step whose states differ.
    pub difference: Option<Difference>,
}

/// Compares the states of two recordings at the steps that both have.
///
/// # Errors
///
/// [`ReadError`] if one of them is damaged.
///
/// # Example
///
/// ```
/// use softjam::replay::{compare, Recording};
/// # use softjam::{record, relax::Relaxation, scene::Scene};
/// # let path = std::env::temp_dir().join("softjam-compare-example.rrd");
/// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// # let mut run = Relaxation::new(&scene).unwrap();
/// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
///
/// let (mut a, mut b) = (Recording::open(&path).unwrap(), Recording::open(&path).unwrap());
/// let found = compare(&mut a, &mut b).unwrap();
/// assert!(found.common > 0 && found.difference.is_none());
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn compare(here: &mut Recording, there: &mut Recording) -> Result<Comparison, ReadError> {
    let mut found = Comparison::default();
    let (mut a, mut b) = (here.next_state()?, there.next_state()?);
    loop {
        match (&a, &b) {
            (None, None) => return Ok(found),
            (Some(x), Some(y)) if x.frame.step == y.frame.step => {
                found.common += 1;
                if found.difference.is_none() {
                    found.difference = Difference::between(&x.frame, &y.frame);
                }
                a = here.next_state()?;
                b = there.next_state()?;
            }
            (Some(x), y) if y.as_ref().is_none_or(|y| x.frame.step < y.frame.step) => {
                found.only_here += 1;
                a = here.next_state()?;
            }
            _ => {
                found.only_there += 1;
                b = there.next_state()?;
            }
        }
    }
}
