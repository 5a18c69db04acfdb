//! What the referee says: a pair a row, and the sentence below.

use demosift::stages::referee::{Candidate, Imitator, Pair, Side, Verdict};

use super::{Scale, percent, table, wrapped};

/// All pairs, and what to train on.
pub(crate) fn verdict(verdict: &Verdict, unit: &str) -> String {
    let sentence = format!("{}\n{}", wrapped(&verdict.sentence), whereabouts(verdict));
    if verdict.pairs.is_empty() {
        return sentence;
    }
    let scale = Scale::of(verdict.pairs.iter().map(|pair| pair.mean), unit);
    let title = scale.title("heuristic");
    let knows_success = verdict.pairs.iter().any(|pair| pair.success.is_some());
    let title = format!("{title} ± 95 %");
    let mut header = vec!["policies from", "by", "times", title.as_str()];
    if knows_success {
        header.push("success");
    }
    header.push("");
    let row = |(index, pair): (usize, &Pair)| {
        let mut row = vec![
            name(&verdict.candidates[pair.trained.candidate]),
            verdict.imitator_name(pair.trained.imitator).to_owned(),
            pair.trained.trainings.len().to_string(),
            with_interval(pair, scale),
        ];
        if knows_success {
            row.push(pair.success.map_or("-".to_owned(), percent));
        }
        row.push(remark(verdict, index, pair).to_owned());
        row
    };
    let rows: Vec<Vec<String>> = verdict.pairs.iter().enumerate().map(row).collect();
    let what = "Final policies, several trainings each; the interval is over trainings (higher is better):";
    format!("{what}\n\n{}\n{sentence}", table(&header, &rows))
}

/// Where the policy is, where it is none of ours.
fn whereabouts(verdict: &Verdict) -> String {
    if verdict.winning_imitator() != Some(Imitator::Trainer) {
        return String::new();
    }
    let words = format!(
        "The policies of {} are its own, so the run keeps none as safetensors; one that it wrote as ONNX is policy_best.onnx. \
         Let it train on these demonstrations; `demosift export` hands them on.",
        verdict.imitator_name(Imitator::Trainer)
    );
    format!("{}\n", wrapped(&words))
}

/// A candidate in a table; which demonstrations it has, the sentence says.
fn name(Candidate { names, side, size, .. }: &Candidate) -> String {
    match side {
        Side::Kept => format!("{size} {}", names.join(", ")),
        Side::Whole => format!("all {size}"),
        Side::Random => format!("random {size}"),
    }
}

/// The mean, and half of its interval, which is as long on both sides.
fn with_interval(pair: &Pair, scale: Scale<'_>) -> String {
    match pair.high {
        Some(high) => format!("{} ± {}", scale.plain(pair.mean), scale.plain(high - pair.mean)),
        None => scale.plain(pair.mean),
    }
}

fn remark(verdict: &Verdict, index: usize, pair: &Pair) -> &'static str {
    if verdict.winner == Some(index) {
        "train on this"
    } else if pair.trained.dropped {
        "dropped early"
    } else if verdict.compared > 0 && !pair.is_compared {
        "shown only"
    } else {
        ""
    }
}
