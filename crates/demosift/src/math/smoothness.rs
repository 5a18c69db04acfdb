//! How smooth a motion is, told from its frequencies.
//!
//! Spectral arc length: Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet 2015, "On the analysis of movement smoothness".
//! Both need no rate of the steps: frequencies are counted in cycles a step.

/// Zeros behind the profile make its spectrum this much denser (the paper's padding level of 4).
const PADDING: usize = 16;
/// The spectrum is followed as far as it reaches this share of its greatest value.
const AMPLITUDE: f64 = 0.05;
/// Frequencies above are shaking rather than motion, in cycles a step: a period of less than eight steps.
const FAST: f64 = 0.125;

/// Minus the arc length of the amplitude spectrum of a speed profile; nearer to 0 is smoother. `None` where nothing moves.
///
/// −Σ √((Δω / ω_c)² + ΔV̂²), V̂ the spectrum by its greatest value, ω up to ω_c, the last at which V̂ ≥ 0.05.
pub fn spectral_arc_length(speeds: &[f64]) -> Option<f64> {
    let power = power_spectrum(speeds, PADDING);
    let greatest = power.iter().copied().fold(0.0, f64::max).sqrt();
    if !(greatest > 0.0 && greatest.is_finite()) {
        return None;
    }
    let amplitudes: Vec<f64> = power.iter().map(|power| power.sqrt() / greatest).collect();
    let cut = amplitudes.iter().rposition(|amplitude| *amplitude >= AMPLITUDE)?.max(1);
    let step = 1.0 / cut as f64;
    let along = amplitudes[..=cut].windows(2).map(|pair| step.hypot(pair[1] - pair[0]));
    Some(-along.sum::<f64>())
}

/// The power of each of several signals together that lies above [`FAST`], and all of it; from the power spectral density of
/// their changes from step to step, so that slow drifts do not count.
pub fn fast_power(signal: &[f64]) -> (f64, f64) {
    let changes: Vec<f64> = signal.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let power = power_spectrum(&changes, 1);
    let last = power.len().saturating_sub(1).max(1) as f64;
    let is_fast = |index: usize| 0.5 * index as f64 / last > FAST;
    let fast = power.iter().enumerate().filter(|(index, _)| is_fast(*index)).map(|(_, power)| power);
    (fast.sum(), power.iter().sum())
}

/// |FFT|² at the frequencies from 0 to half a cycle a step, of the signal with zeros behind it: at least `padding` times its
/// length in all.
fn power_spectrum(signal: &[f64], padding: usize) -> Vec<f64> {
    let len = (signal.len().max(1).next_power_of_two() * padding).max(2);
    let mut values: Vec<[f64; 2]> = signal.iter().map(|&value| [value, 0.0]).collect();
    values.resize(len, [0.0; 2]);
    transform(&mut values);
    values[..=len / 2].iter().map(|[real, imaginary]| real * real + imaginary * imaginary).collect()
}

/// The fast Fourier transform of Cooley and Tukey 1965, in place; the length is a power of two.
fn transform(values: &mut [[f64; 2]]) {
    let len = values.len();
    let bits = len.trailing_zeros();
    for index in 0..len {
        let mirrored = index.reverse_bits() >> (usize::BITS - bits);
        if index < mirrored {
            values.swap(index, mirrored);
        }
    }
    let mut half = 1;
    while half < len {
        let angle = -std::f64::consts::PI / half as f64;
        for block in values.chunks_exact_mut(2 * half) {
            let (evens, odds) = block.split_at_mut(half);
            for (index, (even, odd)) in evens.iter_mut().zip(odds).enumerate() {
                let (sine, cosine) = (angle * index as f64).sin_cos();
                let turned = [odd[0] * cosine - odd[1] * sine, odd[0] * sine + odd[1] * cosine];
                (*even, *odd) =
                    ([even[0] + turned[0], even[1] + turned[1]], [even[0] - turned[0], even[1] - turned[1]]);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    /// The sum that the transform is defined by.
    #[test]
    fn the_transform_is_that_of_its_definition() {
        let signal: Vec<f64> = (0..8).map(|step| f64::from(step * step % 5) - 1.5).collect();
        let found = power_spectrum(&signal, 1);
        for (frequency, power) in found.iter().enumerate() {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (step, value) in signal.iter().enumerate() {
                let angle = std::f64::consts::TAU * (frequency * step) as f64 / 8.0;
                (real, imaginary) = (real + value * angle.cos(), imaginary - value * angle.sin());
            }
            assert!((power - (real * real + imaginary * imaginary)).abs() < 1e-9, "{frequency}");
        }
    }

    #[test]
    fn one_bell_is_smoother_than_several_whatever_its_size() {
        let bells = |count: usize| -> Vec<f64> {
            let speed = |step: usize| (std::f64::consts::PI * (step * count) as f64 / 100.0).sin().powi(2);
            (0..=100).map(speed).collect()
        };
        let lengths: Vec<f64> = [1, 2, 5].map(|count| spectral_arc_length(&bells(count)).unwrap()).to_vec();
        assert!(lengths.is_sorted_by(|smoother, other| smoother > other), "{lengths:?}");
        let large: Vec<f64> = bells(2).iter().map(|speed| 1000.0 * speed).collect();
        assert!((spectral_arc_length(&large).unwrap() - lengths[1]).abs() < 1e-9);
        assert_eq!(spectral_arc_length(&[0.0; 20]), None);
    }

    #[test]
    fn shaking_is_fast_and_motion_is_not() {
        let share = |motion: &dyn Fn(f64) -> f64| {
            let (fast, all) = fast_power(&(0..65).map(|step| motion(f64::from(step))).collect::<Vec<_>>());
            fast / all
        };
        assert!(share(&|step| (0.1 * step).sin()) < 0.05);
        assert!(share(&|step| (3.0 * step).sin()) > 0.9);
        assert!(share(&|step| (0.1 * step).sin() + 0.02 * (3.0 * step).sin()) > 0.1);
    }
}
