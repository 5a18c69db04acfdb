//! A figure as SVG.

use std::fmt::Write as _;

use super::axis::{Axis, Span};
use super::{COLORS, Grid, Line, Panel, Row, Stroke};

/// Inside of a panel's axes.
const WIDTH: f64 = 190.0;
const HEIGHT: f64 = 130.0;
/// Left of the first panel, for the title and the numbers of a row.
const LEFT: f64 = 78.0;
/// Between two panels of a row.
const BESIDE: f64 = 28.0;
/// Below a panel's axis, for its numbers.
const BELOW: f64 = 34.0;
/// Below the last row, for what its axes show.
const X_LABEL: f64 = 14.0;
/// A line of a legend.
const LEGEND: f64 = 16.0;
/// Above the first row: title, note, legend, titles of columns.
const HEAD: f64 = 84.0;
const MARGIN: f64 = 16.0;
/// Names that fit into one legend for all panels.
const SHARED: usize = 6;
/// Estimates of how wide a letter is, and one of the title.
const LETTER: f64 = 6.2;
const TITLE_LETTER: f64 = 8.8;

/// After Okabe and Ito; the light and the dark shade of each.
const SHADES: [[&str; 2]; COLORS] = [
    ["#0072b2", "#56b4e9"],
    ["#d55e00", "#f0803c"],
    ["#009e73", "#2fc79a"],
    ["#6e7781", "#9aa4af"],
    ["#b58900", "#e6b422"],
    ["#cc79a7", "#e29cc3"],
    ["#5a4fcf", "#9a91f2"],
    ["#1f2328", "#e6edf3"],
];

/// The picture as the text of a file.
pub fn svg(grid: &Grid) -> String {
    let shared = shared_legend(grid);
    let below = if shared.is_some() { 0.0 } else { 2.0 * LEGEND };
    let pitch = HEIGHT + BELOW + below;
    let columns = grid.columns.len().max(1) as f64;
    // Titles and legends may be wider than few panels.
    let legend =
        shared.as_deref().map_or(0.0, |lines| lines.iter().map(|line| entry_width(line)).sum::<f64>());
    let wide = |text: &str, letter: f64| text.chars().count() as f64 * letter;
    let words = wide(&grid.title, TITLE_LETTER).max(wide(&grid.note, LETTER));
    let panels = columns * (WIDTH + BESIDE);
    let width = LEFT + panels.max(legend + MARGIN).max(words - LEFT + 2.0 * MARGIN);
    let height = HEAD + grid.rows.len() as f64 * pitch + X_LABEL + MARGIN;
    let mut text = head(width, height, &grid.title);
    let _ = writeln!(text, r#"<text class="ink title" x="{MARGIN}" y="24">{}</text>"#, escaped(&grid.title));
    let _ = writeln!(text, r#"<text class="soft" x="{MARGIN}" y="42">{}</text>"#, escaped(&grid.note));
    if let Some(lines) = &shared {
        legend_at(&mut text, lines, Place { x: LEFT, y: 60.0 }, f64::INFINITY);
    }
    for (column, name) in grid.columns.iter().enumerate() {
        let x = LEFT + column as f64 * (WIDTH + BESIDE) + WIDTH / 2.0;
        let y = HEAD - 6.0;
        let _ = writeln!(text, r#"<text class="ink middle" x="{x:.1}" y="{y:.1}">{}</text>"#, escaped(name));
    }
    for (number, row) in grid.rows.iter().enumerate() {
        let top = HEAD + number as f64 * pitch;
        let last = number + 1 == grid.rows.len();
        draw_row(
            &mut text,
            row,
            &Below {
                top,
                x_label: last.then_some(grid.x_label.as_str()),
                legends: shared.is_none(),
                fitted_from: grid.fitted_from,
            },
        );
    }
    text.push_str("</svg>\n");
    text
}

#[derive(Clone, Copy)]
struct Place {
    x: f64,
    y: f64,
}

/// The lines of all panels by name, where they are few enough for one legend.
fn shared_legend(grid: &Grid) -> Option<Vec<&Line>> {
    let mut lines: Vec<&Line> = Vec::new();
    for line in grid.lines() {
        if !lines.iter().any(|known| known.name == line.name) {
            lines.push(line);
        }
    }
    lines.sort_by_key(|line| line.color);
    let looks = |line: &Line| (line.color, line.stroke);
    let alike = lines
        .iter()
        .all(|named| grid.lines().all(|line| line.name != named.name || looks(line) == looks(named)));
    (lines.len() <= SHARED && alike).then_some(lines)
}

fn head(width: f64, height: f64, title: &str) -> String {
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{}\">\n<style>\n",
        escaped(title)
    );
    text.push_str(
        "text{font:11px system-ui,-apple-system,'Segoe UI',Helvetica,Arial,sans-serif}\n\
         .title{font-size:14px;font-weight:600}.middle{text-anchor:middle}.end{text-anchor:end}\n\
         .ground{fill:#ffffff}.ink{fill:#1f2328}.soft{fill:#57606a}.axis{stroke:#8c959f;fill:none}.grid{stroke:#e4e8ec;fill:none}\n\
         .line{fill:none;stroke-width:1.6;stroke-linejoin:round}.thick{stroke-width:2.8}.dashed{stroke-dasharray:5 3}.band{stroke:none;fill-opacity:.17}\n",
    );
    for (shade, [light, dark]) in
        [0, 1].into_iter().zip([["", ""], ["@media (prefers-color-scheme: dark){\n", "}\n"]])
    {
        text.push_str(light);
        if shade == 1 {
            text.push_str(
                ".ground{fill:#0d1117}.ink{fill:#e6edf3}.soft{fill:#9198a1}.axis{stroke:#6e7681}.grid{stroke:#262c36}\n",
            );
        }
        for (index, color) in SHADES.iter().enumerate() {
            let color = color[shade];
            let _ = writeln!(text, ".s{index}{{stroke:{color}}}.f{index}{{fill:{color}}}");
        }
        text.push_str(dark);
    }
    text.push_str("</style>\n<rect class=\"ground\" width=\"100%\" height=\"100%\"/>\n");
    text
}

/// Where a row stands, and what stands below its axes.
struct Below<'a> {
    top: f64,
    /// In the last row.
    x_label: Option<&'a str>,
    /// Whether each panel has a legend of its own.
    legends: bool,
    /// That of the grid.
    fitted_from: f64,
}

fn draw_row(text: &mut String, row: &Row, below: &Below<'_>) {
    let Below { top, x_label, legends, fitted_from } = *below;
    let lines = || row.panels.iter().flat_map(|panel| &panel.lines);
    let nothing = Span { low: 0.0, high: 1.0 };
    let along = Span::of(lines().flat_map(|line| line.x.iter().copied())).unwrap_or(nothing);
    let from = along.low + fitted_from * (along.high - along.low);
    let values = |line: &Line| -> Vec<f64> {
        let ends = line.x.iter().zip(&line.mean).zip(&line.deviation).filter(|((x, _), _)| **x >= from);
        ends.flat_map(|((_, mean), deviation)| [mean - deviation, mean + deviation]).collect()
    };
    let y = Axis::of(Span::of(lines().flat_map(values)).unwrap_or(nothing).with_room(0.06), 5);
    let points = lines().any(|line| line.stroke == Stroke::Points);
    let x = Axis::of(if points { along.with_room(0.04) } else { along }, 5);
    let middle = top + HEIGHT / 2.0;
    for (x, class, words) in [(14.0, "ink middle", &row.title), (30.0, "soft middle", &row.y_label)] {
        let words = escaped(words);
        let _ = writeln!(
            text,
            r#"<text class="{class}" transform="translate({x:.1} {middle:.1}) rotate(-90)">{words}</text>"#
        );
    }
    for (column, panel) in row.panels.iter().enumerate() {
        let left = LEFT + column as f64 * (WIDTH + BESIDE);
        draw_panel(text, panel, &Frame { left, top, x: &x, y: &y, numbers: column == 0 });
        let (middle, under) =
            (left + WIDTH / 2.0, top + HEIGHT + BELOW + if legends { 2.0 * LEGEND } else { 0.0 });
        if let Some(label) = x_label.map(escaped) {
            let _ =
                writeln!(text, r#"<text class="soft middle" x="{middle:.1}" y="{under:.1}">{label}</text>"#);
        }
        if legends {
            let lines: Vec<&Line> = panel.lines.iter().collect();
            legend_at(text, &lines, Place { x: left, y: top + HEIGHT + BELOW }, left + WIDTH + BESIDE);
        }
    }
}

/// Where a panel stands.
struct Frame<'a> {
    left: f64,
    top: f64,
    x: &'a Axis,
    y: &'a Axis,
    /// Whether the vertical axis has numbers.
    numbers: bool,
}

impl Frame<'_> {
    fn place(&self, x: f64, y: f64) -> Place {
        Place { x: self.left + self.x.share(x) * WIDTH, y: self.top + (1.0 - self.y.share(y)) * HEIGHT }
    }
}

fn draw_panel(text: &mut String, panel: &Panel, frame: &Frame<'_>) {
    let Frame { left, top, x, y, numbers } = *frame;
    let (right, bottom) = (left + WIDTH, top + HEIGHT);
    for tick in &y.ticks {
        let at = frame.place(x.low, *tick).y;
        let _ = writeln!(text, r#"<path class="grid" d="M{left:.1} {at:.1}H{right:.1}"/>"#);
        if numbers {
            let (x, at, label) = (left - 6.0, at + 3.5, y.label(*tick));
            let _ = writeln!(text, r#"<text class="soft end" x="{x:.1}" y="{at:.1}">{label}</text>"#);
        }
    }
    let _ = writeln!(text, r#"<path class="axis" d="M{left:.1} {top:.1}V{bottom:.1}H{right:.1}"/>"#);
    if panel.lines.is_empty() {
        let (x, y) = (left + WIDTH / 2.0, top + HEIGHT / 2.0);
        let _ =
            writeln!(text, r#"<text class="soft middle" x="{x:.1}" y="{y:.1}">nothing finished yet</text>"#);
        return;
    }
    for tick in &x.ticks {
        let at = frame.place(*tick, y.low).x;
        let (to, under, label) = (bottom + 4.0, bottom + 15.0, x.label(*tick));
        let _ = writeln!(text, r#"<path class="axis" d="M{at:.1} {bottom:.1}V{to:.1}"/>"#);
        let _ = writeln!(text, r#"<text class="soft middle" x="{at:.1}" y="{under:.1}">{label}</text>"#);
    }
    let name = format!("inside-{left:.0}-{top:.0}");
    let _ = writeln!(
        text,
        r#"<clipPath id="{name}"><rect x="{left:.1}" y="{top:.1}" width="{WIDTH}" height="{HEIGHT}"/></clipPath>
<g clip-path="url(#{name})">"#
    );
    panel.lines.iter().for_each(|line| draw_band(text, line, frame));
    panel.lines.iter().for_each(|line| draw_line(text, line, frame));
    text.push_str("</g>\n");
}

fn draw_band(text: &mut String, line: &Line, frame: &Frame<'_>) {
    if line.stroke == Stroke::Points || line.deviation.iter().all(|deviation| *deviation == 0.0) {
        return;
    }
    let ends = |sign: f64| {
        let each = line.x.iter().zip(&line.mean).zip(&line.deviation);
        each.map(move |((at, mean), deviation)| frame.place(*at, mean + sign * deviation)).collect::<Vec<_>>()
    };
    let mut way = ends(1.0);
    way.extend(ends(-1.0).into_iter().rev());
    let _ = writeln!(text, r#"<path class="band f{}" d="{}Z"/>"#, shade(line), path(&way));
}

fn draw_line(text: &mut String, line: &Line, frame: &Frame<'_>) {
    let way: Vec<Place> = line.x.iter().zip(&line.mean).map(|(at, mean)| frame.place(*at, *mean)).collect();
    let color = shade(line);
    let name = escaped(&line.name);
    if line.stroke != Stroke::Points {
        let class = class(line);
        let _ = writeln!(
            text,
            r#"<path class="{class}" d="{}"><title>{name}, {} seeds</title></path>"#,
            path(&way),
            line.seeds
        );
        return;
    }
    for ((at, mean), deviation) in line.x.iter().zip(&line.mean).zip(&line.deviation) {
        let (low, here) = (frame.place(*at, mean - deviation), frame.place(*at, *mean));
        let high = frame.place(*at, mean + deviation);
        let _ = writeln!(
            text,
            r#"<path class="line s{color}" d="M{:.1} {:.1}V{:.1}"/><circle class="f{color}" cx="{:.1}" cy="{:.1}" r="3"><title>{name}</title></circle>"#,
            low.x, low.y, high.y, here.x, here.y
        );
    }
}

fn class(line: &Line) -> String {
    let stroke = match line.stroke {
        Stroke::Dashed => " dashed",
        Stroke::Thick => " thick",
        Stroke::Solid | Stroke::Points => "",
    };
    format!("line s{}{stroke}", shade(line))
}

fn shade(line: &Line) -> usize {
    line.color % COLORS
}

fn path(way: &[Place]) -> String {
    let mut text = String::new();
    for (index, Place { x, y }) in way.iter().enumerate() {
        let _ = write!(text, "{}{x:.1} {y:.1}", if index == 0 { 'M' } else { 'L' });
    }
    text
}

fn entry_width(line: &Line) -> f64 {
    26.0 + line.name.chars().count() as f64 * LETTER
}

/// Entries beside each other, and below where there is no room up to `right`.
fn legend_at(text: &mut String, lines: &[&Line], place: Place, right: f64) {
    let Place { mut x, mut y } = place;
    for line in lines {
        if x > place.x && x + entry_width(line) > right {
            (x, y) = (place.x, y + LEGEND);
        }
        let (middle, end, label) = (y - 4.0, x + 16.0, x + 20.0);
        match line.stroke {
            Stroke::Points => {
                let at = x + 8.0;
                let _ = writeln!(
                    text,
                    r#"<circle class="f{}" cx="{at:.1}" cy="{middle:.1}" r="3"/>"#,
                    shade(line)
                );
            }
            _ => {
                let class = class(line);
                let _ = writeln!(text, r#"<path class="{class}" d="M{x:.1} {middle:.1}H{end:.1}"/>"#);
            }
        }
        let _ =
            writeln!(text, r#"<text class="ink" x="{label:.1}" y="{y:.1}">{}</text>"#, escaped(&line.name));
        x += entry_width(line);
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
