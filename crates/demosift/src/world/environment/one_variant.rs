//! A task of several goals as a task of one: S_{v|e} (§3) is said of a goal, and so is what to learn from.

use super::{EnvVariant, Episode, Led, Rollout, Specification, Task, Worker};
use crate::basics::error::Result;
use crate::math::rows::Rows;
use crate::world::heuristic::Heuristic;
use crate::world::trainer::Apprentice;

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

    fn worker(&self) -> Result<Box<dyn Worker>> {
        Ok(Box::new(UnderIt { worker: self.task.worker()?, variant: self.variant }))
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

/// A worker that always plays under the one variant.
struct UnderIt {
    worker: Box<dyn Worker>,
    variant: EnvVariant,
}

impl Worker for UnderIt {
    fn width(&self) -> usize {
        self.worker.width()
    }

    fn play(&mut self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
        assert!(episodes.iter().all(|one| one.variant == EnvVariant(0)), "the task has one variant");
        let under_it = episodes.iter().map(|episode| Episode { variant: self.variant, ..*episode });
        let episodes: Vec<Episode<'_>> = under_it.collect();
        self.worker.play(&episodes)
    }

    fn play_led(&mut self, episode: Led<'_>, by: &mut dyn Apprentice) -> Result<Rollout> {
        assert_eq!(episode.variant, EnvVariant(0), "the task has one variant");
        self.worker.play_led(Led { variant: self.variant, ..episode }, by)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::observation_filter::ObservationFilter;
    use crate::world::point_mass::PointMass;
    use crate::world::policy::{Acting, Policy, PolicyShape};

    #[test]
    fn it_plays_the_episodes_of_its_variant_and_of_no_other() {
        let whole = PointMass::with_goals(3);
        let only = OneVariant::new(Box::new(PointMass::with_goals(3)), "west").expect("one of its goals");
        let shape = PolicyShape { hidden: vec![4], initial_std: 0.5 };
        let policy = Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(1));
        let play = |task: &dyn Task, variant: usize| {
            let seeds = Seed::new(3).many(2);
            let asked = seeds.iter().map(|seed| Episode {
                policy: &policy,
                acting: Acting::Sampled,
                variant: EnvVariant(variant),
                seed,
                keep_states: false,
            });
            let mut worker = task.worker().expect("a point");
            worker.play(&asked.collect::<Vec<_>>()).expect("the point mass plays")
        };
        assert_eq!(play(&only, 0), play(&whole, 2));
        assert_ne!(play(&only, 0), play(&whole, 0));
    }
}
