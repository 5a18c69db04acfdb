//! A task of several goals as a task of one: S_{v|e} (§3) is said of a goal, and so is what to learn from.

use super::{EnvVariant, Environment, SimulatorState, Specification, StepOutcome, Task};
use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::math::rows::Rows;
use crate::world::heuristic::Heuristic;

/// A task under one of its variants alone: whatever is learned, judged and chosen with it is for this goal.
///
/// Its only variant is number 0, and keeps its name.
///
/// ```
/// use demosift::world::environment::{EnvVariant, OneVariant, Task};
/// use demosift::world::point_mass::PointMass;
///
/// let north = OneVariant::new(Box::new(PointMass::with_goals(2)), "north")?;
/// assert_eq!(north.specification().variants, ["north"]);
///
/// // A name that the task does not have gets an error that lists those it has.
/// let error = OneVariant::new(Box::new(PointMass::with_goals(2)), "up").err().expect("no such goal");
/// assert!(error.to_string().contains("east, north"));
/// # Ok::<(), demosift::Error>(())
/// ```
pub struct OneVariant {
    task: Box<dyn Task>,
    variant: EnvVariant,
    specification: Specification,
}

impl OneVariant {
    /// The task under the variant of this name; bad input if it has none such.
    pub fn new(task: Box<dyn Task>, name: &str) -> Result<Self> {
        let variant = task.specification().variant(name)?;
        let specification = Specification { variants: vec![name.to_owned()], ..task.specification().clone() };
        Ok(Self { task, variant, specification })
    }
}

impl Task for OneVariant {
    fn specification(&self) -> &Specification {
        &self.specification
    }

    fn environment(&self) -> Result<Box<dyn Environment>> {
        Ok(Box::new(UnderIt { environment: self.task.environment()?, variant: self.variant }))
    }

    fn heuristic(&self) -> &dyn Heuristic {
        self.task.heuristic()
    }

    fn succeeded(&self, measurements: &Rows) -> Option<bool> {
        self.task.succeeded(measurements)
    }

    fn true_return(&self, measurements: &Rows) -> Option<f64> {
        self.task.true_return(measurements)
    }

    fn may_end_early(&self) -> bool {
        self.task.may_end_early()
    }
}

/// An instance that always starts under the one variant.
struct UnderIt {
    environment: Box<dyn Environment>,
    variant: EnvVariant,
}

impl Environment for UnderIt {
    fn reset(&mut self, only: EnvVariant, seed: Seed, observation: &mut [f32], measurements: &mut [f32]) {
        assert_eq!(only, EnvVariant(0), "the task has one variant");
        self.environment.reset(self.variant, seed, observation, measurements);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32], measurements: &mut [f32]) -> StepOutcome {
        self.environment.step(action, observation, measurements)
    }

    fn simulator_state(&self) -> Option<SimulatorState<'_>> {
        self.environment.simulator_state()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::point_mass::PointMass;

    #[test]
    fn it_plays_the_episodes_of_its_variant_and_of_no_other() {
        let whole = PointMass::with_goals(3);
        let only = OneVariant::new(Box::new(PointMass::with_goals(3)), "west").expect("one of its goals");
        let play = |task: &dyn Task, variant: usize| {
            let (mut observation, mut measurements) = ([0.0; 4], [0.0; 3]);
            let mut environment = task.environment().expect("a point");
            environment.reset(EnvVariant(variant), Seed::new(3), &mut observation, &mut measurements);
            let outcome = environment.step(&[0.5, -0.2], &mut observation, &mut measurements);
            (observation, measurements, outcome)
        };
        assert_eq!(play(&only, 0), play(&whole, 2));
        assert_ne!(play(&only, 0), play(&whole, 0));
    }
}
