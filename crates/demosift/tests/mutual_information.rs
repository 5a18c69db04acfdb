//! Mutual information on the point mass: the posterior comes to tell by the change of behavior what was imitated.

use demosift::basics::observer::{Event, Observer};
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{Demonstration, DemonstrationSet};
use demosift::learning::adapt::InnerUpdate;
use demosift::learning::gail::Fitting;
use demosift::learning::mutual_information::{Paid, PosteriorFitting};
use demosift::math::rows::Rows;
use demosift::run::preset::Preset;
use demosift::stages::meta_train::{self, Learning, MetaState, MetaTraining, MutualInformation};
use demosift::world::environment::{EnvVariant, Environment};
use demosift::world::point_mass::PointMass;
use demosift::world::policy::PolicyShape;
use demosift::world::rollout::Playground;

/// log Q of a posterior that knows nothing: standard normal, at encodings of variance 1.
const IGNORANT: f64 = -1.418_938_533;

/// The point is driven so far to the east and held there; the norm of the observations tells how far.
fn driven(distance: f32, seed: Seed) -> Demonstration {
    let mut point = PointMass::new().environment();
    let (mut observation, mut measurements) = ([0.0; 4], [0.0; 3]);
    point.reset(EnvVariant(0), seed, &mut observation, &mut measurements);
    let (mut observations, mut actions) = (Rows::with_capacity(4, 30), Rows::with_capacity(2, 30));
    for _ in 0..30 {
        let target = [distance, 0.0];
        let push = |axis: usize| 2.0 * (target[axis] - observation[axis]) - 1.5 * observation[2 + axis];
        let action = [push(0).clamp(-1.0, 1.0), push(1).clamp(-1.0, 1.0)];
        observations.push(&observation);
        actions.push(&action);
        point.step(&action, &mut observation, &mut measurements);
    }
    Demonstration::new(observations, actions).unwrap()
}

/// One of the numbers that meta-training measures, round by round.
struct Measured(&'static str, Vec<f64>);

impl Observer for Measured {
    fn on(&mut self, event: Event<'_>) -> demosift::Result<()> {
        if let Event::Measured { numbers, .. } = event {
            self.1.extend(numbers.iter().filter(|(name, _)| *name == self.0).map(|(_, value)| value));
        }
        Ok(())
    }
}

fn late(values: &[f64]) -> f64 {
    values[5..].iter().sum::<f64>() / (values.len() - 5) as f64
}

/// With mutual information paid as said, or without any.
fn by_round(measured: &'static str, seed: u64, paid: Option<Paid>) -> Vec<f64> {
    let demonstrations = (0..6).map(|i| driven(0.25 * i as f32, Seed::new(seed).at(i))).collect();
    let set = DemonstrationSet::new(demonstrations).unwrap();
    let quick = Preset::Quick.config();
    let discriminator = Fitting { learning_rate: 0.01, steps: 20, batch: 100, entropy: 0.3, most_told: 1.0 };
    let inner = InnerUpdate { batch_steps: 600, discriminator, ..quick.inner };
    let training = MetaTraining { rounds: 15, discriminator_hidden: vec![32, 32], ..quick.meta_train };
    let fitting =
        PosteriorFitting { lstm: 32, dense: 32, readings: 15, ..quick.mutual_information.posterior };
    let quick = quick.mutual_information;
    let paid_by = paid.unwrap_or(quick.paid);
    let information = MutualInformation { paid: paid_by, batch_steps: 600, posterior: fitting, ..quick };
    let shape = PolicyShape { hidden: vec![16, 16], initial_std: 0.5 };
    let (task, seed) = (PointMass::new(), Seed::new(100 + seed));
    let playground = Playground::new(&task);
    let hidden = &training.discriminator_hidden;
    let asked = paid.is_some().then_some(&information);
    let state = MetaState::start(&set, &shape, hidden, asked, &seed.of("start"));
    let learning = Learning { training: &training, inner: &inner, information: asked };
    let mut log = Measured(measured, Vec::new());
    meta_train::meta_train(&set, &playground, &learning, state, &seed, &mut log).unwrap();
    assert_eq!(log.1.len(), 15);
    log.1
}

#[test]
fn eq_4_log_q_on_held_out_pairs_rises_above_that_of_a_posterior_that_knows_nothing() {
    for paid in [Paid::Before, Paid::After] {
        for seed in 0..2 {
            let log_q = by_round("log_q", seed, Some(paid));
            assert!(late(&log_q) > IGNORANT + 0.05, "seed {seed}, {paid:?}: {log_q:.2?}");
            assert!(late(&log_q) > log_q[0], "seed {seed}, {paid:?}: {log_q:.2?}");
        }
    }
}
