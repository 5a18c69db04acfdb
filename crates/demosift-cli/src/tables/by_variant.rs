//! Scores under each goal of a multi-goal task.

use demosift::stages::judge::ScoreTable;
use demosift::stages::select;
use demosift::world::environment::EnvVariant;

use super::{Scale, table, wrapped};

/// What imitating each demonstration gained under each variant by those who decide, the best of a variant marked (Eq. 9);
/// nothing where there is a single goal, since the ranking says it all.
///
/// The rows are in the order of the ranking over all variants.
pub(crate) fn gains(deciding: &[&ScoreTable], variants: &[String], unit: &str) -> String {
    if variants.len() < 2 {
        return String::new();
    }
    let under = |variant| select::rank_together_under(deciding, EnvVariant(variant));
    let rankings: Vec<_> = (0..variants.len()).map(under).collect();
    let overall: Vec<_> = deciding.iter().map(|table| select::rank(table)).collect();
    let all = rankings.iter().flat_map(|ranking| &ranking.entries);
    let scale = Scale::of(all.flat_map(|entry| [entry.before, entry.after]), unit);
    let mut header = vec!["demonstration"];
    header.extend(variants.iter().map(String::as_str));
    let rows: Vec<Vec<String>> = select::together(&overall)
        .entries
        .iter()
        .map(|overall| {
            let gain = |ranking: &select::Ranking| {
                let place = ranking.entries.iter().position(|entry| entry.demo == overall.demo);
                place.map_or("-".to_owned(), |place| {
                    let mark = if place == 0 { "*" } else { " " };
                    format!("{}{mark}", scale.signed(ranking.entries[place].gain))
                })
            };
            std::iter::once(overall.demo.to_string()).chain(rankings.iter().map(gain)).collect()
        })
        .collect();
    let what = scale.title("gain");
    let rows = table(&header, &rows);
    let advice = "The order here is by the mean, which chooses nothing: `demosift sift` and `demosift select` rank and keep for each \
                  of them by itself.";
    format!("\nThe {what} under each variant, the best marked with *:\n\n{rows}\n{}\n", wrapped(advice))
}

#[cfg(test)]
mod tests {
    use demosift::data::demonstration::DemoId;
    use demosift::stages::judge::Suitability;

    use super::*;

    /// Gains of two demonstrations under two variants.
    fn scores(gains: [[f64; 2]; 2]) -> ScoreTable {
        let mut suitabilities = Vec::new();
        for (variant, gains) in gains.iter().enumerate() {
            for (demo, gain) in gains.iter().enumerate() {
                suitabilities.push(Suitability {
                    demo: DemoId(demo),
                    variant: EnvVariant(variant),
                    before: vec![vec![-1.0]],
                    after: vec![vec![gain - 1.0]],
                    distances: Vec::new(),
                    curves: Vec::new(),
                    evaluated: None,
                });
            }
        }
        ScoreTable::new(suitabilities)
    }

    #[test]
    fn the_best_demonstration_of_each_variant_is_marked() {
        let scores = scores([[0.5, 0.25], [-0.25, 0.75]]);
        let said = gains(&[&scores], &["left".to_owned(), "right".to_owned()], "m");
        let lines: Vec<Vec<&str>> = said.lines().map(|line| line.split_whitespace().collect()).collect();
        assert!(said.contains("The gain [m] under each variant"), "{said}");
        assert_eq!(lines[3], ["demonstration", "left", "right"]);
        assert_eq!(lines[4], ["1", "+0.250", "+0.750*"]);
        assert_eq!(lines[5], ["0", "+0.500*", "-0.250"]);
    }

    #[test]
    fn a_single_goal_needs_no_table_of_its_own() {
        assert_eq!(gains(&[&scores([[0.5, 0.25], [-0.25, 0.75]])], &["default".to_owned()], "m"), "");
    }
}
