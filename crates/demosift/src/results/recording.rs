//! Demonstration sets: episodes of demonstrators at stages of their training (§5.1), from hopeless to successful.
//!
//! Neither a demonstration's place in the set nor its variant tells at which stage it was made: both are drawn.
//! What a demonstration is worth stands in its [`Origin`], apart from the trajectory.

use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::trajectory::{StateLog, Trajectory};
use crate::stages::demonstrator::Stage;
use crate::world::environment::{EnvVariant, Episode, Rollout, Specification};
use crate::world::heuristic::Score;
use crate::world::rollout::{self, Acting, Playground};

/// One demonstrator's part in a set: an episode each of these stages, the worst first.
pub struct Cast<'p, 't> {
    /// Where the demonstrator plays, in its own body.
    pub playground: &'p Playground<'t>,
    /// Stages as [`choose_stages`] returns them.
    pub stages: Vec<&'p Stage>,
}

/// A demonstration and where it came from.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// What the demonstrator did.
    pub trajectory: Trajectory,
    /// The simulator's states behind it, where there is a simulator.
    pub states: Option<StateLog>,
    /// Where it came from.
    pub origin: Origin,
}

/// Where a demonstration came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Origin {
    /// Its place in the set.
    pub demonstration: usize,
    /// The task that was played, which tells whose body it was.
    pub task: String,
    /// The variant that was played.
    pub variant: usize,
    /// TRPO steps of the demonstrator at this stage.
    pub updates: usize,
    /// Mean task reward of an episode at this stage.
    pub stage_return: f64,
    /// Mean heuristic at this stage.
    pub stage_score: Score,
    /// Share of episodes that succeeded at this stage.
    pub stage_success: Option<f64>,
    /// Heuristic of the recorded episode itself.
    pub score: Score,
    /// Whether the recorded episode succeeded.
    pub succeeded: Option<bool>,
    /// Its steps.
    pub steps: usize,
}

/// The demonstrations of all parts in an order from which nothing can be read.
pub fn record(parts: &[Cast<'_, '_>], seed: &Seed) -> Result<Vec<Recorded>> {
    let mut takes = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        let variants = part.playground.specification().variants.len();
        let drawn = draw_variants(part.stages.len(), variants, seed.of("variants").at(index));
        takes
            .extend(part.stages.iter().zip(drawn).map(|(stage, variant)| (part.playground, *stage, variant)));
    }
    let order = shuffled_order(takes.len(), seed.of("order"));
    let seed = seed.of("record");
    let recorded = order.into_iter().enumerate().map(|(demonstration, take)| {
        let (playground, stage, variant) = takes[take];
        let (trajectory, states) = median_episode(playground, stage, variant, &seed.at(demonstration))?;
        let origin = Origin {
            demonstration,
            task: playground.specification().name.clone(),
            variant: variant.0,
            updates: stage.updates,
            stage_return: stage.task_return,
            stage_score: stage.score,
            stage_success: stage.success,
            score: playground.score(&trajectory),
            succeeded: playground.task().succeeded(trajectory.measurements()),
            steps: trajectory.steps(),
        };
        Ok(Recorded { trajectory, states, origin })
    });
    recorded.collect()
}

/// `count` stages whose scores span those of the training as evenly as they can, from the worst to the best.
///
/// A stage may be taken more than once, but each time that it was taken makes it count as farther away by the distance
/// between two wanted scores, so that it is passed over while another one is about as near.
/// A single demonstration is one of the best stage.
///
/// # Errors
/// If there are no stages.
pub fn choose_stages<'s>(stages: &[&'s Stage], count: usize) -> Result<Vec<&'s Stage>> {
    let by_score = |a: &&&Stage, b: &&&Stage| a.score.total_cmp(&b.score);
    let ends = stages.iter().min_by(by_score).zip(stages.iter().max_by(by_score));
    let Some((worst, best)) = ends.map(|(worst, best)| (worst.score, best.score)) else {
        return Err(Error::bad_input("there are no stages of training to record demonstrations at"));
    };
    let spacing = (best - worst) / (count.max(2) - 1) as f64;
    let mut taken = vec![0_usize; stages.len()];
    for index in 0..count {
        let wanted = best - spacing * (count - 1 - index) as f64;
        let distance = |stage: usize| (stages[stage].score - wanted).abs() + spacing * taken[stage] as f64;
        let nearest = (0..stages.len())
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)).then(taken[*a].cmp(&taken[*b])))
            .expect("there are stages");
        taken[nearest] += 1;
    }
    let mut chosen: Vec<&Stage> =
        stages.iter().zip(taken).flat_map(|(stage, times)| std::iter::repeat_n(*stage, times)).collect();
    chosen.sort_by(|a, b| a.score.total_cmp(&b.score));
    Ok(chosen)
}

/// The stage whose score is nearest to this share of the way from the worst stage to the best, which is 0 to 1.
///
/// All demonstrations of one stage make a set of equals, in which there is nothing to select.
///
/// # Errors
/// If there are no stages.
pub fn stage_at<'s>(stages: &[&'s Stage], share: f64) -> Result<&'s Stage> {
    let scores = stages.iter().map(|stage| stage.score);
    let (worst, best) = scores
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(worst, best), score| (worst.min(score), best.max(score)));
    let distance = |stage: &Stage| (stage.score - (worst + share * (best - worst))).abs();
    let nearest = stages.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest
        .copied()
        .ok_or_else(|| Error::bad_input("there are no stages of training to record demonstrations at"))
}

/// The stages for a second set of `count` demonstrations: those that the first one did not choose, if they are enough, or all.
pub fn other_stages<'s>(stages: &'s [Stage], chosen: &[&Stage], count: usize) -> Vec<&'s Stage> {
    let is_chosen = |stage: &&Stage| chosen.iter().any(|chosen| chosen.updates == stage.updates);
    let others: Vec<&Stage> = stages.iter().filter(|stage| !is_chosen(stage)).collect();
    if others.len() < count { stages.iter().collect() } else { others }
}

/// Stages from which a guest's demonstrations are recorded: it succeeds in at least this share of its episodes.
pub const GUEST_SUCCESS: f64 = 0.5;

/// `count` stages of a guest, a demonstrator of another body: only those at which it succeeds, spread evenly.
///
/// # Errors
/// If it succeeds at none; says how often it does at best.
pub fn guest_stages(stages: &[Stage], count: usize) -> Result<Vec<&Stage>> {
    let able = |stage: &&Stage| stage.success.is_some_and(|share| share >= GUEST_SUCCESS);
    let successful: Vec<&Stage> = stages.iter().filter(able).collect();
    if successful.is_empty() {
        let best = stages.iter().filter_map(|stage| stage.success).fold(0.0, f64::max);
        return Err(Error::bad_input(format!(
            "a guest must succeed in its own task in at least {:.0} % of its episodes at some stage, and this one reaches {:.0} %",
            100.0 * GUEST_SUCCESS,
            100.0 * best
        )));
    }
    choose_stages(&successful, count)
}

/// Whether demonstrations of a guest's task can stand among those of a task.
///
/// # Errors
/// If a size differs: of observations or actions, which the set could not hold, or the horizon or the number of variants,
/// from which the guest could be told.
pub fn check_guest(own: &Specification, guest: &Specification) -> Result<()> {
    let sizes = |task: &Specification| {
        [
            ("numbers in an observation", task.observation_size),
            ("numbers in an action", task.action_size),
            ("steps in an episode", task.horizon),
            ("variants", task.variants.len()),
        ]
    };
    match sizes(guest).into_iter().zip(sizes(own)).find(|(guest, own)| guest != own) {
        Some(((what, found), (_, wanted))) => Err(Error::bad_input(format!(
            "the guest's task '{}' has {found} {what}, and '{}' has {wanted}",
            guest.name, own.name
        ))),
        None => Ok(()),
    }
}

/// Whether these stages can act in a task.
///
/// # Errors
/// If their policies were made for other sizes; says both.
pub fn check_stages(stages: &[Stage], task: &Specification) -> Result<()> {
    let wanted = (task.observation_size, task.action_size);
    let sizes = |stage: &Stage| (stage.policy.filter().observation_size(), stage.policy.action_size());
    match stages.iter().map(sizes).find(|found| *found != wanted) {
        Some(found) => Err(Error::bad_input(format!(
            "the demonstrator maps {} observations to {} actions, and the task '{}' has {} and {}",
            found.0, found.1, task.name, wanted.0, wanted.1
        ))),
        None => Ok(()),
    }
}

/// A variant for each of `count` stages that are sorted by score.
///
/// Every run of as many stages as there are variants gets each variant once, in an order of its own.
/// So the variants are balanced, each has bad stages and good ones, and none tells of the stage.
fn draw_variants(count: usize, variants: usize, seed: Seed) -> Vec<EnvVariant> {
    let mut rng = seed.into_rng();
    let mut drawn = Vec::with_capacity(count + variants);
    while drawn.len() < count {
        let mut block: Vec<EnvVariant> = (0..variants).map(EnvVariant).collect();
        block.shuffle(&mut rng);
        drawn.extend(block);
    }
    drawn.truncate(count);
    drawn
}

fn shuffled_order(count: usize, seed: Seed) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut seed.into_rng());
    order
}

/// Episodes that a stage plays for a demonstration; odd, so that there is a median.
const EPISODES_PER_DEMONSTRATION: usize = 15;

/// Environment steps that are played for a demonstration, where episodes last to the horizon.
pub fn steps_of_demonstration(horizon: usize) -> usize {
    EPISODES_PER_DEMONSTRATION * horizon
}

/// The episode of median score among a few that a stage plays: neither its luckiest nor its worst.
fn median_episode(
    playground: &Playground<'_>,
    stage: &Stage,
    variant: EnvVariant,
    seed: &Seed,
) -> Result<(Trajectory, Option<StateLog>)> {
    let seeds: Vec<Seed> = (0..EPISODES_PER_DEMONSTRATION).map(|episode| seed.at(episode)).collect();
    let (policy, acting) = (&stage.policy, Acting::Sampled);
    let episodes = seeds.iter().map(|seed| Episode { policy, acting, variant, seed, keep_states: true });
    let mut played = rollout::play_episodes(playground, &episodes.collect::<Vec<_>>())?;
    let scores: Vec<Score> = played.iter().map(|rollout| playground.score(&rollout.trajectory)).collect();
    let mut by_score: Vec<usize> = (0..played.len()).collect();
    by_score.sort_by(|a, b| scores[*a].total_cmp(&scores[*b]));
    let median = by_score[by_score.len() / 2];
    let Rollout { trajectory, states } = played.swap_remove(median);
    Ok((trajectory, states))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::observation_filter::ObservationFilter;
    use crate::world::point_mass::PointMass;
    use crate::world::policy::{Policy, PolicyShape};

    fn stages(scores: &[f64]) -> Vec<Stage> {
        let shape = PolicyShape { hidden: vec![2], initial_std: 1.0 };
        let policy = Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(0));
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
        let stages = stages(scores);
        let stages: Vec<&Stage> = stages.iter().collect();
        choose_stages(&stages, count).expect("some").iter().map(|stage| stage.score).collect()
    }

    #[test]
    fn stages_span_the_training_evenly_from_the_worst_to_the_best() {
        let scores: Vec<f64> = (0..=100).map(|value| f64::from(value) / 10.0).collect();
        assert_eq!(chosen(&scores, 5), [0.0, 2.5, 5.0, 7.5, 10.0]);
        // Training leaps: what is nearest to an even span is taken.
        assert_eq!(chosen(&[9.0, 0.0, 10.0, 0.1, 4.0], 3), [0.0, 4.0, 10.0]);
        assert_eq!(chosen(&[3.0, 1.0, 2.0], 3), [1.0, 2.0, 3.0]);
        assert_eq!(chosen(&[3.0, 1.0, 2.0], 2), [1.0, 3.0]);
        assert_eq!(chosen(&[3.0, 1.0, 2.0], 1), [3.0]);
    }

    #[test]
    fn more_demonstrations_than_stages_still_span_evenly() {
        // A training that stays at its end for long does not fill the set with its end.
        let mut scores: Vec<f64> = (0..20).map(f64::from).collect();
        scores.extend([19.5; 40]);
        for count in [40, 100] {
            let found = chosen(&scores, count);
            assert_eq!(found.len(), count);
            for (index, score) in found.iter().enumerate() {
                let even = 19.5 * index as f64 / (count - 1) as f64;
                assert!((score - even).abs() <= 1.0, "{score} instead of {even} of {count}");
            }
        }
    }

    #[test]
    fn stages_that_tie_are_taken_equally_often() {
        for (count, most) in [(8, 1), (9, 2), (16, 2)] {
            let stages = stages(&[1.0; 8]);
            let references: Vec<&Stage> = stages.iter().collect();
            let found = choose_stages(&references, count).expect("some");
            for stage in &stages {
                let times = found.iter().filter(|chosen| chosen.updates == stage.updates).count();
                assert!((most - 1..=most).contains(&times) && times > 0);
            }
        }
        assert!(choose_stages(&[], 3).expect_err("none").is_bad_input());
    }

    #[test]
    fn a_set_of_equals_is_of_the_stage_that_far_up() {
        let stages = stages(&[3.0, 0.0, 10.0, 6.0]);
        let all: Vec<&Stage> = stages.iter().collect();
        let score = |share| stage_at(&all, share).expect("there are stages").score;
        assert_eq!([score(0.0), score(0.4), score(0.5), score(1.0)], [0.0, 3.0, 6.0, 10.0]);
        assert!(stage_at(&[], 0.5).expect_err("none").is_bad_input());
    }

    #[test]
    fn a_second_set_takes_other_stages_where_there_are_enough() {
        let stages = stages(&[0.0, 1.0, 2.0, 3.0, 4.0]);
        let all: Vec<&Stage> = stages.iter().collect();
        let first = choose_stages(&all, 2).expect("some");
        let scores = |count| other_stages(&stages, &first, count).iter().map(|s| s.score).collect::<Vec<_>>();
        assert_eq!(scores(3), [1.0, 2.0, 3.0]);
        assert_eq!(scores(4).len(), 5);
    }

    #[test]
    fn variants_are_balanced_and_each_has_bad_stages_and_good_ones() {
        let drawn: Vec<usize> = draw_variants(26, 4, Seed::new(3)).iter().map(|variant| variant.0).collect();
        for variant in 0..4 {
            let places: Vec<usize> = (0..26).filter(|place| drawn[*place] == variant).collect();
            assert!((6..=7).contains(&places.len()), "{drawn:?}");
            assert!(places[0] < 4 && places[places.len() - 1] >= 20, "{drawn:?}");
        }
        // No variant keeps its place among its neighbors, so the stage does not tell it.
        assert!(
            (0..4).all(|place| (0..6).any(|block| drawn[block * 4 + place] != drawn[place])),
            "{drawn:?}"
        );
        assert_ne!(drawn, draw_variants(26, 4, Seed::new(4)).iter().map(|v| v.0).collect::<Vec<_>>());
    }

    #[test]
    fn a_recording_has_each_stage_and_variant_in_an_order_of_its_own() {
        let task = PointMass::with_goals(2);
        let playground = Playground::new(&task);
        let scores: Vec<f64> = (0..12).map(f64::from).collect();
        let stages = stages(&scores);
        let all: Vec<&Stage> = stages.iter().collect();
        let part = || Cast { playground: &playground, stages: choose_stages(&all, 12).expect("some") };
        let recorded = record(&[part()], &Seed::new(5)).expect("plays");
        let updates: Vec<usize> = recorded.iter().map(|recorded| recorded.origin.updates).collect();
        assert!(
            !updates.is_sorted() && recorded.iter().enumerate().all(|(i, r)| r.origin.demonstration == i)
        );
        let mut sorted = updates.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..12).collect::<Vec<_>>());
        assert_eq!(recorded.iter().filter(|recorded| recorded.origin.variant == 0).count(), 6);
        for Recorded { trajectory, origin, .. } in &recorded {
            assert_eq!(origin.score, playground.score(trajectory));
        }
        let second = record(&[part()], &Seed::new(5).of("unseen")).expect("plays");
        for recorded in &recorded {
            assert!(second.iter().all(|other| other.trajectory.actions() != recorded.trajectory.actions()));
        }
    }

    #[test]
    fn a_guest_is_recorded_only_at_stages_at_which_it_succeeds() {
        let mut stages = stages(&[0.0, 1.0, 2.0, 3.0]);
        assert!(guest_stages(&stages, 2).expect_err("nobody says success").is_bad_input());
        for (stage, success) in stages.iter_mut().zip([0.0, 0.3, 0.5, 0.9]) {
            stage.success = Some(success);
        }
        let scores = |count| -> Vec<f64> {
            guest_stages(&stages, count).expect("some").iter().map(|stage| stage.score).collect()
        };
        assert_eq!(scores(2), [2.0, 3.0]);
        assert_eq!(scores(5), [2.0, 2.0, 3.0, 3.0, 3.0]);
        let error = guest_stages(&stages[..2], 1).expect_err("not good enough");
        assert!(error.to_string().contains("reaches 30 %"), "{error}");
    }

    #[test]
    fn a_guest_must_have_the_sizes_of_the_task() {
        use crate::world::environment::Task as _;
        let (one, two) = (PointMass::new(), PointMass::with_goals(2));
        check_guest(one.specification(), one.specification()).expect("the same");
        let error = check_guest(one.specification(), two.specification()).expect_err("other goals");
        assert!(error.to_string().contains("has 2 variants, and 'point_mass' has 1"), "{error}");
        let mut longer = one.specification().clone();
        longer.horizon += 1;
        let error = check_guest(one.specification(), &longer).expect_err("its length tells it");
        assert!(error.to_string().contains("steps in an episode"), "{error}");
    }

    #[test]
    fn stages_of_other_sizes_are_refused() {
        use crate::world::environment::Task as _;
        let shape = PolicyShape { hidden: vec![2], initial_std: 1.0 };
        let mut stages = stages(&[0.0, 1.0]);
        check_stages(&stages, PointMass::new().specification()).expect("fits");
        stages[1].policy = Policy::untrained(&shape, ObservationFilter::identity(5), 2, Seed::new(0));
        let error = check_stages(&stages, PointMass::new().specification()).expect_err("does not fit");
        assert!(error.to_string().contains("5 observations to 2 actions"), "{error}");
    }
}
