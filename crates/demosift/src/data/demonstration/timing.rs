//! When the steps of a set were recorded, as far as it says.

use crate::data::demonstration::episode::{Episode, Source};
use crate::math::statistics;

/// From so many usual steps on, the time between two steps is a jump.
const JUMP: f64 = 2.5;

/// Time that passes between two steps of an episode unlike between the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Jump {
    /// What the file calls the episode.
    pub label: String,
    /// The step after it.
    pub step: usize,
    /// What passes, s; not above 0 where the clock stands still or goes back.
    pub secs: f64,
}

/// What the clock of a set tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// What usually passes between two steps, s.
    pub step_secs: f64,
    /// The first jump of each episode that has one.
    pub jumps: Vec<Jump>,
}

/// What the timestamps of a set tell; `None` where it has none, or a clock that does not run.
pub fn timing(source: &Source) -> Option<Timing> {
    let mut steps: Vec<f64> = source.episodes.iter().flat_map(passed).collect();
    if steps.is_empty() {
        return None;
    }
    steps.sort_by(f64::total_cmp);
    let step_secs = statistics::quantile(&steps, 0.5);
    if !(step_secs > 0.0 && step_secs.is_finite()) {
        return None;
    }
    let jumps = source.episodes.iter().filter_map(|episode| {
        let is_jump = |secs: &f64| !(*secs > 0.0 && *secs < JUMP * step_secs);
        let (at, secs) = passed(episode).enumerate().find(|(_, secs)| is_jump(secs))?;
        Some(Jump { label: episode.label.clone(), step: at + 1, secs })
    });
    Some(Timing { step_secs, jumps: jumps.collect() })
}

fn passed(episode: &Episode) -> impl Iterator<Item = f64> {
    episode.timestamps_secs.windows(2).map(|pair| pair[1] - pair[0])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;
    use crate::data::demonstration::episode::{Columns, Format};
    use crate::math::rows::Rows;

    fn source(clocks: &[&[f64]]) -> Source {
        let episode = |(label, clock): (usize, &&[f64])| {
            let rows = || Rows::from_flat(vec![0.5; clock.len()], 1).unwrap();
            let timestamps_secs = clock.to_vec();
            Episode { timestamps_secs, ..Episode::new(label.to_string(), rows(), rows(), None) }
        };
        let episodes = clocks.iter().enumerate().map(episode).collect();
        Source::new(Format::LeRobotV3, Columns::default(), episodes)
    }

    #[test]
    fn a_jump_is_told_with_its_episode_and_step_and_a_little_jitter_is_none() {
        let steady = [0.0, 0.04, 0.081, 0.12, 0.155];
        let late = [10.0, 10.04, 13.08, 13.12, 13.16];
        let back = [0.0, 0.04, 0.08, 0.02, 0.06];
        let told = timing(&source(&[&steady, &late, &back])).unwrap();
        assert!((told.step_secs - 0.04).abs() < 1e-9);
        let jumps: Vec<(&str, usize)> =
            told.jumps.iter().map(|jump| (jump.label.as_str(), jump.step)).collect();
        assert_eq!(jumps, [("1", 2), ("2", 3)]);
        assert!((told.jumps[0].secs - 3.04).abs() < 1e-9 && told.jumps[1].secs < 0.0);
        assert_eq!(timing(&source(&[&[0.0; 5]])), None, "a clock that stands still tells nothing");
        assert_eq!(timing(&source(&[&[]])), None);
    }
}
