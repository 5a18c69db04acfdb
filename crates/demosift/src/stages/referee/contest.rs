//! Which trainings are still to be made: rounds, and who is dropped between them.

use super::welch::Sample;
use super::{
    Candidate, DECISIVE, IMITATORS, Imitator, Refereeing, Side, Trained, Training, Verdict, decision,
};
use crate::world::trainer::TrainerIdentity;

/// A pair is dropped if the best of its side is better at this level: so strict that the decision is none the wiser.
const STRICT: f64 = 0.001;

/// Where the referee stands.
#[derive(Clone, Debug)]
pub struct Contest {
    candidates: Vec<Candidate>,
    refereeing: Refereeing,
    pairs: Vec<Trained>,
    /// Trainings of every pair that stays in.
    rounds: usize,
    /// Whether the whole set was given the trainings that a rival by another imitator has.
    has_evened: bool,
    /// Whether the pairs that decide nothing have joined.
    has_shown: bool,
}

/// A training of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Which of the pairs.
    pub pair: usize,
    /// Which candidate that is.
    pub candidate: usize,
    /// By whom.
    pub imitator: Imitator,
    /// Which training of it, from 0.
    pub training: usize,
}

impl Contest {
    /// Before the first training.
    pub fn new(candidates: Vec<Candidate>, refereeing: Refereeing) -> Self {
        let imitators = IMITATORS.into_iter().filter(|rule| refereeing.trainings(*rule) >= DECISIVE);
        let pairs = imitators.flat_map(|rule| (0..candidates.len()).map(move |index| untrained(index, rule)));
        Self {
            pairs: pairs.collect(),
            candidates,
            refereeing,
            rounds: 0,
            has_evened: false,
            has_shown: false,
        }
    }

    /// What could be trained on.
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// The next trainings, to be added before the next are asked for; none at the end.
    ///
    /// The first rounds are one, as nobody is dropped between them.
    pub fn next_units(&mut self) -> Vec<Unit> {
        let most = self.refereeing.most();
        while self.rounds < most && !self.pairs.is_empty() && !self.has_shown {
            if self.rounds >= DECISIVE {
                for pair in hopeless(&self.candidates, &self.pairs) {
                    self.pairs[pair].dropped = true;
                }
            }
            let (from, to) = (self.rounds, if self.rounds == 0 { DECISIVE } else { self.rounds + 1 });
            self.rounds = to;
            let units = self.units(from, to, 0);
            if !units.is_empty() {
                return units;
            }
        }
        if self.has_shown {
            return Vec::new();
        }
        if !self.has_evened {
            self.has_evened = true;
            let units = self.evening_units(most);
            if !units.is_empty() {
                return units;
            }
        }
        self.has_shown = true;
        let first = self.pairs.len();
        let kept = shown_kept(&self.candidates, self.best_kept());
        let whole = self.candidates.iter().position(|candidate| candidate.side == Side::Whole);
        for rule in shown_imitators(&self.refereeing) {
            self.pairs.extend(kept.iter().copied().chain(whole).map(|index| untrained(index, rule)));
        }
        self.units(0, DECISIVE, first)
    }

    /// Trainings `from..to` of the pairs from `first` on, round by round.
    fn units(&self, from: usize, to: usize, first: usize) -> Vec<Unit> {
        let is_asked =
            |pair: &Trained, training| !pair.dropped && training < self.refereeing.trainings(pair.imitator);
        let of_round = |training: usize| {
            let pairs = self.pairs.iter().enumerate().skip(first);
            pairs.filter(move |(_, pair)| is_asked(pair, training)).map(move |(index, pair)| Unit {
                pair: index,
                candidate: pair.candidate,
                imitator: pair.imitator,
                training,
            })
        };
        (from..to).flat_map(of_round).collect()
    }

    /// Trainings of the whole set by imitators with fewer of them than others, where only these could still keep a kept pair
    /// from being better: three are not enough to say so.
    ///
    /// What the few say is not looked at, so each comparison is made once.
    fn evening_units(&self, most: usize) -> Vec<Unit> {
        let is_whole = |pair: &Trained| self.candidates[pair.candidate].side == Side::Whole && !pair.dropped;
        let is_short = |pair: &Trained| is_whole(pair) && self.refereeing.trainings(pair.imitator) < most;
        let mut rest = self.pairs.clone();
        rest.retain(|pair| !is_short(pair));
        if !decision::beats_the_whole(&self.candidates, &rest) {
            return Vec::new();
        }
        let short = self.pairs.iter().enumerate().filter(|(_, pair)| is_short(pair));
        let all = short.flat_map(|(index, pair)| {
            (pair.trainings.len()..most).map(move |training| Unit {
                pair: index,
                candidate: pair.candidate,
                imitator: pair.imitator,
                training,
            })
        });
        all.collect()
    }

    /// The result of a unit; units are added in order.
    pub fn add(&mut self, unit: Unit, training: Training) {
        self.pairs[unit.pair].trainings.push(training);
    }

    /// The kept candidate with the best pair so far.
    fn best_kept(&self) -> Option<usize> {
        let kept = self.pairs.iter().filter(|pair| self.candidates[pair.candidate].side == Side::Kept);
        kept.filter(|pair| !pair.trainings.is_empty())
            .rev()
            .max_by(|a, b| Sample::of(&a.trainings).mean.total_cmp(&Sample::of(&b.trainings).mean))
            .map(|pair| pair.candidate)
    }

    /// What it all says; `unit` is that of the heuristic, and `trainer` who the imitator of that name is.
    pub fn decide(self, unit: &str, trainer: Option<TrainerIdentity>) -> Verdict {
        let trainer = trainer.filter(|_| self.refereeing.trainer > 0);
        let verdict = decision::decide_between(self.candidates, self.pairs, unit, trainer);
        Verdict { asked: Some(self.refereeing), ..verdict }
    }
}

fn untrained(candidate: usize, imitator: Imitator) -> Trained {
    Trained { candidate, imitator, trainings: Vec::new(), dropped: false }
}

/// Imitators with too few trainings to decide anything.
fn shown_imitators(refereeing: &Refereeing) -> impl Iterator<Item = Imitator> {
    IMITATORS.into_iter().filter(|rule| (1..DECISIVE).contains(&refereeing.trainings(*rule)))
}

/// The kept candidates that such an imitator trains: the best, or all where none is known to be the best.
fn shown_kept(candidates: &[Candidate], best: Option<usize>) -> Vec<usize> {
    let is_shown =
        |index: &usize| candidates[*index].side == Side::Kept && best.is_none_or(|best| *index == best);
    (0..candidates.len()).filter(is_shown).collect()
}

/// Pairs that are surely worse than the best of their side; random subsets are the control of their own imitator, and stay.
pub fn hopeless(candidates: &[Candidate], pairs: &[Trained]) -> Vec<usize> {
    let side = |pair: &Trained| candidates[pair.candidate].side;
    let is_surely_worse = |index: &usize| {
        let pair = &pairs[*index];
        let sample = Sample::of(&pair.trainings);
        let rivals =
            pairs.iter().filter(|rival| side(rival) == side(pair) && rival.trainings.len() >= DECISIVE);
        let rivals = rivals.map(|rival| Sample::of(&rival.trainings));
        let best = rivals.max_by(|a, b| a.mean.total_cmp(&b.mean));
        best.is_some_and(|best| best.mean > sample.mean && best.over(&sample).low(STRICT) > 0.0)
    };
    let stays = |index: &usize| {
        let pair = &pairs[*index];
        !pair.dropped && side(pair) != Side::Random && pair.trainings.len() >= DECISIVE
    };
    (0..pairs.len()).filter(stays).filter(is_surely_worse).collect()
}

/// A training that is meant to be made if nobody is dropped: by which imitator, and of which candidate, or one of which.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Meant {
    /// By whom.
    pub imitator: Imitator,
    /// One of these candidates.
    pub candidates: Vec<usize>,
    /// Which training of it.
    pub training: usize,
}

/// All trainings that a contest makes at most: where nobody is dropped, and the whole set gets by each imitator as many
/// trainings as by the one that has most.
pub fn meant(candidates: &[Candidate], refereeing: &Refereeing) -> Vec<Meant> {
    let most = refereeing.most();
    let all = IMITATORS.into_iter().flat_map(|imitator| {
        let trainings = refereeing.trainings(imitator);
        let kept: Vec<usize> = shown_kept(candidates, None);
        let whole = (0..candidates.len()).filter(|index| candidates[*index].side == Side::Whole);
        let is_deciding = IMITATORS.iter().any(|rule| refereeing.trainings(*rule) >= DECISIVE);
        let groups: Vec<Vec<usize>> = match (trainings >= DECISIVE, is_deciding, kept.is_empty()) {
            (true, _, _) => (0..candidates.len()).map(|index| vec![index]).collect(),
            (false, true, false) => [kept].into_iter().chain(whole.map(|index| vec![index])).collect(),
            (false, ..) => kept.into_iter().chain(whole).map(|index| vec![index]).collect(),
        };
        groups.into_iter().flat_map(move |group| {
            let is_evened = trainings >= DECISIVE
                && group.iter().all(|index| candidates[*index].side == Side::Whole)
                && candidates.iter().any(|candidate| candidate.side == Side::Kept);
            let trainings = if is_evened { most } else { trainings };
            let candidates = group;
            (0..trainings).map(move |training| Meant { imitator, candidates: candidates.clone(), training })
        })
    });
    all.collect()
}
