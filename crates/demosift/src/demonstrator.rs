//! Demonstrators: agents trained by reinforcement learning on the task's own shaped reward (§5.1), whose episodes at different
//! stages of training make a noisy demonstration set.

use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use crate::adapt::Played;
use crate::advantage::AdvantageEstimation;
use crate::environment::EnvVariant;
use crate::error::{Error, Result};
use crate::heuristic::Score;
use crate::observation_filter::Moments;
use crate::observer::{Event, Observer};
use crate::policy::{Policy, PolicyShape};
use crate::rollout::{self, Acting, Playground};
use crate::seed::Seed;
use crate::trajectory::{StateLog, Trajectory};
use crate::trpo::{self, TrustRegion};

/// How a demonstrator is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemonstratorTraining {
    /// TRPO steps.
    pub updates: usize,
    /// Environment steps before each TRPO step; whole episodes are played until they have this many.
    pub batch_steps: usize,
    /// The policy's shape.
    pub policy: PolicyShape,
    /// TRPO's trust region.
    pub trust_region: TrustRegion,
    /// How rewards become advantages.
    pub advantage: AdvantageEstimation,
    /// Training ends before `updates` once this share of the episodes played for a step succeeded.
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
    /// Episodes of `horizon` steps that are played before each TRPO step.
    fn episodes(&self, horizon: usize) -> usize {
        self.batch_steps.div_ceil(horizon).max(2)
    }
}

impl DemonstratorState {
    /// A demonstrator that knows nothing; its filter comes from a few random episodes.
    pub fn start(playground: &Playground<'_>, training: &DemonstratorTraining, seed: &Seed) -> Result<Self> {
        use crate::observation_filter::ObservationFilter;
        let specification = playground.specification();
        let filter = ObservationFilter::identity(specification.observation_size);
        let policy =
            Policy::untrained(&training.policy, filter, specification.action_size, seed.of("policy"));
        let seeds = seed.of("filter").many(training.episodes(specification.horizon));
        let played = rollout::play(playground, &policy, Acting::Sampled, EnvVariant(0), seeds)?;
        let mut moments = Moments::default();
        played.iter().for_each(|trajectory| moments.add(trajectory.observations()));
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
    observer.on(Event::Started { stage: STAGE, done: state.updates, total: training.updates });
    loop {
        let (trajectories, stage) = play_stage(playground, training, &state, seed)?;
        report(&stage, observer);
        let last = state.updates >= training.updates
            || stage.success.is_some_and(|success| success >= training.enough_success);
        if last || state.updates.is_multiple_of(training.snapshot_every.max(1)) {
            state.stages.push(stage);
        }
        if last {
            return Ok(state.stages);
        }
        improve(&mut state, playground, training, &trajectories)
            .map_err(|error| error.during(&format!("demonstrator, update {}", state.updates)))?;
        observer.on(Event::Advanced { stage: STAGE, done: state.updates });
        if state.updates.is_multiple_of(training.checkpoint_every.max(1)) {
            observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &state });
        }
    }
}

/// `count` stages whose scores span those of the training as evenly as they can, from the worst to the best.
pub fn choose_stages(stages: &[Stage], count: usize) -> Result<Vec<Stage>> {
    if stages.len() < count {
        return Err(Error::bad_config(format!(
            "{count} demonstrations at stages of their own are wanted, but the training was kept at {} stages only",
            stages.len()
        ))
        .with_hint(
            "training ends early once it succeeds often enough: lower demonstrator.snapshot_every, or raise demonstrator.updates or demonstrator.enough_success",
        ));
    }
    let mut rest: Vec<&Stage> = stages.iter().collect();
    rest.sort_by(|a, b| a.score.total_cmp(&b.score));
    let (worst, best) = (rest[0].score, rest[rest.len() - 1].score);
    let mut chosen = Vec::with_capacity(count);
    for index in 0..count {
        let wanted = worst + (best - worst) * index as f64 / (count - 1).max(1) as f64;
        let still_needed = count - index - 1;
        // Later choices take from what lies above, so enough must be left there.
        let candidates = &rest[..rest.len() - still_needed];
        let nearest = (0..candidates.len())
            .min_by(|a, b| {
                (candidates[*a].score - wanted).abs().total_cmp(&(candidates[*b].score - wanted).abs())
            })
            .expect("checked above that there are enough");
        chosen.push(rest[nearest].clone());
        rest.drain(..=nearest);
    }
    Ok(chosen)
}

/// An episode that became a demonstration.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// What the demonstrator did.
    pub trajectory: Trajectory,
    /// The simulator's states behind it, where there is a simulator.
    pub states: Option<StateLog>,
}

/// Episodes that a stage plays for a recording; odd, so that there is a median.
const EPISODES_PER_RECORDING: usize = 15;

/// The episode of median score among a few that a stage plays: neither its luckiest nor its worst.
pub fn record(
    playground: &Playground<'_>,
    stage: &Stage,
    variant: EnvVariant,
    seed: &Seed,
) -> Result<Recorded> {
    let seeds = (0..EPISODES_PER_RECORDING).map(|episode| seed.at(episode)).collect();
    let mut played = rollout::play(playground, &stage.policy, Acting::Sampled, variant, seeds)?;
    let scores: Vec<Score> = played.iter().map(|trajectory| playground.score(trajectory)).collect();
    let mut by_score: Vec<usize> = (0..played.len()).collect();
    by_score.sort_by(|a, b| scores[*a].total_cmp(&scores[*b]));
    let median = by_score[by_score.len() / 2];
    let trajectory = played.swap_remove(median);
    let states = rollout::state_log(playground, &trajectory, variant, &seed.at(median))?;
    Ok(Recorded { trajectory, states })
}

/// An order of `count` demonstrations from which their stages cannot be read.
pub fn shuffled_order(count: usize, seed: Seed) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut seed.into_rng());
    order
}

fn play_stage(
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    state: &DemonstratorState,
    seed: &Seed,
) -> Result<(Vec<Trajectory>, Stage)> {
    let variants = playground.specification().variants.len();
    let total = training.episodes(playground.specification().horizon);
    let mut trajectories = Vec::with_capacity(total);
    for variant in 0..variants {
        let episodes = total.div_ceil(variants);
        let seeds = seed.of("play").at(state.updates).at(variant).many(episodes);
        trajectories.extend(rollout::play(
            playground,
            &state.policy,
            Acting::Sampled,
            EnvVariant(variant),
            seeds,
        )?);
    }
    let count = trajectories.len() as f64;
    let task_return = |played: &Trajectory| played.task_rewards().iter().map(|r| f64::from(*r)).sum::<f64>();
    let stage = Stage {
        updates: state.updates,
        environment_steps: state.environment_steps,
        task_return: trajectories.iter().map(task_return).sum::<f64>() / count,
        score: trajectories.iter().map(|played| playground.score(played)).sum::<f64>() / count,
        success: playground.success_rate(&trajectories),
        policy: state.policy.clone(),
    };
    Ok((trajectories, stage))
}

fn improve(
    state: &mut DemonstratorState,
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    trajectories: &[Trajectory],
) -> Result<()> {
    let played = Played::new(playground, &state.policy, trajectories);
    let rewards: Vec<f32> = trajectories.iter().flat_map(|played| played.task_rewards()).copied().collect();
    let advantages = played.advantages(&rewards, &training.advantage)?;
    let experiences = played.experiences(&state.policy, &advantages, 1.0);
    let step = trpo::step(&experiences, &training.trust_region, 1.0)?;
    state.policy = state.policy.moved(&step.displacement);
    state.updates += 1;
    state.environment_steps += trajectories.iter().map(Trajectory::steps).sum::<usize>();
    if state.updates <= training.filter_updates {
        trajectories.iter().for_each(|trajectory| state.moments.add(trajectory.observations()));
        state.policy = state.policy.with_filter(state.moments.filter());
    }
    Ok(())
}

fn report(stage: &Stage, observer: &mut dyn Observer) {
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
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation_filter::ObservationFilter;

    fn stages(scores: &[f64]) -> Vec<Stage> {
        let shape = PolicyShape { hidden: vec![2], initial_std: 1.0 };
        let policy = Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(0));
        let stage = |(updates, score): (usize, &f64)| Stage {
            updates,
            environment_steps: 0,
            task_return: 0.0,
            score: *score,
            success: None,
            policy: policy.clone(),
        };
        scores.iter().enumerate().map(stage).collect()
    }

    fn chosen(scores: &[f64], count: usize) -> Vec<f64> {
        choose_stages(&stages(scores), count).expect("enough").iter().map(|stage| stage.score).collect()
    }

    #[test]
    fn stages_span_the_training_evenly_from_the_worst_to_the_best() {
        let scores: Vec<f64> = (0..=100).map(|value| f64::from(value) / 10.0).collect();
        assert_eq!(chosen(&scores, 5), [0.0, 2.5, 5.0, 7.5, 10.0]);
        // Training leaps: what is nearest to an even span is taken.
        assert_eq!(chosen(&[9.0, 0.0, 10.0, 0.1, 4.0], 3), [0.0, 4.0, 10.0]);
        assert_eq!(chosen(&[3.0, 1.0, 2.0], 3), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn no_stage_is_chosen_twice_even_where_scores_tie() {
        for scores in [vec![1.0; 8], vec![0.0, 0.0, 0.0, 5.0, 5.0, 5.0, 5.0, 5.0], vec![0.0, 9.0, 9.0, 9.0]] {
            for count in 1..=scores.len() {
                let found = choose_stages(&stages(&scores), count).expect("enough");
                let mut updates: Vec<usize> = found.iter().map(|stage| stage.updates).collect();
                updates.sort_unstable();
                updates.dedup();
                assert_eq!(updates.len(), count, "{scores:?}");
                assert!(found.is_sorted_by(|a, b| a.score <= b.score));
            }
        }
    }

    #[test]
    fn too_few_stages_are_told_with_both_numbers() {
        let error = choose_stages(&stages(&[1.0, 2.0]), 3).expect_err("too few");
        assert!(error.is_bad_config());
        assert!(error.to_string().contains("3 demonstrations") && error.to_string().contains("2 stages"));
    }

    #[test]
    fn a_shuffled_order_holds_each_index_once() {
        let mut order = shuffled_order(20, Seed::new(4));
        assert_ne!(order, (0..20).collect::<Vec<_>>());
        order.sort_unstable();
        assert_eq!(order, (0..20).collect::<Vec<_>>());
    }
}
