//! A point mass that should reach a goal: the smallest task, in pure Rust, for tests, documentation and first steps.
//!
//! The point starts near the origin of a plane at rest and is pushed by a force; the goal lies to the east, or, in the
//! other variants, to the north, west or south.
//! Its demonstrations can be planted: [`planted_set`] makes good ones that go to the goal and bad ones that do not.

use rand_distr::{Distribution, StandardNormal};

use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::{Demonstration, DemonstrationSet};
use crate::math::rows::Rows;
use crate::world::environment::{EnvVariant, Environment, Specification, StepOutcome, Stepped, Task, Worker};
use crate::world::heuristic::{Heuristic, Score};

const CONTROL_STEP_SECS: f32 = 0.1;
const HORIZON: usize = 30;
const FRICTION_PER_SEC: f32 = 1.0;
const FORCE_M_PER_S2: f32 = 2.0;
const GOAL_DISTANCE_M: f32 = 1.0;
const GOAL_RADIUS_M: f32 = 0.25;
const RESET_STD_M: f32 = 0.05;

/// The task: 4 observations (position in m, velocity in m/s), 2 actions (force), up to 4 goals.
#[derive(Debug)]
pub struct PointMass {
    specification: Specification,
}

impl PointMass {
    /// The task with its one goal in the east.
    pub fn new() -> Self {
        Self::with_goals(1)
    }

    /// The task with the first `count` of the goals east, north, west and south as variants.
    ///
    /// # Panics
    /// If `count` is not from 1 to 4: a bug of the caller.
    pub fn with_goals(count: usize) -> Self {
        let goals = ["east", "north", "west", "south"];
        assert!((1..=goals.len()).contains(&count), "1 to 4 goals");
        let name = |name: &&str| (*name).to_owned();
        Self {
            specification: Specification {
                name: "point_mass".to_owned(),
                observation_size: 4,
                observation_parts: vec![("position".to_owned(), 2), ("velocity".to_owned(), 2)],
                action_size: 2,
                control_ranges: vec![[-1.0, 1.0].map(|bound| bound * f64::from(FORCE_M_PER_S2)); 2],
                measurements: ["x", "y", "goal_distance"].iter().map(name).collect(),
                variants: goals[..count].iter().map(name).collect(),
                horizon: HORIZON,
                control_step_secs: f64::from(CONTROL_STEP_SECS),
                is_control_step_told: true,
            },
        }
    }
}

impl PointMass {
    /// A running instance, to be stepped by hand.
    pub fn environment(&self) -> impl Environment + use<> {
        self.point()
    }

    fn point(&self) -> Point {
        Point { position: [0.0; 2], velocity: [0.0; 2], goal: goal(EnvVariant(0)) }
    }
}

impl Default for PointMass {
    fn default() -> Self {
        Self::new()
    }
}

impl Task for PointMass {
    fn specification(&self) -> &Specification {
        &self.specification
    }

    fn worker(&self) -> Result<Box<dyn Worker>> {
        Ok(Box::new(Stepped::new(self.point(), &self.specification)))
    }

    fn heuristic(&self) -> &dyn Heuristic {
        &NegatedFinalDistance
    }

    fn succeeded(&self, measurements: &Rows) -> Option<bool> {
        Some(NegatedFinalDistance.score(measurements) > -f64::from(GOAL_RADIUS_M))
    }
}

/// − distance to the goal at the end, in meters.
struct NegatedFinalDistance;

impl Heuristic for NegatedFinalDistance {
    fn score(&self, measurements: &Rows) -> Score {
        -f64::from(measurements.row(measurements.len() - 1)[2])
    }

    fn unit(&self) -> &str {
        "m"
    }
}

fn goal(variant: EnvVariant) -> [f32; 2] {
    let (x, y) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][variant.0];
    [x * GOAL_DISTANCE_M, y * GOAL_DISTANCE_M]
}

struct Point {
    position: [f32; 2],
    velocity: [f32; 2],
    goal: [f32; 2],
}

impl Point {
    fn goal_distance(&self) -> f32 {
        (self.position[0] - self.goal[0]).hypot(self.position[1] - self.goal[1])
    }

    fn look(&self, observation: &mut [f32], measurements: &mut [f32]) {
        observation[..2].copy_from_slice(&self.position);
        observation[2..].copy_from_slice(&self.velocity);
        measurements[..2].copy_from_slice(&self.position);
        measurements[2] = self.goal_distance();
    }
}

impl Environment for Point {
    fn reset(&mut self, variant: EnvVariant, seed: Seed, observation: &mut [f32], measurements: &mut [f32]) {
        let mut rng = seed.into_rng();
        let mut noise = || -> f32 { StandardNormal.sample(&mut rng) };
        self.position = [RESET_STD_M * noise(), RESET_STD_M * noise()];
        self.velocity = [0.0; 2];
        self.goal = goal(variant);
        self.look(observation, measurements);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32], measurements: &mut [f32]) -> StepOutcome {
        let before = self.goal_distance();
        for ((position, velocity), action) in self.position.iter_mut().zip(&mut self.velocity).zip(action) {
            let force = action.clamp(-1.0, 1.0) * FORCE_M_PER_S2;
            *velocity += (force - FRICTION_PER_SEC * *velocity) * CONTROL_STEP_SECS;
            *position += *velocity * CONTROL_STEP_SECS;
        }
        self.look(observation, measurements);
        StepOutcome { task_reward: before - self.goal_distance(), terminated: false }
    }
}

/// Demonstrations for the goal in the east, one for each bearing, in degrees counterclockwise from east: the point is
/// driven 1 m in that direction and held there, with some noise on the actions.
///
/// Bearings near 0 are good demonstrations, those near 180 the worst.
pub fn planted_set(bearings: &[f32], seed: Seed) -> Result<DemonstrationSet> {
    let demonstrations =
        bearings.iter().enumerate().map(|(index, bearing)| planted(*bearing, seed.at(index)));
    DemonstrationSet::new(demonstrations.collect::<Result<_>>()?)
}

fn planted(bearing: f32, seed: Seed) -> Result<Demonstration> {
    const ACTION_NOISE_STD: f32 = 0.2;
    let target = [bearing.to_radians().cos() * GOAL_DISTANCE_M, bearing.to_radians().sin() * GOAL_DISTANCE_M];
    let mut point = Point { position: [0.0; 2], velocity: [0.0; 2], goal: target };
    let (mut observation, mut measurements) = ([0.0; 4], [0.0; 3]);
    point.reset(EnvVariant(0), seed.of("reset"), &mut observation, &mut measurements);
    let mut rng = seed.of("act").into_rng();
    let (mut observations, mut actions) = (Rows::with_capacity(4, HORIZON), Rows::with_capacity(2, HORIZON));
    for _ in 0..HORIZON {
        let mut action = [0.0; 2];
        for (axis, force) in action.iter_mut().enumerate() {
            let noise: f32 = StandardNormal.sample(&mut rng);
            let push = 2.0 * (target[axis] - observation[axis]) - 1.5 * observation[2 + axis];
            *force = (push + ACTION_NOISE_STD * noise).clamp(-1.0, 1.0);
        }
        observations.push(&observation);
        actions.push(&action);
        point.step(&action, &mut observation, &mut measurements);
    }
    Demonstration::new(observations, actions)
}
