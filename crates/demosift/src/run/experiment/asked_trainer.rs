//! Somebody else's trainer, where a run asks it: as a judge, or for the referee.

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::ledger::Ledger;
use crate::results::artifact::Artifact as _;
use crate::results::panel::Judge;
use crate::stages::judge::{Judged, Judging, ScoreTable, ScoredOn};
use crate::world::policy::Acting;
use crate::world::rollout::Playground;
use crate::world::trainer::{Trainer, TrainerIdentity};

/// How demonstrations are judged by somebody else's trainer; not in the paper.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainerJudge {
    /// M: evaluation seeds, fewer where episodes are long ([`Judging::episodes`]).
    pub evaluations: usize,
    /// Trainings on each demonstration under each variant, each with its own random numbers.
    pub repeats: usize,
    /// Up to how many a demonstration gets while it may still belong to either side of the cut; none are added where this is
    /// not more than `repeats`.
    pub most_repeats: usize,
}

impl Default for TrainerJudge {
    /// Fewer than three repeats say little of a spread, and each may take minutes.
    fn default() -> Self {
        Self { evaluations: 10, repeats: 3, most_repeats: 0 }
    }
}

impl TrainerJudge {
    /// The same as judging takes it: its updates are the trainer's, and its policies act as they like.
    pub(super) fn judging(&self) -> Judging {
        let Self { evaluations, repeats, most_repeats } = *self;
        let (scored_on, acting) = (ScoredOn::Evaluations, Acting::Mean);
        Judging { iterations: 0, averaged: 0, scored_on, evaluations, repeats, most_repeats, acting }
    }
}

/// Who asks for trainings by a trainer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Asks {
    /// Judging.
    Judge,
    /// The referee.
    Referee,
}

/// Who trains here besides ours; an error where nobody is there.
pub(super) fn of<'a>(playground: &Playground<'a>, asks: Asks) -> Result<&'a dyn Trainer> {
    let (what, instead) = match asks {
        Asks::Judge => ("judges = trainer", "ask another judge"),
        Asks::Referee => ("referee.trainer", "leave it out of --referee"),
    };
    playground.trainer().ok_or_else(|| {
        Error::bad_config(format!("{what} asks for trainings by a trainer, and there is none"))
            .with_hint(format!("add --trainer FILE.py:FUNCTION, or {instead}"))
    })
}

/// Whether this trainer may go on with a run: it has judged nothing, or was judged by this one.
///
/// # Errors
/// `is_bad_config` if another trainer has judged it.
pub fn check_judged_by(ledger: &dyn Ledger, trainer: &dyn Trainer) -> Result<()> {
    match Judged::recall(ledger, Judge::Trainer.name())? {
        Some(Judged { scores, .. }) => check_same(&scores, Some(trainer)),
        None => Ok(()),
    }
}

/// Whether scores are of the trainer that is there, if one is there and they are of any. A finished ranking is never made
/// again, and it would be by one trainer and the verdict by another.
pub(super) fn check_same(scores: &ScoreTable, trainer: Option<&dyn Trainer>) -> Result<()> {
    match (&scores.trainer, trainer.map(Trainer::identity)) {
        (Some(judged), Some(now)) if judged != now => Err(Error::bad_config(format!(
            "the demonstrations were judged by the trainer {}, and the trainer is {} now",
            judged.name,
            in_words(judged, now)
        ))
        .with_hint("take back the change, or begin another run with it: --out OTHER_FOLDER")),
        _ => Ok(()),
    }
}

/// Another trainer, or one of the same name whose file has changed.
fn in_words(judged: &TrainerIdentity, now: &TrainerIdentity) -> String {
    if judged.name == now.name { "that of a file which has changed".to_owned() } else { now.name.clone() }
}
