//! How a stage of a run is stored: its checkpoints as it goes, its result and what it cost when it is finished.

use crate::basics::error::Result;
use crate::basics::ledger::Ledger;
use crate::basics::observer::{Event, Observer, Snapshot};
use crate::results::artifact::{self, Artifact};
use crate::stages::method::Spent;
use crate::world::rollout::Playground;

/// Passes events on, writes the checkpoints among them into the ledger, and counts what is played.
pub struct Checkpointing<'a> {
    ledger: &'a mut dyn Ledger,
    observer: &'a mut dyn Observer,
    playground: &'a Playground<'a>,
    stage: String,
    checkpoint: String,
    /// Environment steps of this stage before this process, less those of this process before this stage.
    offset: u64,
}

/// A state, behind the environment steps that it took to come there.
#[derive(Debug)]
struct Counted<'a>(u64, &'a dyn Snapshot);

impl Snapshot for Counted<'_> {
    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = self.0.to_bytes();
        bytes.extend(self.1.to_bytes());
        bytes
    }
}

/// Forgets the checkpoint of a stage whose result is stored: a kill may have come between the two.
///
/// It changes no result, so where it cannot be forgotten, as on a disk that is only read, it may lie there.
pub fn forget_checkpoint(ledger: &mut dyn Ledger, stage: &str, part: &str) {
    let _ = ledger.forget(&artifact::checkpoint_name(stage, part));
}

/// A stage's part as one name.
pub(crate) fn stage_name(stage: &str, part: &str) -> String {
    if part.is_empty() { stage.to_owned() } else { format!("{stage}_{part}") }
}

/// Environment steps that a stage has taken up to its last checkpoint, and how much of its work is done by then; none of
/// both, if it has not begun.
pub(crate) fn begun<State: serde::de::DeserializeOwned>(
    ledger: &dyn Ledger,
    stage: &str,
    part: &str,
    done: impl FnOnce(&State) -> usize,
) -> Result<(u64, usize)> {
    let checkpoint = artifact::checkpoint_name(stage, part);
    let Some(bytes) = ledger.recall(&checkpoint)? else { return Ok((0, 0)) };
    let (spent, state): (u64, State) = artifact::read_checkpoint(&bytes, &checkpoint)?;
    Ok((spent, done(&state)))
}

impl<'a> Checkpointing<'a> {
    /// The state of a stage: that of its last checkpoint, or a new one.
    pub fn begin<State: Snapshot + serde::de::DeserializeOwned>(
        ledger: &'a mut dyn Ledger,
        observer: &'a mut dyn Observer,
        playground: &'a Playground<'a>,
        stage: &str,
        part: &str,
        start: impl FnOnce() -> Result<State>,
    ) -> Result<(State, Self)> {
        ledger.claim()?;
        let checkpoint = artifact::checkpoint_name(stage, part);
        let (spent, state): (u64, State) = match ledger.recall(&checkpoint)? {
            Some(bytes) => artifact::read_checkpoint(&bytes, &checkpoint)?,
            None => (0, start()?),
        };
        let offset = spent.wrapping_sub(playground.steps_taken());
        let stage = stage_name(stage, part);
        Ok((state, Self { ledger, observer, playground, stage, checkpoint, offset }))
    }

    fn spent(&self) -> u64 {
        self.offset.wrapping_add(self.playground.steps_taken())
    }

    /// Stores the finished result and what it cost, and forgets the checkpoint.
    pub fn finish(self, part: &str, noun: &impl Artifact) -> Result<()> {
        let spent = self.spent();
        self.finish_having(spent, part, noun)
    }

    /// The same for a stage that knows what it played: of units side by side, a checkpoint finds some half played.
    pub fn finish_having(self, environment_steps: u64, part: &str, noun: &impl Artifact) -> Result<()> {
        let spent = Spent { environment_steps };
        self.observer.on(Event::Finished { stage: &self.stage })?;
        spent.store(self.ledger, &self.stage)?;
        noun.store(self.ledger, part)?;
        self.ledger.forget(&self.checkpoint)
    }
}

impl Observer for Checkpointing<'_> {
    fn on(&mut self, event: Event<'_>) -> Result<()> {
        let Event::Checkpoint { state, .. } = &event else { return self.observer.on(event) };
        let counted = artifact::write_checkpoint(&Counted(self.spent(), *state));
        // In this order: what was measured on the way to a state is not measured again from there.
        self.observer.on(event)?;
        self.ledger.store(&self.checkpoint, &counted)
    }
}
