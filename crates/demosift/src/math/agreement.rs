//! How well a ranking agrees with another opinion, such as that of the oracle.

use crate::math::statistics::mean;

/// Spearman's rank correlation of two lists of values, ties sharing their mean rank; NaN if one list is constant.
///
/// ```
/// let (ours, oracle) = ([0.9, 0.1, 0.5], [10.0, 2.0, 7.0]);
/// assert_eq!(demosift::math::agreement::spearman(&ours, &oracle), 1.0);
/// ```
pub fn spearman(left: &[f64], right: &[f64]) -> f64 {
    pearson(&ranks(left), &ranks(right))
}

/// Kendall's rank correlation of two lists of values, its form τ-b, which allows for ties; NaN if one list is constant.
///
/// Of all pairs, those ordered alike less those ordered oppositely, by the geometric mean of the pairs that are not
/// tied on the left and of those that are not tied on the right (Kendall 1945, "The treatment of ties").
///
/// ```
/// let (ours, oracle) = ([0.9, 0.1, 0.5], [10.0, 7.0, 2.0]); // one pair of three the other way round
/// assert!((demosift::math::agreement::kendall(&ours, &oracle) - 1.0 / 3.0).abs() < 1e-12);
/// ```
pub fn kendall(left: &[f64], right: &[f64]) -> f64 {
    let (mut agreement, mut untied_left, mut untied_right) = (0.0, 0.0, 0.0);
    for i in 0..left.len() {
        for j in 0..i {
            let (a, b) = (order(left[i], left[j]), order(right[i], right[j]));
            agreement += a * b;
            untied_left += a.abs();
            untied_right += b.abs();
        }
    }
    agreement / (untied_left * untied_right).sqrt()
}

/// 1, 0 or −1.
fn order(one: f64, other: f64) -> f64 {
    f64::from(one > other) - f64::from(one < other)
}

/// Which share of our K highest values are among the K highest of a reference, from 0 to 1; NaN if K is 0.
///
/// Where a tie straddles the K-th place its members share the places left, so the result is the mean over all ways to
/// break ties and does not depend on the order of the values.
///
/// ```
/// let (ours, oracle) = ([0.9, 0.1, 0.5, 0.2], [10.0, 2.0, 1.0, 7.0]);
/// assert_eq!(demosift::math::agreement::hit_rate(&ours, &oracle, 2), 0.5); // of the first and third only the first
/// ```
pub fn hit_rate(ours: &[f64], reference: &[f64], k: usize) -> f64 {
    let both =
        membership(ours, k).into_iter().zip(membership(reference, k)).map(|(ours, theirs)| ours * theirs);
    both.sum::<f64>() / k as f64
}

/// How much of each value is among the K highest: 1, 0, or a share in the places for which it is tied.
fn membership(values: &[f64], k: usize) -> Vec<f64> {
    let of = |Place { below, equal }: Place| {
        let above = values.len() - below - equal;
        // What is not a number has no equal, and is not among the highest.
        if equal == 0 { 0.0 } else { (k.saturating_sub(above) as f64 / equal as f64).min(1.0) }
    };
    places(values).into_iter().map(of).collect()
}

/// The rank of each value from 1, the lowest, ties sharing their mean rank.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mean_rank = |Place { below, equal }: Place| below as f64 + (equal as f64 + 1.0) / 2.0;
    places(values).into_iter().map(mean_rank).collect()
}

/// How many of the values are lower than one of them, and how many the same, itself among them.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    below: usize,
    equal: usize,
}

/// In time proportional to n log n; nothing is lower than NaN or the same.
fn places(values: &[f64]) -> Vec<Place> {
    let mut ascending: Vec<usize> = (0..values.len()).filter(|&at| !values[at].is_nan()).collect();
    ascending.sort_unstable_by(|&one, &other| values[one].total_cmp(&values[other]));
    let (mut places, mut below) = (vec![Place::default(); values.len()], 0);
    for alike in ascending.chunk_by(|&one, &other| values[one] == values[other]) {
        alike.iter().for_each(|&at| places[at] = Place { below, equal: alike.len() });
        below += alike.len();
    }
    places
}

fn pearson(left: &[f64], right: &[f64]) -> f64 {
    let (left_mean, right_mean) = (mean(left), mean(right));
    let product = |a: &[f64], a_mean: f64, b: &[f64], b_mean: f64| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - a_mean) * (b - b_mean)).sum()
    };
    let scale = product(left, left_mean, left, left_mean) * product(right, right_mean, right, right_mean);
    product(left, left_mean, right, right_mean) / scale.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.stats.spearmanr of the same lists.
    #[test]
    fn spearman_agrees_with_scipy() {
        let left = [106.0, 86.0, 100.0, 101.0, 99.0, 103.0, 97.0, 113.0, 112.0, 110.0];
        let right = [7.0, 0.0, 27.0, 50.0, 28.0, 29.0, 20.0, 12.0, 6.0, 17.0];
        assert!((spearman(&left, &right) - -0.175_757_575_757_575_75).abs() < 1e-12);
        let tied = [1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0, 5.0, 9.0];
        assert!((spearman(&tied, &left) - 0.524_781_348_825_117_3).abs() < 1e-12);
    }

    /// scipy.stats.kendalltau of the same lists; tests/references/kendall.py prints them.
    #[test]
    fn kendall_agrees_with_scipy() {
        let left = [106.0, 86.0, 100.0, 101.0, 99.0, 103.0, 97.0, 113.0, 112.0, 110.0];
        let right = [7.0, 0.0, 27.0, 50.0, 28.0, 29.0, 20.0, 12.0, 6.0, 17.0];
        let tied = [1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0, 5.0, 9.0];
        let tied_too = [2.0, 2.0, 1.0, 1.0, 7.0, 3.0, 3.0, 3.0, 8.0, 8.0];
        for (left, right, wanted) in
            [(left, right, KENDALL[0]), (tied, left, KENDALL[1]), (tied, tied_too, KENDALL[2])]
        {
            assert!((kendall(&left, &right) - wanted).abs() < 1e-12);
            assert_eq!(kendall(&left, &right), kendall(&right, &left));
        }
        assert!(kendall(&[1.0, 1.0], &[1.0, 2.0]).is_nan());
    }

    const KENDALL: [f64; 3] = [-0.1111111111111111, 0.3299831645537222, 0.6076436202501999];

    /// The definition, pair by pair, with ties, zeros of both signs and what is no number.
    #[test]
    fn places_are_counted_as_defined() {
        let values =
            [2.0, -0.0, 1.0, 0.0, f64::NAN, 2.0, f64::INFINITY, -3.0, 2.0, f64::NAN, f64::NEG_INFINITY];
        for (value, place) in values.iter().zip(places(&values)) {
            let count =
                |is_it: fn(f64, f64) -> bool| values.iter().filter(|other| is_it(**other, *value)).count();
            assert_eq!(place.below, count(|other, value| other < value), "below {value}");
            assert_eq!(place.equal, count(|other, value| other == value), "as {value}");
        }
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [3.5, 1.0, 3.5, 2.0]);
    }

    /// Every way to order the values of a tie, by brute force.
    #[test]
    fn hit_rate_is_the_mean_over_the_ways_to_break_ties() {
        let (ours, reference) = ([3.0, 1.0, 1.0, 2.0, 1.0], [5.0, 4.0, 9.0, 0.0, 4.0]);
        let top = |values: &[f64; 5], order: &[usize; 5], k: usize| -> Vec<usize> {
            let mut ids = order.to_vec();
            ids.sort_by(|&a, &b| values[b].total_cmp(&values[a])); // stable, so ties stay in the order given
            ids[..k].to_vec()
        };
        let orders: Vec<[usize; 5]> = (0..5_usize.pow(5))
            .map(|code| std::array::from_fn(|place| code / 5_usize.pow(place as u32) % 5))
            .filter(|order| (0..5).all(|id| order.contains(&id)))
            .collect();
        assert_eq!(orders.len(), 120);
        for k in 1..=5 {
            let mut hits = 0;
            for one in &orders {
                for other in &orders {
                    let theirs = top(&reference, other, k);
                    hits += top(&ours, one, k).iter().filter(|id| theirs.contains(id)).count();
                }
            }
            let wanted = hits as f64 / (120.0 * 120.0 * k as f64);
            assert!((hit_rate(&ours, &reference, k) - wanted).abs() < 1e-12, "K = {k}");
        }
        assert_eq!(hit_rate(&ours, &reference, 5), 1.0);
    }

    #[test]
    fn spearman_of_the_same_order_is_one_and_of_the_opposite_minus_one() {
        assert_eq!(spearman(&[1.0, 5.0, 9.0], &[0.1, 0.2, 7.0]), 1.0);
        assert_eq!(spearman(&[1.0, 5.0, 9.0], &[3.0, 2.0, 1.0]), -1.0);
    }
}
