//! Episodes made into pictures: every step as a picture, a contact sheet of all, and a clip of one after the other.

use demosift::basics::observer::{Event, Observer};
use demosift::data::trajectory::StateLog;
use demosift::{Error, Result};

use crate::mujoco_task::MujocoTask;
use crate::pictures::picture::{Animation, Picture, TEXT_HEIGHT, text_width};
use crate::pictures::render::Viewpoint;
use crate::replay::Replay;

/// How observers are told of the work; its unit is a picture.
pub const STAGE: &str = "film";

/// A clip shows no picture for a shorter time: many viewers slow such clips down.
const SHORTEST_SHOWN_SECS: f64 = 0.04;
/// How long the last picture of an episode stands in a clip.
const LAST_SHOWN_SECS: f64 = 1.0;
/// White between and around what is on a sheet, pixels.
const MARGIN: usize = 6;

/// An episode to be filmed.
#[derive(Clone, Debug)]
pub struct Take {
    /// What is written above its pictures.
    pub label: String,
    /// How many steps it has.
    pub steps: usize,
}

/// Whatever can show episodes.
pub trait Camera {
    /// Pixels in a row of its pictures.
    fn width(&self) -> usize;

    /// What a step of one of the episodes looks like; they are asked for one after the other, and the steps of each in order.
    ///
    /// # Errors
    /// If the simulator or rendering fails.
    fn picture(&mut self, take: usize, step: usize) -> Result<Picture>;
}

/// Shows episodes of a task in MuJoCo, from their states.
pub struct OfStates<'a> {
    task: &'a MujocoTask,
    viewpoint: Viewpoint,
    states: Vec<Recorded<'a>>,
    /// Which of them is shown.
    shown: Option<(usize, Replay<'a>)>,
}

/// The states of an episode, one per step.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// The simulator's states.
    pub states: &'a StateLog,
    /// How many there are.
    pub steps: usize,
}

impl<'a> OfStates<'a> {
    /// Looks at these episodes from one place.
    pub fn new(task: &'a MujocoTask, viewpoint: Viewpoint, states: Vec<Recorded<'a>>) -> Self {
        Self { task, viewpoint, states, shown: None }
    }
}

impl Camera for OfStates<'_> {
    fn width(&self) -> usize {
        self.viewpoint.width()
    }

    fn picture(&mut self, take: usize, step: usize) -> Result<Picture> {
        if self.shown.as_ref().is_none_or(|(shown, _)| *shown != take) {
            let Recorded { states, steps } = self.states[take];
            self.shown = Some((take, Replay::new(self.task, states, steps)?));
        }
        let (_, replay) = self.shown.as_mut().expect("it was just put there");
        self.viewpoint.picture(replay.at(step)?)
    }
}

/// What is made of the episodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// A picture of each step.
    pub frames: bool,
    /// A contact sheet: a row an episode, with this many evenly spaced moments.
    pub sheet: Option<usize>,
    /// A clip that plays the episodes one after the other, as fast as they went.
    pub clip: bool,
}

/// What was made, as the bytes of a file.
#[derive(Debug)]
pub enum Film {
    /// PNG: one step of one take.
    Frame {
        /// Which of the takes.
        take: usize,
        /// Which step of it.
        step: usize,
        /// The file.
        png: Vec<u8>,
    },
    /// PNG: the contact sheet.
    Sheet(Vec<u8>),
    /// GIF: the clip.
    Clip(Vec<u8>),
}

/// Films episodes whose steps take so many seconds, and hands over each file as soon as it is complete.
///
/// # Errors
/// `is_bad_config` if a sheet of no moments is wanted; else what the camera or `keep` met.
pub fn film(
    camera: &mut dyn Camera,
    takes: &[Take],
    step_secs: f64,
    wanted: Wanted,
    observer: &mut dyn Observer,
    keep: &mut dyn FnMut(Film) -> Result<()>,
) -> Result<()> {
    if wanted.sheet == Some(0) {
        return Err(Error::bad_config("a contact sheet of 0 moments; at least 1 is needed"));
    }
    let plans: Vec<Plan> = takes.iter().map(|take| Plan::of(take.steps, wanted, step_secs)).collect();
    let total = plans.iter().map(Plan::pictures).sum();
    observer.on(Event::Started { stage: STAGE, done: 0, total })?;
    let (mut done, mut rows, mut clip) = (0, Vec::new(), Animation::new());
    let text_width = camera.width().saturating_sub(2 * MARGIN);
    let labels: Vec<_> = takes.iter().map(|take| wrapped(&take.label, text_width)).collect();
    let most_lines = labels.iter().map(Vec::len).max().unwrap_or(0);
    for (number, (take, plan)) in takes.iter().zip(&plans).enumerate() {
        let mut row = Vec::new();
        for step in (0..take.steps).filter(|step| plan.shows(*step)) {
            let picture = camera.picture(number, step)?;
            if let Some(shown_secs) = plan.in_clip(step) {
                clip.show(&labeled(&picture, &labels[number], most_lines), shown_secs)?;
            }
            if plan.frames {
                keep(Film::Frame { take: number, step, png: picture.to_png()? })?;
            }
            let times = plan.moments.iter().filter(|moment| **moment == step).count();
            row.extend(std::iter::repeat_n((step_secs * step as f64, picture), times));
            done += 1;
            observer.on(Event::Advanced { stage: STAGE, done })?;
        }
        rows.push((take.label.as_str(), row));
    }
    if wanted.sheet.is_some() {
        keep(Film::Sheet(sheet(&rows).to_png()?))?;
    }
    clip.into_bytes()?.map_or(Ok(()), |gif| keep(Film::Clip(gif)))
}

/// Which steps of an episode are needed for what.
struct Plan {
    steps: usize,
    frames: bool,
    moments: Vec<usize>,
    /// Every how many steps a clip has a picture, and the seconds of a step.
    clip: Option<(usize, f64)>,
}

impl Plan {
    fn of(steps: usize, wanted: Wanted, step_secs: f64) -> Self {
        let stride = (1..steps).find(|stride| *stride as f64 * step_secs >= SHORTEST_SHOWN_SECS - 1e-9);
        Self {
            steps,
            frames: wanted.frames,
            moments: wanted.sheet.map_or(Vec::new(), |count| moments(steps, count)),
            clip: wanted.clip.then_some((stride.unwrap_or(1), step_secs)),
        }
    }

    fn shows(&self, step: usize) -> bool {
        self.frames || self.moments.contains(&step) || self.in_clip(step).is_some()
    }

    fn pictures(&self) -> usize {
        (0..self.steps).filter(|step| self.shows(*step)).count()
    }

    /// For how many seconds a clip shows this step.
    fn in_clip(&self, step: usize) -> Option<f64> {
        let (stride, step_secs) = self.clip.filter(|(stride, _)| step.is_multiple_of(*stride))?;
        Some(if step + stride < self.steps { stride as f64 * step_secs } else { LAST_SHOWN_SECS })
    }
}

/// Steps that are evenly spaced from the first to the last.
fn moments(steps: usize, count: usize) -> Vec<usize> {
    let last = steps.saturating_sub(1);
    (0..count).map(|moment| (last * moment * 2 + (count - 1)) / (2 * (count - 1)).max(1)).collect()
}

/// A picture with some lines of text above it, in a place for `most` lines.
fn labeled(picture: &Picture, lines: &[String], most: usize) -> Picture {
    let above = most * TEXT_HEIGHT + 2 * MARGIN;
    let mut paper = Picture::blank(picture.width, picture.height + above);
    for (place, line) in lines.iter().enumerate() {
        paper.write(line, MARGIN, MARGIN + place * TEXT_HEIGHT);
    }
    paper.paste(picture, 0, above);
    paper
}

/// The text in lines that fit a width; a word that is too long for it gets a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        let longer = lines.last().map(|line| format!("{line} {word}"));
        match (lines.last_mut(), longer) {
            (Some(line), Some(longer)) if text_width(&longer) <= width => *line = longer,
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Rows of pictures, each row with its label above and each picture with its time below.
fn sheet(rows: &[(&str, Vec<(f64, Picture)>)]) -> Picture {
    let pictures = || rows.iter().flat_map(|(_, row)| row).map(|(_, picture)| picture);
    let wide = pictures().map(|picture| picture.width).max().unwrap_or(0) + MARGIN;
    let line = TEXT_HEIGHT + MARGIN;
    let high = pictures().map(|picture| picture.height).max().unwrap_or(0) + 2 * line + MARGIN;
    let columns = rows.iter().map(|(_, row)| row.len()).max().unwrap_or(0);
    let mut paper = Picture::blank(columns * wide + MARGIN, rows.len() * high + MARGIN);
    for (place, (label, row)) in rows.iter().enumerate() {
        let top = MARGIN + place * high;
        paper.write(label, MARGIN, top);
        for (column, (secs, picture)) in row.iter().enumerate() {
            let (left, time) = (MARGIN + column * wide, format!("{secs:.2} s"));
            paper.paste(picture, left, top + line);
            let middle = left + (wide - MARGIN).saturating_sub(text_width(&time)) / 2;
            paper.write(&time, middle, top + line + picture.height);
        }
    }
    paper
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_evenly_spaced_from_the_first_step_to_the_last() {
        assert_eq!(moments(60, 6), [0, 12, 24, 35, 47, 59]);
        assert_eq!(moments(5, 5), [0, 1, 2, 3, 4]);
        assert_eq!(moments(2, 4), [0, 0, 1, 1]);
        assert_eq!(moments(9, 1), [0]);
        assert_eq!(moments(1, 3), [0, 0, 0]);
    }

    #[test]
    fn a_clip_lasts_as_long_as_its_episode_and_the_last_picture_longer() {
        let wanted = Wanted { frames: false, sheet: None, clip: true };
        for (steps, step_secs, pictures) in
            [(60, 0.025, 30), (1000, 0.05, 1000), (50, 0.02, 25), (7, 0.01, 2)]
        {
            let plan = Plan::of(steps, wanted, step_secs);
            assert_eq!(plan.pictures(), pictures, "{steps} of {step_secs} s");
            let shown: Vec<f64> = (0..steps).filter_map(|step| plan.in_clip(step)).collect();
            let (last, others) = shown.split_last().expect("at least one picture");
            let stride = if step_secs < 0.04 { (0.04 / step_secs).ceil() } else { 1.0 };
            let before_last = (pictures - 1) as f64 * stride * step_secs;
            assert!((others.iter().sum::<f64>() - before_last).abs() < 1e-9, "{steps} of {step_secs} s");
            assert_eq!(*last, LAST_SHOWN_SECS);
        }
    }

    #[test]
    fn only_what_is_wanted_is_rendered() {
        let nothing = Wanted { frames: false, sheet: None, clip: false };
        assert_eq!(Plan::of(60, nothing, 0.025).pictures(), 0);
        assert_eq!(Plan::of(60, Wanted { sheet: Some(6), ..nothing }, 0.025).pictures(), 6);
        assert_eq!(Plan::of(60, Wanted { frames: true, sheet: Some(6), clip: true }, 0.025).pictures(), 60);
    }

    #[test]
    fn a_label_is_broken_between_words_where_it_is_too_wide() {
        let width = text_width("episode 3:");
        assert_eq!(wrapped("episode 3: -0.5 m, no success", width), ["episode 3:", "-0.5 m, no", "success"]);
        assert_eq!(wrapped("demonstration 4", 1), ["demonstration", "4"]);
    }

    /// A sheet of two rows of one-colored pictures: what is where.
    #[test]
    fn a_sheet_has_a_row_an_episode_with_its_moments_from_left_to_right() {
        let of = |level| Picture { width: 80, height: 50, rgb: vec![level; 80 * 50 * 3] };
        let rows = [("one", vec![(0.0, of(10)), (0.5, of(20))]), ("two", vec![(0.0, of(30)), (1.0, of(40))])];
        let sheet = sheet(&rows);
        let high = 50 + 2 * (TEXT_HEIGHT + MARGIN) + MARGIN;
        assert_eq!((sheet.width, sheet.height), (2 * (80 + MARGIN) + MARGIN, 2 * high + MARGIN));
        for (row, column, level) in [(0, 0, 10), (0, 1, 20), (1, 0, 30), (1, 1, 40)] {
            let (x, y) =
                (MARGIN + column * (80 + MARGIN) + 40, MARGIN + row * high + TEXT_HEIGHT + MARGIN + 25);
            assert_eq!(sheet.rgb[(y * sheet.width + x) * 3], level, "row {row} column {column}");
        }
        assert_ne!(
            sheet.rgb[..sheet.width * (TEXT_HEIGHT + MARGIN) * 3],
            vec![255; sheet.width * (TEXT_HEIGHT + MARGIN) * 3]
        );
    }
}
