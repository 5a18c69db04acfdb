//! What random actions do in a task: whether the simulation holds, what varies, and whether the heuristic can tell episodes apart.
//!
//! In every other episode each action is held for a tenth of the episode, since a heavy robot hardly follows actions that are
//! drawn again at every step.

use demosift::Result;
use demosift::basics::seed::{Rng, Seed};
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment as _, Specification, Task as _};
use rand::RngExt;
use serde::Serialize;

use super::{Finding, first_few, several};
use crate::environment::MujocoEnvironment;
use crate::model::{Axis, Kind};
use crate::mujoco_task::MujocoTask;
use crate::task::measurement::Measurement;

/// Control steps that are played at least.
const STEPS: usize = 5_000;
/// Episodes that are played at least.
const EPISODES: usize = 10;
/// Control steps that are played at most, in fewer or shorter episodes where they are very long.
const MOST_STEPS: usize = 200_000;
/// Episodes below which they are cut rather than fewer.
const FEWEST: usize = 4;
/// Control steps after which an actuator that does something has shown it.
const PUSHED: usize = 10;
/// How far geoms may be inside each other as an episode starts, m: more is thrown apart by the physics.
const DEEP: f64 = 0.02;

/// How far outside of its range a joint may start, rad or m: keyframes are written with few digits.
const OUTSIDE: f64 = 1e-3;

/// The result of random actions.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Tried {
    /// Episodes, spread evenly over the variants.
    pub episodes: usize,
    /// Control steps of all episodes, up to where one ended or became unstable.
    pub steps: usize,
    /// Control steps of an episode that were played: all of them, but of very long ones the first.
    pub steps_per_episode: usize,
    /// Control steps of everything that was played, episodes that were repeated and actuators that were tried included.
    pub steps_in_all: usize,
    /// Episodes that ended before their horizon because a measurement left its range.
    pub ended_early: usize,
    /// Episodes that start outside of such a range.
    pub ended_at_start: usize,
    /// Episodes in which the simulation became unstable.
    pub unstable: usize,
    /// What MuJoCo warned of, and in how many episodes.
    pub warnings: Vec<(String, usize)>,
    /// One entry for each number of an observation.
    pub observation: Vec<Range>,
    /// One entry for each measurement.
    pub measurements: Vec<Range>,
    /// Heuristics of the episodes that were stable.
    pub scores: Range,
    /// Share of the stable episodes that succeeded; `None` if the task does not say, or episodes were cut.
    pub success: Option<f64>,
    /// Actuators of which the agent sees no effect.
    pub without_effect: Vec<String>,
    /// Whether the same seed gave the same bits, in a new simulation and in one with a past.
    pub repeats: bool,
}

/// The values that a number took.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Range {
    /// What the number is.
    pub name: String,
    /// The least finite value; infinite if there was none.
    pub least: f64,
    /// The greatest finite value; infinite if there was none.
    pub greatest: f64,
}

impl Range {
    fn of(name: impl Into<String>) -> Self {
        Self { name: name.into(), least: f64::INFINITY, greatest: f64::NEG_INFINITY }
    }

    fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.least = self.least.min(value);
            self.greatest = self.greatest.max(value);
        }
    }

    /// Whether the number never changed.
    pub fn is_constant(&self) -> bool {
        self.least >= self.greatest
    }
}

impl Tried {
    /// Control steps a second of all that was played, if it took so many seconds.
    pub fn steps_per_sec(&self, seconds: f64) -> f64 {
        self.steps_in_all as f64 / seconds
    }
}

/// An episode of random actions, up to its end or to where the simulation became unstable.
struct Episode {
    observations: Rows,
    measurements: Rows,
    unstable: bool,
    ended: bool,
    /// What ended it before the first step, in words.
    ended_at_start: Option<String>,
    warnings: Vec<&'static str>,
}

/// How many episodes are played, and how many control steps of each.
fn plan(specification: &Specification) -> (usize, usize) {
    let Specification { horizon, ref variants, .. } = *specification;
    let affordable = (MOST_STEPS / horizon).max(FEWEST);
    let count = STEPS.div_ceil(horizon).max(EPISODES).min(affordable).next_multiple_of(variants.len());
    (count, horizon.min((MOST_STEPS / count).max(1)))
}

/// Plays random actions in whole episodes, at least ten of them, or in the beginnings of fewer very long ones.
///
/// # Errors
/// If MuJoCo has no memory for a simulation.
pub fn play(task: &MujocoTask, seed: &Seed) -> Result<(Tried, Vec<Finding>)> {
    let specification = task.specification();
    let variants = specification.variants.len();
    let (count, length) = plan(specification);
    let mut environment = task.mujoco_environment()?;
    let episodes: Vec<Episode> =
        (0..count).map(|number| episode(&mut environment, seed, number, length)).collect();
    let again = [episode(&mut environment, seed, 0, length), {
        episode(&mut task.mujoco_environment()?, seed, 0, length)
    }];
    let repeats = again.iter().all(|again| {
        let bits = |rows: &Rows| rows.flat().iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        bits(&again.observations) == bits(&episodes[0].observations)
            && bits(&again.measurements) == bits(&episodes[0].measurements)
    });
    let overlaps = (0..variants).flat_map(|variant| overlaps(&mut environment, seed, variant));
    let overlaps: Vec<String> = overlaps.collect();
    let outside: Vec<String> = (0..variants).flat_map(|variant| starts_outside(task, variant)).collect();
    let without_effect = without_effect(task, &mut environment, seed);
    let played = sum_up(task, &episodes, length);
    let tried = 2 * PUSHED * specification.action_size;
    let steps_in_all = played.steps + again.iter().map(Episode::steps).sum::<usize>() + tried;
    let played = Tried { without_effect, repeats, steps_in_all, ..played };
    let warned = episodes.iter().filter(|episode| !episode.warnings.is_empty()).count();
    let mut findings = findings(task, &played, &Odd { warned, overlaps, outside });
    findings.extend(ends(task, &episodes));
    Ok((played, findings))
}

impl Episode {
    fn steps(&self) -> usize {
        self.observations.len() - 1
    }
}

/// The first `length` control steps of an episode.
fn episode(environment: &mut MujocoEnvironment, seed: &Seed, number: usize, length: usize) -> Episode {
    let specification = environment.task().specification.clone();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    let mut rng = seed.of("actions").at(number).into_rng();
    let hold = if number % 2 == 1 { length.div_ceil(10) } else { 1 };
    let variant = EnvVariant(number % specification.variants.len());
    environment.reset(variant, seed.of("reset").at(number), &mut observation, &mut now);
    let mut observations = Rows::with_capacity(observation.len(), length + 1);
    let mut measurements = Rows::with_capacity(now.len(), length + 1);
    observations.push(&observation);
    measurements.push(&now);
    let left = environment.task().ends.left(environment.measured());
    let ended_at_start = left.map(|kept| kept.words(&specification.measurements));
    let mut ended = false;
    let mut action = vec![0.0; specification.action_size];
    for step in 0..length {
        if ended {
            break;
        }
        if step.is_multiple_of(hold) {
            draw(&mut action, &mut rng);
        }
        let outcome = environment.step(&action, &mut observation, &mut now);
        if environment.is_unstable() {
            break;
        }
        ended = outcome.terminated;
        observations.push(&observation);
        measurements.push(&now);
    }
    Episode {
        ended: ended && observations.len() <= specification.horizon,
        observations,
        measurements,
        unstable: environment.is_unstable(),
        ended_at_start,
        warnings: environment.warnings_by_kind().into_iter().map(|(words, _)| words).collect(),
    }
}

fn draw(action: &mut [f32], rng: &mut Rng) {
    action.iter_mut().for_each(|value| *value = rng.random_range(-1.0..1.0));
}

/// Pairs of geoms that are inside each other as an episode of the variant starts.
fn overlaps(environment: &mut MujocoEnvironment, seed: &Seed, variant: usize) -> Vec<String> {
    let specification = environment.task().specification.clone();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    environment.reset(EnvVariant(variant), seed.of("overlaps").at(variant), &mut observation, &mut now);
    let names = environment.model().called(Kind::Geom);
    let deep = environment.data().contact().iter().filter(|contact| contact.dist < -DEEP);
    let pairs = deep.filter_map(|contact| {
        let [Ok(one), Ok(other)] = contact.geom.map(usize::try_from) else { return None };
        let under = under(&specification, variant);
        Some(format!("{} and {} by {:.3} m{under}", names[one], names[other], -contact.dist))
    });
    pairs.collect()
}

/// Joints that start outside of their ranges under the variant, noise aside.
fn starts_outside(task: &MujocoTask, variant: usize) -> Vec<String> {
    let start = task.blueprint().reset.start(variant);
    let axes = task.model().axes().into_iter();
    let outside = axes.filter_map(|Axis { name, qpos, range, .. }| {
        let ([low, high], at) = (range?, start[qpos]);
        let is_within = (low - OUTSIDE..=high + OUTSIDE).contains(&at);
        let under = under(task.specification(), variant);
        (!is_within).then(|| format!("{name} at {at:.3}, range {low:.3} to {high:.3}{under}"))
    });
    outside.collect()
}

/// Such as ` under 'left'`, where there are several variants.
fn under(specification: &Specification, variant: usize) -> String {
    match &specification.variants[..] {
        [_] => String::new(),
        variants => format!(" under '{}'", variants[variant]),
    }
}

/// Controls for which −1 and 1 lead to the same observations, bit for bit.
fn without_effect(task: &MujocoTask, environment: &mut MujocoEnvironment, seed: &Seed) -> Vec<String> {
    let specification = task.specification();
    let mut seen = |control: usize, value: f32| {
        let mut observation = vec![0.0; specification.observation_size];
        let mut now = vec![0.0; specification.measurements.len()];
        environment.reset(EnvVariant(0), seed.of("effect").at(0), &mut observation, &mut now);
        let mut action = vec![0.0; specification.action_size];
        action[control] = value;
        let mut seen = Vec::new();
        for _ in 0..PUSHED {
            environment.step(&action, &mut observation, &mut now);
            seen.extend(observation.iter().chain(&now).map(|value| value.to_bits()));
        }
        seen
    };
    let names = task.model().controls().into_iter().enumerate();
    names.filter(|(control, _)| seen(*control, -1.0) == seen(*control, 1.0)).map(|(_, name)| name).collect()
}

/// Everything but `without_effect`, `repeats` and `steps_in_all`, which the episodes do not tell.
fn sum_up(task: &MujocoTask, episodes: &[Episode], length: usize) -> Tried {
    let columns = task.blueprint().observation.iter().flat_map(|reading| reading.columns(task.model()));
    let mut observation: Vec<Range> = columns.map(Range::of).collect();
    let mut measurements: Vec<Range> = task.specification().measurements.iter().map(Range::of).collect();
    let mut scores = Range::of("heuristic");
    let mut warnings: Vec<(String, usize)> = Vec::new();
    let (mut stable, mut succeeded) = (0, 0);
    for episode in episodes {
        for (ranges, rows) in
            [(&mut observation, &episode.observations), (&mut measurements, &episode.measurements)]
        {
            for row in rows.iter() {
                ranges.iter_mut().zip(row).for_each(|(range, value)| range.add(f64::from(*value)));
            }
        }
        for words in &episode.warnings {
            match warnings.iter_mut().find(|(known, _)| known == words) {
                Some((_, count)) => *count += 1,
                None => warnings.push(((*words).to_owned(), 1)),
            }
        }
        if !episode.unstable {
            stable += 1;
            scores.add(task.heuristic().score(&episode.measurements));
            succeeded += usize::from(task.succeeded(&episode.measurements) == Some(true));
        }
    }
    let is_whole = length == task.specification().horizon;
    let says = task.blueprint().success.is_some() && stable > 0 && is_whole;
    let steps = episodes.iter().map(Episode::steps).sum();
    Tried {
        episodes: episodes.len(),
        steps,
        steps_per_episode: length,
        steps_in_all: steps,
        ended_early: episodes.iter().filter(|episode| episode.ended).count(),
        ended_at_start: episodes.iter().filter(|episode| episode.ended_at_start.is_some()).count(),
        unstable: episodes.len() - stable,
        warnings,
        observation,
        measurements,
        scores,
        success: says.then(|| succeeded as f64 / stable as f64),
        without_effect: Vec::new(),
        repeats: true,
    }
}

/// What was seen beside what is told of each number.
struct Odd {
    /// Episodes in which MuJoCo warned.
    warned: usize,
    /// Geoms that are inside each other as an episode starts.
    overlaps: Vec<String>,
    /// Joints that are outside of their ranges then.
    outside: Vec<String>,
}

fn findings(task: &MujocoTask, played: &Tried, odd: &Odd) -> Vec<Finding> {
    let mut findings = physics(played, odd);
    findings.extend(what_is_seen(task, played));
    if played.unstable < played.episodes {
        findings.extend(heuristic(task, played));
    }
    findings
}

fn physics(played: &Tried, Odd { warned, overlaps, outside }: &Odd) -> Vec<Finding> {
    let mut findings = Vec::new();
    let episodes = several(played.episodes, "episode");
    let kinds: Vec<String> =
        played.warnings.iter().map(|(words, count)| format!("{words} ({count})")).collect();
    if played.unstable > 0 {
        findings.push(Finding::error(
            format!(
                "the simulation became unstable in {} of {episodes} of random actions: {}",
                played.unstable,
                kinds.join("; ")
            ),
            "try a smaller timestep (and a larger frame_skip), integrator=\"implicitfast\", more damping or armature, or \
             weaker actuators",
        ));
    } else if played.warnings.is_empty() {
        findings.push(Finding::fine(format!(
            "the simulation is stable and without warnings in {episodes} of random actions"
        )));
    } else {
        findings.push(Finding::warning(
            format!("MuJoCo warned in {warned} of {episodes} of random actions: {}", kinds.join("; ")),
            "the physics is not quite what the model asks for; mend the model",
        ));
    }
    if !overlaps.is_empty() {
        findings.push(Finding::warning(
            format!("geoms are inside each other as an episode starts: {}", first_few(overlaps)),
            "move them apart in [reset], or <exclude> the pair in the model; the physics throws them apart",
        ));
    }
    if !outside.is_empty() {
        findings.push(Finding::warning(
            format!("joints start outside of their ranges: {}", first_few(outside)),
            "start within them in [reset], perhaps with a keyframe of the model; the physics throws them back",
        ));
    }
    findings.push(if played.repeats {
        Finding::fine("the same seed gives the same bits")
    } else {
        Finding::error(
            "the same seed does not give the same bits",
            "runs of this task could not be repeated; a plugin of the model may keep a state of its own",
        )
    });
    if !played.without_effect.is_empty() {
        findings.push(Finding::warning(
            format!(
                "full control either way changes nothing that is observed or measured: {}",
                first_few(&played.without_effect)
            ),
            "see whether the actuator moves the right joint, its gear is not 0, and the agent sees that joint",
        ));
    }
    findings
}

/// Where episodes of random actions end, if the task says that they may end early.
fn ends(task: &MujocoTask, episodes: &[Episode]) -> Option<Finding> {
    if !task.may_end_early() {
        return None;
    }
    let outside = episodes.iter().filter_map(|episode| episode.ended_at_start.as_deref());
    if let Some(first) = outside.clone().next() {
        return Some(Finding::error(
            format!(
                "{} of {} start where they should end: {first}",
                outside.count(),
                several(episodes.len(), "random episode")
            ),
            "they are over after one step; widen the range in [ends], or start within it in [reset]",
        ));
    }
    let mut lengths: Vec<usize> = episodes.iter().filter(|one| one.ended).map(Episode::steps).collect();
    lengths.sort_unstable();
    let (Some(least), Some(most)) = (lengths.first(), lengths.last()) else {
        return Some(Finding::fine(format!(
            "none of {} leaves the ranges of [ends]",
            several(episodes.len(), "random episode")
        )));
    };
    let message = format!(
        "{} of {} end early, after {least} to {most} steps (half of them by step {})",
        lengths.len(),
        several(episodes.len(), "random episode"),
        lengths[(lengths.len() - 1) / 2]
    );
    if *most == 1 {
        return Some(Finding::error(message, "nobody can learn in one step; see the ranges in [ends]"));
    }
    Some(Finding::fine(message))
}

fn what_is_seen(task: &MujocoTask, played: &Tried) -> Vec<Finding> {
    let constant = |ranges: &[Range]| -> Vec<String> {
        ranges.iter().filter(|range| range.is_constant()).map(|range| range.name.clone()).collect()
    };
    let mut findings = Vec::new();
    let still = constant(&played.observation);
    findings.push(match still.len() {
        0 => Finding::fine(format!("each of the {} numbers of an observation varies", played.observation.len())),
        count => Finding::warning(
            format!("{count} of the {} numbers of an observation never changed: {}", played.observation.len(), first_few(&still)),
            "they tell the agent nothing; leave them out unless demonstrations bring them, or random actions rarely get there",
        ),
    });
    let still = constant(&played.measurements);
    let measured = |name: &String| {
        let column = task.specification().measurements.iter().position(|known| known == name);
        column.map(|column| &task.blueprint().measurements[column])
    };
    let is_contact = |name: &String| measured(name).is_some_and(Measurement::is_contact);
    // That no random episode ended has been said.
    let still = still.into_iter().filter(|name| !measured(name).is_some_and(Measurement::is_alive));
    let (contacts, others): (Vec<String>, Vec<String>) = still.partition(is_contact);
    if !contacts.is_empty() {
        findings.push(Finding::fine(format!(
            "contacts that neither began nor ended, as may be in random episodes: {}",
            first_few(&contacts)
        )));
    }
    if !others.is_empty() {
        findings.push(Finding::warning(
            format!("measurements that never changed: {}", first_few(&others)),
            "see whether they name the right places, which something can move",
        ));
    }
    if task.blueprint().reset.is_noiseless() {
        findings.push(Finding::warning(
            "every episode of a variant starts in the same state",
            "give [reset] a qpos_noise or qvel_noise, as the demonstrations have: a policy that knows one start only is \
             judged by it",
        ));
    }
    findings
}

fn heuristic(task: &MujocoTask, played: &Tried) -> Vec<Finding> {
    let mut findings = Vec::new();
    let Range { least, greatest, .. } = played.scores;
    // What an episode is rated by may come after the steps that were played.
    let is_cut = played.steps_per_episode < task.specification().horizon;
    let may_be_same = task.blueprint().heuristic.is_sparse() || is_cut;
    findings.push(if !played.scores.is_constant() {
        Finding::fine("the heuristic tells random episodes apart")
    } else if may_be_same {
        Finding::warning(
            format!("the heuristic is {least} in all random episodes"),
            "nothing can be ranked until agents differ in it; see whether its conditions can hold",
        )
    } else {
        Finding::error(
            format!("the heuristic is {greatest} in all random episodes, whatever was done"),
            "see whether its measurement belongs to something that the agent moves",
        )
    });
    if played.success == Some(1.0) {
        findings.push(Finding::warning(
            "every random episode is a success, so success tells nothing",
            "see whether [success] has the right bound, and `above` or `below` the right way round",
        ));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tried(unstable: usize) -> Tried {
        Tried {
            episodes: 100,
            steps: 5000,
            steps_per_episode: 50,
            steps_in_all: 5200,
            ended_early: 0,
            ended_at_start: 0,
            unstable,
            warnings: vec![("too many contacts".to_owned(), 2), ("a wild position".to_owned(), 1)],
            observation: Vec::new(),
            measurements: Vec::new(),
            scores: Range::of("heuristic"),
            success: None,
            without_effect: Vec::new(),
            repeats: true,
        }
    }

    #[test]
    fn warnings_are_told_with_the_episodes_in_which_they_came() {
        let odd = Odd { warned: 2, overlaps: Vec::new(), outside: Vec::new() };
        let message = |unstable: usize| physics(&tried(unstable), &odd)[0].message.clone();
        let kinds = "too many contacts (2); a wild position (1)";
        assert_eq!(message(0), format!("MuJoCo warned in 2 of 100 episodes of random actions: {kinds}"));
        let wanted =
            format!("the simulation became unstable in 1 of 100 episodes of random actions: {kinds}");
        assert_eq!(message(1), wanted);
    }
}
