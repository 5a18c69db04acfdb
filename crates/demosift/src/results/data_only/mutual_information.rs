//! Mutual information of state and action: states are diverse, and each says which action is taken.
//!
//! DemInf (Hejna et al. 2025, "Robot data curation with mutual information estimators") scores a demonstration by what
//! its pairs contribute, on average, to an estimate of I(S; A) over the set. The estimator counts neighbors
//! (Kraskov, Stögbauer and Grassberger 2004, "Estimating mutual information", their first one):
//!
//! i_t = ψ(k) + ψ(N) − ψ(n_s + 1) − ψ(n_a + 1)
//!
//! where n_s and n_a count the pairs whose state, or action, is nearer to that of pair t than its k-th neighbor in both.
//! As DemInf does, contributions are averaged over k = 5, 6, 7, distances are Euclidean within states and within actions
//! with the greater of the two for both, and contributions are clipped to their middle 98 %.
//!
//! What we simplify: DemInf learns variational autoencoders of images and of chunks of actions and measures in their
//! codes; here distances are those of the standardized observations and of single actions. DemInf looks for neighbors in
//! random batches of 1024; here in the whole set, thinned evenly where it is large.
//! Where k neighbors and more are the very same pair, as when a recording stands still, ties are counted as for
//! discrete values (Gao et al. 2017, "Estimating mutual information for discrete-continuous mixtures").

use rayon::prelude::*;

use super::{standard_actions, standard_observations};
use crate::basics::error::Result;
use crate::data::demonstration::DemonstrationSet;
use crate::math::rows::Rows;
use crate::math::statistics;

/// k of DemInf.
const NEIGHBORS: [usize; 3] = [5, 6, 7];
/// Pairs that are compared with each other at most; time grows with its square, and 6000 take about a second.
const MOST_PAIRS: usize = 6000;
/// Share of the contributions clipped at each end.
const CLIPPED: f64 = 0.01;

/// The mean contribution of each demonstration's pairs, in nats; nothing to say where neither states nor actions vary, or
/// where there are too few pairs for neighbors.
pub fn mutual_information(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    let (states, actions) = (standard_observations(set), standard_actions(set));
    // One group of a set that is not large. Neighbors of a group are as good as those of the whole set: each is a part of it,
    // evenly spread, and as many pairs as are compared at most.
    let groups = set.len().div_ceil(MOST_PAIRS);
    let mut means = vec![0.0; set.len()];
    for group in 0..groups {
        let members: Vec<usize> = (group..set.len()).step_by(groups).collect();
        let Some(found) = of_group(&states, &actions, &members) else { return Ok(None) };
        members.iter().zip(found).for_each(|(&member, mean)| means[member] = mean);
    }
    Ok(Some(means))
}

/// The same for some of the demonstrations, whose pairs are compared with each other alone.
fn of_group(states: &[Rows], actions: &[Rows], members: &[usize]) -> Option<Vec<f64>> {
    let total: usize = members.iter().map(|&member| states[member].len()).sum();
    let stride = total.div_ceil(MOST_PAIRS).max(1);
    let (mut s, mut a) =
        (Rows::with_capacity(states[0].width(), 0), Rows::with_capacity(actions[0].width(), 0));
    let mut ends = Vec::with_capacity(members.len());
    for &member in members {
        for step in (0..states[member].len()).step_by(stride) {
            s.push(states[member].row(step));
            a.push(actions[member].row(step));
        }
        ends.push(s.len());
    }
    let [.., most] = NEIGHBORS;
    if s.width() == 0 || a.width() == 0 || s.len() <= most {
        return None;
    }
    let contributions = clipped(contributions(&s, &a));
    let starts = [0].into_iter().chain(ends.iter().copied());
    Some(starts.zip(&ends).map(|(start, &end)| statistics::mean(&contributions[start..end])).collect())
}

/// i of every pair, the mean over k; their mean estimates I(S; A) in nats.
fn contributions(states: &Rows, actions: &Rows) -> Vec<f64> {
    let count = states.len();
    let digamma = digammas(count + 1);
    let of = |index: usize| {
        let (s, a) = (distances(states, index), distances(actions, index));
        let mut both: Vec<f32> = s.iter().zip(&a).map(|(s, a)| s.max(*a)).collect();
        both.sort_unstable_by(f32::total_cmp);
        let contribution = |k: usize| {
            // The pair itself stands first, at distance 0.
            let reach = both[k];
            let (k, nearer): (usize, fn(f32, f32) -> bool) = if reach > 0.0 {
                (k, |distance, reach| distance < reach)
            } else {
                (both.iter().filter(|distance| **distance == 0.0).count() - 1, |distance, _| distance == 0.0)
            };
            // Counts hold the pair itself, which makes them n + 1.
            let n = |distances: &[f32]| distances.iter().filter(|distance| nearer(**distance, reach)).count();
            digamma[k] + digamma[count] - digamma[n(&s)] - digamma[n(&a)]
        };
        statistics::mean(&NEIGHBORS.map(contribution))
    };
    (0..count).into_par_iter().map(of).collect()
}

/// Euclidean distances of all rows to one.
fn distances(rows: &Rows, index: usize) -> Vec<f32> {
    let center = rows.row(index);
    let distance = |row: &[f32]| row.iter().zip(center).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
    rows.iter().map(distance).collect()
}

/// ψ(n) = −γ + Σ_{j<n} 1/j for n from 1 to `most`; place 0 is never asked for.
fn digammas(most: usize) -> Vec<f64> {
    const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;
    let mut values = vec![f64::NAN, -EULER_GAMMA];
    (1..most).for_each(|n| values.push(values[n] + 1.0 / n as f64));
    values
}

/// With the lowest and the highest hundredth brought in to where the rest begins.
fn clipped(mut values: Vec<f64>) -> Vec<f64> {
    let mut sorted = values.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64).round() as usize];
    let (low, high) = (at(CLIPPED), at(1.0 - CLIPPED));
    values.iter_mut().for_each(|value| *value = value.clamp(low, high));
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use crate::data::demonstration::Demonstration;
    use crate::world::point_mass::planted_set;
    use rand_distr::{Distribution, StandardNormal};

    fn normal(len: usize, seed: u64) -> Vec<f32> {
        let mut rng = Seed::new(seed).into_rng();
        (0..len).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// Jointly normal columns with correlation ρ have I = −½ ln(1 − ρ²) nats, and of two independent such pairs twice that.
    #[test]
    fn the_estimate_is_that_of_the_closed_form_for_normal_variables() {
        for rho in [0.0, 0.5, 0.9_f32] {
            for columns in [1, 2] {
                let count = 2000;
                let (x, noise) = (normal(count * columns, 1), normal(count * columns, 2));
                let y = x
                    .iter()
                    .zip(&noise)
                    .map(|(x, noise)| rho * x + (1.0 - rho * rho).sqrt() * noise)
                    .collect();
                let (x, y) = (Rows::from_flat(x, columns).unwrap(), Rows::from_flat(y, columns).unwrap());
                let found = contributions(&x, &y).iter().sum::<f64>() / count as f64;
                let exact = -0.5 * (1.0 - f64::from(rho * rho)).ln() * columns as f64;
                assert!(
                    (found - exact).abs() < 0.06,
                    "rho {rho}, columns {columns}: {found}, exactly {exact}"
                );
            }
        }
    }

    /// Two values each, always the same: I = ln 2 nats.
    #[test]
    fn repeated_pairs_are_counted_as_discrete_values() {
        let x: Vec<f32> = (0..1000).map(|index| (index % 2) as f32).collect();
        let rows = Rows::from_flat(x, 1).unwrap();
        let found = contributions(&rows, &rows).iter().sum::<f64>() / 1000.0;
        assert!((found - std::f64::consts::LN_2).abs() < 0.01, "{found}");
    }

    #[test]
    fn actions_that_do_not_depend_on_the_state_are_told() {
        let set = planted_set(&[0.0, 5.0, -5.0, 10.0, -10.0, 2.0], Seed::new(1)).unwrap();
        let mut demonstrations: Vec<Demonstration> = set.iter().map(|(_, one)| one.clone()).collect();
        let steps = demonstrations[3].steps();
        let random = Rows::from_flat(normal(2 * steps, 3), 2).unwrap();
        demonstrations[3] = Demonstration::new(demonstrations[3].observations().clone(), random).unwrap();
        let found = mutual_information(&DemonstrationSet::new(demonstrations).unwrap()).unwrap().unwrap();
        let lowest = (0..6).min_by(|a, b| found[*a].total_cmp(&found[*b]));
        assert_eq!(lowest, Some(3), "{found:?}");
    }

    #[test]
    fn what_never_varies_says_nothing() {
        let rows = || Rows::from_flat(vec![0.5; 20], 1).unwrap();
        let one = Demonstration::new(rows(), rows()).unwrap();
        assert_eq!(
            mutual_information(&DemonstrationSet::new(vec![one.clone(), one]).unwrap()).unwrap(),
            None
        );
    }
}
