//! How a stage of a run is stored: its checkpoints as it goes, its result and what it cost when it is finished.

use std::collections::BTreeSet;

use crate::basics::error::Result;
use crate::basics::ledger::Ledger;
use crate::basics::observer::{Event, Observer, Snapshot};
use crate::math::arithmetic::Arithmetic;
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
    /// That of this process, and of those that came before it.
    arithmetic: BTreeSet<Arithmetic>,
}

/// A state, behind what it took to come there.
#[derive(Debug)]
struct Counted<'a>(Spent, &'a dyn Snapshot);

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
    done: impl FnOnce(State) -> usize,
) -> Result<(u64, usize)> {
    let checkpoint = artifact::checkpoint_name(stage, part);
    let Some(bytes) = ledger.recall(&checkpoint)? else { return Ok((0, 0)) };
    let (spent, state): (Spent, State) = artifact::read_checkpoint(&bytes, &checkpoint)?;
    Ok((spent.environment_steps, done(state)))
}

/// Where a part of a run stands in a stage.
pub(crate) struct OfPart<State> {
    pub(crate) spent: Spent,
    pub(crate) state: State,
}

/// Where the parts of a run stand in a stage.
pub(crate) fn states_of_parts<State: serde::de::DeserializeOwned>(
    ledger: &dyn Ledger,
    stage: &str,
    part: &str,
) -> Result<Vec<OfPart<State>>> {
    let checkpoint = artifact::checkpoint_name(stage, part);
    let read = |bytes: Vec<u8>| {
        let (spent, state) = artifact::read_checkpoint(&bytes, &checkpoint)?;
        Ok(OfPart { spent, state })
    };
    ledger.of_parts(&checkpoint)?.into_iter().map(read).collect()
}

/// Writes down that this process makes pieces of a stage, which are results by themselves: its checkpoint says only with what
/// they were computed, for whoever brings them together.
pub(crate) fn note_work_on(ledger: &mut dyn Ledger, stage: &str) -> Result<()> {
    let mut arithmetic = noted_here(ledger, stage)?;
    arithmetic.insert(Arithmetic::of_this_process());
    let noted = Counted(Spent { environment_steps: 0, arithmetic }, &());
    ledger.store(&artifact::checkpoint_name(stage, ""), &artifact::write_checkpoint(&noted))
}

/// The arithmetic of all processes that noted work on a stage, here and in the parts of the run.
pub(crate) fn worked_on_by(ledger: &dyn Ledger, stage: &str) -> Result<BTreeSet<Arithmetic>> {
    let mut all = noted_here(ledger, stage)?;
    for OfPart { spent, state: () } in states_of_parts(ledger, stage, "")? {
        all.extend(spent.arithmetic);
    }
    Ok(all)
}

fn noted_here(ledger: &dyn Ledger, stage: &str) -> Result<BTreeSet<Arithmetic>> {
    let name = artifact::checkpoint_name(stage, "");
    let Some(bytes) = ledger.recall(&name)? else { return Ok(BTreeSet::new()) };
    let (spent, ()) = artifact::read_checkpoint::<(Spent, ())>(&bytes, &name)?;
    Ok(spent.arithmetic)
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
        let (spent, state): (Spent, State) = match ledger.recall(&checkpoint)? {
            Some(bytes) => artifact::read_checkpoint(&bytes, &checkpoint)?,
            None => (Spent::default(), start()?),
        };
        let offset = spent.environment_steps.wrapping_sub(playground.steps_taken());
        let stage = stage_name(stage, part);
        let arithmetic = BTreeSet::from([Arithmetic::of_this_process()]);
        let mut begun = Self { ledger, observer, playground, stage, checkpoint, offset, arithmetic };
        begun.was_worked_on_by(&spent);
        Ok((state, begun))
    }

    /// Takes over what others did of the stage.
    pub(crate) fn was_worked_on_by(&mut self, others: &Spent) {
        self.arithmetic.extend(&others.arithmetic);
    }

    fn spent(&self) -> Spent {
        let environment_steps = self.offset.wrapping_add(self.playground.steps_taken());
        Spent { environment_steps, arithmetic: self.arithmetic.clone() }
    }

    /// Stores the finished result and what it cost, and forgets the checkpoint.
    pub fn finish(self, part: &str, result: &impl Artifact) -> Result<()> {
        let spent = self.spent().environment_steps;
        self.finish_having(spent, part, result)
    }

    /// The same for a stage that knows what it played: of units side by side, a checkpoint finds some half played.
    pub fn finish_having(self, environment_steps: u64, part: &str, result: &impl Artifact) -> Result<()> {
        let spent = Spent { environment_steps, ..self.spent() };
        self.observer.on(Event::Finished { stage: &self.stage })?;
        spent.store(self.ledger, &self.stage)?;
        result.store(self.ledger, part)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::error::Error;
    use crate::basics::ledger::InMemory;
    use crate::basics::observer::Silent;
    use crate::basics::seed::Seed;
    use crate::results::panel::Judge;
    use crate::run::experiment::{Config, Run, scores};
    use crate::run::preset::Preset;
    use crate::stages::judge::ScoreTable;
    use crate::world::point_mass::{PointMass, planted_set};

    /// A ledger on a disk that is full from some write on.
    struct Full<'a> {
        inner: &'a mut InMemory,
        left: usize,
    }

    impl Ledger for Full<'_> {
        fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
            self.inner.recall(name)
        }

        fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
            self.left = self.left.checked_sub(1).ok_or_else(full)?;
            self.inner.store(name, bytes)
        }

        fn forget(&mut self, name: &str) -> Result<()> {
            self.inner.forget(name)
        }
    }

    /// Measurements that cannot be written from some on.
    struct Deaf(usize);

    impl Observer for Deaf {
        fn on(&mut self, event: Event<'_>) -> Result<()> {
            if let Event::Measured { .. } = event {
                self.0 = self.0.checked_sub(1).ok_or_else(full)?;
            }
            Ok(())
        }
    }

    fn full() -> Error {
        Error::io("cannot write", std::path::Path::new("disk"), &std::io::ErrorKind::StorageFull.into())
    }

    /// A run with what its parts have stored.
    #[derive(Default)]
    struct Shared {
        own: InMemory,
        part: InMemory,
    }

    impl Ledger for Shared {
        fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
            self.own.recall(name)
        }

        fn store(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
            self.own.store(name, bytes)
        }

        fn forget(&mut self, name: &str) -> Result<()> {
            self.own.forget(name)
        }

        fn of_parts(&self, name: &str) -> Result<Vec<Vec<u8>>> {
            Ok(self.part.recall(name)?.into_iter().collect())
        }
    }

    #[test]
    fn with_what_pieces_were_computed_is_known_to_who_brings_them_together() {
        let mut ledger = Shared::default();
        assert!(worked_on_by(&ledger, "referee").expect("memory").is_empty());
        let older = Spent { arithmetic: [Arithmetic::X86].into(), ..Spent::default() };
        let noted = artifact::write_checkpoint(&Counted(older, &()));
        ledger.part.store(&artifact::checkpoint_name("referee", ""), &noted).expect("memory");
        for _ in 0..2 {
            note_work_on(&mut ledger, "referee").expect("memory");
        }
        let wanted = BTreeSet::from([Arithmetic::X86, Arithmetic::of_this_process()]);
        assert_eq!(worked_on_by(&ledger, "referee").expect("memory"), wanted);
    }

    fn tiny() -> Config {
        let mut config = Preset::Quick.config();
        (config.meta_train.rounds, config.meta_train.checkpoint_every) = (8, 2);
        (config.inner.batch_steps, config.judge.iterations, config.judge.evaluations) = (120, 2, 2);
        config
    }

    fn judged(ledger: &mut dyn Ledger, observer: &mut dyn Observer) -> (Result<ScoreTable>, u64) {
        let (set, task) = (planted_set(&[0.0, 90.0], Seed::new(1)).expect("a valid set"), PointMass::new());
        let (playground, config) = (Playground::new(&task), tiny());
        let mut run = Run { set: &set, playground: &playground, config: &config, ledger, observer };
        let scores = scores(&mut run, Judge::Paper);
        (scores, playground.steps_taken())
    }

    #[test]
    fn a_write_that_fails_stops_the_stage_and_nothing_before_it_is_lost() {
        let (whole, all_steps) = judged(&mut InMemory::default(), &mut Silent);
        let whole = whole.expect("judges");
        for left in 0..6 {
            let mut kept = InMemory::default();
            let (failed, steps) = judged(&mut Full { inner: &mut kept, left }, &mut Silent);
            assert!(failed.expect_err("a full disk").is_io());
            // Of eight rounds of learning and then judging, it went on to the next checkpoint alone.
            assert!(steps < all_steps, "{steps} of {all_steps} with {left} writes");
            let (again, rest) = judged(&mut kept, &mut Silent);
            assert_eq!(again.expect("judges"), whole, "{left}");
            // The first write says what the prior will be trained on; the second is a checkpoint.
            assert!(left < 2 || rest < all_steps, "{rest} of {all_steps} after {left} writes");
        }
        let (failed, steps) = judged(&mut InMemory::default(), &mut Deaf(2));
        assert!(failed.expect_err("a full disk").is_io() && steps < all_steps / 2, "{steps} of {all_steps}");
    }

    #[test]
    fn a_checkpoint_that_a_kill_left_is_forgotten() {
        let mut ledger = InMemory::default();
        judged(&mut ledger, &mut Silent).0.expect("judges");
        let name = artifact::checkpoint_name("judge", "paper");
        let prior = artifact::checkpoint_name("meta_train", "");
        for name in [&name, &prior] {
            ledger.store(name, b"left").expect("memory");
        }
        let (set, task) = (planted_set(&[0.0, 90.0], Seed::new(1)).expect("a valid set"), PointMass::new());
        let (playground, mut config) = (Playground::new(&task), tiny());
        config.judges = crate::results::panel::Judges::Paper;
        let mut run = Run {
            set: &set,
            playground: &playground,
            config: &config,
            ledger: &mut ledger,
            observer: &mut Silent,
        };
        crate::run::experiment::panel(&mut run).expect("is judged");
        assert_eq!(playground.steps_taken(), 0);
        assert!([&name, &prior].iter().all(|name| ledger.recall(name).expect("memory").is_none()));
    }
}
