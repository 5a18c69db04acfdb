//! What a file of demonstrations holds, at a glance: what one looks at before learning from it.

mod looks;

use serde::Serialize;

use crate::data::demonstration::DemoId;
use crate::data::demonstration::choice;
use crate::data::demonstration::episode::{Columns, Episode, Format, LeftOut, Source};
use crate::math::rows::Rows;

pub use looks::{Look, looks};

/// What is seen in a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Inspection {
    /// How it is stored.
    pub format: Format,
    /// The columns that were read.
    pub columns: Columns,
    /// In file order.
    pub episodes: Vec<EpisodeSummary>,
    /// Steps of all episodes.
    pub steps: usize,
    /// Steps after the last complete episode, which were left out.
    pub dropped_steps: usize,
    /// Episodes that were not chosen.
    pub left_out: Vec<LeftOut>,
    /// What else was not read although it looks like an episode, in words.
    pub not_read: Vec<String>,
    /// One entry for each number of an observation; of the first episode's size.
    pub observations: Vec<Spread>,
    /// One entry for each number of an action; of the first episode's size.
    pub actions: Vec<Spread>,
}

/// One episode.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EpisodeSummary {
    /// Its position in the file, by which demosift names it.
    pub demonstration: DemoId,
    /// What the file calls it.
    pub label: String,
    /// T.
    pub steps: usize,
    /// Numbers in an observation.
    pub observation_size: usize,
    /// Numbers in an action.
    pub action_size: usize,
    /// Numbers that are not finite.
    pub not_finite: usize,
    /// Why nobody can learn from it; `None` if one can.
    pub fault: Option<String>,
}

/// How one number of an observation or action varies over all steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spread {
    /// The least finite value; `None` if there is none.
    pub least: Option<f32>,
    /// The greatest finite value; `None` if there is none.
    pub greatest: Option<f32>,
    /// Values that are not finite.
    pub not_finite: usize,
    /// Steps with a value outside [−1, 1], where the tasks here take actions.
    pub outside: usize,
}

impl Spread {
    /// Whether the number never changes.
    pub fn is_constant(&self) -> bool {
        self.not_finite == 0 && self.least == self.greatest
    }
}

/// Looks at everything that was read.
pub fn inspect(source: &Source) -> Inspection {
    let faults = choice::faults(&source.episodes);
    let summary = |((episode, id), fault): ((&Episode, &DemoId), Option<String>)| EpisodeSummary {
        demonstration: *id,
        fault,
        label: episode.label.clone(),
        steps: episode.actions.len(),
        observation_size: episode.observations.width(),
        action_size: episode.actions.width(),
        not_finite: [&episode.observations, &episode.actions]
            .into_iter()
            .map(|rows| rows.flat().iter().filter(|value| !value.is_finite()).count())
            .sum(),
    };
    let episodes: Vec<EpisodeSummary> =
        source.episodes.iter().zip(&source.ids).zip(faults).map(summary).collect();
    Inspection {
        format: source.format,
        columns: source.columns.clone(),
        steps: episodes.iter().map(|episode| episode.steps).sum(),
        episodes,
        dropped_steps: source.dropped_steps,
        left_out: source.left_out.clone(),
        not_read: source.not_read.clone(),
        observations: spreads(source, |episode| &episode.observations),
        actions: spreads(source, |episode| &episode.actions),
    }
}

/// Over the episodes of the first one's size; the others do not fit anyway.
fn spreads(source: &Source, rows: impl Fn(&Episode) -> &Rows) -> Vec<Spread> {
    let width =
        source.episodes.iter().map(|episode| rows(episode).width()).find(|&width| width > 0).unwrap_or(0);
    let mut spreads = vec![Spread { least: None, greatest: None, not_finite: 0, outside: 0 }; width];
    let fitting = source.episodes.iter().map(rows).filter(|rows| rows.width() == width);
    for row in fitting.flat_map(|rows| rows.iter()) {
        for (spread, &value) in spreads.iter_mut().zip(row) {
            if value.is_finite() {
                spread.least = Some(spread.least.map_or(value, |least| least.min(value)));
                spread.greatest = Some(spread.greatest.map_or(value, |greatest| greatest.max(value)));
                spread.outside += usize::from(value.abs() > 1.0);
            } else {
                spread.not_finite += 1;
            }
        }
    }
    spreads
}
