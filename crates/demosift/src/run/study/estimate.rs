//! A mean over seeds with its interval, and a difference that is paired by seed.
//!
//! | of what | interval | why this one |
//! |---|---|---|
//! | a mean over seeds | percentile bootstrap | stays within the range of what was measured, which a correlation near 1 needs |
//! | a difference of pairs | Student's t | a bootstrap of ten pairs is too narrow by a fifth, and this interval decides |

use serde::{Deserialize, Serialize};

use super::curves::deviation;
use crate::basics::seed::Seed;
use crate::math::statistics::{
    mean, mean_at, mean_of, mean_or_zero, quantile, resample, squared_deviations, standard_error,
    student_quantile,
};

/// How sure an interval is.
pub const LEVEL: f64 = 0.95;
/// Pairs from which a difference can be told; fewer are named.
pub const ENOUGH_SEEDS: usize = 10;
/// Draws of a bootstrap.
const DRAWS: usize = 2000;

/// A mean over seeds with one standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// One standard deviation of the seeds; 0 of a single one.
    pub deviation: f64,
    /// How many.
    pub seeds: usize,
}

impl Spread {
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let (mean, deviation) = (mean_or_zero(values), deviation(values));
        (!values.is_empty()).then_some(Self { mean, deviation, seeds: values.len() })
    }
}

/// A mean over seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Lower end of its interval; the mean itself where there is a single seed.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
    /// Seeds.
    pub seeds: usize,
}

/// The mean of one value a seed with its bootstrap interval; `None` of nothing. The same values give the same bits.
pub fn estimate(values: &[f64]) -> Option<Estimate> {
    if values.is_empty() {
        return None;
    }
    let mut rng = Seed::new(0).of("study").into_rng();
    let mut drawn: Vec<f64> =
        (0..DRAWS).map(|_| mean_at(values, &resample(values.len(), &mut rng))).collect();
    drawn.sort_by(f64::total_cmp);
    let tail = (1.0 - LEVEL) / 2.0;
    Some(Estimate {
        mean: mean(values),
        low: quantile(&drawn, tail),
        high: quantile(&drawn, 1.0 - tail),
        seeds: values.len(),
    })
}

/// By how much one is above the other, and whether that can be told from luck.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Difference {
    /// The mean difference.
    pub mean: f64,
    /// Lower end of its interval; NaN would be no JSON, so it is missing where there is a single pair.
    pub interval: Option<[f64; 2]>,
    /// Standard error of the mean difference, from two pairs on.
    pub standard_error: Option<f64>,
    /// Degrees of freedom of that error.
    pub freedom: f64,
    /// Pairs; over several sets those of the set that has the fewest.
    pub pairs: usize,
}

impl Difference {
    /// Whether the interval is without 0.
    pub fn is_separable(&self) -> bool {
        self.interval.is_some_and(|[low, high]| low > 0.0 || high < 0.0)
    }

    /// Whether there is enough to decide anything.
    pub fn can_decide(&self) -> bool {
        self.pairs >= ENOUGH_SEEDS && self.interval.is_some()
    }

    /// With the interval of an error; without an error, or a degree of freedom, there is none.
    fn with_error(mean: f64, error: Option<f64>, freedom: f64, pairs: usize) -> Self {
        let half = error.and_then(|error| Some(error * student_quantile((1.0 - LEVEL) / 2.0, freedom)?));
        let interval = half.map(|half| [mean - half, mean + half]);
        Self { mean, interval, standard_error: error, freedom, pairs }
    }
}

/// The mean difference of pairs with its interval by Student's t; `None` of nothing.
pub fn paired_difference(pairs: &[(f64, f64)]) -> Option<Difference> {
    if pairs.is_empty() {
        return None;
    }
    let differences: Vec<f64> = pairs.iter().map(|(one, other)| one - other).collect();
    let (center, count) = (mean(&differences), differences.len());
    let error = (count > 1).then(|| standard_error(&differences));
    Some(Difference::with_error(center, error, (count - 1) as f64, count))
}

/// The mean difference of pairs that are held against a truth which was drawn as well, `[truth's seeds][pairs]`, each row with one
/// of the truth's seeds left out; `None` of nothing.
///
/// Its error holds the luck of the pairs and, by the jackknife, that of the truth, whose luck is the same in all pairs and does not
/// shrink with their number: s² = Var(pairs)/n + (m − 1)/m Σ (θ₋ᵢ − θ̄)², with the degrees of freedom of Welch and Satterthwaite.
/// There is no interval where the truth has one seed, whose luck nobody knows.
pub fn difference_beside_drawn(left_out: &[Vec<f64>]) -> Option<Difference> {
    let pairs = left_out.first().map(Vec::len).filter(|pairs| *pairs > 0)?;
    let by_pair: Vec<f64> = (0..pairs).map(|pair| mean_of(left_out.iter().map(|row| row[pair]))).collect();
    let center = mean(&by_pair);
    if left_out.len() < 2 || pairs < 2 {
        return Some(Difference::with_error(center, None, 0.0, pairs));
    }
    let (rows, own) = (left_out.len() as f64, standard_error(&by_pair).powi(2));
    let by_truth: Vec<f64> = left_out.iter().map(|row| mean(row)).collect();
    let of_truth = (rows - 1.0) / rows * squared_deviations(&by_truth);
    let fourths = own.powi(2) / (pairs - 1) as f64 + of_truth.powi(2) / (rows - 1.0);
    let freedom = if fourths > 0.0 { (own + of_truth).powi(2) / fourths } else { (pairs - 1) as f64 };
    Some(Difference::with_error(center, Some((own + of_truth).sqrt()), freedom, pairs))
}

/// The mean of differences that were found on sets of their own, which are what they are and no sample; one set counts as
/// much as another. `None` where no set has an error.
///
/// The interval is by Student's t with the degrees of freedom of Welch and Satterthwaite, so that few seeds stay few however
/// many sets they judge: (Σ s²)² / Σ s⁴/d for standard errors s with d degrees of freedom.
pub fn over_sets(differences: &[Difference]) -> Option<OverSets> {
    let known: Vec<(&Difference, f64)> =
        differences.iter().filter_map(|of| Some((of, of.standard_error?))).collect();
    let fewest = known.iter().map(|(of, _)| of.pairs).min()?;
    let squares: f64 = known.iter().map(|(_, error)| error.powi(2)).sum();
    let fourths: f64 = known.iter().map(|(of, error)| error.powi(4) / of.freedom).sum();
    let freedom = if fourths > 0.0 { squares.powi(2) / fourths } else { 1.0 };
    let error = squares.sqrt() / known.len() as f64;
    let center = mean_of(known.iter().map(|(of, _)| of.mean));
    let difference = Difference::with_error(center, Some(error), freedom, fewest);
    Some(OverSets { difference, sets: known.len() })
}

/// A difference over several sets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OverSets {
    /// With the pairs of the set that has the fewest.
    pub difference: Difference,
    /// How many sets there are.
    pub sets: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: [f64; 10] = [0.91, 0.88, 0.93, 0.79, 0.95, 0.9, 0.86, 0.92, 0.81, 0.94];
    const OTHER: [f64; 10] = [0.85, 0.9, 0.84, 0.75, 0.93, 0.78, 0.88, 0.83, 0.72, 0.9];

    /// Mean and interval of the pairs above, and of the first three; tests/references/study.py prints them.
    const TTEST_REL: [[f64; 3]; 2] = [
        [0.05100000000000001, 0.01670097579066456, 0.08529902420933547],
        [0.04333333333333337, -0.09792071635270774, 0.18458738301937447],
    ];

    #[test]
    fn a_paired_difference_agrees_with_scipy() {
        let pairs: Vec<(f64, f64)> = ONE.into_iter().zip(OTHER).collect();
        for (count, wanted) in [(10, TTEST_REL[0]), (3, TTEST_REL[1])] {
            let found = paired_difference(&pairs[..count]).expect("some");
            let [low, high] = found.interval.expect("more than one");
            for (found, wanted) in [found.mean, low, high].into_iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-9, "{found} and {wanted}");
            }
        }
        assert!(paired_difference(&pairs).expect("some").is_separable());
        assert!(!paired_difference(&pairs[..3]).expect("some").is_separable());
        let alone = paired_difference(&pairs[..1]).expect("some");
        assert!(alone.interval.is_none() && !alone.is_separable());
        assert!(paired_difference(&[]).is_none());
    }

    /// Every way to draw three values with replacement, by brute force.
    #[test]
    fn the_bootstrap_comes_near_all_ways_to_draw() {
        let values = [0.2, 0.9, 0.5, 0.7];
        let mut all: Vec<f64> = (0..256_usize)
            .map(|code| (0..4).map(|place| values[code / 4_usize.pow(place) % 4]).sum::<f64>() / 4.0)
            .collect();
        all.sort_by(f64::total_cmp);
        let found = estimate(&values).expect("some");
        assert!((found.low - quantile(&all, 0.025)).abs() < 0.03, "{found:?}");
        assert!((found.high - quantile(&all, 0.975)).abs() < 0.03, "{found:?}");
        assert_eq!(found, estimate(&values).expect("some"), "the same each time");
        let alone = estimate(&[0.3]).expect("one");
        assert_eq!((alone.low, alone.mean, alone.high), (0.3, 0.3, 0.3));
        assert!(estimate(&[]).is_none());
    }

    #[test]
    fn sets_count_alike_and_few_seeds_stay_few() {
        let of = |mean, standard_error, pairs: usize| Difference {
            mean,
            interval: None,
            standard_error,
            freedom: pairs as f64 - 1.0,
            pairs,
        };
        let found =
            over_sets(&[of(0.1, Some(0.03), 10), of(0.3, Some(0.04), 10), of(9.0, None, 1)]).expect("two");
        assert!((found.difference.mean - 0.2).abs() < 1e-12);
        assert!((found.difference.standard_error.expect("known") - 0.025).abs() < 1e-12);
        assert!(found.difference.is_separable() && found.sets == 2 && found.difference.pairs == 10);
        // One set alone has the interval that it has by itself; sets without any spread add no certainty.
        let pairs: Vec<(f64, f64)> = ONE.into_iter().zip(OTHER).take(3).collect();
        let alone = paired_difference(&pairs).expect("some");
        assert_eq!(over_sets(&[alone]).expect("one").difference, alone);
        let with_ties = over_sets(&[alone, of(0.0, Some(0.0), 3)]).expect("two").difference;
        let half = |of: Difference| of.interval.map(|[low, high]| high - low).expect("known");
        assert!((half(with_ties) - half(alone) / 2.0).abs() < 1e-9);
        // Many sets of two seeds are no ten pairs.
        let two = paired_difference(&[(0.9, 0.7), (0.8, 0.6)]).expect("two pairs");
        let many = over_sets(&[two; 5]).expect("five sets").difference;
        assert!(many.pairs == 2 && !many.can_decide());
        // Whatever their number and errors, one set alone keeps its degrees of freedom.
        for count in 2..=10 {
            let pairs: Vec<(f64, f64)> = ONE.into_iter().zip(OTHER).take(count).collect();
            let alone = paired_difference(&pairs).expect("some");
            assert!(
                (half(over_sets(&[alone]).expect("one").difference) - half(alone)).abs() < 1e-9,
                "{count}"
            );
        }
    }

    /// Rows of the same differences but for what the truth's seeds shift all of them by.
    #[test]
    fn what_a_drawn_truth_shifts_does_not_shrink_with_the_pairs() {
        let differences: Vec<f64> = ONE.into_iter().zip(OTHER).map(|(one, other)| one - other).collect();
        let shifted = |by: f64| differences.iter().map(|of| of + by).collect::<Vec<f64>>();
        let width = |of: &Difference| of.interval.map(|[low, high]| high - low).expect("known");
        let same = difference_beside_drawn(&[shifted(0.0), shifted(0.0), shifted(0.0)]).expect("some");
        let pairs: Vec<(f64, f64)> = ONE.into_iter().zip(OTHER).collect();
        let plain = paired_difference(&pairs).expect("some");
        assert!((same.mean - plain.mean).abs() < 1e-12 && (width(&same) - width(&plain)).abs() < 1e-9);
        let drawn = difference_beside_drawn(&[shifted(0.1), shifted(-0.1), shifted(0.0)]).expect("some");
        // The jackknife of 0.1, -0.1 and 0: 2/3 of 0.02.
        let wanted = (plain.standard_error.expect("known").powi(2) + 2.0 / 3.0 * 0.02).sqrt();
        assert!((drawn.standard_error.expect("known") - wanted).abs() < 1e-12, "{drawn:?}");
        assert!(plain.is_separable() && !drawn.is_separable());
        let alone = difference_beside_drawn(&[shifted(0.0)]).expect("some");
        assert!(alone.interval.is_none() && alone.pairs == 10 && !alone.can_decide());
    }
}
