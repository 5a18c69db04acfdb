//! A training by somebody else's trainer: it learns from the demonstrations where and how it likes, and its policy is played
//! on the episodes on which ours are played too.

use serde::{Deserialize, Serialize};

use super::Training;
use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::data::trajectory::Trajectory;
use crate::math::statistics;
use crate::stages::imitate::CurvePoint;
use crate::world::environment::Specification;
use crate::world::heuristic::Score;
use crate::world::rollout::{self, Playground};
use crate::world::trainer::{Trainer, TrainerIdentity};

/// The result of a training by somebody else's trainer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ByTrainer {
    /// What was learned from.
    pub demos: Vec<DemoId>,
    /// Who learned.
    pub trainer: TrainerIdentity,
    /// How the policy did.
    pub outcome: CurvePoint,
    /// Environment steps that were played for that.
    pub played: u64,
    /// The policy as an ONNX file, where it is one; it has a file of its own.
    #[serde(skip)]
    pub onnx: Option<Vec<u8>>,
}

impl From<&ByTrainer> for Training {
    /// There is one policy, so that nothing was chosen.
    fn from(by: &ByTrainer) -> Self {
        Self { outcome: by.outcome, end: by.outcome, chosen_by: by.outcome.score }
    }
}

/// Environment steps that a training plays here, where episodes last to the horizon.
pub fn steps_by_trainer(task: &Specification, evaluations: usize) -> u64 {
    (evaluations * task.variants.len() * task.horizon) as u64
}

/// Trains on these demonstrations and plays the policy: `evaluations` episodes of each variant, one after the other, on the
/// same seeds on which the outcome of an imitation by ours is played.
///
/// # Errors
/// Those of the trainer and its policy, with the name of the trainer.
pub fn train_by(
    trainer: &dyn Trainer,
    set: &DemonstrationSet,
    demos: &[DemoId],
    playground: &Playground<'_>,
    evaluations: usize,
    seed: &Seed,
) -> Result<ByTrainer> {
    let mut apprentice = trainer.train(set, demos, &seed.of("trainer"))?;
    let mut trajectories: Vec<Trajectory> = Vec::new();
    for variant in playground.specification().variant_ids() {
        let seeds = seed.of("outcome").at(variant.0).many(evaluations);
        trajectories.extend(rollout::play_led(playground, apprentice.as_mut(), variant, &seeds)?);
    }
    let scores: Vec<Score> = trajectories.iter().map(|played| playground.score(played)).collect();
    let outcome = CurvePoint {
        updates: 0,
        environment_steps: 0,
        score: statistics::mean(&scores),
        standard_error: statistics::standard_error(&scores),
        success: playground.success_rate(&trajectories),
        true_return: playground.mean_true_return(&trajectories),
    };
    Ok(ByTrainer {
        demos: demos.to_vec(),
        trainer: trainer.identity().clone(),
        outcome,
        played: trajectories.iter().map(|played| played.steps() as u64).sum(),
        onnx: apprentice.onnx().map(<[u8]>::to_vec),
    })
}
