//! Results as plain tables and sentences.

pub(crate) mod by_variant;
pub(crate) mod costs;
pub(crate) mod differences;
pub(crate) mod forecast;
pub(crate) mod judgment;
pub(crate) mod panel;
pub(crate) mod standing;
pub(crate) mod study;
pub(crate) mod verdict;
pub(crate) mod weights;

use demosift::basics::rounding;
use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::results::decline;
use demosift::results::decline::Decline;
use demosift::results::gain;
use demosift::results::gain::Gain;
use demosift::stages::imitate::LearningCurve;
use demosift::world::heuristic::Score;

/// Columns that fit their widest cell; words to the left, numbers to the right.
pub(crate) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let is_number = |column: usize| rows.iter().all(|row| !row[column].contains(char::is_alphabetic));
    let line = |cells: &[String]| {
        let padded: Vec<String> = (0..widths.len())
            .map(|column| {
                let (cell, width) = (&cells[column], widths[column]);
                // By hand, since a width of `format!` has 16 bits.
                let room = " ".repeat(width.saturating_sub(cell.chars().count()));
                if is_number(column) { room + cell } else { cell.clone() + &room }
            })
            .collect();
        format!("  {}", padded.join("   ")).trim_end().to_owned() + "\n"
    };
    let header: Vec<String> = header.iter().map(|&cell| cell.to_owned()).collect();
    std::iter::once(line(&header)).chain(rows.iter().map(|row| line(row))).collect()
}

/// How scores of a run are written: with its unit, and as many decimals as their size asks for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale<'a> {
    pub(crate) unit: &'a str,
    decimals: usize,
}

impl<'a> Scale<'a> {
    pub(crate) fn of(scores: impl IntoIterator<Item = Score>, unit: &'a str) -> Self {
        Self { unit, decimals: rounding::decimals(scores) }
    }

    pub(crate) fn plain(self, score: Score) -> String {
        let written = format!("{score:.*}", self.decimals);
        // A zero with a sign means nothing.
        if written.trim_start_matches('-').chars().all(|digit| matches!(digit, '0' | '.')) {
            return written.trim_start_matches('-').to_owned();
        }
        written
    }

    pub(crate) fn signed(self, score: Score) -> String {
        format!("{score:+.*}", self.decimals)
    }

    pub(crate) fn with_unit(self, score: Score) -> String {
        format!("{} {}", self.plain(score), self.unit).trim_end().to_owned()
    }

    /// A column's title with the unit of its numbers.
    pub(crate) fn title(self, name: &str) -> String {
        if self.unit.is_empty() { name.to_owned() } else { format!("{name} [{}]", self.unit) }
    }
}

/// The policies from imitating from scratch, one per row; below, which imitations lost what they had learned.
pub(crate) fn policies(curves: &[(String, &LearningCurve)], unit: &str) -> String {
    let scale = Scale::of(curves.iter().map(|(_, curve)| curve.outcome.score), unit);
    let title = scale.title("heuristic");
    let knows_success = curves.iter().any(|(_, curve)| curve.outcome.success.is_some());
    let mut header = vec!["policy from", title.as_str()];
    if knows_success {
        header.push("success");
    }
    header.push("environment steps");
    let rows: Vec<Vec<String>> = curves
        .iter()
        .map(|(name, curve)| {
            let outcome = curve.outcome;
            let mut row = vec![name.clone(), scale.plain(outcome.score)];
            if knows_success {
                row.push(outcome.success.map_or("-".to_owned(), percent));
            }
            row.push(outcome.environment_steps.to_string());
            row
        })
        .collect();
    let declines = curves
        .iter()
        .filter_map(|(name, curve)| decline::decline(curve).map(|decline| declined(name, decline, scale)));
    std::iter::once(table(&header, &rows)).chain(declines).collect()
}

fn declined(name: &str, Decline { best, last }: Decline, scale: Scale<'_>) -> String {
    let mut said = format!(
        "The policy from {name} was best after {} updates ({}); by update {} it had lost at least half of what it had \
         gained ({}). The best one is kept.",
        best.updates,
        scale.with_unit(best.score),
        last.updates,
        scale.with_unit(last.score)
    );
    // Behavioral cloning learns from no environment step, and has no discriminator.
    if last.environment_steps > 0 {
        said += " Where the discriminator's accuracy in metrics.jsonl is 1 by then, a run of its own in which it learns \
                 more slowly may keep more: --set imitate.update.discriminator.steps=3 --out DIR.";
    }
    format!("\n{}\n", wrapped(&said))
}

/// What the column of the kept says of a demonstration.
pub(crate) fn is_kept(kept: &[DemoId], demo: DemoId) -> &'static str {
    if kept.contains(&demo) { "kept" } else { "-" }
}

pub(crate) fn yes_or_no(is_so: bool) -> String {
    if is_so { "yes" } else { "no" }.to_owned()
}

pub(crate) fn percent(share: f64) -> String {
    format!("{:.0} %", share * 100.0)
}

/// Two digits that count.
pub(crate) fn rounded(number: f64) -> String {
    let unit = 10_f64.powf(number.max(1.0).log10().floor() - 1.0).max(1.0);
    format!("{:.0}", (number / unit).round() * unit)
}

/// At most four decimals, and none that are 0.
pub(crate) fn short(number: f64) -> String {
    let written = format!("{number:.4}");
    written.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A difference of positions, of which the size matters.
pub(crate) fn drifted(off: f64) -> String {
    match off {
        0.0 => "0".to_owned(),
        0.0005.. => format!("{off:.3}"),
        _ => format!("{off:.0e}"),
    }
}

/// The policy from the subset beside that from the whole set, and an honest word on how little that says.
pub(crate) fn comparison(
    set: &DemonstrationSet,
    from_subset: &LearningCurve,
    from_all: &LearningCurve,
    unit: &str,
) -> String {
    let names = [
        format!("the {} kept ({})", from_subset.demos.len(), list(&from_subset.demos)),
        format!("all {}", set.len()),
    ];
    let [subset, all] = names;
    let rows = policies(&[(subset, from_subset), (all, from_all)], unit);
    format!(
        "What a policy learns from scratch, with as many environment steps each:\n\n{rows}\n{}\n",
        difference(set, from_subset, from_all, unit)
    )
}

/// One training each says little, and that is said.
fn difference(
    set: &DemonstrationSet,
    from_subset: &LearningCurve,
    from_all: &LearningCurve,
    unit: &str,
) -> String {
    let Gain { gain, low, high } = gain::gain(&from_subset.outcome, &from_all.outcome);
    let scale = Scale::of([from_subset.outcome.score, from_all.outcome.score], unit);
    if from_subset.demos.len() == set.len() {
        return "All demonstrations were kept, so there is nothing to compare.".to_owned();
    }
    let with_unit = |score| format!("{} {unit}", scale.signed(score)).trim_end().to_owned();
    wrapped(&format!(
        "The policy from the kept demonstrations scores {} beside the one from all, between {} and {} by these episodes. \
         That is one training each, and another seed would change both: whether selecting helps is what `demosift \
         referee` finds out by several.",
        with_unit(gain),
        scale.signed(low),
        with_unit(high)
    ))
}

/// Characters of the widest line.
const WIDTH: usize = 100;

/// Lines of at most the width that tables keep to.
pub(crate) fn wrapped(text: &str) -> String {
    wrapped_to(text, WIDTH)
}

/// A first column, and words that keep to the right of it, in lines that end with a line break.
pub(crate) fn hanging(first: &str, words: &str) -> String {
    let indent = first.chars().count();
    let lines =
        wrapped_to(words, WIDTH.saturating_sub(indent)).replace('\n', &format!("\n{}", " ".repeat(indent)));
    format!("{first}{lines}\n")
}

fn wrapped_to(text: &str, width: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().expect("there is always one");
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines.join("\n")
}

/// Which ids a set has: from the first to the last, or all one by one where some episodes of the file were left out.
pub(crate) fn range_of(set: &DemonstrationSet) -> String {
    match set.positions() {
        positions if positions == set.len() => format!("0 to {}", set.len() - 1),
        _ => list(&set.ids()),
    }
}

/// Ids in ascending order.
pub(crate) fn list(demos: &[DemoId]) -> String {
    let mut demos = demos.to_vec();
    demos.sort_unstable();
    demos.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use demosift::stages::imitate::CurvePoint;

    use super::*;

    #[test]
    fn a_cell_may_be_longer_than_a_width_of_the_formatter() {
        let long = "m".repeat(70_000);
        let rows = vec![vec![long.clone(), "1".to_owned()], vec!["x".to_owned(), "20".to_owned()]];
        let shown = table(&["name", "steps"], &rows);
        assert!(shown.contains(&format!("  {long}       1\n")), "{}", &shown[..100]);
    }

    #[test]
    fn words_stand_left_and_numbers_right() {
        let rows = [["1", "kept", "-0.5"], ["10", "-", "+12.25"]].map(|row| row.map(str::to_owned).to_vec());
        let wanted = "  rank   kept     gain\n     1   kept     -0.5\n    10   -      +12.25\n";
        assert_eq!(table(&["rank", "kept", "gain"], &rows), wanted);
    }

    #[test]
    fn an_imitation_that_lost_what_it_had_learned_is_told() {
        let point = |updates: usize, score: f64| CurvePoint {
            updates,
            environment_steps: 2000 * updates,
            score,
            standard_error: 0.01,
            success: None,
            true_return: None,
        };
        let curve = |last: f64| LearningCurve {
            demos: vec![DemoId(7)],
            points: vec![point(0, -1.77), point(60, -0.7), point(120, last)],
            outcome: point(60, -0.72),
            end: point(120, last),
            played: 0,
            best: demosift::world::policy::Policy::untrained(
                &demosift::world::policy::PolicyShape { hidden: vec![1], initial_std: 1.0 },
                demosift::data::observation_filter::ObservationFilter::identity(1),
                1,
                demosift::basics::seed::Seed::new(1),
            ),
        };
        let said = policies(&[("all 8".to_owned(), &curve(-1.25)), ("4".to_owned(), &curve(-0.8))], "m");
        assert!(said.contains("\nThe policy from all 8 was best after 60 updates (-0.700 m)"), "{said}");
        assert!(
            said.contains("gained (-1.250 m). The best one is kept.") && !said.contains("from 4 was"),
            "{said}"
        );
        assert!(said.contains("imitate.update.discriminator.steps=3"), "{said}");
    }

    #[test]
    fn scores_have_decimals_for_their_size_and_no_negative_zero() {
        let near = Scale::of([-0.25, f64::NAN], "m");
        assert_eq!(near.plain(-0.25), "-0.250");
        assert_eq!(near.plain(-0.0004), "0.000");
        assert_eq!(near.signed(0.5), "+0.500");
        assert_eq!((near.with_unit(0.5), near.title("gain")), ("0.500 m".to_owned(), "gain [m]".to_owned()));
        let far = Scale::of([4312.0, -178.0], "");
        assert_eq!((far.plain(4312.4), far.with_unit(-178.0)), ("4312".to_owned(), "-178".to_owned()));
        assert_eq!(far.title("gain"), "gain");
    }

    #[test]
    fn numbers_have_the_digits_that_matter() {
        assert_eq!([26_340.0, 999.0, 7.4, 0.2].map(rounded), ["26000", "1000", "7", "0"]);
        assert_eq!([-1.0, 0.25, 1.234_56].map(short), ["-1", "0.25", "1.2346"]);
        assert_eq!([0.0, 0.00001, 0.0123].map(drifted), ["0", "1e-5", "0.012"]);
    }
}
