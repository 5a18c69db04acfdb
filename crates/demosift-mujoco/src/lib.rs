//! Tasks in MuJoCo: an MJCF model and a `task.toml` become a [`demosift::world::environment::Task`].
//!
//! The flow: [`registry::load`] finds the two files, [`mujoco_task::MujocoTask`] resolves every name in them once,
//! and each worker plays on a [`environment::MujocoEnvironment`] of its own.
//! No algorithm is known here.
//! Recorded states go the other way: [`replay`] measures them, and [`pictures::render`] and [`pictures::film`] make them into
//! pictures.
//!
//! # A task of your own
//!
//! needs no Rust: a folder with an MJCF file, in which every actuator has a `ctrlrange`, and a `task.toml`.
//! `demosift task check FOLDER` ([`check`]) says what it sees there and what is wrong; with `--data SET` also whether
//! demonstrations fit. The guide `docs/guides/reacher.md` makes such a folder from nothing.
//!
//! ```toml
//! name = "reach"
//! model = "arm.xml"         # beside this file; it may include files, from other folders too
//! camera = "front"          # optional: the one that shows the task best
//! frame_skip = 5            # steps of the physics in a control step
//! horizon = 100             # control steps in an episode, always, or at most where there is [ends]
//!
//! # What the agent sees, in order. A place is a site, geom or body; `site:`, `geom:` or `body:` before
//! # a name says which where several have it. What has no name is called `body 4`, `joint 1` and so on, as the check lists it.
//! # A slice behind a name takes some of its numbers, counted from 0 and half open, as in Python; `clip` cuts a part off.
//! observation = [
//!   { qpos = { except = ["ball"] } },  # "all", a joint, [joints], or all but some
//!   { qpos = "ball[2:]" },             # of a free joint's 7 positions all but x and y; also "all[2:]"
//!   { qvel = "all", clip = [-10, 10] },                # a free joint has 6 velocities; an end may be inf
//!   { position = ["hand"] },           # 3 numbers a place, m
//!   { velocity = ["hand"] },           # 3 numbers a place, m/s
//!   { contact_wrench = ["foot[3:]"] }, # of 6 numbers a body, torque and force of its contacts, the force
//!   "phase",                           # share of the episode that has passed
//! ]
//!
//! # Optional: terms of the reward on which demonstrators are trained.
//! reward = [{ rate_of = "x", weight = 1.0 }, { measurement = "reach", weight = -1.0 }, { control_cost = 0.1 }, { constant = 1.0 }]
//!
//! [reset]                              # optional; the model's own initial state without noise if not given
//! keyframe = "ready"
//! qpos = { elbow = 0.5 }
//! qvel = { ball = [0, 0, 0, 1, 0, 0] }
//! qpos_noise = { uniform = 0.1, except = ["ball"] }   # half width
//! qvel_noise = { normal = 0.1 }                       # standard deviation
//!
//! [measurements]                       # written down at every step, in alphabetical order
//! x = { qpos = "slider" }              # or qvel: a hinge or slide joint
//! reach = { distance = ["hand", "target"] }           # or horizontal_distance
//! head = { height = "head" }           # over the origin of the world
//! upright = { height_above = ["head", "pelvis"] }
//! aside = { position = { of = "hand", axis = "y" } }  # or velocity
//! lands = { contact = ["hand", "floor"] }             # 1 while geoms (or geoms of bodies) touch, else 0
//! speed = { rate_of = "x" }            # what it changed in the control step, a second; 0 after the reset
//! effort = "effort"                    # |action|² of the step, clipped to [-1, 1]; 0 after the reset
//! alive = "alive"                      # 1 while every range of [ends] holds, else 0
//! worth = { sum = { alive = 1.0, speed = 1.0, effort = -0.001 } }      # others, each times its weight
//!
//! [ends]                               # optional: the step after which a measurement is not within its range is the last one
//! head = [0.8, 2.0]                    # the ends are outside; [0.8, inf] has one
//!
//! [return]                             # optional: what others would report, for reports only and never for judging
//! measurement = "worth"                # added up over the steps, without the row after the reset
//!
//! [heuristic]                          # of the T+1 rows of measurements; the one after the reset is the first
//! fold = "min"                         # last_minus_first, min, max, sum, mean, last, count (of rows: without `of`)
//! of = "reach"                         # or [several], which are added up
//! negate = true                        # higher must be better
//! unit = "m"
//! when = [{ measurement = "upright", above = 0 }]     # counts only these rows; is, above, below
//! while = [{ measurement = "lands", is = 0 }]         # and none from the first row at which this fails
//! otherwise = 10.0                     # the value, before negate, where no row is counted
//!
//! [success]                            # optional; a fold, and above or below
//! fold = "min"
//! of = "reach"
//! below = 0.05
//! reward = 100.0                       # once, into the task reward, as soon as the success is certain
//!
//! [[variant]]                          # optional: the goals of a multi-goal task
//! name = "left"
//! qpos = { target = -1.0 }             # on top of [reset]; also qvel
//! ```
//!
//! Where an episode ends early, heuristic, success and return are worked out of the rows that were played.
//! A mean then rates a beginning; `docs/traps/variable-horizon.md` says what to take instead.

pub mod check;
pub mod environment;
mod include;
pub mod model;
pub mod mujoco_task;
pub mod pictures;
mod quiet;
pub mod registry;
pub mod replay;
pub mod task;
mod tasks;

pub use demosift::basics::names;

/// The version of the MuJoCo library that this program found when it started, such as `3.17.0`.
pub fn mujoco_version() -> &'static str {
    mujoco_rs::mujoco_version()
}
