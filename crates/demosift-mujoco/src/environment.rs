//! A running instance of a task.
//!
//! After a control step everything that is observed or measured belongs to the same moment:
//! the physics is cut in such a way that places, velocities and contacts are computed for the state in which
//! the step ended, at no cost (MuJoCo's `mj_step1` and `mj_step2`). Contact wrenches are those of the step's last physics step.
//!
//! A simulation that became unstable shows itself: from then to the end of the episode all
//! observations, measurements and rewards are NaN, which
//! [`Trajectory::new`](demosift::data::trajectory::Trajectory::new) turns into an error.

use std::sync::Arc;

use demosift::basics::seed::Seed;
use demosift::world::environment::{EnvVariant, Environment, SimulatorState, StepOutcome};
use demosift::world::fold::FoldState;
use demosift::{Error, Result};
use mujoco_rs::prelude::{MjData, MjtWarning};

use crate::model::Model;
use crate::task::blueprint::Blueprint;
use crate::task::measurement::{Data, Moment, Step};
use crate::task::observation::Reading;
use crate::task::reward::Transition;

/// Warnings after which MuJoCo no longer simulates what was asked for: it starts again, or drops the controls.
const FATAL: [MjtWarning; 4] = [
    MjtWarning::mjWARN_BADQPOS,
    MjtWarning::mjWARN_BADQVEL,
    MjtWarning::mjWARN_BADQACC,
    MjtWarning::mjWARN_BADCTRL,
];

/// MuJoCo's warnings in words, in its order.
const WARNINGS: [&str; 7] = [
    "a mass matrix is nearly singular (INERTIA): a body has too little mass or armature",
    "there are more contacts than there is memory for (CONTACTFULL)",
    "there are more constraints than there is memory for (CNSTRFULL)",
    "a position is not finite or far too large (BADQPOS)",
    "a velocity is not finite or far too large (BADQVEL)",
    "an acceleration is not finite or far too large (BADQACC)",
    "a control is not finite or far too large (BADCTRL)",
];

/// A running instance of a [`MujocoTask`](crate::mujoco_task::MujocoTask).
pub struct MujocoEnvironment {
    task: Arc<Blueprint>,
    data: Data,
    /// Control steps taken in this episode.
    steps: usize,
    before: Vec<f64>,
    after: Vec<f64>,
    success: Option<Progress>,
    needs_wrenches: bool,
}

/// The success of the running episode.
struct Progress {
    so_far: FoldState,
    paid: bool,
}

impl MujocoEnvironment {
    pub(crate) fn new(task: Arc<Blueprint>) -> Result<Self> {
        let data = MjData::try_new(task.model.mujoco().clone())
            .map_err(|error| Error::simulation(format!("MuJoCo cannot set up a simulation: {error}")))?;
        let measurements = vec![0.0; task.measurements.len()];
        let needs_wrenches = task.observation.iter().any(Reading::is_contact_wrench);
        let (before, after) = (measurements.clone(), measurements);
        Ok(Self { task, data, steps: 0, before, after, success: None, needs_wrenches })
    }

    /// Positions of all joints, `[nq]`, in MuJoCo's order: enough to draw the state again.
    pub fn qpos(&self) -> &[f64] {
        self.data.qpos()
    }

    /// Velocities of all joints, `[nv]`, in MuJoCo's order.
    pub fn qvel(&self) -> &[f64] {
        self.data.qvel()
    }

    /// Controls of the step that was taken last, `[nu]`, in MuJoCo's order and units.
    pub fn controls(&self) -> &[f64] {
        self.data.ctrl()
    }

    /// Starts an episode at the given state, `[nq]` and `[nv]`, without noise.
    ///
    /// # Errors
    /// If a length is not the model's, or a number is not finite.
    pub fn set_state(&mut self, qpos: &[f64], qvel: &[f64]) -> Result<()> {
        self.place(qpos, qvel)?;
        self.begin();
        Ok(())
    }

    /// Goes on to the given state as if the action had led there, for what is measured of steps.
    ///
    /// # Errors
    /// As [`set_state`](Self::set_state).
    pub(crate) fn go_on_to(&mut self, qpos: &[f64], qvel: &[f64], action: &[f32]) -> Result<()> {
        self.place(qpos, qvel)?;
        self.compute();
        self.steps += 1;
        std::mem::swap(&mut self.before, &mut self.after);
        self.measure(Some(action));
        Ok(())
    }

    fn place(&mut self, qpos: &[f64], qvel: &[f64]) -> Result<()> {
        for (what, got, wanted) in
            [("qpos", qpos, self.data.qpos().len()), ("qvel", qvel, self.data.qvel().len())]
        {
            if got.len() != wanted {
                let message = format!("{what} of this model has {wanted} numbers, got {}", got.len());
                return Err(Error::bad_input(message));
            }
            if let Some(at) = got.iter().position(|value| !value.is_finite()) {
                return Err(Error::bad_input(format!("{what}[{at}] is {}, and must be finite", got[at])));
            }
        }
        self.data.reset();
        self.task.reset.write_beside(&mut self.data);
        self.data.qpos_mut().copy_from_slice(qpos);
        self.data.qvel_mut().copy_from_slice(qvel);
        Ok(())
    }

    /// Fills the observation `[obs]` and the measurements `[measurements]` of the present state.
    pub fn observe(&self, observation: &mut [f32], measurements: &mut [f32]) {
        if self.is_unstable() {
            observation.fill(f32::NAN);
            measurements.fill(f32::NAN);
            return;
        }
        let phase = self.steps as f64 / self.task.specification.horizon as f64;
        let mut rest = observation;
        for reading in &self.task.observation {
            let (part, others) = rest.split_at_mut(reading.width());
            reading.write(&self.data, phase, part);
            rest = others;
        }
        measurements.iter_mut().zip(&self.after).for_each(|(to, from)| *to = *from as f32);
    }

    /// Whether MuJoCo found the state, an acceleration or a control to be unusable in this episode.
    pub fn is_unstable(&self) -> bool {
        FATAL.iter().any(|kind| self.data.warning()[*kind as usize].number > 0)
    }

    /// How many warnings of any kind MuJoCo gave in this episode.
    pub fn warnings(&self) -> usize {
        self.data.warning().iter().map(|warning| warning.number as usize).sum()
    }

    /// What MuJoCo warned of in this episode, in words, and how often.
    pub(crate) fn warnings_by_kind(&self) -> Vec<(&'static str, usize)> {
        let counts = self.data.warning().iter().map(|warning| warning.number as usize);
        WARNINGS.into_iter().zip(counts).filter(|(_, count)| *count > 0).collect()
    }

    /// Applies an action, which is clipped to [−1, 1], for so many steps of the physics; counts and measures nothing.
    pub(crate) fn push(&mut self, action: &[f32], physics_steps: u32) {
        self.set_controls(action);
        self.advance(physics_steps);
    }

    pub(crate) fn task(&self) -> &Blueprint {
        &self.task
    }

    pub(crate) fn data(&self) -> &Data {
        &self.data
    }

    pub(crate) fn data_mut(&mut self) -> &mut Data {
        &mut self.data
    }

    pub(crate) fn model(&self) -> &Model {
        &self.task.model
    }

    /// Whether the state is one in which an episode ends before its horizon; never, if that is unstable.
    pub(crate) fn has_ended(&self) -> bool {
        !self.is_unstable() && self.task.ends.left(&self.after).is_some()
    }

    /// The measurements of the present state, `[measurements]`.
    pub(crate) fn measured(&self) -> &[f64] {
        &self.after
    }

    /// Computes everything that follows from position and velocity.
    fn compute(&mut self) {
        self.data.forward();
        if self.needs_wrenches {
            self.data.rne_post_constraint();
        }
    }

    /// Computes the state, and forgets the episode before.
    fn begin(&mut self) {
        self.compute();
        self.steps = 0;
        self.measure(None);
        self.success = self.task.success.as_ref().map(|success| {
            let row: Vec<f32> = self.after.iter().map(|value| *value as f32).collect();
            let mut so_far = success.fold.start();
            success.fold.push(&mut so_far, &row);
            Progress { so_far, paid: false }
        });
    }

    /// Takes all measurements of the present state, to which `action` led from that of `before`.
    fn measure(&mut self, action: Option<&[f32]>) {
        let secs = self.task.specification.control_step_secs;
        let step = action.map(|action| Step { before: &self.before, action, secs });
        let moment = Moment { data: &self.data, step, ends: &self.task.ends };
        for &column in &self.task.measuring_order {
            self.after[column] = self.task.measurements[column].take(&moment, &self.after);
        }
    }

    fn set_controls(&mut self, action: &[f32]) {
        for ((to, control), action) in self.data.ctrl_mut().iter_mut().zip(&self.task.controls).zip(action) {
            *to = control.middle + control.half_range * f64::from(action.clamp(-1.0, 1.0));
        }
    }

    fn advance(&mut self, physics_steps: u32) {
        if self.task.model.has_split_step() {
            self.data.step2();
        } else {
            self.data.step();
        }
        (1..physics_steps).for_each(|_| self.data.step());
        if self.needs_wrenches {
            self.data.rne_post_constraint();
        }
        self.data.step1();
    }

    /// What reaching the goal pays in this step: once, as soon as the success cannot be undone any more.
    fn success_reward(&mut self, measurements: &[f32]) -> f64 {
        let is_last = self.steps == self.task.specification.horizon || self.has_ended();
        let (Some(success), Some(progress)) = (&self.task.success, &mut self.success) else { return 0.0 };
        success.fold.push(&mut progress.so_far, measurements);
        let holds = success.bound.holds(success.fold.value(&progress.so_far));
        let pays = !progress.paid
            && holds
            && (is_last || success.fold.is_settled_by(&progress.so_far, success.bound));
        progress.paid |= pays;
        if pays { success.reward } else { 0.0 }
    }

    fn task_reward(&mut self, action: &[f32], observation: &[f32], measurements: &[f32]) -> f64 {
        let success = self.success_reward(measurements);
        let transition = Transition {
            before: &self.before,
            after: &self.after,
            action,
            observation,
            steps: self.steps,
            horizon: self.task.specification.horizon,
        };
        let terms: f64 = self.task.terms.iter().map(|term| term.of(&transition)).sum();
        let shaping = self.task.shaping.as_ref().map_or(0.0, |shaping| shaping.reward(&transition));
        terms + shaping + success
    }
}

impl Environment for MujocoEnvironment {
    fn trouble(&self) -> Option<String> {
        let fatal: Vec<&str> = FATAL
            .iter()
            .filter(|kind| self.data.warning()[**kind as usize].number > 0)
            .map(|kind| WARNINGS[*kind as usize])
            .collect();
        (!fatal.is_empty()).then(|| fatal.join(", "))
    }

    fn simulator_state(&self) -> Option<SimulatorState<'_>> {
        Some(SimulatorState { qpos: self.qpos(), qvel: self.qvel() })
    }

    fn reset(&mut self, variant: EnvVariant, seed: Seed, observation: &mut [f32], measurements: &mut [f32]) {
        self.data.reset();
        self.task.reset.write_beside(&mut self.data);
        let (mut qpos, mut qvel) = (self.data.qpos().to_vec(), self.data.qvel().to_vec());
        self.task.reset.write(variant.0, seed, &mut qpos, &mut qvel);
        self.task.model.mujoco().normalize_quat(&mut qpos);
        self.data.qpos_mut().copy_from_slice(&qpos);
        self.data.qvel_mut().copy_from_slice(&qvel);
        self.begin();
        self.observe(observation, measurements);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32], measurements: &mut [f32]) -> StepOutcome {
        self.push(action, self.task.frame_skip);
        self.steps += 1;
        std::mem::swap(&mut self.before, &mut self.after);
        self.measure(Some(action));
        self.observe(observation, measurements);
        let task_reward = if self.is_unstable() {
            f32::NAN
        } else {
            self.task_reward(action, observation, measurements) as f32
        };
        StepOutcome { task_reward, terminated: self.has_ended() }
    }
}
