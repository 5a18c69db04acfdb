//! Racing (Maron and Moore 1994): further repeats go only to those that may still belong to either side of the cut.
//!
//! Each demonstration has an interval for the mean of its repeats.
//! All intervals of all looks hold together with the probability `level`: each is as wide as Bonferroni's correction over
//! demonstrations and looks asks for.
//! So stopping by them does not make them wrong, however often one looks.

use crate::math::statistics::{Moderation, mean, squared_deviations, student_quantile};

/// The probability with which every decision of a race is right.
pub(super) const LEVEL: f64 = 0.9;

/// How many degrees of freedom the mean variance of the set is worth beside a demonstration's own.
///
/// Three repeats say little of a spread; see [`crate::results::uncertainty`], which does the same.
const POOLING: f64 = 4.0;

/// What a race is about.
#[derive(Clone, Copy, Debug)]
pub(super) struct Race {
    /// K of the top K.
    pub cut: usize,
    /// How often one will look, at least 1.
    pub looks: usize,
    /// The probability with which every decision is right.
    pub level: f64,
}

/// Who may still belong to either side of the cut, ascending; `means` holds the scores of each demonstration, one per repeat.
/// In a large set those nearest to the cut.
///
/// Nobody is sure of a side before all have two repeats.
pub(super) fn contested(means: &[Vec<f64>], race: &Race) -> Vec<usize> {
    let all: Vec<usize> = (0..means.len()).collect();
    if race.cut >= means.len() {
        return Vec::new();
    }
    if means.iter().any(|repeats| repeats.len() < 2) {
        return all;
    }
    let intervals = intervals(means, race);
    let ascending = |end: fn(&Interval) -> f64| {
        let mut ends: Vec<f64> = intervals.iter().map(end).collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends
    };
    let (lows, highs) = (ascending(|of| of.low), ascending(|of| of.high));
    let is_open = |index: &usize| {
        let own = intervals[*index];
        // The highs count its own, which is above its low.
        let maybe_above = highs.len() - 1 - highs.partition_point(|high| *high < own.low);
        let surely_above = lows.len() - lows.partition_point(|low| *low <= own.high);
        maybe_above >= race.cut && surely_above < race.cut
    };
    nearest(means, all.into_iter().filter(is_open).collect(), race.cut)
}

/// Of a small set everybody who is contested gets a further repeat ...
const FEW: usize = 100;
/// ... and of a larger one so large a share of the set.
const SHARE: usize = 10;

/// How many of a set get further repeats at most.
///
/// In a large set nearly all are contested, as intervals are wide that hold for a thousand at once, and one more repeat of
/// everybody decides little.
pub(super) fn most_contested(demonstrations: usize) -> usize {
    FEW.max(demonstrations.div_ceil(SHARE))
}

/// Of those contested the nearest to the cut, as many as get further repeats at most; ascending.
fn nearest(means: &[Vec<f64>], mut contested: Vec<usize>, cut: usize) -> Vec<usize> {
    let most = most_contested(means.len());
    if contested.len() > most {
        let centers: Vec<f64> = means.iter().map(|repeats| mean(repeats)).collect();
        let mut descending = centers.clone();
        descending.sort_unstable_by(|one, other| other.total_cmp(one));
        let border = (descending[cut.max(1) - 1] + descending[cut]) / 2.0;
        let away = |index: usize| (centers[index] - border).abs();
        contested.sort_by(|&one, &other| away(one).total_cmp(&away(other)).then(one.cmp(&other)));
        contested.truncate(most);
        contested.sort_unstable();
    }
    contested
}

#[derive(Clone, Copy)]
struct Interval {
    low: f64,
    high: f64,
}

fn intervals(means: &[Vec<f64>], race: &Race) -> Vec<Interval> {
    let centers: Vec<f64> = means.iter().map(|repeats| mean(repeats)).collect();
    let own: Vec<f64> = means.iter().map(|repeats| squared_deviations(repeats)).collect();
    let all_freedom: f64 = means.iter().map(|repeats| repeats.len() as f64 - 1.0).sum();
    let moderation = Moderation { common: own.iter().sum::<f64>() / all_freedom, worth: POOLING };
    let tail = (1.0 - race.level) / (2.0 * means.len() as f64 * race.looks.max(1) as f64);
    let interval = |((repeats, center), squares): ((&Vec<f64>, &f64), &f64)| {
        let freedom = repeats.len() as f64 - 1.0;
        let quantile = student_quantile(tail, moderation.freedom(freedom)).expect("there is some freedom");
        let half = quantile * (moderation.variance(*squares, freedom) / repeats.len() as f64).sqrt();
        Interval { low: center - half, high: center + half }
    };
    means.iter().zip(&centers).zip(&own).map(interval).collect()
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution as _, Normal};

    use super::*;
    use crate::basics::seed::Seed;

    #[test]
    fn who_is_surely_on_one_side_is_left_alone() {
        let race = |cut| Race { cut, looks: 3, level: 0.9 };
        let means = vec![vec![9.0, 9.2, 8.9], vec![5.0, 5.1, 4.9], vec![1.0, 1.1, 0.9], vec![1.1, 1.0, 0.8]];
        assert!(contested(&means, &race(1)).is_empty());
        assert!(contested(&means, &race(2)).is_empty());
        assert_eq!(contested(&means, &race(3)), [2, 3]);
        assert!(contested(&means, &race(4)).is_empty(), "all belong to the top");
        assert_eq!(
            contested(&[vec![1.0], vec![2.0]], &race(1)),
            [0, 1],
            "one repeat says nothing of a spread"
        );
    }

    /// The result of many races of six with known means.
    struct Raced {
        /// In which anybody was put on the wrong side.
        wrong: usize,
        /// Repeats that nobody needed.
        spared: usize,
    }

    fn raced(truth: [f64; 6], races: usize) -> Raced {
        let (cut, first, most) = (2, 3, 9);
        let race = Race { cut, looks: most - first, level: 0.9 };
        let normal = Normal::new(0.0, 1.0).expect("a spread of one");
        let mut raced = Raced { wrong: 0, spared: 0 };
        for number in 0..races {
            let mut rng = Seed::new(5).at(number).into_rng();
            let mut repeat = |index: usize| truth[index] + normal.sample(&mut rng);
            let mut means: Vec<Vec<f64>> =
                (0..truth.len()).map(|index| (0..first).map(|_| repeat(index)).collect()).collect();
            for _ in first..most {
                let open = contested(&means, &race);
                open.iter().for_each(|&index| means[index].push(repeat(index)));
                raced.spared += truth.len() - open.len();
            }
            let open = contested(&means, &race);
            let mut order: Vec<usize> = (0..truth.len()).collect();
            order.sort_by(|&a, &b| mean(&means[b]).total_cmp(&mean(&means[a])));
            let misplaced = |index: &usize| !open.contains(index) && *index < truth.len() - cut;
            raced.wrong += usize::from(order[..cut].iter().any(misplaced));
        }
        raced
    }

    /// Sure of nothing: scores that rise evenly, with a spread as wide as the set.
    #[test]
    fn of_a_large_set_those_nearest_to_the_cut_get_further_repeats() {
        let wide = |count: usize| -> Vec<Vec<f64>> {
            (0..count).map(|index| vec![index as f64 - 1e4, index as f64 + 1e4]).collect()
        };
        let race = |cut| Race { cut, looks: 1, level: 0.9 };
        assert_eq!(contested(&wide(100), &race(25)), (0..100).collect::<Vec<_>>(), "all of a small set");
        // The best 500 of 2000 are those from 1500 on.
        assert_eq!(contested(&wide(2000), &race(500)), (1400..1600).collect::<Vec<_>>());
        assert_eq!(contested(&wide(500), &race(1)), (400..500).collect::<Vec<_>>());
    }

    /// The definition, pair by pair.
    #[test]
    fn who_is_contested_is_counted_as_defined() {
        let normal = Normal::new(0.0, 1.0).expect("a spread of one");
        let mut rng = Seed::new(8).into_rng();
        let mut repeats = |worth: f64| (0..3).map(|_| worth + normal.sample(&mut rng)).collect::<Vec<f64>>();
        let means: Vec<Vec<f64>> = (0..60).map(|index| repeats(f64::from(index))).collect();
        for cut in [1, 7, 30, 59] {
            let race = Race { cut, looks: 2, level: 0.9 };
            let intervals = intervals(&means, &race);
            let is_open = |index: &usize| {
                let own = intervals[*index];
                let others = || intervals.iter().enumerate().filter(|(other, _)| other != index);
                others().filter(|(_, other)| other.high >= own.low).count() >= cut
                    && others().filter(|(_, other)| other.low > own.high).count() < cut
            };
            let wanted: Vec<usize> = (0..60).filter(is_open).collect();
            assert_eq!(contested(&means, &race), wanted, "{cut}");
            assert!(!wanted.is_empty() && wanted.len() < 60, "{cut}");
        }
    }

    #[test]
    fn decisions_are_right_as_often_as_the_level_says_however_often_one_looks() {
        let close = raced([0.0, 0.5, 1.0, 1.5, 2.0, 2.5], 1000);
        assert!(close.wrong <= 100, "{} of 1000 races put a demonstration on the wrong side", close.wrong);
        // Where the good ones are far ahead, nearly all of the six further repeats of all six are spared.
        let clear = raced([0.0, 1.0, 2.0, 3.0, 20.0, 21.0], 100);
        assert!(clear.wrong == 0 && clear.spared > 3000, "{} of 3600 repeats were spared", clear.spared);
    }
}
