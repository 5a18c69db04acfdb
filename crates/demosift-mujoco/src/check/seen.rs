//! What a task is made of, in words and numbers, and what can be said of it without playing.

use demosift::world::environment::Task as _;
use demosift::world::heuristic::Heuristic as _;
use serde::Serialize;

use super::Finding;
use crate::model::Kind;
use crate::mujoco_task::MujocoTask;
use crate::task::blueprint::Blueprint;
use crate::task::reward::Term;

/// A task as its model and its task file describe it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Seen {
    /// The task's name.
    pub name: String,
    /// Bodies but the world, by name.
    pub bodies: Vec<String>,
    /// Joints by name, in the order of their numbers in the state.
    pub joints: Vec<String>,
    /// Numbers of the position of all joints, nq.
    pub positions: usize,
    /// Numbers of the velocity of all joints, nv.
    pub velocities: usize,
    /// What an action moves, in the order of its numbers.
    pub actuators: Vec<Actuator>,
    /// Cameras by name.
    pub cameras: Vec<String>,
    /// Simulated seconds of a step of the physics.
    pub timestep_secs: f64,
    /// Steps of the physics in a control step.
    pub frame_skip: u32,
    /// Simulated seconds of a control step.
    pub control_step_secs: f64,
    /// Control steps in an episode.
    pub horizon: usize,
    /// Simulated seconds of an episode.
    pub episode_secs: f64,
    /// When an episode ends before that, such as `height leaves [0.8, 2]`; any one of them ends it.
    pub ends: Vec<String>,
    /// What the agent sees, in order.
    pub observation: Vec<Part>,
    /// Numbers in an observation.
    pub observation_size: usize,
    /// Names of the variants.
    pub variants: Vec<String>,
    /// What is written down at every step.
    pub measurements: Vec<Measured>,
    /// The heuristic in words; higher is better.
    pub heuristic: String,
    /// Unit of the heuristic; may be empty.
    pub unit: String,
    /// When an episode is a success, in words; `None` if the task does not say.
    pub success: Option<String>,
    /// The measurement whose sum over an episode is its true return, which is only reported; `None` if the task does not say.
    pub true_return: Option<String>,
    /// Terms of the reward on which demonstrators are trained; none if the task has no such reward.
    pub reward: Vec<String>,
}

/// An actuator and the range of its control, which actions in [−1, 1] are scaled to.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Actuator {
    /// Its name; `servo[0]` for the first control of one that takes several.
    pub name: String,
    /// The control that −1 becomes.
    pub low: f64,
    /// The control that 1 becomes.
    pub high: f64,
}

/// A part of an observation.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Part {
    /// Its key in the task file, such as `qpos`.
    pub key: String,
    /// The first of its columns in the observation.
    pub first: usize,
    /// What each of its numbers is, such as `qpos elbow`.
    pub columns: Vec<String>,
    /// The range `[low, high]` that its numbers are clipped to.
    pub clip: Option<[f64; 2]>,
}

/// A measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Measured {
    /// Its name in the task file.
    pub name: String,
    /// What it is, with its unit where it has one.
    pub what: String,
}

/// Looks at a task without playing it.
pub fn look(task: &MujocoTask) -> (Seen, Vec<Finding>) {
    let seen = describe(task);
    let mut findings = Vec::new();
    findings.extend(sign(task.blueprint()));
    findings.extend(early_end(task.blueprint()));
    findings.extend(times(&seen));
    if !task.has_reward() {
        findings.push(Finding::warning(
            "the task has no reward, so `demosift record` has nothing to train a demonstrator on",
            "if you want it to, add terms to `reward`, or `reward` to [success]; judging needs neither",
        ));
    }
    if let Some(why) = task.model().lacks_camera() {
        findings.push(Finding::warning(
            format!("the model {why}, so `demosift play` takes no pictures"),
            "wanted one in the model such as <camera name=\"front\" pos=\"0 -2 1\" xyaxes=\"1 0 0 0 0.4 1\"/>",
        ));
    }
    (seen, findings)
}

fn describe(task: &MujocoTask) -> Seen {
    let specification = task.specification();
    let blueprint = task.blueprint();
    let model = task.model();
    let names = &specification.measurements;
    let actuators = model.controls().into_iter().zip(&blueprint.controls);
    let measured = names.iter().zip(&blueprint.measurements);
    let success = blueprint
        .success
        .as_ref()
        .map(|success| format!("{} is {}", success.fold.words(names), success.bound.words()));
    Seen {
        name: specification.name.clone(),
        bodies: model.called(Kind::Body).split_off(1),
        joints: model.called(Kind::Joint),
        positions: model.mujoco().nq() as usize,
        velocities: model.mujoco().nv() as usize,
        actuators: actuators
            .map(|(name, control)| Actuator {
                name,
                low: control.middle - control.half_range,
                high: control.middle + control.half_range,
            })
            .collect(),
        cameras: model.cameras(),
        timestep_secs: model.timestep_secs(),
        frame_skip: blueprint.frame_skip,
        control_step_secs: specification.control_step_secs,
        horizon: specification.horizon,
        episode_secs: specification.control_step_secs * specification.horizon as f64,
        ends: blueprint.ends.words(names),
        observation: parts(blueprint),
        observation_size: specification.observation_size,
        variants: specification.variants.clone(),
        measurements: measured
            .map(|(name, measurement)| Measured { name: name.clone(), what: measurement.words(model, names) })
            .collect(),
        heuristic: blueprint.heuristic.words(names),
        unit: blueprint.heuristic.unit().to_owned(),
        success,
        true_return: blueprint.true_return.map(|column| names[column].clone()),
        reward: reward(blueprint),
    }
}

/// Neighbors of one key that are clipped alike are one part.
fn parts(task: &Blueprint) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut first = 0;
    for reading in &task.observation {
        let columns = reading.columns(&task.model);
        let clip = reading.clip.map(|clip| [clip.low, clip.high]);
        match parts.last_mut() {
            Some(last) if last.key == reading.key() && last.clip == clip => last.columns.extend(columns),
            _ => parts.push(Part { key: reading.key().to_owned(), first, columns, clip }),
        }
        first += reading.width();
    }
    parts
}

fn reward(task: &Blueprint) -> Vec<String> {
    let names = &task.specification.measurements;
    let mut terms: Vec<String> = task.terms.iter().map(|term: &Term| term.words(names)).collect();
    terms.extend(task.shaping.as_ref().map(|_| "shaping in Rust".to_owned()));
    let success = task.success.as_ref().filter(|success| success.reward != 0.0);
    terms.extend(success.map(|success| format!("{} once, for success", success.reward)));
    terms
}

/// A heuristic that rises with a distance, which is a score with the wrong sign more often than not.
fn sign(task: &Blueprint) -> Option<Finding> {
    let heuristic = &task.heuristic;
    let distance = heuristic.columns().iter().find(|column| task.measurements[**column].is_distance());
    let name = &task.specification.measurements[*distance?];
    heuristic.rises_with_its_columns().then(|| {
        Finding::warning(
            format!(
                "higher is better, always, and the heuristic is the higher the larger the distance `{name}`"
            ),
            "if near is good, add `negate = true` to [heuristic]",
        )
    })
}

/// A heuristic that an early end favors, whatever the agent did before it.
fn early_end(task: &Blueprint) -> Option<Finding> {
    let why = task.heuristic.favors_an_early_end().filter(|_| !task.ends.is_empty())?;
    Some(Finding::warning(
        format!("episodes may end early, and the heuristic is {why}"),
        "take a sum of what is good at each step (such as `alive`), or how far it came: docs/traps/variable-horizon.md",
    ))
}

/// Control steps and episodes of unusual length.
fn times(seen: &Seen) -> Vec<Finding> {
    let mut findings = Vec::new();
    let step = seen.control_step_secs;
    if !(0.004..=0.2).contains(&step) {
        findings.push(Finding::warning(
            format!(
                "a control step of {step:.4} s is unusual; most robots are controlled every 0.01 s to 0.1 s"
            ),
            "see whether `frame_skip` and the model's timestep are what you recorded with",
        ));
    }
    if !(10..=2000).contains(&seen.horizon) {
        findings.push(Finding::warning(
            format!("an episode of {} control steps ({:.2} s) is unusual", seen.horizon, seen.episode_secs),
            "see whether `horizon` counts control steps, and not seconds or steps of the physics",
        ));
    }
    findings
}
