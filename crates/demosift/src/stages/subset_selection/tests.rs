use super::*;
use crate::run::preset::Preset;
use crate::world::environment::EnvVariant;

fn how() -> SubsetSelection {
    SubsetSelection {
        beta: 1.5,
        epsilon: 1.0,
        floor: 0.01,
        smallest: 1,
        ..Preset::Quick.config().subset_selection
    }
}

fn suitability(variant: usize, demo: usize, before: &[f64], after: &[f64]) -> Suitability {
    Suitability {
        demo: DemoId(demo),
        variant: EnvVariant(variant),
        before: vec![before.to_vec()],
        after: vec![after.to_vec()],
        distances: Vec::new(),
        curves: Vec::new(),
        evaluated: None,
    }
}

fn values(weights: &Weights) -> Vec<f64> {
    weights.iter().map(|(_, weight)| weight).collect()
}

#[test]
fn algorithm_3_line_6_subtracts_the_baseline_once_and_divides_by_the_spread() {
    // Under the first variant the episodes are 0, 2, 4, 4, −2, −2: mean 1, squared deviations 1, 1, 9, 9, 9, 9.
    let table = ScoreTable::new(vec![
        suitability(0, 0, &[0.0, 2.0], &[4.0, 4.0]),
        suitability(0, 1, &[0.0, 2.0], &[-2.0, -2.0]),
        suitability(1, 0, &[5.0, 5.0], &[5.0, 5.0]),
        suitability(1, 1, &[5.0, 5.0], &[5.0, 5.0]),
    ]);
    let spread = (38.0_f64 / 6.0).sqrt();
    // The second variant tells nothing, and counts as no difference.
    assert_eq!(deltas(&table, 2), [3.0 / spread / 2.0, -3.0 / spread / 2.0]);
    let one = ScoreTable::new(table.suitabilities[..2].to_vec());
    assert_eq!(deltas(&one, 2), [3.0 / spread, -3.0 / spread]);
}

#[test]
fn algorithm_3_line_6_has_no_unit() {
    let table = |unit: f64| {
        ScoreTable::new(vec![
            suitability(0, 0, &[0.5 * unit, 1.5 * unit], &[2.0 * unit, 2.25 * unit]),
            suitability(0, 1, &[0.5 * unit, 1.5 * unit], &[0.75 * unit, 0.25 * unit]),
        ])
    };
    let (millimeters, light_years) = (deltas(&table(1e3), 2), deltas(&table(1e-16), 2));
    assert!(millimeters.iter().zip(&light_years).all(|(one, other)| (one - other).abs() < 1e-9));
}

/// The claim with which the module rules out an overflow, tried on sets made to break it.
#[test]
fn algorithm_3_line_6_is_bounded_by_the_size_of_the_set() {
    for count in [1, 2, 10, 100] {
        for outlier in 0..count.min(3) {
            for (before, others) in [(0.0, 0.0), (0.0, 5e9), (-1e10, 0.0), (0.0, 1e10)] {
                let after = |demo: usize| if demo == outlier { 1e10 } else { others };
                let suitabilities =
                    (0..count).map(|demo| suitability(0, demo, &[before; 3], &[after(demo); 3])).collect();
                let deltas = deltas(&ScoreTable::new(suitabilities), count);
                let bound = (2.0 + 2.0 * count as f64).sqrt();
                assert!(deltas.iter().all(|delta| delta.abs() <= bound + 1e-9), "{count}: {deltas:?}");
                assert!(deltas.iter().all(|delta| delta.exp().is_finite()));
            }
        }
    }
}

/// Lines 7 to 11 with the corrected sign, number by number.
#[test]
fn algorithm_3_lines_7_to_11_multiply_by_beta_and_the_exponential() {
    let weights = Weights::new(vec![1.0, 2.0, 0.5, 1.0]);
    let found = values(&adjusted(&weights, &[0.3, -0.7, 0.0, -4.0], &how()));
    let e = std::f64::consts::E;
    let product = [1.5 * e.powf(0.3), 2.0 / 1.5 * e.powf(-0.7), 0.5 / 1.5, e.powf(-4.0) / 1.5];
    let mean = product.iter().sum::<f64>() / 4.0;
    let wanted = product.map(|weight| weight / mean);
    assert!(found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-12), "{found:?}");
}

#[test]
fn algorithm_3_a_good_demonstration_never_loses_weight_and_a_bad_one_never_gains_any() {
    for delta in [1e-9, 0.1, 3.0, 28.0] {
        let found = values(&adjusted(&Weights::new(vec![1.0; 2]), &[delta, -delta], &how()));
        assert!(found[0] > 1.0 && found[1] < 1.0, "{delta}: {found:?}");
    }
}

#[test]
fn algorithm_3_weights_neither_overflow_nor_vanish() {
    let mut weights = Weights::new(vec![1.0; 2]);
    for _ in 0..1000 {
        weights = adjusted(&weights, &[14.0, -14.0], &how());
    }
    let found = values(&weights);
    assert!((found[0] - 2.0).abs() < 1e-6 && found[1] == 0.01, "{found:?}");
    // Who was misjudged comes back within a few rounds.
    for _ in 0..3 {
        weights = adjusted(&weights, &[-1.0, 1.0], &how());
    }
    assert_eq!(kept(&weights, &how()), [DemoId(1)]);
}

/// Once θ is as good as the best, no Δ is above 0; the good ones do not fall below the mean for that.
#[test]
fn algorithm_3_weights_are_compared_with_each_other() {
    let mut weights = Weights::new(vec![1.0; 3]);
    for _ in 0..5 {
        weights = adjusted(&weights, &[-0.1, -0.12, -1.4], &how());
    }
    assert_eq!(kept(&weights, &how()), [DemoId(0), DemoId(1)]);
    let alone = adjusted(&Weights::new(vec![1.0; 1]), &[-3.0], &how());
    assert_eq!(values(&alone), [1.0]);
}

#[test]
fn algorithm_3_line_15_keeps_what_is_above_the_threshold_and_never_too_few() {
    let weights = Weights::new(vec![0.2, 3.0, 1.0, 1.1, 0.2]);
    let ids = |how: &SubsetSelection| kept(&weights, how).iter().map(|demo| demo.0).collect::<Vec<_>>();
    assert_eq!(ids(&how()), [1, 3], "1 is not above 1");
    assert_eq!(ids(&SubsetSelection { epsilon: 0.1, ..how() }), [1, 3, 2, 0, 4], "ties by id");
    assert_eq!(ids(&SubsetSelection { epsilon: 50.0, ..how() }), [1]);
    assert_eq!(ids(&SubsetSelection { epsilon: 50.0, smallest: 4, ..how() }), [1, 3, 2, 0]);
}

#[test]
fn algorithm_3_ends_when_the_subset_stays_or_the_rounds_are_up() {
    let how = SubsetSelection { rounds: 5, steady_rounds: 3, ..how() };
    let round = |weights: [f64; 3]| Weighed {
        baseline: 0.0,
        scores: vec![0.0; 3],
        deltas: vec![0.0; 3],
        weights: Weights::new(weights.to_vec()),
    };
    let (first, second) = (round([2.0, 0.5, 0.5]), round([0.5, 2.0, 0.5]));
    let both = [round([2.0, 3.0, 0.5]), round([3.0, 2.0, 0.5])];
    let all = round([2.0, 2.0, 1.5]);
    let rounds = |rounds: &[&Weighed]| rounds.iter().map(|&round| round.clone()).collect::<Vec<_>>();
    assert_eq!(end(&[], &how), None);
    assert_eq!(end(&rounds(&[&first, &first]), &how), None);
    assert_eq!(end(&rounds(&[&first, &first, &first]), &how), Some(WeighingEnd::Converged));
    assert_eq!(end(&rounds(&[&first, &first, &second]), &how), None);
    // The same subset in another order is the same subset.
    assert_eq!(end(&rounds(&[&both[0], &both[1], &both[0]]), &how), Some(WeighingEnd::Converged));
    // Everybody counts at first, so that everybody is kept says nothing.
    assert_eq!(end(&rounds(&[&all, &all, &all]), &how), None);
    assert_eq!(end(&rounds(&[&all, &first, &first, &first]), &how), Some(WeighingEnd::Converged));
    let restless = rounds(&[&first, &second, &first, &second, &first]);
    assert_eq!(end(&restless, &how), Some(WeighingEnd::RoundLimit));
    assert_eq!(end(&restless[..4], &how), None);
}

#[test]
fn a_round_takes_the_mean_of_the_last_iterates_as_judging_does() {
    let of = |preset: Preset| {
        let config = preset.config();
        let few = assessing(&config.subset_selection, &config.judge);
        (few.averaged, few.iterations)
    };
    assert_eq!([of(Preset::Quick), of(Preset::Standard), of(Preset::Paper)], [(2, 5), (3, 8), (1, 5)]);
}
