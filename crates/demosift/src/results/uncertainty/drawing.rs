//! How a judgment is drawn again: evaluations, adaptations, and the agents before.

use rand_distr::{ChiSquared, Distribution as _, StudentT};

use super::{Judged, Resampling, UnderVariant, compare};
use crate::basics::error::{Error, Result};
use crate::basics::seed::{Rng, Seed};
use crate::math::statistics::{Moderation, mean, mean_at, resample, squared_deviations};
use crate::world::heuristic::Score;

/// The scores drawn again, `[draws][demonstrations]`.
pub(super) fn draw(
    judged: &[Judged],
    evaluations: usize,
    resampling: &Resampling,
    seed: &Seed,
) -> Result<Vec<Vec<Score>>> {
    let mut rng = seed.of("evaluations").into_rng();
    let variants = judged[0].variants.len();
    let gains = judged.iter().map(|judged| judged.gain).collect::<Vec<Score>>();
    let mut draws = vec![gains; resampling.draws_of(judged.len())];
    for draw in &mut draws {
        for variant in 0..variants {
            let picks = resample(evaluations, &mut rng);
            let unknown_spread = widening(evaluations, &mut rng)?;
            for (judged, score) in judged.iter().zip(draw.iter_mut()) {
                let deviation = deviation(&judged.variants[variant].gains, &picks);
                *score += unknown_spread * deviation / variants as f64;
            }
        }
    }
    add_repeats(&mut draws, judged, resampling, seed)?;
    add_starts(&mut draws, judged, seed)?;
    Ok(draws)
}

/// Adds what other agents before would have changed, by Student's t; all gains are beside the same ones, so it moves all alike and
/// changes no order. Nothing where all begin with one agent.
fn add_starts(draws: &mut [Vec<Score>], judged: &[Judged], seed: &Seed) -> Result<()> {
    let mut rng = seed.of("starts").into_rng();
    let variants = &judged[0].variants;
    for UnderVariant { starts, .. } in variants {
        let error =
            (squared_deviations(starts) / (starts.len() as f64 - 1.0).max(1.0) / starts.len() as f64).sqrt();
        if error == 0.0 {
            continue;
        }
        let freedom = (starts.len() - 1) as f64;
        let student = StudentT::new(freedom).map_err(|error| {
            Error::bad_config(format!("{freedom} degrees of freedom of the agents before: {error}"))
        })?;
        for draw in &mut *draws {
            let moved = error * student.sample(&mut rng) / variants.len() as f64;
            draw.iter_mut().for_each(|score| *score += moved);
        }
    }
    Ok(())
}

/// How far the mean of the picked gains lies from that of all.
///
/// A sample spreads less than what it was drawn from, by (M − 1)/M in variance, and that is made up for.
fn deviation(gains: &[Score], picks: &[usize]) -> f64 {
    let count = gains.len() as f64;
    (mean_at(gains, picks) - mean(gains)) * (count / (count - 1.0).max(1.0)).sqrt()
}

/// √((M − 1)/χ²) with M − 1 degrees of freedom, one factor for all demonstrations of a draw: by it a normal deviation becomes one of
/// Student's t, since the spread of M episodes is itself only known from these. Where there is one, nothing is drawn.
fn widening(evaluations: usize, rng: &mut Rng) -> Result<f64> {
    if evaluations < 2 {
        return Ok(1.0);
    }
    let freedom = (evaluations - 1) as f64;
    let chi_squared = ChiSquared::new(freedom).map_err(|error| {
        Error::bad_config(format!("{freedom} degrees of freedom of the evaluations: {error}"))
    })?;
    Ok((freedom / chi_squared.sample(rng)).sqrt())
}

/// Adds what other adaptations would have changed, by Student's t for each demonstration; nothing where all were imitated
/// once.
fn add_repeats(
    draws: &mut [Vec<Score>],
    judged: &[Judged],
    resampling: &Resampling,
    seed: &Seed,
) -> Result<()> {
    let spreads: Vec<Spread> = judged.iter().map(Spread::of).collect();
    let all_freedom: f64 = spreads.iter().map(|spread| spread.freedom).sum();
    if all_freedom == 0.0 {
        return Ok(());
    }
    let common = spreads.iter().map(|spread| spread.squares).sum::<f64>() / all_freedom;
    let moderation = Moderation { common, worth: resampling.pooling };
    let mut stream = 0;
    for (index, spread) in spreads.iter().enumerate() {
        // Demonstrations of which the same was measured are the same one twice, and stay level in every draw.
        if index > 0 && compare(&judged[index - 1], &judged[index]).is_ne() {
            stream = index;
        }
        let freedom = moderation.freedom(spread.freedom);
        let student = StudentT::new(freedom).map_err(|error| {
            Error::bad_config(format!(
                "{freedom} degrees of freedom of the repeats, and there must be some: {error}"
            ))
        })?;
        let mut rng: Rng = seed.of("repeats").at(stream).into_rng();
        let error = (moderation.variance(spread.squares, spread.freedom) * spread.share).sqrt();
        draws.iter_mut().for_each(|draw| draw[index] += error * student.sample(&mut rng));
    }
    Ok(())
}

/// How the repeats of one demonstration lie about their means, all variants together.
struct Spread {
    /// Squared deviations, summed.
    squares: f64,
    /// Repeats beyond the first of each variant.
    freedom: f64,
    /// Variance of the mean over variants, for repeats of variance 1.
    share: f64,
}

impl Spread {
    fn of(judged: &Judged) -> Self {
        let variants = judged.variants.len() as f64;
        let of = |number: fn(&UnderVariant) -> f64| judged.variants.iter().map(number).sum::<f64>();
        Self {
            squares: of(|under| under.repeat_squares),
            freedom: of(|under| under.repeats as f64 - 1.0),
            share: of(|under| 1.0 / under.repeats as f64) / variants.powi(2),
        }
    }
}
