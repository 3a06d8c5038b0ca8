use softjam::{relax::*, scene::*};
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n: usize = a[1].parse().unwrap();
    let phi: f64 = a[2].parse().unwrap();
    let seeds: u64 = a[3].parse().unwrap();
    let c: f64 = a.get(4).map_or(0.0, |s| s.parse().unwrap());
    for seed in 1..=seeds {
        let mut scene = Scene { particles: n, phi, seed, ..Scene::default() };
        let t = Instant::now();
        let mut run = Relaxation::new(&scene).unwrap();
        let t0 = t.elapsed();
        let dt = run.frame().minimizer.dt_max;
        if c > 0.0 {
            scene.dt_max = Some(dt * c);
            run = Relaxation::new(&scene).unwrap();
        }
        let t = Instant::now();
        while run.status() == Status::Running {
            run.advance().unwrap();
        }
        let el = t.elapsed();
        let w = run.law().work();
        let o = run.observables();
        println!("n {n} phi {phi} seed {seed} disks {:?} in {:?}; dtmax {:.4} steps {} {:?} f_max {:e} Z {:.3} rattlers {} p {:.5} {:?} per step {:?} sweeps/step {:.3} it/step {:.2} gaps/step {:.1}",
            run.disks().unwrap().steps, t0, run.frame().minimizer.dt_max, run.step(), run.status(), run.f_max(), o.coordination(), o.rattlers, o.pressure(), el, el / run.step().max(1) as u32,
            w.sweeps as f64 / w.solves as f64, w.iterations as f64 / w.solves as f64, w.gaps as f64 / w.solves as f64);
    }
}
