//! Which episodes of a file make the set: those that a user names, those of a filter key, those that can be learned from.
//!
//! What is kept keeps its position in the file, and what is left out is named with the reason.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Episode, LeftOut, Source, trailing_number};
use crate::data::demonstration::named::listed;

use crate::data::demonstration::numbers::Numbers;

/// An episode of fewer steps shows no change, so nothing can be learned from it.
pub const FEWEST_STEPS: usize = 2;

/// Which episodes of a file are taken; by default all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Choice {
    /// Only these, by the numbers that the file gives them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub episodes: Option<Numbers>,
    /// All but these.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without: Option<Numbers>,
    /// None from which nobody can learn: empty, too short, of another size than the others, or with a number that is not finite.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub skip_bad: bool,
    /// Only those of this filter key of robomimic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filter_key: Option<String>,
}

impl Choice {
    /// Whether nothing is left out.
    pub fn is_all(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let option = |name: &str, value: Option<String>| value.map(|value| format!("--{name} {value}"));
        let parts = [
            option("episodes", self.episodes.as_ref().map(ToString::to_string)),
            option("without", self.without.as_ref().map(ToString::to_string)),
            option("filter-key", self.filter_key.clone()),
            self.skip_bad.then(|| "--skip-bad".to_owned()),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        out.pad(&if parts.is_empty() { "all".to_owned() } else { parts.join(" ") })
    }
}

/// Leaves out what is not chosen; `of_key` are the names of the episodes of the filter key, if one is asked for.
///
/// # Errors
/// `is_bad_input` if an episode is named that is not there, or none is left.
pub(super) fn choose(source: Source, choice: &Choice, of_key: Option<&[String]>) -> Result<Source> {
    if choice.is_all() {
        return Ok(source);
    }
    let numbers: Vec<Option<u64>> =
        source.episodes.iter().map(|episode| trailing_number(&episode.label)).collect();
    for (option, named) in [("--episodes", &choice.episodes), ("--without", &choice.without)] {
        named.as_ref().map_or(Ok(()), |named| check(option, named, &numbers))?;
    }
    let absent = absent(&source.episodes, of_key.unwrap_or_default());
    let faults = if choice.skip_bad { faults(&source.episodes) } else { vec![None; numbers.len()] };
    let Source { ids, episodes, mut left_out, mut not_read, .. } = source;
    if !absent.is_empty() {
        let key = choice.filter_key.as_deref().unwrap_or_default();
        not_read
            .push(format!("The filter key '{key}' names what the file does not have: {}.", listed(absent)));
    }
    let (mut kept_ids, mut kept) = (Vec::new(), Vec::new());
    for (((id, episode), number), fault) in ids.into_iter().zip(episodes).zip(numbers).zip(faults) {
        let named =
            |list: &Option<Numbers>| list.as_ref().map(|list| number.is_some_and(|number| list.hold(number)));
        let why = if named(&choice.episodes) == Some(false) {
            Some("not of --episodes".to_owned())
        } else if named(&choice.without) == Some(true) {
            Some("by --without".to_owned())
        } else if of_key.is_some_and(|labels| !labels.contains(&episode.label)) {
            Some(format!("not of the filter key '{}'", choice.filter_key.as_deref().unwrap_or_default()))
        } else {
            fault
        };
        match why {
            Some(why) => left_out.push(LeftOut { label: episode.label, why }),
            None => {
                kept_ids.push(id);
                kept.push(episode);
            }
        }
    }
    if kept.is_empty() {
        return Err(Error::bad_input(format!("no episode is left of {} by {choice}", left_out.len()))
            .with_hint("`demosift inspect SET` shows the numbers of the episodes"));
    }
    Ok(Source { ids: kept_ids, episodes: kept, left_out, not_read, ..source })
}

/// What a filter key names and no episode is called.
fn absent<'a>(episodes: &[Episode], of_key: &'a [String]) -> Vec<&'a String> {
    of_key.iter().filter(|&name| episodes.iter().all(|episode| episode.label != *name)).collect()
}

fn check(option: &str, named: &Numbers, numbers: &[Option<u64>]) -> Result<()> {
    let most = numbers.iter().flatten().max().copied().unwrap_or(0);
    let missing = named.0.iter().find(|&&(first, last)| {
        last > most || !numbers.iter().flatten().any(|number| (first..=last).contains(number))
    });
    let Some(&(first, last)) = missing else { return Ok(()) };
    let all = listed(numbers.iter().flatten());
    let of = Numbers(vec![(first, last)]);
    Err(Error::bad_input(format!("{option} {of}: the file does not have these; its episodes are {all}")))
}

/// Why nobody can learn from an episode, for each; `None` for a good one.
pub(super) fn faults(episodes: &[Episode]) -> Vec<Option<String>> {
    let alone: Vec<Option<String>> = episodes.iter().map(Episode::fault).collect();
    let mut counts = BTreeMap::new();
    for (place, (episode, _)) in
        episodes.iter().zip(&alone).enumerate().filter(|(_, (_, fault))| fault.is_none())
    {
        counts.entry(episode.sizes()).or_insert((0_usize, Reverse(place))).0 += 1;
    }
    // That of most episodes; of equals the one that comes first.
    let usual = counts.into_iter().max_by_key(|(_, count)| *count).map(|(sizes, _)| sizes);
    let fault = |(episode, alone): (&Episode, Option<String>)| {
        let (steps, (observed, acted)) = (episode.actions.len(), episode.sizes());
        alone.or_else(|| match usual {
            _ if steps < FEWEST_STEPS => Some(format!("{steps} step is too short to learn from")),
            Some(usual) if usual != (observed, acted) => Some(format!(
                "a step has {observed} observed numbers and {acted} of an action; the others have {} and {}",
                usual.0, usual.1
            )),
            _ => None,
        })
    };
    episodes.iter().zip(alone).map(fault).collect()
}

/// What was left out, in words; `None` if nothing was.
pub fn in_words(left_out: &[LeftOut]) -> Option<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for LeftOut { label, why } in left_out {
        match reasons.iter_mut().find(|(known, _)| known == why) {
            Some((_, labels)) => labels.push(label),
            None => reasons.push((why, vec![label])),
        }
    }
    let one = |(why, labels): &(&str, Vec<&str>)| format!("{} ({why})", labels.join(", "));
    let all: Vec<String> = reasons.iter().map(one).collect();
    let episodes = if left_out.len() == 1 { "episode" } else { "episodes" };
    (!all.is_empty()).then(|| format!("Left out: {episodes} {}.", all.join("; ")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;
    use crate::data::demonstration::DemoId;
    use crate::data::demonstration::episode::{Columns, Format};
    use crate::math::rows::Rows;

    fn source(labels: &[&str], steps: &[usize]) -> Source {
        let episode = |(label, steps): (&&str, &usize)| {
            let rows = |width: usize| {
                if *steps == 0 {
                    Rows::default()
                } else {
                    Rows::from_flat(vec![0.5; steps * width], width).unwrap()
                }
            };
            Episode::new((*label).to_owned(), rows(2), rows(1), None)
        };
        let episodes = labels.iter().zip(steps).map(episode).collect();
        Source::new(Format::D4rl, Columns::default(), episodes)
    }

    #[test]
    fn what_is_chosen_keeps_its_position_and_goes_by_the_numbers_of_the_file() {
        let source = source(&["demo_0", "demo_2", "demo_5", "demo_9"], &[3, 3, 3, 3]);
        let choice = Choice {
            episodes: Some("0-5".parse().unwrap()),
            without: Some("2".parse().unwrap()),
            ..Choice::default()
        };
        let chosen = choose(source.clone(), &choice, None).unwrap();
        assert_eq!(chosen.ids, [DemoId(0), DemoId(2)]);
        assert_eq!(chosen.episode(DemoId(2)).unwrap().label, "demo_5");
        let words = in_words(&chosen.left_out).unwrap();
        assert_eq!(words, "Left out: episodes demo_2 (by --without); demo_9 (not of --episodes).");
        let wrong = Choice { without: Some("3".parse().unwrap()), ..Choice::default() };
        let error = choose(source.clone(), &wrong, None).unwrap_err();
        assert!(
            error.to_string().contains("--without 3") && error.to_string().contains("0, 2, 5, 9"),
            "{error}"
        );
        let key = Choice { filter_key: Some("better".to_owned()), ..Choice::default() };
        let chosen = choose(source.clone(), &key, Some(&["demo_9".to_owned()])).unwrap();
        assert_eq!((chosen.ids, chosen.left_out.len()), (vec![DemoId(3)], 3));
        assert!(chosen.not_read.is_empty(), "{:?}", chosen.not_read);
        let chosen = choose(source, &key, Some(&["demo_9", "demo_4"].map(str::to_owned))).unwrap();
        assert_eq!(chosen.ids, [DemoId(3)]);
        assert_eq!(chosen.not_read, ["The filter key 'better' names what the file does not have: demo_4."]);
    }

    #[test]
    fn every_bad_episode_is_named_and_skipped_on_request() {
        let mut source = source(&["0", "1", "2", "3", "4", "5"], &[3, 0, 3, 1, 3, 3]);
        source.episodes[2].actions = Rows::from_flat(vec![0.0, f32::NAN, 0.0], 1).unwrap();
        source.episodes[4].observations = Rows::from_flat(vec![0.0; 9], 3).unwrap();
        let error = source.demonstrations().unwrap_err();
        for part in ["episode 1: ", "episode 2: action 0 at step 1 is NaN"] {
            assert!(error.to_string().contains(part), "{error}");
        }
        assert!(error.hint().unwrap().contains("--skip-bad"));
        let chosen = choose(source, &Choice { skip_bad: true, ..Choice::default() }, None).unwrap();
        assert_eq!(chosen.ids, [DemoId(0), DemoId(5)]);
        let words = in_words(&chosen.left_out).unwrap();
        for part in
            ["1 (", "2 (action 0 at step 1 is NaN", "3 (1 step is too short", "4 (a step has 3 observed"]
        {
            assert!(words.contains(part), "{words}");
        }
        assert_eq!(chosen.set().unwrap().ids(), [DemoId(0), DemoId(5)]);
    }
}
