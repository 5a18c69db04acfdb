use super::axis::{Axis, Span};
use super::*;

fn line(name: &str, color: usize, stroke: Stroke) -> Line {
    Line {
        name: name.to_owned(),
        color,
        stroke,
        x: vec![0.0, 100_000.0, 200_000.0],
        mean: vec![-1.0, -0.5, -0.25],
        deviation: vec![0.1, 0.2, 0.0],
        seeds: 3,
    }
}

fn grid() -> Grid {
    let full = Panel {
        lines: vec![
            line("top 1", 0, Stroke::Solid),
            line("all", 3, Stroke::Dashed),
            line("by weights", 4, Stroke::Thick),
        ],
    };
    Grid {
        title: "A & B".to_owned(),
        note: "over 3 seeds".to_owned(),
        x_label: "environment steps".to_owned(),
        x_name: "environment_steps".to_owned(),
        fitted_from: 0.0,
        columns: vec!["MAML".to_owned(), "one, two".to_owned()],
        rows: vec![Row {
            title: "free_throw_8".to_owned(),
            y_label: "score [m]".to_owned(),
            panels: vec![full, Panel::default()],
        }],
    }
}

fn count(text: &str, part: &str) -> usize {
    text.matches(part).count()
}

#[test]
fn an_axis_has_round_ticks_within_its_span() {
    for (low, high, ticks) in [
        (0.0, 400_000.0, vec!["0", "100k", "200k", "300k", "400k"]),
        (-0.13, 0.42, vec!["0", "0.2", "0.4"]),
        (3.0, 3.0, vec!["3.0", "3.2", "3.4", "3.6", "3.8", "4.0"]),
        (0.0, 5_000_000.0, vec!["0", "1M", "2M", "3M", "4M", "5M"]),
        (-0.021, -0.001, vec!["−0.020", "−0.015", "−0.010", "−0.005"]),
    ] {
        let about = if high == 400_000.0 { 4 } else { 5 };
        let axis = Axis::of(Span { low, high }, about);
        let found: Vec<String> = axis.ticks.iter().map(|tick| axis.label(*tick)).collect();
        assert_eq!(found, ticks, "{low} to {high}");
        assert!(axis.ticks.iter().all(|tick| *tick >= low - 1e-9 && *tick <= axis.high + 1e-9));
    }
    assert_eq!(Span::of([f64::NAN, 2.0, -1.0].into_iter()), Some(Span { low: -1.0, high: 2.0 }));
    assert_eq!(Span::of(std::iter::empty()), None);
}

#[test]
fn a_picture_has_an_element_for_each_thing_it_shows() {
    let text = svg(&grid());
    // Three lines and three entries of the legend; the band of each line, as each has some spread.
    assert_eq!(count(&text, "class=\"line s0\""), 2);
    assert_eq!(count(&text, "class=\"line s3 dashed\""), 2);
    assert_eq!(count(&text, "class=\"line s4 thick\""), 2);
    assert_eq!(count(&text, "class=\"band f"), 3);
    assert_eq!(count(&text, "<title>top 1, 3 seeds</title>"), 1);
    assert_eq!(count(&text, "nothing finished yet"), 1);
    assert!(text.contains("A &amp; B") && !text.contains("A & B"));
    assert!(text.contains("prefers-color-scheme: dark"));
    assert_eq!(count(&text, ">score [m]<"), 1);
    assert_eq!(count(&text, "<svg "), 1);
    assert!(text.ends_with("</svg>\n") && !text.contains("NaN") && !text.contains("inf"));
    // Every element is closed: as many opening as closing ones, or closed by themselves.
    let opened = count(&text, "<") - count(&text, "</");
    assert_eq!(opened, count(&text, "</") + count(&text, "/>"));
}

#[test]
fn panels_of_a_row_share_their_axes_and_what_is_before_them_is_cut_off() {
    let mut grid = grid();
    let longer = Line { x: vec![0.0, 400_000.0, 800_000.0], ..line("top 1", 0, Stroke::Solid) };
    grid.rows[0].panels[1] = Panel { lines: vec![longer] };
    let text = svg(&grid);
    assert_eq!(count(&text, ">800k</text>"), 2, "both panels go as far as the longer one");
    assert_eq!(count(&text, ">−1.0</text>"), 1);
    let late = svg(&Grid { fitted_from: 0.1, ..grid });
    assert_eq!(count(&late, ">−1.0</text>"), 0, "where all lines begin does not count");
    assert_eq!(count(&late, "clip-path=\"url(#inside-"), 2);
}

#[test]
fn lines_that_differ_from_panel_to_panel_have_legends_of_their_own() {
    let mut grid = grid();
    let other = (0..7).map(|demo| line(&format!("demo {demo}"), demo, Stroke::Points)).collect();
    grid.rows[0].panels[1] = Panel { lines: other };
    let text = svg(&grid);
    assert_eq!(count(&text, "<circle"), 7 * 3 + 7, "points, and a mark in the legend for each line");
    for name in ["top 1", "demo 0", "demo 6"] {
        assert_eq!(count(&text, &format!(">{name}</text>")), 1, "{name}");
    }
}

#[test]
fn the_numbers_of_a_figure_are_a_table() {
    let text = csv(&grid());
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "row,column,line,environment_steps,mean,deviation,seeds");
    assert_eq!(lines.len(), 1 + 3 * 3);
    assert_eq!(lines[2], "free_throw_8,MAML,top 1,100000,-0.5,0.2,3");
    let mut quoted = grid();
    quoted.rows[0].panels.swap(0, 1);
    assert!(csv(&quoted).contains("free_throw_8,\"one, two\",all,0,-1,0.1,3"));
    assert!(!grid().is_empty() && Grid::default().is_empty());
}
