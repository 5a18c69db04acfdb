//! scratch
use demosift::experiment::*;
use demosift::observer::*;
use demosift::point_mass::*;
use demosift::preset::Preset;
use demosift::rollout::Playground;
use demosift::seed::Seed;
struct Show(&'static str, usize);
impl Observer for Show {
    fn on(&mut self, e: Event<'_>) {
        if let Event::Measured { stage, part, iteration, numbers } = e {
            if self.0.contains(stage) && (stage != "meta_train" || iteration % self.1 == 0) {
                print!("{stage} {part} {iteration}");
                for (n, v) in numbers {
                    print!(" {}={:.3}", n, v);
                }
                println!();
            }
        }
    }
}
fn main() -> demosift::Result<()> {
    let bearings = [0.0, 20.0, 60.0, 100.0, 140.0, 180.0];
    let mut config = Preset::Quick.config();
    let arg = |i: usize, d: f64| std::env::args().nth(i).map_or(d, |s| s.parse().unwrap());
    config.meta_train.rounds = arg(1, 60.0) as usize;
    config.inner.discriminator.steps = arg(2, 5.0) as usize;
    config.inner.discriminator.learning_rate = arg(3, 3e-3);
    config.inner.trust_region.max_kl = arg(4, 0.15);
    config.meta_train.discriminator_learning_rate = arg(5, 1e-3);
    config.seed = arg(6, 0.0) as u64;
    let set = planted_set(&bearings, Seed::new(1))?;
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let mut ledger = InMemory::default();
    let mut show = Show("meta_train judge", 15);
    let mut run =
        Run { set: &set, playground: &playground, config: &config, ledger: &mut ledger, observer: &mut show };
    let prior = prior(&mut run)?;
    let s = scores(&mut run, &prior)?;
    for entry in &demosift::select::rank(&s).entries {
        println!(
            "bearing {:5} before {:+.2} after {:+.2}",
            bearings[entry.demo.0], entry.before, entry.after
        );
    }
    Ok(())
}
