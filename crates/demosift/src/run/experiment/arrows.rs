//! Which arrows of the flow are still to be made, and in which order: the flow makes these, and the forecast counts them.

use super::{Config, Run, forget_checkpoint};
use crate::basics::error::Result;
use crate::learning::adapt::MetaPrior;
use crate::results::artifact::{self, Artifact};
use crate::results::panel::Judge;
use crate::stages::judge::{self, Judged};
use crate::stages::select::Keep;
use crate::stages::subset_selection::{self, Weighing};

/// An arrow of the flow that plays, by what it makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arrow {
    /// The meta-parameters, by the run's method.
    Prior,
    /// The scores of a judge.
    Scores(Judge),
    /// The weights of the demonstrations.
    Weighing,
}

impl Arrow {
    /// What it starts from.
    fn from(self) -> Option<Self> {
        match self {
            Self::Prior | Self::Scores(Judge::Cloning | Judge::Trainer) => None,
            Self::Scores(Judge::Paper) | Self::Weighing => Some(Self::Prior),
        }
    }

    /// The stage that makes it, with its part.
    fn stage(self, config: &Config) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Prior => config.method.stage().map(|stage| (stage, "")),
            Self::Scores(judge) => Some((judge::STAGE, judge.name())),
            Self::Weighing => Some((subset_selection::STAGE, "")),
        }
    }

    /// Whether what it makes is stored.
    fn is_made(self, run: &Run<'_>) -> Result<bool> {
        Ok(match self {
            Self::Prior => MetaPrior::recall(run.ledger, "")?.is_some(),
            Self::Scores(judge) => Judged::recall(run.ledger, judge.name())?.is_some(),
            Self::Weighing => Weighing::recall(run.ledger, "")?.is_some(),
        })
    }
}

/// Forgets the checkpoints of all that is made of what is wanted, as a kill may have come before.
pub(crate) fn tidy(run: &mut Run<'_>, wanted: &[Arrow]) -> Result<()> {
    for arrow in wanted.iter().flat_map(|arrow| arrow.from().into_iter().chain([*arrow])) {
        let Some((stage, part)) = arrow.stage(run.config) else { continue };
        if run.ledger.recall(&artifact::checkpoint_name(stage, part))?.is_some() && arrow.is_made(run)? {
            forget_checkpoint(run.ledger, stage, part);
        }
    }
    Ok(())
}

/// The scores of every judge that is asked.
pub(crate) fn all_scores(config: &Config) -> Vec<Arrow> {
    config.judges.each().iter().map(|judge| Arrow::Scores(*judge)).collect()
}

/// What a selection is made of.
pub(crate) fn for_selection(config: &Config) -> Vec<Arrow> {
    let mut wanted = all_scores(config);
    wanted.extend((config.keep == Keep::Weights).then_some(Arrow::Weighing));
    wanted
}

/// What has to be made to have all that is wanted, each after what it starts from.
pub(crate) fn missing(run: &Run<'_>, wanted: &[Arrow]) -> Result<Vec<Arrow>> {
    let mut missing = Vec::new();
    for arrow in wanted {
        if arrow.is_made(run)? {
            continue;
        }
        for needed in arrow.from().into_iter().chain([*arrow]) {
            if !missing.contains(&needed) && !needed.is_made(run)? {
                missing.push(needed);
            }
        }
    }
    Ok(missing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::ledger::InMemory;
    use crate::basics::observer::Silent;
    use crate::basics::seed::Seed;
    use crate::learning::adapt::Learner;
    use crate::results::panel::Judges;
    use crate::run::preset::Preset;
    use crate::world::point_mass::{PointMass, planted_set};
    use crate::world::rollout::Playground;

    #[test]
    fn each_is_made_once_and_after_what_it_starts_from() {
        let (set, task) = (planted_set(&[0.0, 90.0], Seed::new(1)).expect("a valid set"), PointMass::new());
        let config = Config { judges: Judges::Both, keep: Keep::Weights, ..Preset::Quick.config() };
        let (playground, mut ledger) = (Playground::new(&task), InMemory::default());
        let prior = Learner::untrained(&set, &config.policy, &[4], &Seed::new(1));
        let all = |ledger: &mut InMemory| {
            let (playground, observer) = (&playground, &mut Silent);
            let run = Run { set: &set, playground, config: &config, ledger, observer };
            missing(&run, &for_selection(&config)).expect("readable")
        };
        let (cloning, paper) = (Arrow::Scores(Judge::Cloning), Arrow::Scores(Judge::Paper));
        assert_eq!(all(&mut ledger), [cloning, Arrow::Prior, paper, Arrow::Weighing]);
        prior.store(&mut ledger, "").expect("stored");
        assert_eq!(all(&mut ledger), [cloning, paper, Arrow::Weighing]);
    }
}
