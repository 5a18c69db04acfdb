//! How probable it is to be among the K best, for every K, in as much memory as there are draws.

use std::collections::BTreeMap;

use crate::world::heuristic::Score;

/// A probability for each K from 1, which rises with K to 1; none where nothing is known.
///
/// It is held as the places at which it rises: of a thousand demonstrations all values would be a million numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chances {
    /// K before whose first value nothing is known.
    demonstrations: usize,
    /// From draws without ties: ascending by K, each with the probability from there on.
    rises: Vec<Rise>,
    /// From draws in which places are shared.
    ties: Vec<Tie>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Rise {
    k: u32,
    to: f64,
}

/// A share of the draws in which `among` demonstrations share the places behind the `first` ones.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tie {
    first: u32,
    among: u32,
    share: f64,
}

impl Chances {
    /// From the value for each K, from 1 on.
    pub fn new(values: &[f64]) -> Self {
        let rises = values.iter().enumerate().map(|(place, &to)| Rise { k: place_of(place) + 1, to });
        Self { demonstrations: values.len(), rises: rises.collect(), ties: Vec::new() }
    }

    /// That for K; `None` where K is 0 or more than there are demonstrations, or nothing is known.
    pub fn at(&self, k: usize) -> Option<f64> {
        let known = (1..=self.demonstrations).contains(&k);
        let above = self.rises.partition_point(|rise| rise.k as usize <= k);
        let alone = above.checked_sub(1).map_or(0.0, |last| self.rises[last].to);
        let of_tie = |tie: &Tie| {
            let places = k.saturating_sub(tie.first as usize).min(tie.among as usize);
            tie.share * places as f64 / f64::from(tie.among)
        };
        known.then(|| alone + self.ties.iter().map(of_tie).sum::<f64>())
    }
}

/// A place in half of the room.
fn place_of(place: usize) -> u32 {
    u32::try_from(place).unwrap_or(u32::MAX)
}

/// Where a demonstration stood in a draw: it shares `among` places from `first` on, counted from 0, with those alike.
#[derive(Clone, Copy)]
struct Stood {
    first: u32,
    among: u32,
}

/// For each demonstration and each K from 1 the share of draws in which it is among the K best.
pub(super) fn top_probabilities(draws: &[Vec<Score>]) -> Vec<Chances> {
    let count = draws[0].len();
    let mut stood: Vec<Vec<Stood>> = vec![Vec::with_capacity(draws.len()); count];
    let mut order: Vec<usize> = (0..count).collect();
    for draw in draws {
        order.sort_unstable_by(|&a, &b| draw[b].total_cmp(&draw[a]));
        let mut first = 0;
        for tied in order.chunk_by(|&a, &b| draw[a] == draw[b]) {
            let place = Stood { first: place_of(first), among: place_of(tied.len()) };
            tied.iter().for_each(|&demonstration| stood[demonstration].push(place));
            first += tied.len();
        }
    }
    stood.into_iter().map(|stood| chances(&stood, count)).collect()
}

fn chances(stood: &[Stood], demonstrations: usize) -> Chances {
    let mut alone: BTreeMap<u32, usize> = BTreeMap::new();
    let mut shared: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for Stood { first, among } in stood {
        match among {
            1 => *alone.entry(*first).or_default() += 1,
            _ => *shared.entry((*first, *among)).or_default() += 1,
        }
    }
    let share = |count: usize| count as f64 / stood.len() as f64;
    let rises = alone.into_iter().scan(0, |sum, (place, count)| {
        *sum += count;
        Some(Rise { k: place + 1, to: share(*sum) })
    });
    let ties = shared.into_iter().map(|((first, among), count)| Tie { first, among, share: share(count) });
    Chances { demonstrations, rises: rises.collect(), ties: ties.collect() }
}
