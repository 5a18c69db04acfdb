//! What a judgment and the policies that came of it are worth (§5.2).

mod agreement;
mod decline;
mod gain;

pub use agreement::{hit_rate, kendall, ranks, spearman};
pub use decline::{Decline, decline};
pub use gain::{AgainstRandom, Gain, against_random, gain, share_of_best};

/// The mean of some values; NaN if there are none.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
