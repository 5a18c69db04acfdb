//! What the exact meta-gradient of cloning brings on the point mass: meta-training by first and by second order, equal rounds.
//!
//! `cargo run --release -p demosift --example meta_order [SEEDS]`
#![allow(clippy::print_stdout, reason = "an example shows what it finds")]

use demosift::basics::ledger::InMemory;
use demosift::basics::observer::Silent;
use demosift::basics::seed::Seed;
use demosift::learning::adapt::{InnerUpdate, Rule};
use demosift::results::panel::Judge;
use demosift::run::experiment::{self, Config, Run};
use demosift::run::preset::Preset;
use demosift::stages::judge::ScoreTable;
use demosift::stages::meta_train::Order;
use demosift::world::point_mass::{PointMass, planted_set};
use demosift::world::rollout::Playground;

fn main() -> demosift::Result<()> {
    let seeds = std::env::args().nth(1).and_then(|seeds| seeds.parse().ok()).unwrap_or(5);
    println!("four demonstrations of a point mass, {seeds} seeds; one update after meta-training");
    println!("loss: of cloning, after that update; distance: from where the demonstration ends");
    println!("{:>6} {:>6} {:>20} {:>20}", "rounds", "order", "loss", "distance, m");
    for rounds in [0, 30, 300] {
        for order in [Order::First, Order::Second] {
            let mut found = Vec::new();
            for seed in 0..seeds {
                found.push(after_one_update(&config(rounds, order, seed))?);
            }
            let (losses, distances): (Vec<f64>, Vec<f64>) = found.into_iter().unzip();
            let order = format!("{order:?}");
            println!("{rounds:>6} {order:>6} {:>20} {:>20}", spread(&losses), spread(&distances));
        }
    }
    Ok(())
}

fn config(rounds: usize, order: Order, seed: u64) -> Config {
    let mut config = Preset::Quick.config();
    config.seed = seed;
    config.inner = InnerUpdate { imitation: Rule::BehavioralCloning, batch_steps: 600, ..config.inner };
    (config.meta_train.rounds, config.meta_train.order) = (rounds, order);
    (config.judge.iterations, config.judge.averaged, config.judge.repeats) = (1, 1, 4);
    config
}

/// Means over the demonstrations: the loss after one update from the meta-parameters, and how far the adapted policy ends
/// from where the demonstration ends. A variant's goal is where one demonstration leads, so that the score says the latter.
fn after_one_update(config: &Config) -> demosift::Result<(f64, f64)> {
    let bearings = [0.0, 90.0, 180.0, 270.0];
    let set = planted_set(&bearings, Seed::new(500 + config.seed))?;
    let task = PointMass::with_goals(bearings.len());
    let run = &mut Run {
        set: &set,
        playground: &Playground::new(&task),
        config,
        ledger: &mut InMemory::default(),
        observer: &mut Silent,
    };
    let ScoreTable { suitabilities, .. } = experiment::scores(run, Judge::Paper)?;
    let own: Vec<_> = suitabilities.iter().filter(|one| one.variant.0 == one.demo.0).collect();
    let updates = own.iter().flat_map(|one| &one.curves).map(|curve| &curve[0]);
    let losses: Vec<f64> = updates.filter_map(|update| update.cloning_loss_after).collect();
    let distances: Vec<f64> = own.iter().map(|one| -one.mean_after()).collect();
    Ok((mean(&losses), mean(&distances)))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn spread(values: &[f64]) -> String {
    if values.iter().any(|value| value.is_nan()) {
        return "-".to_owned();
    }
    let center = mean(values);
    let squares = values.iter().map(|value| (value - center).powi(2)).sum::<f64>();
    format!("{center:.4} ± {:.4}", (squares / (values.len() as f64 - 1.0).max(1.0)).sqrt())
}
