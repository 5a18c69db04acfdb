//! What is kept, and under which names it is stored: a run may be asked again with another `keep`, and what was trained on
//! before stays.

use std::collections::BTreeSet;

use super::{Config, Run, Selection, kept};
use crate::basics::error::Result;
use crate::data::demonstration::DemoId;
use crate::results::panel::{Judges, Opinion, Panel};
use crate::stages::referee::{KEPT, NamedSubset};
use crate::stages::select::Keep;

/// K of the top K that is to be kept, as far as it is known before judging.
pub(crate) fn cut(run: &Run<'_>) -> usize {
    run.config.keep.count_before_judging(run.set.len())
}

/// The same as it was while judging, which gave further repeats to those near it.
pub(super) fn cut_of_judging(run: &Run<'_>) -> usize {
    run.config.judged_for.unwrap_or(run.config.keep).count_before_judging(run.set.len())
}

/// What stands at the end of names in files that depend on what is kept; nothing where that was never asked for differently.
fn ending(config: &Config) -> String {
    config.judged_for.map_or_else(String::new, |_| format!("_keep_{}", config.keep))
}

/// Under which name the policy is stored that one training made of the kept demonstrations: `subset`, and such as
/// `subset_keep_5` where another number was asked for after judging.
pub fn kept_part(config: &Config) -> String {
    format!("subset{}", ending(config))
}

/// The name of what the selection by weights kept.
const BY_WEIGHTS: &str = "kept by weights";
/// The name of what `--keep auto` would keep.
const SURELY_HELPS: &str = "surely helping";

/// What a judge would keep whose order is not the one that is taken, if there is such a thing.
///
/// One that judged only those near the cut would keep as many of them as the one that decides, beside what this keeps of the
/// others.
fn kept_by_other(run: &Run<'_>, panel: &Panel, opinion: &Opinion) -> Result<Option<Vec<DemoId>>> {
    if panel.judged_all(opinion) {
        return Ok(Some(kept(run, opinion.order())?.demos));
    }
    if run.config.keep == Keep::Auto {
        return Ok(None);
    }
    let cut = cut(run);
    let judged: BTreeSet<DemoId> = opinion.ranking.entries.iter().map(|entry| entry.demo).collect();
    let first = panel.deciding().ranking.entries.iter().take(cut).map(|entry| entry.demo);
    let own = opinion.ranking.entries.iter().map(|entry| entry.demo).take(panel.places_above(opinion, cut));
    Ok(Some(first.filter(|demo| !judged.contains(demo)).chain(own).collect()))
}

/// What final policies could be trained on: what is kept, what each judge would keep, and what surely helps by those who decide.
pub fn worth_training_on(run: &Run<'_>, panel: &Panel, selection: &Selection) -> Result<Vec<NamedSubset>> {
    let (mut by_others, mut heard) = (Vec::new(), 0);
    for opinion in panel.others().filter(|_| run.config.keep != Keep::Weights) {
        let Some(demos) = kept_by_other(run, panel, opinion)? else { continue };
        heard += 1;
        let name = format!("{KEPT} by {}", as_keeper(opinion.judge.into()));
        by_others.push(NamedSubset::new(&name, &demos).ending_in(&ending(run.config)));
    }
    by_others.retain(|other| !is_same(&other.demos, &selection.subset.demos));
    let name = match (run.config.keep, panel.opinions.len(), by_others.len()) {
        (Keep::Weights, ..) => BY_WEIGHTS.to_owned(),
        (_, 1, _) => KEPT.to_owned(),
        (_, _, 0) if heard > 0 => format!("{KEPT} by both"),
        _ => format!("{KEPT} by {}", as_keeper(panel.decides)),
    };
    let kept = NamedSubset::new(&name, &selection.subset.demos);
    let mut subsets = vec![match run.config.keep {
        // What has its weights is the same whatever was asked for before.
        Keep::Weights => kept,
        _ => kept.ending_in(&ending(run.config)),
    }];
    subsets.extend(by_others);
    let surely = panel.deciding().uncertainty.surely_helpful();
    if !surely.is_empty() && !subsets.iter().any(|known| is_same(&known.demos, &surely)) {
        subsets.push(NamedSubset::new(SURELY_HELPS, &surely));
    }
    Ok(subsets)
}

/// Those who keep something in the name of it.
fn as_keeper(judges: Judges) -> &'static str {
    match judges {
        Judges::Cloning => "cloning",
        Judges::Paper => "the paper's judge",
        Judges::Both => "both",
        Judges::Trainer => "the trainer",
    }
}

/// Whether both hold the same demonstrations, in whatever order.
fn is_same(one: &[DemoId], other: &[DemoId]) -> bool {
    one.len() == other.len() && one.iter().collect::<BTreeSet<_>>() == other.iter().collect()
}
