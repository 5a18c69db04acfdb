//! The verdict as one sentence that is true.

use super::{Candidate, Conclusion, DECISIVE, Side, Verdict};
use crate::basics::rounding::decimals;

/// More demonstrations than these are not listed.
const LISTED: usize = 8;

/// What the verdict says, and what to train on.
pub(super) fn sentence(verdict: &Verdict, unit: &str) -> String {
    let Verdict { conclusion, difference, winner, candidates, pairs, .. } = verdict;
    let Some(winner) = winner else {
        return "No policy was trained, so nothing is known of whether selecting helps.".to_owned();
    };
    let candidate = |pair: usize| &candidates[pairs[pair].trained.candidate];
    let by = |pair: usize| verdict.imitator_name(pairs[pair].trained.imitator);
    let train = format!("train on {} by {}", described(candidate(*winner)), by(*winner));
    let Some(difference) = difference else {
        let is_all = candidates.iter().all(|candidate| candidate.side == Side::Whole);
        return match is_all {
            true => format!("All demonstrations were kept, so there is nothing to compare: {train}."),
            false => format!(
                "Too few trainings to compare, at least {DECISIVE} of each are needed: {train}, as far as these show."
            ),
        };
    };
    let (kept, size) = (candidate(difference.of), candidate(difference.of).size);
    let numbers = [difference.by, difference.low, difference.high];
    let signed = |score| format!("{:+.*}", decimals(numbers), score);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let between = format!("between {} and {}{unit}", signed(difference.low), signed(difference.high));
    let beside = |whose: &str| {
        let over = by(difference.over);
        let by = signed(difference.by);
        format!("olicies from {whose} score {by}{unit} beside those from the whole set by {over}, {between}")
    };
    let theirs = format!("p{}", beside(&format!("{} by {}", described(kept), by(difference.of))));
    match conclusion {
        Conclusion::Helps => format!(
            "Selecting helps: {train}. P{}, and surely more than those from random subsets of {size}.",
            beside("them")
        ),
        Conclusion::FewerHelps => format!(
            "Fewer help, no matter which: {train}. P{}, but not surely more than those from random subsets of {size}.",
            beside("them")
        ),
        Conclusion::DoesNotHelp => format!("Selecting does not help, take the whole set: {train}; {theirs}."),
        Conclusion::CannotTell | Conclusion::NothingToCompare => {
            format!("It cannot be told whether selecting helps: {theirs}. As a guess, {train}.")
        }
    }
}

/// A candidate as one speaks of it.
fn described(Candidate { names, side, size, demos, .. }: &Candidate) -> String {
    let ids: Vec<String> = demos.iter().flatten().map(ToString::to_string).collect();
    let listed = if ids.len() <= LISTED { format!(" ({})", ids.join(", ")) } else { String::new() };
    match side {
        Side::Whole => format!("all {size} demonstrations"),
        Side::Kept => {
            let noun = if *size == 1 { "demonstration" } else { "demonstrations" };
            format!("the {size} {noun} {}{listed}", names.join(" and "))
        }
        Side::Random => format!("random subsets of {size}"),
    }
}
