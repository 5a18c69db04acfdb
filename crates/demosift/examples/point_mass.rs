//! Ranks planted demonstrations of a point mass: the first thing to run.
//!
//! `cargo run --release -p demosift --example point_mass`

#![allow(clippy::print_stdout, reason = "an example shows what it finds")]

use demosift::basics::ledger::InMemory;
use demosift::basics::observer::Silent;
use demosift::basics::seed::Seed;
use demosift::run::experiment::{Run, sift};
use demosift::run::preset::Preset;
use demosift::world::point_mass::{PointMass, planted_set};
use demosift::world::rollout::Playground;

fn main() -> demosift::Result<()> {
    // Where the demonstrations go, in degrees from the goal: the first is best, the last goes the opposite way.
    let bearings = [0.0, 20.0, 60.0, 100.0, 140.0, 180.0];
    let set = planted_set(&bearings, Seed::new(1))?;
    let task = PointMass::new();
    let config = Preset::Quick.config();
    let sifted = sift(&mut Run {
        set: &set,
        playground: &Playground::new(&task),
        config: &config,
        ledger: &mut InMemory::default(),
        observer: &mut Silent,
    })?;
    for entry in &sifted.selection.ranking.entries {
        println!("bearing {:5} gains {:+.2} m", bearings[entry.demo.0], entry.gain);
    }
    println!("{}", sifted.verdict.sentence);
    Ok(())
}
