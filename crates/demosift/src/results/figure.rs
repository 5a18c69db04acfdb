//! Figures as text: rows and columns of panels with lines, drawn as SVG, and their numbers as CSV.
//!
//! A line has a band of one standard deviation around it.
//! Panels of a row share their axes, so that what stands beside each other can be compared.
//! Colors are told apart by the color-blind (Okabe and Ito 2008), and follow the reader's choice of light or dark.

mod axis;
mod svg;

pub use svg::svg;

use std::fmt::Write as _;

/// A picture of panels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// Above all.
    pub title: String,
    /// Below the title, such as how many seeds there are.
    pub note: String,
    /// Below the horizontal axes.
    pub x_label: String,
    /// What x is called in the table of numbers.
    pub x_name: String,
    /// The share of the way along x after which values must fit the vertical axes; those before it are cut off where they do not.
    pub fitted_from: f64,
    /// The titles of the columns.
    pub columns: Vec<String>,
    /// From above to below.
    pub rows: Vec<Row>,
}

/// A row of panels with the same axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Beside it.
    pub title: String,
    /// Beside the vertical axis, such as a unit.
    pub y_label: String,
    /// One a column; without a line where nothing is finished.
    pub panels: Vec<Panel>,
}

/// One pair of axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// In the order in which they are drawn.
    pub lines: Vec<Line>,
}

/// So many lines are told apart by color.
pub const COLORS: usize = 8;

/// A mean with its spread along an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// In the legend.
    pub name: String,
    /// Which of the [`COLORS`].
    pub color: usize,
    /// How it is drawn.
    pub stroke: Stroke,
    /// `[points]`.
    pub x: Vec<f64>,
    /// `[points]`.
    pub mean: Vec<f64>,
    /// One standard deviation, `[points]`.
    pub deviation: Vec<f64>,
    /// Over so many seeds.
    pub seeds: usize,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    /// Through all points.
    Solid,
    /// The same, broken.
    Dashed,
    /// The same, thick.
    Thick,
    /// Points with a bar of one standard deviation to both sides.
    Points,
}

impl Grid {
    /// Whether no panel has a line.
    pub fn is_empty(&self) -> bool {
        self.lines().next().is_none()
    }

    fn lines(&self) -> impl Iterator<Item = &Line> {
        self.rows.iter().flat_map(|row| &row.panels).flat_map(|panel| &panel.lines)
    }
}

/// The numbers of a figure, a line a point: row, column, line, x, mean, standard deviation and seeds.
pub fn csv(grid: &Grid) -> String {
    let mut text = format!("row,column,line,{},mean,deviation,seeds\n", field(&grid.x_name));
    for row in &grid.rows {
        for (column, panel) in grid.columns.iter().zip(&row.panels) {
            for line in &panel.lines {
                for ((x, mean), deviation) in line.x.iter().zip(&line.mean).zip(&line.deviation) {
                    let [row, column, name] = [&row.title, column, &line.name].map(|name| field(name));
                    let _ = writeln!(
                        text,
                        "{row},{column},{name},{},{},{},{}",
                        digits(*x),
                        digits(*mean),
                        digits(*deviation),
                        line.seeds
                    );
                }
            }
        }
    }
    text
}

/// Six digits, and no more of them than it takes.
fn digits(value: f64) -> String {
    const DIGITS: usize = 6;
    let short: f64 = format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value);
    short.to_string()
}

/// In quotes where a comma, a quote or the end of a line asks for them.
fn field(text: &str) -> String {
    match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests;
