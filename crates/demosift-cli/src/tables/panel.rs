//! The judges beside each other: what each says, how well they agree, and whose order is taken.

use demosift::data::demonstration::DemoId;
use demosift::results::panel::{Disagreement, Judge, Judges, Opinion, Panel, Vote};

use super::{Scale, list, percent, table, wrapped};

/// What all judges say of each demonstration, in the order that was taken, with their agreement; of a single judge only
/// whether it has a vote.
pub(crate) fn judges(panel: &Panel, unit: &str) -> String {
    let table = if panel.opinions.len() > 1 { beside_each_other(panel, unit) } else { String::new() };
    let remarks: String = remarks(panel).iter().map(|remark| format!("\n{}\n", wrapped(remark))).collect();
    format!("{table}{remarks}")
}

fn beside_each_other(panel: &Panel, unit: &str) -> String {
    let doubts = || panel.opinions.iter().flat_map(|opinion| &opinion.uncertainty.demonstrations);
    let scale = Scale::of(doubts().flat_map(|doubt| [doubt.low, doubt.high]), unit);
    let mut header = vec!["demonstration".to_owned()];
    for opinion in &panel.opinions {
        header.push(opinion.judge.to_string());
        header.push(scale.title("gain"));
        header.push(format!("{} interval", percent(opinion.uncertainty.level)));
    }
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let row = |demo: DemoId| {
        let mut row = vec![demo.to_string()];
        for opinion in &panel.opinions {
            let doubts = &opinion.uncertainty.demonstrations;
            let Some(place) = doubts.iter().position(|doubt| doubt.demo == demo) else {
                row.extend(["-", "-", "-"].map(str::to_owned));
                continue;
            };
            let doubt = &doubts[place];
            row.push((place + 1).to_string());
            row.push(scale.signed(doubt.gain));
            row.push(format!("[{}, {}]", scale.signed(doubt.low), scale.signed(doubt.high)));
        }
        row
    };
    let entries = &panel.deciding().ranking.entries;
    let rows: Vec<Vec<String>> = entries.iter().map(|entry| row(entry.demo)).collect();
    format!("\nThe place that each judge gives, and its gain:\n\n{}", table(&header, &rows))
}

fn remarks(panel: &Panel) -> Vec<String> {
    let mut remarks = Vec::new();
    if let [_, _] = panel.opinions.as_slice() {
        remarks.push(taken(panel));
    }
    remarks.extend(
        panel.others().filter(|opinion| !panel.judged_all(opinion)).map(|opinion| near(panel, opinion)),
    );
    remarks.extend(panel.opinions.iter().filter_map(without_vote));
    if let [one, other] = panel.opinions.as_slice() {
        let (one, other) = (one.judge, other.judge);
        remarks.extend(disagreement(&panel.disagreements, one, other));
        remarks.extend(disagreement(&panel.disagreements, other, one));
    }
    remarks
}

/// Whose order is taken, and how well the judges agree.
fn taken(panel: &Panel) -> String {
    let correlation =
        |agreement: Option<f64>| agreement.map_or("unknown".to_owned(), |value| format!("{value:.2}"));
    let own: Vec<String> = panel
        .opinions
        .iter()
        .map(|opinion| format!("{} {}", in_words(opinion.judge), correlation(opinion.agrees_with_itself)))
        .collect();
    let order = match panel.decides {
        Judges::Both => "The order is by the mean of both gains".to_owned(),
        one => format!("The order is that of {}", in_words(one)),
    };
    format!(
        "{order}. Rank correlation between the two judges: {}; of each with itself, from one repeat to \
         the others: {}.",
        correlation(panel.agreement),
        own.join(", ")
    )
}

/// Whom a judge judged that did not judge all.
fn near(panel: &Panel, opinion: &Opinion) -> String {
    format!(
        "Of the {} demonstrations {} judged the {} nearest to the cut, and its places are among these.",
        panel.judged(),
        in_words(opinion.judge),
        opinion.judged()
    )
}

/// Whom the judge of the paper will judge, where that is not all.
pub(crate) fn will_judge(judged: usize, all: usize) -> String {
    format!(
        "Of the {all} demonstrations the judge of the paper judges the {judged} nearest to the cut of the judge by cloning; \
         --set near_cut={all} asks it about all."
    )
}

/// Why a judge has no vote.
fn without_vote(opinion: &Opinion) -> Option<String> {
    let judge = in_words(opinion.judge);
    match opinion.vote {
        Vote::Counts | Vote::Unrepeated | Vote::TooFewToTell => None,
        Vote::DisagreesWithItself => Some(format!(
            "No vote for {judge}: its repeats agree with each other no better than chance, so imitating by it taught the \
             agent nothing that can be told apart here."
        )),
        Vote::TaughtNothing => Some(format!(
            "No vote for {judge}: imitating by it surely made the agent better for no demonstration."
        )),
    }
}

/// What one judge would keep, and the other not.
fn disagreement(all: &[Disagreement], one: Judge, other: Judge) -> Option<String> {
    let demos: Vec<DemoId> =
        all.iter().filter(|found| found.kept_by == one).map(|found| found.demo).collect();
    (!demos.is_empty()).then(|| {
        format!(
            "They clearly disagree about {}: {} is sure that it belongs to the best, and {} that it does not. The replay of \
             the report shows what each imitation did.",
            list(&demos),
            in_words(one),
            in_words(other)
        )
    })
}

/// Judges in words.
pub(crate) fn in_words(judges: impl Into<Judges>) -> &'static str {
    match judges.into() {
        Judges::Cloning => "the judge by cloning",
        Judges::Paper => "the judge of the paper",
        Judges::Both => "both judges together",
        Judges::Trainer => "your own trainer",
    }
}
