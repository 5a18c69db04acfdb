//! What the scores of the trainings say: a pure function of them, so that its error rates can be measured.

use super::welch::{Sample, Welch};
use super::{Candidate, Conclusion, DECISIVE, Difference, LEVEL, Pair, Side, Trained, Verdict, words};
use crate::math::statistics::{mean, mean_of};
use crate::world::trainer::TrainerIdentity;

/// Share of the level at which is tested. Scores that are all or nothing come in steps, and at the level itself a test of
/// five or ten such trainings a side is wrong in 5.8 % (`docs/design.md`).
const TESTED: f64 = 0.7;

/// The probability beyond each end of a pair's own interval, which is of 95 %.
const TAIL: f64 = 0.025;

/// What the scores of the trainings say; `unit` is that of the heuristic, for the sentence.
///
/// Compared are the kept pairs with enough trainings, if those of the whole set have enough as well.
/// A kept pair beats the whole set if it beats it by *each* imitator, and random subsets by its own, which are like it but for
/// the choice: the least sure of these comparisons counts, which needs no correction (an intersection of tests).
/// Over the pairs compared the level is divided by their number (Bonferroni), for the limits of the difference too.
///
/// ```
/// use demosift::data::demonstration::DemoId;
/// use demosift::stages::imitate::CurvePoint;
/// use demosift::stages::referee::{Conclusion, Imitator, NamedSubset, Trained, Training, candidates, decide};
///
/// let ids: Vec<DemoId> = (0..6).map(DemoId).collect();
/// let kept = [NamedSubset::new("kept", &[DemoId(1), DemoId(3)])];
/// let candidates = candidates(&ids, &kept)?; // the kept, the whole set, random subsets of two
///
/// let trained = |candidate, scores: [f64; 5]| {
///     let point = |score| CurvePoint { updates: 0, environment_steps: 0, score, standard_error: 0.02, success: None, true_return: None };
///     let training = |score| Training { outcome: point(score), end: point(score), chosen_by: score };
///     let trainings = scores.map(training).to_vec();
///     Trained { candidate, imitator: Imitator::BehavioralCloning, trainings, dropped: false }
/// };
/// let verdict = decide(
///     candidates,
///     vec![
///         trained(0, [-0.41, -0.38, -0.44, -0.40, -0.39]),
///         trained(1, [-0.92, -0.85, -0.97, -0.88, -0.94]),
///         trained(2, [-1.40, -0.80, -1.10, -1.52, -0.95]),
///     ],
///     "m",
/// );
/// assert_eq!((verdict.conclusion, verdict.winner), (Conclusion::Helps, Some(0)));
/// assert!(verdict.sentence.starts_with("Selecting helps: train on the 2 demonstrations kept (1, 3) by cloning."));
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn decide(candidates: Vec<Candidate>, trained: Vec<Trained>, unit: &str) -> Verdict {
    decide_between(candidates, trained, unit, None)
}

/// The same where one of the imitators is this trainer.
pub(super) fn decide_between(
    candidates: Vec<Candidate>,
    trained: Vec<Trained>,
    unit: &str,
    trainer: Option<TrainerIdentity>,
) -> Verdict {
    let trained: Vec<Trained> = trained.into_iter().filter(|pair| !pair.trainings.is_empty()).collect();
    let field = Field::of(&candidates, &trained);
    let compared = field.kept.len();
    let found = field.compare();
    let winner = found.as_ref().map_or_else(|| field.best_of_all(), |found| Some(found.winner));
    let mut verdict = Verdict {
        conclusion: found.as_ref().map_or(Conclusion::NothingToCompare, |found| found.conclusion),
        sentence: String::new(),
        difference: found.map(|found| found.difference),
        winner,
        best_training: winner.map(|winner| best_training(&trained[winner])),
        compared,
        level: LEVEL,
        asked: None,
        trainer,
        pairs: pairs(&field, &trained),
        candidates,
    };
    verdict.sentence = words::sentence(&verdict, unit);
    verdict
}

/// Whether a kept pair surely beats every pair of the whole set that is among these.
pub(super) fn beats_the_whole(candidates: &[Candidate], trained: &[Trained]) -> bool {
    !Field::of(candidates, trained).better_than_the_whole().is_empty()
}

/// The pairs that are compared, by their side.
struct Field<'a> {
    candidates: &'a [Candidate],
    trained: &'a [Trained],
    samples: Vec<Sample>,
    kept: Vec<usize>,
    whole: Vec<usize>,
}

struct Found {
    conclusion: Conclusion,
    difference: Difference,
    winner: usize,
}

impl<'a> Field<'a> {
    fn of(candidates: &'a [Candidate], trained: &'a [Trained]) -> Self {
        let samples = trained.iter().map(|pair| Sample::of(&pair.trainings)).collect();
        let mut field = Self { candidates, trained, samples, kept: Vec::new(), whole: Vec::new() };
        field.whole = field.enough(|candidate| candidate.side == Side::Whole);
        if !field.whole.is_empty() {
            field.kept = field.enough(|candidate| candidate.side == Side::Kept);
        }
        field
    }

    fn enough(&self, is_meant: impl Fn(&Candidate) -> bool) -> Vec<usize> {
        let is_enough = |index: &usize| {
            let pair = &self.trained[*index];
            pair.trainings.len() >= DECISIVE && is_meant(&self.candidates[pair.candidate])
        };
        (0..self.trained.len()).filter(is_enough).collect()
    }

    fn over(&self, of: usize, over: usize) -> Welch {
        self.samples[of].over(&self.samples[over])
    }

    /// The pair with the highest mean, the first of equals.
    fn best(&self, among: &[usize]) -> Option<usize> {
        among.iter().copied().rev().max_by(|a, b| self.samples[*a].mean.total_cmp(&self.samples[*b].mean))
    }

    /// Where nothing is compared: the best pair that is no control, of those with enough trainings if there are any.
    fn best_of_all(&self) -> Option<usize> {
        let is_control = |index: &usize| self.candidates[self.trained[*index].candidate].side == Side::Random;
        let all: Vec<usize> = (0..self.trained.len()).filter(|index| !is_control(index)).collect();
        let enough = self.enough(|candidate| candidate.side != Side::Random);
        self.best(&enough).or_else(|| self.best(&all))
    }

    /// The random subsets that a kept pair is held against: as large, and imitated by the same imitator.
    fn random(&self, kept: usize) -> Vec<usize> {
        let Trained { candidate, imitator, .. } = &self.trained[kept];
        let size = self.candidates[*candidate].size;
        let mut random = self.enough(|candidate| candidate.side == Side::Random && candidate.size == size);
        random.retain(|pair| self.trained[*pair].imitator == *imitator);
        random
    }

    /// The level of each test.
    fn level(&self) -> f64 {
        TESTED * LEVEL / self.kept.len() as f64
    }

    fn beats(&self, of: usize, others: &[usize]) -> bool {
        others.iter().all(|over| self.over(of, *over).low(self.level()) > 0.0)
    }

    /// The kept pairs that beat the whole set.
    fn better_than_the_whole(&self) -> Vec<usize> {
        self.kept.iter().copied().filter(|of| self.beats(*of, &self.whole)).collect()
    }

    fn compare(&self) -> Option<Found> {
        let (best_kept, best_whole) = (self.best(&self.kept)?, self.best(&self.whole)?);
        let level = self.level();
        let beat_whole = self.better_than_the_whole();
        let mut beat_both = beat_whole.clone();
        beat_both.retain(|of| {
            let random = self.random(*of);
            !random.is_empty() && self.beats(*of, &random)
        });
        let is_worse = |of: &usize| self.over(*of, best_whole).high(level) < 0.0;
        let (conclusion, kept, winner) = match (self.best(&beat_both), self.best(&beat_whole)) {
            (Some(best), _) => (Conclusion::Helps, best, best),
            (None, Some(best)) => (Conclusion::FewerHelps, best, best),
            _ if self.kept.iter().all(is_worse) => (Conclusion::DoesNotHelp, best_kept, best_whole),
            _ => (Conclusion::CannotTell, best_kept, self.guess(best_kept, best_whole)),
        };
        let found = self.over(kept, best_whole);
        let (low, high) = (found.low(level), found.high(level));
        let difference = Difference { of: kept, over: best_whole, by: found.by, low, high };
        Some(Found { conclusion, difference, winner })
    }

    /// What to train on where it cannot be told: the whole set, which needs no selecting, unless the kept are ahead by more
    /// than a standard error. Being the best of several brings about as much by luck alone.
    fn guess(&self, kept: usize, whole: usize) -> usize {
        let found = self.over(kept, whole);
        if found.by > found.standard_error { kept } else { whole }
    }
}

/// The training whose policy did best on the episodes that chose it; the first of equals.
fn best_training(pair: &Trained) -> usize {
    let scores = pair.trainings.iter().map(|training| training.chosen_by).enumerate();
    scores.rev().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(training, _)| training)
}

fn pairs(field: &Field<'_>, trained: &[Trained]) -> Vec<Pair> {
    let controls: Vec<usize> = field.kept.iter().flat_map(|kept| field.random(*kept)).collect();
    let pair = |(index, trained): (usize, &Trained)| {
        let success: Option<Vec<f64>> =
            trained.trainings.iter().map(|training| training.outcome.success).collect();
        let limits = field.samples[index].limits(TAIL);
        let sides = [&field.kept, &field.whole, &controls];
        Pair {
            mean: field.samples[index].mean,
            low: limits.map(|limits| limits.0),
            high: limits.map(|limits| limits.1),
            end: mean_of(trained.trainings.iter().map(|training| training.end.score)),
            success: success.map(|shares| mean(&shares)),
            is_compared: !field.kept.is_empty() && sides.iter().any(|side| side.contains(&index)),
            trained: trained.clone(),
        }
    };
    trained.iter().enumerate().map(pair).collect()
}
