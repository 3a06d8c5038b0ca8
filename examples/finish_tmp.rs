use softjam::relax::{Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
use std::time::Instant;
fn main() {
    let a: Vec<f64> = std::env::args()
        .skip(1)
        .map(|x| x.parse().unwrap())
        .collect();
    let (n, phi, seeds, thr) = (a[0] as usize, a[1], a[2] as u64, a[3]);
    let form = if a.len() > 4 && a[4] > 0.0 {
        softjam::force::Form::Gradient
    } else {
        Default::default()
    };
    let verbose = a.len() > 5;
    for seed in 1..=seeds {
        let scene = Scene {
            particles: n,
            phi,
            seed,
            threshold: thr,
            minimizer: Minimizer::FireNewton,
            forces: form,
            steps: std::env::var("STEPS")
                .ok()
                .and_then(|s| s.parse().ok())
                .unwrap_or(200000),
            contact_tolerance: std::env::var("TOL")
                .ok()
                .and_then(|s| s.parse().ok())
                .unwrap_or(1e-12),
            dt_max: std::env::var("DT").ok().and_then(|s| s.parse().ok()),
            ..Scene::default()
        };
        let mut run = Relaxation::new(&scene).unwrap();
        let (mut tf, mut tn, mut fails) = (0.0, 0.0, 0);
        let mut t_fail = 0.0;
        while run.status() == Status::Running {
            let before = run.frame().minimizer.turns;
            let fm = run.f_max();
            let t = Instant::now();
            run.advance().unwrap();
            let dt = t.elapsed().as_secs_f64();
            let after = run.frame().minimizer.turns;
            if after.moves > before.moves {
                tn += dt;
                if verbose {
                    println!(
                        "  newton {:6} {:.2e} -> {:.2e} {:.1} ms",
                        run.step(),
                        fm,
                        run.f_max(),
                        dt * 1e3
                    );
                }
            } else {
                tf += dt;
                if after.failures > before.failures {
                    fails += 1;
                    t_fail += dt;
                    if verbose {
                        println!("  failed {:6} {:.2e} {:.1} ms", run.step(), fm, dt * 1e3);
                    }
                }
            }
        }
        let t = run.frame().minimizer.turns;
        println!(
            "dt_max {:.3} N {n} phi {phi} seed {seed}: {:?} f_max {:.1e} res {:.1e} steps {} fire {:.0} ms, newton {} steps {:.0} ms, failed {fails} {:.0} ms",
            run.frame().minimizer.dt_max,
            run.status(),
            run.f_max(),
            run.law().residual(),
            run.step(),
            tf * 1e3,
            t.moves,
            tn * 1e3,
            t_fail * 1e3
        );
    }
}
