use softjam::relax::{Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
fn main() {
    for (n, phi, seed) in [
        (1024, 0.86, 1),
        (1024, 0.86, 2),
        (1024, 0.86, 3),
        (1024, 0.9, 2),
        (1024, 0.845, 1),
    ] {
        let mut run = Relaxation::new(&Scene {
            particles: n,
            phi,
            seed,
            threshold: 1e-12,
            minimizer: Minimizer::FireNewton,
            ..Scene::default()
        })
        .unwrap();
        let mut next = 1e-2;
        print!("{n} {phi} {seed}: start {:.1e}", run.f_max());
        while run.status() == Status::Running {
            run.advance().unwrap();
            while run.f_max() < next && next > 1e-7 {
                print!("  <{next:.0e} @{}", run.step());
                next *= 0.316;
            }
        }
        println!("  end {}", run.step());
    }
}
