//! Ready-made configurations: minutes, an evening, or the paper's values.

use crate::adapt::InnerUpdate;
use crate::advantage::AdvantageEstimation;
use crate::experiment::Config;
use crate::gail::Fitting;
use crate::imitate::Imitation;
use crate::judge::Judging;
use crate::meta_train::MetaTraining;
use crate::policy::PolicyShape;
use crate::rollout::Acting;
use crate::trpo::TrustRegion;

/// How much a run may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Minutes: proves that it runs, and ranks roughly.
    Quick,
    /// Half an hour a set on two cores: what the result pages use.
    Standard,
    /// The paper's values, where it gives them (A.2.1).
    Paper,
}

impl Preset {
    /// All presets by name, the cheapest first.
    pub const ALL: [(&'static str, Self); 3] =
        [("quick", Self::Quick), ("standard", Self::Standard), ("paper", Self::Paper)];

    /// The preset's configuration; tasks have small changes of their own on top.
    pub fn config(self) -> Config {
        let by = |quick, standard, paper| match self {
            Self::Quick => quick,
            Self::Standard => standard,
            Self::Paper => paper,
        };
        Config {
            seed: 0,
            keep: 0,
            policy: PolicyShape { hidden: vec![32, 32], initial_std: 0.5 },
            inner: inner_update(by(8, 20, 20)),
            meta_train: MetaTraining {
                rounds: by(60, 400, 2000),
                meta_batch: 10,
                trust_region: TrustRegion { max_kl: 0.01, ..TrustRegion::default() },
                discriminator_learning_rate: 1e-3,
                discriminator_hidden: vec![100, 100],
                checkpoint_every: 10,
            },
            judge: Judging {
                iterations: by(5, 8, 8),
                evaluations: by(20, 50, 50),
                repeats: by(2, 4, 4),
                acting: Acting::Mean,
            },
            imitate: Imitation {
                environment_steps: by(100_000, 600_000, 5_000_000),
                update: imitation_update(by(30, 50, 50)),
                discriminator_hidden: vec![100, 100],
                evaluate_every: 10,
                evaluations: 20,
                acting: Acting::Mean,
                checkpoint_every: 10,
            },
        }
    }
}

fn inner_update(trajectories: usize) -> InnerUpdate {
    InnerUpdate {
        trajectories,
        alphas: vec![1.0, 0.5],
        trust_region: TrustRegion { max_kl: 0.15, ..TrustRegion::default() },
        discriminator: Fitting { learning_rate: 3e-3, steps: 20, batch: 500, entropy: 0.3 },
        advantage: AdvantageEstimation::default(),
    }
}

fn imitation_update(trajectories: usize) -> InnerUpdate {
    InnerUpdate {
        trajectories,
        alphas: vec![1.0],
        trust_region: TrustRegion { max_kl: 0.03, ..TrustRegion::default() },
        discriminator: Fitting { learning_rate: 3e-3, steps: 10, batch: 500, entropy: 0.3 },
        advantage: AdvantageEstimation::default(),
    }
}
