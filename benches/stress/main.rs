//! The stress program; see `docs/stress.md`, which it writes.
mod families;
mod hand_made;
mod outcome;
mod random;
mod verify;

use std::time::Instant;

fn main() {
    let only: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    for family in families::all() {
        if !only.is_empty() && !only.iter().any(|o| family.name.contains(o.as_str())) {
            continue;
        }
        let clock = Instant::now();
        let mut ends = std::collections::BTreeMap::<&str, (usize, u64)>::new();
        let (mut f, mut law): (f64, f64) = (0.0, 0.0);
        let mut slowest = (0.0, 0u64, String::new());
        for (name, case) in (family.cases)() {
            let c2 = Instant::now();
            let o = case();
            let t = c2.elapsed().as_secs_f64();
            if t > slowest.0 { slowest = (t, o.steps, name.clone()); }
            let e = ends.entry(o.end).or_default();
            e.0 += 1;
            e.1 = e.1.max(o.steps);
            if let (Some(c), "converged") = (o.check, o.end) {
                f = f.max(c.f_max);
                law = law.max(c.law);
            }
            if let Some(w) = &o.wrong {
                println!("   WRONG {name}: {} after {} steps: {w}", o.end, o.steps);
            } else if o.end != "converged" {
                println!("   {name}: {} after {} steps: {}", o.end, o.steps, o.message);
            }
        }
        println!("{}: {ends:?} f_max {f:.1e} law {law:.1e} {:.1} s; slowest {slowest:?}", family.name, clock.elapsed().as_secs_f64());
    }
}
