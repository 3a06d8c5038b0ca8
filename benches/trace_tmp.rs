use softjam::relax::{Relaxation, Status};
use softjam::scene::Scene;
fn main() {
    let lines: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let scene = Scene::from_toml(&lines.join("\n")).unwrap();
    let mut run = Relaxation::new(&scene).unwrap();
    let mut last = run.frame().minimizer.turns;
    let mut before = run.law().work();
    while run.status() == Status::Running {
        run.advance().unwrap();
        let t = run.frame().minimizer.turns;
        let forces = run.contacts().forces;
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        if t.moves != last.moves || t.failures != last.failures {
            println!(
                "   newton {:?} f_max {:.2e} step {}",
                t,
                run.f_max(),
                run.step()
            );
        }
        last = t;
        if run.step() % 50 == 0 {
            let w = run.law().work();
            println!(
                "{} f_max {:.2e} rel {:.2e} dt {:.3} structures {} its {} sweeps {} patches {}",
                run.step(),
                run.f_max(),
                run.f_max() / mean,
                run.frame().minimizer.dt / run.frame().minimizer.dt_max,
                w.structures - before.structures,
                w.iterations - before.iterations,
                w.sweeps - before.sweeps,
                w.patches - before.patches
            );
            before = w;
        }
    }
    println!("end {} {:.2e}", run.step(), run.f_max());
}
