//! Where new demonstrations stand in the ranking of an earlier run.

use demosift::data::demonstration::DemoId;
use demosift::data::likeness::Likeness;
use demosift::results::panel::{Judge, Judges};
use demosift::results::standing::Standing;
use demosift::stages::judge::ScoreTable;
use demosift::stages::method::Account;
use demosift::stages::select::Keep;

use super::{Scale, list, percent, table, wrapped};

/// What one judge, or both together, say of the new demonstrations under one goal.
pub(crate) struct Found {
    pub(crate) judges: Judges,
    /// The goal, where the task has several.
    pub(crate) goal: Option<String>,
    pub(crate) standings: Vec<Standing>,
    /// By which rule the earlier run keeps.
    pub(crate) keep: Keep,
    /// How many the earlier run keeps.
    pub(crate) kept: usize,
}

/// Which of the new demonstrations are unlike those that the prior was trained on.
pub(crate) fn likeness(ids: &[DemoId], likeness: Option<&[Likeness]>) -> String {
    let Some(likeness) = likeness else {
        return format!(
            "{}\n\n",
            wrapped(
                "The run does not say what its prior was trained on, so nobody can tell whether these demonstrations are \
                 like it."
            )
        );
    };
    let unlike: Vec<_> =
        ids.iter().zip(likeness).filter(|(_, likeness)| likeness.is_unlike()).map(|(id, _)| *id).collect();
    if unlike.is_empty() {
        return String::new();
    }
    let one = if unlike.len() == 1 { "Demonstration" } else { "Demonstrations" };
    let what = format!(
        "{one} {}: unlike all that the prior was trained on, farther from each of them than any of them is from its nearest. \
         An agent that has learned to imitate those may fail at this; judging the whole set again tells.",
        list(&unlike)
    );
    format!("{}\n\n", wrapped(&what))
}

/// The places by one judge, a table for each goal.
pub(crate) fn of_judge(judge: Judge, scores: &ScoreTable, found: &[Found], unit: &str) -> String {
    let judge = super::panel::in_words(judge);
    if found.is_empty() {
        let gains = scores.suitabilities.iter().map(|of| (of.demo, of.gain()));
        let scale = Scale::of(gains.clone().map(|(_, gain)| gain), unit);
        let rows: Vec<Vec<String>> =
            gains.map(|(demo, gain)| vec![demo.to_string(), scale.signed(gain)]).collect();
        let what = format!(
            "By {judge}; the run of the prior has no scores by it, so there is no ranking to stand in."
        );
        return format!("{}\n\n{}\n", wrapped(&what), table(&["demonstration", &scale.title("gain")], &rows));
    }
    found.iter().map(|found| places(judge, found, unit)).collect()
}

/// The places by the mean of both gains, a table for each goal.
pub(crate) fn together(found: &[Found], unit: &str) -> String {
    found.iter().map(|found| places(super::panel::in_words(found.judges), found, unit)).collect()
}

fn places(judge: &str, found: &Found, unit: &str) -> String {
    let Found { goal, standings, keep, kept, .. } = found;
    let untold = if *keep == Keep::Weights { "by weights" } else { "-" };
    let scale = Scale::of(standings.iter().flat_map(|of| [of.low, of.high]), unit);
    let header =
        ["demonstration", &scale.title("gain"), "90 % interval", "place", &format!("P(top {kept})"), "kept"];
    let rows: Vec<Vec<String>> = standings
        .iter()
        .map(|of| {
            vec![
                of.demo.to_string(),
                scale.signed(of.gain),
                format!("[{}, {}]", scale.signed(of.low), scale.signed(of.high)),
                format!("{} of {}", of.place, of.of),
                percent(of.top),
                of.kept.map_or(untold, |kept| if kept { "yes" } else { "no" }).to_owned(),
            ]
        })
        .collect();
    let under = goal.as_ref().map_or(String::new(), |goal| format!(", goal {goal}"));
    let what = format!(
        "By {judge}{under}: where each would stand beside the demonstrations of the run, each by itself, and whether it would \
         be kept."
    );
    format!("{}\n\n{}\n", wrapped(&what), table(&header, &rows))
}

/// Whose word counts.
pub(crate) fn decides(decides: Option<Judges>, found: &[Found]) -> String {
    match decides {
        Some(Judges::Both) => {
            format!("{}\n", wrapped("In that run both judges decide, by the mean of their gains."))
        }
        Some(one) if found.iter().any(|found| found.judges != one) => {
            format!("{}\n", wrapped(&format!("In that run {} decides.", super::panel::in_words(one))))
        }
        _ => String::new(),
    }
}

/// What the judge of the paper cost.
pub(crate) fn account(Account { once, each }: Account) -> String {
    let what = format!(
        "The prior was paid once, with {once} environment steps; each of these demonstrations took {each} on top by the judge \
         of the paper."
    );
    format!("\n{}\n", wrapped(&what))
}
