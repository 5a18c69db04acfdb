//! Demonstrators: agents trained by reinforcement learning on the task's own shaped reward (§5.1), whose episodes at different
//! stages of training make a noisy demonstration set.

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer, is_due};
use crate::basics::seed::Seed;
use crate::data::observation_filter::Moments;
use crate::data::trajectory::Trajectory;
use crate::learning::adapt::Played;
use crate::learning::advantage::AdvantageEstimation;
use crate::learning::trpo::{self, TrustRegion};
use crate::math::statistics::mean_of;
use crate::world::environment::{EnvVariant, Specification};
use crate::world::heuristic::Score;
use crate::world::policy::{Policy, PolicyShape};
use crate::world::rollout::{self, Acting, Playground};

/// How a demonstrator is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemonstratorTraining {
    /// TRPO steps.
    pub updates: usize,
    /// Environment steps before each TRPO step: as many episodes as have so many where all last to the horizon, and no more where
    /// they end early.
    pub batch_steps: usize,
    /// The policy's shape.
    pub policy: PolicyShape,
    /// TRPO's trust region.
    pub trust_region: TrustRegion,
    /// How rewards become advantages.
    pub advantage: AdvantageEstimation,
    /// Training ends before `updates` once this share of the episodes played for a step succeeded, and of a hundred others:
    /// the best of many batches is a lucky one.
    pub enough_success: f64,
    /// Steps between two snapshots of the policy, the stages to choose from.
    pub snapshot_every: usize,
    /// Updates for which the observation filter still learns; then it is frozen.
    pub filter_updates: usize,
    /// Steps between two checkpoints.
    pub checkpoint_every: usize,
}

/// The demonstrator at some stage of its training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// TRPO steps made.
    pub updates: usize,
    /// Environment steps learned from.
    pub environment_steps: usize,
    /// Mean task reward of an episode, as it played for the last step.
    pub task_return: f64,
    /// Mean heuristic.
    pub score: Score,
    /// Share of episodes that succeeded.
    pub success: Option<f64>,
    /// The policy.
    pub policy: Policy,
}

/// Where a training stands; from here it goes on to the identical result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DemonstratorState {
    updates: usize,
    environment_steps: usize,
    policy: Policy,
    moments: Moments,
    stages: Vec<Stage>,
}

/// Name of the stage in events.
pub const STAGE: &str = "demonstrator";

impl DemonstratorTraining {
    /// Episodes that are played before each TRPO step, as many under each variant.
    fn episodes(&self, task: &Specification) -> usize {
        self.batch_steps.div_ceil(task.horizon).max(2).next_multiple_of(task.variants.len())
    }
}

/// Environment steps that a whole training takes at most, where episodes last to the horizon, but for those in which an
/// early success is confirmed: one batch for the filter, one for each update, and one in which the last policy is seen.
pub fn steps(task: &Specification, training: &DemonstratorTraining) -> u64 {
    ((training.updates + 2) * training.episodes(task) * task.horizon) as u64
}

impl DemonstratorState {
    /// TRPO steps made so far.
    pub fn updates(&self) -> usize {
        self.updates
    }

    /// The demonstrator as it is now.
    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// A demonstrator that knows nothing; its filter comes from a few random episodes under every variant.
    pub fn start(playground: &Playground<'_>, training: &DemonstratorTraining, seed: &Seed) -> Result<Self> {
        use crate::data::observation_filter::ObservationFilter;
        let specification = playground.specification();
        let filter = ObservationFilter::identity(specification.observation_size);
        let policy =
            Policy::untrained(&training.policy, filter, specification.action_size, seed.of("policy"));
        let mut moments = Moments::default();
        let episodes = training.episodes(playground.specification());
        for played in play_all_variants(playground, &policy, episodes, &seed.of("filter"))?.concat() {
            moments.add(played.observations());
        }
        let policy = policy.with_filter(moments.filter());
        Ok(Self { updates: 0, environment_steps: 0, policy, moments, stages: Vec::new() })
    }
}

/// Trains a demonstrator by TRPO and returns it at its stages, the untrained one first, the finished one last.
pub fn train(
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    mut state: DemonstratorState,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<Vec<Stage>> {
    observer.on(Event::Started { stage: STAGE, done: state.updates, total: training.updates })?;
    loop {
        let (by_variant, stage) = play_stage(playground, training, &state, seed)?;
        report(&stage, observer)?;
        let enough = |success: Option<f64>| success.is_some_and(|share| share >= training.enough_success);
        let last = state.updates >= training.updates
            || enough(stage.success) && enough(confirmed_success(playground, &state, seed)?);
        if last || is_due(state.updates, training.snapshot_every) {
            state.stages.push(stage);
        }
        if last {
            return Ok(state.stages);
        }
        improve(&mut state, playground, training, &by_variant)
            .map_err(|error| error.during(&format!("demonstrator, update {}", state.updates)))?;
        observer.on(Event::Advanced { stage: STAGE, done: state.updates })?;
        if is_due(state.updates, training.checkpoint_every) {
            observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &state })?;
        }
    }
}

/// How a policy does, over a number of episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Outcome {
    /// Episodes played.
    pub episodes: usize,
    /// Share of them that succeeded; `None` where the task does not say.
    pub success: Option<f64>,
    /// Mean heuristic.
    pub score: Score,
    /// Mean task reward of an episode.
    #[serde(rename = "return")]
    pub task_return: f64,
}

/// Plays a policy as in training, its actions sampled, for `episodes` episodes that are spread evenly over the variants.
pub fn assess(playground: &Playground<'_>, policy: &Policy, episodes: usize, seed: &Seed) -> Result<Outcome> {
    Ok(outcome(playground, &play_all_variants(playground, policy, episodes, seed)?.concat()))
}

/// Episodes that a success must be confirmed in.
const CONFIRMING_EPISODES: usize = 100;

fn confirmed_success(
    playground: &Playground<'_>,
    state: &DemonstratorState,
    seed: &Seed,
) -> Result<Option<f64>> {
    let seed = seed.of("confirm").at(state.updates);
    Ok(assess(playground, &state.policy, CONFIRMING_EPISODES, &seed)?.success)
}

fn play_stage(
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    state: &DemonstratorState,
    seed: &Seed,
) -> Result<(Vec<Vec<Trajectory>>, Stage)> {
    let seed = seed.of("play").at(state.updates);
    let by_variant =
        play_all_variants(playground, &state.policy, training.episodes(playground.specification()), &seed)?;
    let Outcome { success, score, task_return, .. } = outcome(playground, &by_variant.concat());
    let stage = Stage {
        updates: state.updates,
        environment_steps: state.environment_steps,
        task_return,
        score,
        success,
        policy: state.policy.clone(),
    };
    Ok((by_variant, stage))
}

/// Episodes that are spread evenly over the variants, `[variants][about episodes / variants]`.
fn play_all_variants(
    playground: &Playground<'_>,
    policy: &Policy,
    episodes: usize,
    seed: &Seed,
) -> Result<Vec<Vec<Trajectory>>> {
    let variants = playground.specification().variants.len();
    let play = |variant: usize| {
        let share = episodes / variants + usize::from(variant < episodes % variants);
        let seeds = seed.at(variant).many(share);
        rollout::play(playground, policy, Acting::Sampled, EnvVariant(variant), seeds)
    };
    (0..variants).map(play).collect()
}

fn outcome(playground: &Playground<'_>, trajectories: &[Trajectory]) -> Outcome {
    let task_return = |played: &Trajectory| played.task_rewards().iter().map(|r| f64::from(*r)).sum::<f64>();
    Outcome {
        episodes: trajectories.len(),
        success: playground.success_rate(trajectories),
        score: mean_of(trajectories.iter().map(|played| playground.score(played))),
        task_return: mean_of(trajectories.iter().map(task_return)),
    }
}

/// One TRPO step on all variants at once.
///
/// Each variant has a baseline of its own: a shot that is hard to save would otherwise look like bad actions.
fn improve(
    state: &mut DemonstratorState,
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    by_variant: &[Vec<Trajectory>],
) -> Result<()> {
    let played: Vec<Played> =
        by_variant.iter().map(|trajectories| Played::new(playground, &state.policy, trajectories)).collect();
    let advantages = played.iter().zip(by_variant).map(|(played, trajectories)| {
        let rewards: Vec<f32> =
            trajectories.iter().flat_map(|played| played.task_rewards()).copied().collect();
        played.advantages(&rewards, &training.advantage)
    });
    let advantages = advantages.collect::<Result<Vec<_>>>()?;
    let weight = 1.0 / by_variant.len() as f64;
    let experiences: Vec<_> = played
        .iter()
        .zip(&advantages)
        .flat_map(|(played, advantages)| played.experiences(&state.policy, advantages, weight))
        .collect();
    let step = trpo::step(&experiences, &training.trust_region, 1.0)?;
    state.policy = state.policy.moved(&step.displacement);
    state.updates += 1;
    state.environment_steps +=
        played.iter().map(|played| played.lengths.iter().sum::<usize>()).sum::<usize>();
    if state.updates <= training.filter_updates {
        by_variant.iter().flatten().for_each(|played| state.moments.add(played.observations()));
        state.policy = state.policy.with_filter(state.moments.filter());
    }
    Ok(())
}

fn report(stage: &Stage, observer: &mut dyn Observer) -> Result<()> {
    observer.on(Event::Measured {
        stage: STAGE,
        part: "",
        iteration: stage.updates,
        numbers: &[
            ("environment_steps", stage.environment_steps as f64),
            ("task_return", stage.task_return),
            ("score", stage.score),
            ("success", stage.success.unwrap_or(f64::NAN)),
        ],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::observation_filter::ObservationFilter;
    use crate::world::environment::Task as _;
    use crate::world::point_mass::PointMass;

    #[test]
    fn an_assessment_plays_each_variant_as_often_as_another_and_averages_over_episodes() {
        let task = PointMass::with_goals(3);
        let playground = Playground::new(&task);
        let shape = PolicyShape { hidden: vec![4], initial_std: 0.5 };
        let policy = Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(1));
        let found = assess(&playground, &policy, 10, &Seed::new(2)).expect("plays");
        assert_eq!(found.episodes, 10);
        // By hand: four episodes of the first goal, three of each other.
        let mut scores = Vec::new();
        for (variant, count) in [(0, 4), (1, 3), (2, 3)] {
            for episode in 0..count {
                let seeds = vec![Seed::new(2).at(variant).at(episode)];
                let played = rollout::play(&playground, &policy, Acting::Sampled, EnvVariant(variant), seeds)
                    .expect("plays");
                scores.push(task.heuristic().score(played[0].measurements()));
            }
        }
        let mean = scores.iter().sum::<f64>() / 10.0;
        assert!((found.score - mean).abs() < 1e-12, "{} and {mean}", found.score);
        let within = scores.iter().filter(|score| **score > -0.25).count() as f64 / 10.0;
        assert_eq!(found.success, Some(within));
    }
}
