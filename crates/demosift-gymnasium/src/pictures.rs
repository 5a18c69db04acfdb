//! What an episode looks like: it is played again with its actions in an environment that draws.
//!
//! The environment is made a second time for that (`render_mode="rgb_array"`): one that draws is slower, and needs a graphics
//! library that playing does not.

use demosift::Result;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::minari::Seeded;
use demosift::data::demonstration::robomimic::Recording;
use demosift::data::demonstration::{DemoId, Demonstration};
use demosift::data::trajectory::Trajectory;
use demosift::math::rows::Rows;

use crate::replay::{LEFT, Starts, distance};
use crate::session::Session;
pub use crate::session::View;
use crate::task::GymnasiumTask;
use crate::turn::Turn;
use crate::whole::{Turns as _, reset_seed};

/// An episode that can be played again.
#[derive(Clone, Debug)]
pub struct Reel {
    start: Start,
    /// In the environment's own unit, `[T][act]`.
    actions: Vec<Vec<f64>>,
    /// What was observed before each of them, `[T, obs]` or longer.
    observations: Rows,
}

#[derive(Clone, Debug)]
enum Start {
    Seed(u64),
    State(Recording),
}

impl Reel {
    /// Of an episode that was played from this seed.
    pub fn of_episode(task: &GymnasiumTask, seed: &Seed, played: &Trajectory) -> Self {
        let own = |action: &[f32]| {
            let mut own = vec![0.0; action.len()];
            task.units().to_own(action, &mut own);
            own
        };
        Self {
            start: Start::Seed(reset_seed(seed)),
            actions: played.actions().iter().map(own).collect(),
            observations: played.observations().clone(),
        }
    }

    /// Of a demonstration as it was recorded, in the environment's own unit; `None` where nobody says how it began.
    pub fn of_demonstration(starts: &Starts, demo: DemoId, recorded: &Demonstration) -> Option<Self> {
        let observations = recorded.observations().clone();
        match starts {
            Starts::Seeds(seeds) => {
                let Seeded { seed, actions } = seeds.get(demo.0)?.clone()?;
                Some(Self { start: Start::Seed(seed), actions, observations })
            }
            Starts::States(recordings) => {
                let recording = recordings.get(demo.0)?.clone()?;
                let actions = recording.actions.clone();
                Some(Self { start: Start::State(recording), actions, observations })
            }
        }
    }

    /// How many steps it has.
    pub fn steps(&self) -> usize {
        self.actions.len()
    }
}

/// An environment that draws, in a process of its own.
pub struct Camera {
    session: Session,
    most: [u32; 2],
    turn: Turn,
    /// How many actions were taken since the episode began.
    taken: usize,
    left_at: Option<usize>,
}

impl Camera {
    /// Makes the environment so that it draws; pictures have at most so many columns and rows.
    ///
    /// # Errors
    /// `is_bad_input` if it cannot be made so, `is_simulation` if it fails or draws nothing.
    pub fn open(task: &GymnasiumTask, most: [u32; 2]) -> Result<Self> {
        let session = task.session_to_view()?;
        let mut camera = Self { session, most, turn: Turn::default(), taken: 0, left_at: None };
        camera.session.reset(0, &mut camera.turn)?;
        Ok(camera)
    }

    /// What it looks like as it is.
    ///
    /// # Errors
    /// `is_simulation` if it fails, or renders nothing that is a picture.
    pub fn look(&mut self) -> Result<View> {
        self.session.view(self.most)
    }

    /// Goes to the beginning of an episode.
    ///
    /// # Errors
    /// `is_simulation` if the environment fails.
    pub fn begin(&mut self, reel: &Reel) -> Result<()> {
        (self.taken, self.left_at) = (0, None);
        match &reel.start {
            Start::Seed(seed) => self.session.reset(*seed, &mut self.turn)?,
            Start::State(Recording { model, states, .. }) => {
                let first = states.first().map_or(&[][..], Vec::as_slice);
                self.session.put(model.as_deref(), first, &mut self.turn)?;
            }
        }
        self.compare(reel);
        Ok(())
    }

    /// What it looks like before the action of this step, which is none before the last that was looked at; where the episode
    /// ended earlier than it did when it was recorded, its end.
    ///
    /// # Errors
    /// `is_simulation` if the environment fails.
    pub fn picture(&mut self, reel: &Reel, step: usize) -> Result<View> {
        while self.taken < step && !self.turn.terminated && !self.turn.truncated {
            let Some(action) = reel.actions.get(self.taken) else { break };
            self.session.step(action, &mut self.turn)?;
            self.taken += 1;
            self.compare(reel);
        }
        self.look()
    }

    /// The first step so far at which it was not where the episode was.
    pub fn left_at(&self) -> Option<usize> {
        self.left_at
    }

    fn compare(&mut self, reel: &Reel) {
        if self.left_at.is_none()
            && self.taken < reel.observations.len()
            && distance(&self.turn, reel.observations.row(self.taken)) > LEFT
        {
            self.left_at = Some(self.taken);
        }
    }
}
