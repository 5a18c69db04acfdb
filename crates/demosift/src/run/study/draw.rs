//! What is finished of a study as figures in the layout of the paper's: a row for each set, a column for each method.

use std::collections::BTreeMap;

use super::Finished;
use super::choice::{Kept, TopK};
use super::curves::{self, Course, Followed};
use super::drawn::{Draws, Figure};
use super::parts::Set;
use super::plan::Study;
use crate::learning::adapt::Rule;
use crate::math::statistics;
use crate::results::figure::{COLORS, Grid, Line, Panel, Row, Stroke};

/// What a policy scores before it learns is far below what is compared, so that learning curves are fitted from here on.
const SETTLED_FROM: f64 = 0.25;

/// A figure, with as many seeds as are finished.
pub fn draw(study: &Study, figure: &Figure, finished: &Finished) -> Grid {
    let shown = |named: &[String], name: &String| named.is_empty() || named.contains(name);
    // A set that nobody judges only lends its prior.
    let sets = study.sets.iter().filter(|set| shown(&figure.sets, &set.name) && set.seeds.count > 0);
    let methods: Vec<&str> = match figure.methods.as_slice() {
        [] => study.methods.iter().map(|method| method.name.as_str()).collect(),
        named => named.iter().map(String::as_str).collect(),
    };
    let rows: Vec<Row> = sets.flat_map(|set| rows(study, figure, set, &methods, finished)).collect();
    let (x_label, x_name) = x_axis(study, figure.draws);
    let mut grid = Grid {
        title: figure.title.clone(),
        note: String::new(),
        x_label: x_label.to_owned(),
        x_name: x_name.to_owned(),
        fitted_from: if figure.draws == Draws::TopK { SETTLED_FROM } else { 0.0 },
        columns: methods.iter().map(|&method| method.to_owned()).collect(),
        rows,
    };
    grid.note = note(&grid, study);
    grid
}

fn x_axis(study: &Study, draws: Draws) -> (&'static str, &'static str) {
    let learns =
        |rule: Rule| study.drawn.curves.as_ref().is_some_and(|curves| curves.imitators.contains(&rule));
    match draws {
        Draws::TopK if !learns(Rule::Gail) => ("updates", "updates"),
        Draws::TopK if learns(Rule::BehavioralCloning) => {
            ("environment steps; updates of cloning", "environment_steps_or_updates")
        }
        Draws::TopK => ("environment steps", "environment_steps"),
        Draws::Adaptation => ("inner updates", "inner_updates"),
        Draws::Weights => ("rounds", "rounds"),
        Draws::Bodies => ("rank", "rank"),
    }
}

/// Over how many seeds, and out of how many.
fn note(grid: &Grid, study: &Study) -> String {
    let lines = || grid.rows.iter().flat_map(|row| &row.panels).flat_map(|panel| &panel.lines);
    let planned = study.sets.iter().map(|set| set.seeds.count).max().unwrap_or(0);
    let seeds = |pick: fn(usize, usize) -> usize| lines().map(|line| line.seeds).reduce(pick).unwrap_or(0);
    let (fewest, most) = (seeds(usize::min), seeds(usize::max));
    let empty = grid.rows.iter().flat_map(|row| &row.panels).filter(|panel| panel.lines.is_empty()).count();
    let count = if fewest == most { most.to_string() } else { format!("{fewest} to {most}") };
    let mut words = format!("Mean and one standard deviation over {count} of {planned} seeds");
    match empty {
        0 => {}
        1 => words += "; one panel is not begun",
        _ => words += &format!("; {empty} panels are not begun"),
    }
    if grid.fitted_from > 0.0 {
        words += &format!("; the first {:.0} % of the way may be cut off", 100.0 * grid.fitted_from);
    }
    words
}

/// One row, or of several imitators one each.
fn rows(study: &Study, figure: &Figure, set: &Set, methods: &[&str], finished: &Finished) -> Vec<Row> {
    let row = |title: String, y_label: String, panel: &dyn Fn(&str) -> Panel| Row {
        title,
        y_label,
        panels: methods.iter().map(|method| panel(method)).collect(),
    };
    let score = if set.unit.is_empty() { "score".to_owned() } else { format!("score [{}]", set.unit) };
    let name = set.name.clone();
    match figure.draws {
        Draws::TopK => {
            let imitators = study.drawn.curves.as_ref().map_or(&[][..], |curves| &curves.imitators);
            let title = |imitator: Rule| match imitators.len() {
                1 => name.clone(),
                _ => format!("{name}, {}", super::imitator_name(imitator)),
            };
            let of = |imitator: &Rule| {
                let panel = |method: &str| top_k(study, set, method, *imitator, finished);
                row(title(*imitator), score.clone(), &panel)
            };
            imitators.iter().map(of).collect()
        }
        Draws::Adaptation => {
            let of = |method: &&str| curves::of_adaptations(set, method, finished);
            vec![Row { title: name, y_label: score, panels: followed(methods.iter().map(of)) }]
        }
        Draws::Weights => {
            let of = |method: &&str| curves::of_weights(set, method, finished);
            let panels = followed(methods.iter().map(of));
            vec![Row { title: name, y_label: "weight".to_owned(), panels }]
        }
        Draws::Bodies => vec![row(name, score, &|method| bodies(study, set, method, finished))],
    }
}

/// A line for each K of the study, for the whole set, and for what weights select.
fn top_k(study: &Study, set: &Set, method: &str, imitator: Rule, finished: &Finished) -> Panel {
    let at = study.drawn.curves.as_ref().map_or(&[][..], |curves| &curves.at);
    let mut shown: Vec<(Kept, String)> = Vec::new();
    for k in at {
        // Of a small set two of them may be the same number.
        let count = k.of(set.demonstrations);
        if count.is_some() && shown.iter().all(|(known, _)| size(*known, set) != count) {
            shown.push((Kept::Top(*k), format!("top {}", in_words(*k))));
        }
    }
    shown.push((Kept::All, "all".to_owned()));
    shown.push((Kept::Weights, "by weights".to_owned()));
    let line = |(place, (kept, name)): (usize, &(Kept, String))| {
        let trained = curves::trained(study, set, method, *kept, imitator, finished);
        let course = curves::of_trainings(&trained, imitator)?;
        let (color, stroke) = match kept {
            Kept::All => (3, Stroke::Dashed),
            Kept::Weights => (4, Stroke::Thick),
            Kept::Top(_) => (if place < 3 { place } else { place + 2 }, Stroke::Solid),
        };
        Some(line(name.clone(), color, stroke, course))
    };
    Panel { lines: shown.iter().enumerate().filter_map(line).collect() }
}

fn size(kept: Kept, set: &Set) -> Option<usize> {
    match kept {
        Kept::Top(k) => k.of(set.demonstrations),
        _ => None,
    }
}

fn in_words(k: TopK) -> String {
    match k {
        TopK::Count(count) => count.to_string(),
        TopK::Half => "half".to_owned(),
        TopK::Quarter => "quarter".to_owned(),
    }
}

fn line(name: String, color: usize, stroke: Stroke, course: Course) -> Line {
    let Course { at, mean, deviation, seeds } = course;
    Line { name, color, stroke, x: at, mean, deviation, seeds }
}

/// A panel for each method: the best and the worst demonstrations, the worst broken, a demonstration in one color throughout.
fn followed(methods: impl Iterator<Item = Vec<Followed>>) -> Vec<Panel> {
    let shown: Vec<Vec<Followed>> = methods.map(curves::both_ends).collect();
    let demos: Vec<Vec<usize>> =
        shown.iter().map(|panel| panel.iter().map(|followed| followed.demo).collect()).collect();
    let colors = colors(&demos);
    let panel = |shown: Vec<Followed>| {
        let half = shown.len().div_ceil(2);
        let of = |(place, followed): (usize, Followed)| {
            let stroke = if place < half { Stroke::Solid } else { Stroke::Dashed };
            line(format!("demo {}", followed.demo), colors[&followed.demo], stroke, followed.course)
        };
        Panel { lines: shown.into_iter().enumerate().map(of).collect() }
    };
    shown.into_iter().map(panel).collect()
}

/// A color for each demonstration of a row of panels: one of its own while there are any, then one that none has beside it.
fn colors(panels: &[Vec<usize>]) -> BTreeMap<usize, usize> {
    let mut colors: BTreeMap<usize, usize> = BTreeMap::new();
    for demo in panels.iter().flatten() {
        let beside = panels.iter().filter(|panel| panel.contains(demo)).flatten();
        let taken: Vec<usize> = beside.filter_map(|other| colors.get(other).copied()).collect();
        let own = (0..COLORS).find(|color| !colors.values().any(|used| used == color));
        let shared = (0..).find(|color| !taken.contains(color)).expect("colors do not end");
        colors.entry(*demo).or_insert(own.unwrap_or(shared));
    }
    colors
}

/// The score of each demonstration by its rank, those of another body marked.
fn bodies(study: &Study, set: &Set, method: &str, finished: &Finished) -> Panel {
    let Some(judge) = study.method(method) else { return Panel::default() };
    let judged: Vec<Vec<f64>> =
        set.seeds.each().filter_map(|seed| study.scores(set, judge, seed, finished)).collect();
    if judged.is_empty() {
        return Panel::default();
    }
    let of_demo = |demo: usize| judged.iter().map(|scores| scores[demo]).collect::<Vec<f64>>();
    let values: Vec<Vec<f64>> = (0..set.demonstrations).map(of_demo).collect();
    let means: Vec<f64> = values.iter().map(|values| statistics::mean(values)).collect();
    let mut order: Vec<usize> = (0..set.demonstrations).collect();
    order.sort_by(|a, b| means[*b].total_cmp(&means[*a]).then(a.cmp(b)));
    let others = set.by_others();
    let of = |is_other: bool| {
        let members = || {
            let ranked = order.iter().enumerate();
            ranked.filter(|(_, demo)| others.get(**demo).copied().unwrap_or(false) == is_other)
        };
        Line {
            name: if is_other { "another body" } else { "the task's body" }.to_owned(),
            color: usize::from(is_other),
            stroke: Stroke::Points,
            x: members().map(|(rank, _)| (rank + 1) as f64).collect(),
            mean: members().map(|(_, demo)| means[*demo]).collect(),
            deviation: members().map(|(_, demo)| curves::deviation(&values[*demo])).collect(),
            seeds: judged.len(),
        }
    };
    Panel { lines: [false, true].map(of).into_iter().filter(|line| !line.x.is_empty()).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demonstration_has_one_color_and_shares_it_with_none_beside_it() {
        let panels = [vec![6, 7, 4, 5, 0, 8], vec![6, 4, 7, 0, 5, 8], vec![9, 6, 7, 1, 2, 8]];
        let colors = colors(&panels);
        assert_eq!([6, 7, 4, 5, 0, 8, 9, 1].map(|demo| colors[&demo]), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(colors[&2], 2, "no color is left, so that of one with which it shares no panel");
        for panel in &panels {
            let distinct: std::collections::BTreeSet<usize> = panel.iter().map(|demo| colors[demo]).collect();
            assert_eq!(distinct.len(), panel.len(), "{panel:?}: {colors:?}");
        }
    }
}
