//! A mean over seeds with its interval, and a difference that is paired by seed.
//!
//! | of what | interval | why this one |
//! |---|---|---|
//! | a mean over seeds | percentile bootstrap | stays within the range of what was measured, which a correlation near 1 needs |
//! | a difference of pairs | Student's t | a bootstrap of ten pairs is too narrow by a fifth, and this interval decides |

use serde::{Deserialize, Serialize};

use super::curves::deviation;
use crate::basics::seed::Seed;
use crate::math::statistics::{mean, mean_at, mean_of, mean_or_zero, quantile, resample, standard_error};

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
    /// Pairs.
    pub pairs: usize,
}

impl Difference {
    /// Whether the interval is without 0.
    pub fn is_separable(&self) -> bool {
        self.interval.is_some_and(|[low, high]| low > 0.0 || high < 0.0)
    }
}

/// The mean difference of pairs with its interval by Student's t; `None` of nothing.
pub fn paired_difference(pairs: &[(f64, f64)]) -> Option<Difference> {
    if pairs.is_empty() {
        return None;
    }
    let differences: Vec<f64> = pairs.iter().map(|(one, other)| one - other).collect();
    let (center, count) = (mean(&differences), differences.len());
    let standard_error = (count > 1).then(|| standard_error(&differences));
    let half = standard_error.map(|error| error * t_quantile(count - 1));
    let interval = half.map(|half| [center - half, center + half]);
    Some(Difference { mean: center, interval, standard_error, pairs: count })
}

/// The mean of differences that were found on sets of their own, which are what they are and no sample; one set counts as
/// much as another. `None` where no set has an error.
///
/// The interval is by Student's t with the degrees of freedom of Welch and Satterthwaite, so that few seeds stay few however
/// many sets they judge: (Σ s²)² / Σ s⁴/(n − 1) for standard errors s of n pairs.
pub fn over_sets(differences: &[Difference]) -> Option<OverSets> {
    let known: Vec<(f64, f64, usize)> =
        differences.iter().filter_map(|of| Some((of.mean, of.standard_error?, of.pairs))).collect();
    if known.is_empty() {
        return None;
    }
    let count = known.len() as f64;
    let center = mean_of(known.iter().map(|(mean, ..)| *mean));
    let squares: f64 = known.iter().map(|(_, error, _)| error.powi(2)).sum();
    let fourths: f64 = known.iter().map(|(_, error, pairs)| error.powi(4) / (pairs - 1) as f64).sum();
    let error = squares.sqrt() / count;
    let degrees = if fourths > 0.0 { (squares.powi(2) / fourths) as usize } else { 1 };
    let half = error * t_quantile(degrees.max(1));
    let difference = Difference {
        mean: center,
        interval: Some([center - half, center + half]),
        standard_error: Some(error),
        pairs: known.iter().map(|(.., pairs)| pairs).sum(),
    };
    Some(OverSets { difference, sets: known.len() })
}

/// A difference over several sets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OverSets {
    /// With the pairs of all sets.
    pub difference: Difference,
    /// How many sets there are.
    pub sets: usize,
}

/// The 97.5 % quantile of Student's t: stored for few degrees of freedom, by the expansion of Cornish and Fisher for more.
fn t_quantile(degrees: usize) -> f64 {
    const STORED: [f64; 12] = [
        12.706204736174694,
        4.302652729749462,
        3.1824463052837078,
        2.7764451051977934,
        2.5705818356363146,
        2.4469118511449786,
        2.364624251592784,
        2.306004135204166,
        2.262157162798205,
        2.228138851986274,
        2.200985160091639,
        2.1788128296672284,
    ];
    if let Some(stored) = degrees.checked_sub(1).and_then(|index| STORED.get(index)) {
        return *stored;
    }
    let (z, n) = (1.959_963_984_540_054_f64, degrees as f64);
    let first = (z.powi(3) + z) / 4.0;
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    z + first / n + second / n.powi(2) + third / n.powi(3)
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
    const T_975: [(usize, f64); 9] = [
        (1, 12.706204736174694),
        (2, 4.302652729749462),
        (5, 2.5705818356363146),
        (9, 2.262157162798205),
        (12, 2.1788128296672284),
        (13, 2.1603686564627913),
        (20, 2.085963447265864),
        (30, 2.0422724563012378),
        (99, 1.9842169515864174),
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

    #[test]
    fn the_quantile_of_t_agrees_with_scipy() {
        for (degrees, wanted) in T_975 {
            assert!((t_quantile(degrees) - wanted).abs() < 1e-4, "{degrees}: {}", t_quantile(degrees));
        }
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
        let of = |mean, standard_error, pairs| Difference { mean, interval: None, standard_error, pairs };
        let found =
            over_sets(&[of(0.1, Some(0.03), 10), of(0.3, Some(0.04), 10), of(9.0, None, 1)]).expect("two");
        assert!((found.difference.mean - 0.2).abs() < 1e-12);
        assert!((found.difference.standard_error.expect("known") - 0.025).abs() < 1e-12);
        assert!(found.difference.is_separable() && found.sets == 2 && found.difference.pairs == 20);
        // One set alone has the interval that it has by itself; sets without any spread add no certainty.
        let pairs: Vec<(f64, f64)> = ONE.into_iter().zip(OTHER).take(3).collect();
        let alone = paired_difference(&pairs).expect("some");
        assert_eq!(over_sets(&[alone]).expect("one").difference, alone);
        let with_ties = over_sets(&[alone, of(0.0, Some(0.0), 3)]).expect("two").difference;
        let half = |of: Difference| of.interval.map(|[low, high]| high - low).expect("known");
        assert!((half(with_ties) - half(alone) / 2.0).abs() < 1e-12);
    }
}
