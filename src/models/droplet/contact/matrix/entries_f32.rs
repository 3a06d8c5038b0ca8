//! The entries of `A` in single precision, straight from what single precision knows of the contacts.
//!
//! Far from balance the forces of a step are solved for to a few digits, and entries in double precision would only be rounded.
//! What an entry takes of a contact goes into sixteen bytes: its direction seen from the lower particle, its angle in parts of the whole
//! turn, and the inverse root. Angles that wrap need no branch, differ exactly, and the direction seen from the other
//! particle is the same number with three bits turned over.

use super::product::product_of_blocks;
use crate::models::droplet::kernel::ROUND;
use crate::state::Packing;
use core::f64::consts::PI;

/// Blocks that are computed together, one in each lane.
pub(super) const LANES: usize = 8;

/// What an entry is made of at one of its two contacts, by their bits: cosine and sine of the direction from the lower particle to the
/// higher; its angle to the x axis in units of 2π/2³², which wraps; `A_cc^(−½)` in units of `(R_max/2πγ)^(−½)`, 0 for an inactive
/// contact.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(16))]
pub(super) struct Operand([u32; 4]);

/// The sign of a number, and half a turn.
const TOP: u32 = 1 << 31;

/// What the opposite direction has turned over.
const SEEN_FROM: [[u32; 4]; 2] = [[0; 4], [TOP, TOP, TOP, 0]];

impl Operand {
    /// Of a contact whose direction, from the lower particle to the higher, has the components `(x, y)` and this `angle` (radians,
    /// −π to π), and whose inverse root is `weight`.
    #[inline(always)]
    pub(super) fn of((x, y): (f64, f64), angle: f64, weight: f64) -> Self {
        Self([
            (x as f32).to_bits(),
            (y as f32).to_bits(),
            (angle * (f64::from(TOP) / PI) + ROUND).to_bits() as u32,
            (weight as f32).to_bits(),
        ])
    }

    /// As seen from an end: `2c` is that at the lower particle of contact `c`, `2c + 1` that at the higher.
    #[inline(always)]
    fn from(self, end: u32) -> Self {
        let [a, b, c, d] = self.0;
        let [e, f, g, h] = SEEN_FROM[(end & 1) as usize];
        Self([a ^ e, b ^ f, c ^ g, d ^ h])
    }
}

/// Of one contact each in blocks that are computed together: its operand and what its entries are multiplied with.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(super) struct Lanes {
    cos: [f32; LANES],
    sin: [f32; LANES],
    angle: [u32; LANES],
    weight: [f32; LANES],
    load: [f32; LANES],
}

impl Lanes {
    #[inline(always)]
    fn set(&mut self, lane: usize, Operand([cos, sin, angle, weight]): Operand, load: f32) {
        self.cos[lane] = f32::from_bits(cos);
        self.sin[lane] = f32::from_bits(sin);
        self.angle[lane] = angle;
        self.weight[lane] = f32::from_bits(weight);
        self.load[lane] = load;
    }
}

/// `−(R_p/R_max) g(θ) w_a w_b`, an entry of `D^(−½) A D^(−½)`, in all lanes; `radius` is `−R_p/R_max`.
///
/// As in [`Direction::g_between`](crate::models::droplet::kernel::Direction::g_between), `π − θ` and `sin θ` have their signs turned over
/// together where the angle is negative.
#[inline(always)]
fn entries(a: &Lanes, b: &Lanes, radius: &[f32; LANES]) -> [f32; LANES] {
    const STEP: f32 = (PI / TOP as f64) as f32;
    let mut entries = [0.0; LANES];
    for k in 0..LANES {
        let turn = (b.angle[k].wrapping_sub(a.angle[k]) ^ TOP).cast_signed() as f32 * STEP;
        let cross = a.sin[k] * b.cos[k] - a.cos[k] * b.sin[k];
        let cos = a.cos[k] * b.cos[k] + a.sin[k] * b.sin[k];
        let g = turn * cross - 0.5 * cos - 1.0;
        entries[k] = (radius[k] * g) * (a.weight[k] * b.weight[k]);
    }
    entries
}

/// An estimate of the rounding of what the entries of a row make of the forces, as a part of the largest `A_cc f`: two units in the
/// last place for each neighbour that the largest particle may have. At φ = 0.845 to 1.2 it comes to 1 to 4 units.
pub(in crate::models::droplet::contact) fn rounding(packing: &Packing) -> f64 {
    let neighbours = PI * (1.0 + packing.largest_radius() / packing.smallest_radius());
    2.0 * (1.0 + neighbours) * f64::from(f32::EPSILON)
}

/// What blocks are made from, and where they go.
pub(super) struct BlocksF32<'a> {
    pub(super) ends: &'a [u32],
    /// Of all contacts: how they are seen from their lower particles, and `A_cc^½ f_c`.
    pub(super) operands: &'a [Operand],
    pub(super) loads: &'a [f32],
    pub(super) entries_f32: &'a mut [f32],
    /// What the entries make of the loads is added to these.
    pub(super) products: &'a mut [f32],
    /// Room for the blocks.
    pub(super) scratch: &'a mut Vec<Lanes>,
}

/// Blocks of `Z` contacts with `T = Z (Z − 1)/2` entries each, and their products; `radii` are `−R_p/R_max`.
#[inline(always)]
pub(super) fn fill_f32<const Z: usize, const T: usize>(
    blocks: BlocksF32<'_>,
    mut radii: impl Iterator<Item = f32>,
) {
    let BlocksF32 {
        ends,
        operands,
        loads,
        entries_f32,
        products,
        scratch,
    } = blocks;
    let groups = ends.len().div_ceil(LANES * Z);
    if scratch.len() < groups * Z {
        scratch.resize(groups * Z, Lanes::default());
    }
    let scratch = scratch.as_chunks_mut::<Z>().0;
    let (ends, entries_f32) = (ends.as_chunks::<Z>().0, entries_f32.as_chunks_mut::<T>().0);
    let loads = &loads[..operands.len()];
    for (ends, scratch) in ends.chunks(LANES).zip(&mut *scratch) {
        for (lane, ends) in ends.iter().enumerate() {
            for (scratch, end) in scratch.iter_mut().zip(ends) {
                let c = (end >> 1) as usize;
                scratch.set(lane % LANES, operands[c].from(*end), loads[c]);
            }
        }
    }
    let groups = ends.chunks(LANES).zip(&*scratch);
    for (column, (ends, lanes)) in entries_f32.chunks_mut(LANES).zip(groups) {
        let mut radius = [0.0; LANES];
        for (own, radius) in radius.iter_mut().zip(radii.by_ref().take(column.len())) {
            *own = radius;
        }
        let (mut all, mut sums) = ([[0.0; LANES]; T], [[0.0; LANES]; Z]);
        for b in 1..Z {
            for a in 0..b {
                let entries = entries(&lanes[a], &lanes[b], &radius);
                for k in 0..LANES {
                    sums[a][k] += entries[k] * lanes[b].load[k];
                    sums[b][k] += entries[k] * lanes[a].load[k];
                }
                all[b * (b - 1) / 2 + a] = entries;
            }
        }
        for (lane, (own, ends)) in column.iter_mut().zip(ends).enumerate() {
            for k in 0..T {
                own[k] = all[k][lane % LANES];
            }
            for k in 0..Z {
                products[(ends[k] >> 1) as usize] += sums[k][lane % LANES];
            }
        }
    }
}

/// [`fill_f32`] of blocks of any size.
#[inline(always)]
pub(super) fn fill_f32_blocks(
    size: usize,
    blocks: BlocksF32<'_>,
    radii: impl Iterator<Item = f32>,
) {
    let BlocksF32 {
        ends,
        operands,
        loads,
        entries_f32,
        products,
        scratch,
    } = blocks;
    if scratch.len() < size {
        scratch.resize(size, Lanes::default());
    }
    let blocks = entries_f32.chunks_exact_mut(size * (size - 1) / 2);
    for ((ends, radius), own) in ends.chunks_exact(size).zip(radii).zip(blocks) {
        for (scratch, end) in scratch.iter_mut().zip(ends) {
            scratch.set(0, operands[(end >> 1) as usize].from(*end), 0.0);
        }
        let mut column = own.iter_mut();
        for b in 1..size {
            for (a, entry) in (0..b).zip(&mut column) {
                *entry = entries(&scratch[a], &scratch[b], &[radius; LANES])[0];
            }
        }
        product_of_blocks(size, ends, own, loads, products);
    }
}

#[cfg(test)]
mod tests {
    use super::rounding;
    use crate::domain::{Domain, Vec2};
    use crate::models::droplet::contact::list::ContactList;
    use crate::models::droplet::contact::matrix::product::FirstProducts;
    use crate::models::droplet::contact::matrix::{ContactMatrix, Geometry};
    use crate::protocol::Relaxation;
    use crate::scene::Scene;
    use crate::state::Packing;
    use core::f64::consts::PI;

    /// The largest difference of the entries from those that are rounded from double precision, and that of their products with the
    /// forces in units of the largest `A_cc f`.
    fn differences(packing: &Packing, pairs: &[[u32; 2]], forces: &[f64], gamma: f64) -> [f64; 2] {
        let list = ContactList::new(packing.len(), pairs).unwrap();
        let geometry = Geometry::of(packing, &list);
        let mut matrix = ContactMatrix::of(packing, &list, &geometry, gamma);
        let mut image = vec![0.0; forces.len()];
        matrix.multiply(forces, &mut image);
        let rounded = matrix.entries_f32().to_vec();
        let mut products = FirstProducts::default();
        matrix.assemble_f32(&geometry, forces, &mut products);
        let entries = rounded.iter().zip(matrix.entries_f32());
        let entries = entries.map(|(a, b)| f64::from((a - b).abs()));
        let (mut off, mut load) = (0.0f64, 0.0f64);
        for (c, f) in forces.iter().enumerate() {
            let a = matrix.diagonal()[c];
            let root = a * matrix.inverse_root()[c];
            let q = f64::from(products.single.sums()[c]) * matrix.unit_of_loads() * root;
            off = off.max((image[c] - a * f - q).abs());
            load = load.max((a * f).abs());
        }
        [entries.fold(0.0, f64::max), off / load]
    }

    #[test]
    fn entries_and_products_are_those_of_double_precision_up_to_rounding() {
        let epsilon = f64::from(f32::EPSILON);
        // Line tensions far outside of what single precision could hold.
        for (phi, gamma) in [(0.845, 1.0), (0.86, 1e-90), (1.0, 1.0), (1.2, 1e90)] {
            let mut scene = Scene {
                particles: 512,
                phi,
                line_tension: gamma,
                ..Scene::default()
            };
            scene.disks.threshold = 1e-4;
            let mut run = Relaxation::new(&scene).unwrap();
            for _ in 0..20 {
                let contacts = run.contacts();
                let [entries, products] =
                    differences(run.packing(), contacts.pairs, contacts.forces, gamma);
                assert!(entries <= 2.0 * epsilon, "{entries:e} at φ = {phi}");
                let most = rounding(run.packing());
                assert!(products <= 0.5 * most, "{products:e} at φ = {phi}");
                assert!(products > 0.0, "compared with itself");
                run.advance().unwrap();
            }
        }
    }

    #[test]
    fn a_particle_with_many_neighbours_anywhere_around_it() {
        let epsilon = f64::from(f32::EPSILON);
        // One directly to the left, where the angle jumps, then at all distances from the axes; radii of 1 to 40.
        for count in [2, 3, 7, 8, 23, 60] {
            let centre = Vec2::new(60.0, 60.0);
            let mut positions = vec![centre];
            for k in 0..count {
                let (sin, cos) = libm::sincos(PI + f64::from(k) * (2.0 * PI / f64::from(count)));
                positions.push(centre + Vec2::new(cos, sin) * 20.4);
            }
            let mut radii = vec![0.5; positions.len()];
            radii[0] = 20.0;
            let packing =
                Packing::new(Domain::new(120.0, 120.0).unwrap(), radii, positions).unwrap();
            let pairs: Vec<[u32; 2]> = (1..=count as u32).map(|k| [0, k]).collect();
            let forces: Vec<f64> = (0..count).map(|k| 0.01 * f64::from(1 + k % 5)).collect();
            let [entries, products] = differences(&packing, &pairs, &forces, 1.0);
            assert!(entries <= 2.0 * epsilon, "{entries:e} of {count}");
            assert!(products <= rounding(&packing), "{products:e} of {count}");
        }
    }
}
