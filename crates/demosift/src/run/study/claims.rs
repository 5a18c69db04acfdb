//! Claims, decided by the interval of a difference that is paired by seed, and not by hand.

use serde::Serialize;

use super::choice::Kept;
use super::curves::{self, Trained};
use super::drawn::{By, Claim, Measure, WHOLE};
use super::estimate::{Difference, paired_difference};
use super::parts::Set;
use super::plan::{Judge, Study};
use super::truth::Truth;
use super::{Finished, TrainingResult};
use crate::learning::adapt::Rule;
use crate::world::heuristic::Score;

/// A claim with all that was measured of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Decided {
    /// The claim as a sentence.
    pub says: String,
    /// Who says it.
    pub by: By,
    /// By what one is better.
    pub measure: Measure,
    /// One a set, imitator, K and other method.
    pub cases: Vec<Case>,
}

/// A claim about one set.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Case {
    /// Which set.
    pub set: String,
    /// Who learned, where policies are compared.
    pub imitator: Option<Rule>,
    /// How many were kept, where that matters.
    pub kept: Option<String>,
    /// The one that is said to be better.
    pub better: String,
    /// Than this.
    pub than: String,
    /// How much better it is, above 0 where it is; `None` before any pair is finished.
    pub difference: Option<Difference>,
    /// What that says.
    pub found: Said,
}

/// What an interval says of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Said {
    /// The whole interval is above 0.
    Agrees,
    /// The whole interval is below 0.
    Disagrees,
    /// It holds 0.
    NotSeparable,
    /// There are fewer pairs than a claim takes.
    TooFew,
}

impl Said {
    fn of(difference: Option<&Difference>) -> Self {
        match difference {
            Some(difference) if difference.can_decide() => {
                match (difference.is_separable(), difference.mean > 0.0) {
                    (false, _) => Self::NotSeparable,
                    (true, true) => Self::Agrees,
                    (true, false) => Self::Disagrees,
                }
            }
            _ => Self::TooFew,
        }
    }
}

impl Decided {
    /// How many cases say so.
    pub fn count(&self, said: Said) -> usize {
        self.cases.iter().filter(|case| case.found == said).count()
    }
}

/// Decides all claims of a study, as far as its cells are finished.
pub fn decide(study: &Study, finished: &Finished) -> Vec<Decided> {
    study.drawn.claims.iter().map(|claim| decided(study, claim, finished)).collect()
}

fn decided(study: &Study, claim: &Claim, finished: &Finished) -> Decided {
    let mut cases = Vec::new();
    for set in study.sets.iter().filter(|set| claim.is_about(set)) {
        let at = claim.kept_of(set);
        for than in &claim.than {
            match claim.measure {
                Measure::Distance => cases.push(by_distance(set, claim, than, finished)),
                Measure::Agreement => cases.extend(by_agreement(study, set, claim, than, finished)),
                Measure::Score | Measure::Best | Measure::Success => {
                    let imitators = study.drawn.curves.as_ref().map_or(&[][..], |curves| &curves.imitators);
                    let each =
                        imitators.iter().flat_map(|imitator| at.iter().map(move |at| (*imitator, *at)));
                    cases.extend(each.map(|(imitator, kept)| {
                        let sides = Sides { study, set, claim, imitator, kept };
                        sides.compared(than, finished)
                    }));
                }
            }
        }
    }
    Decided { says: claim.says.clone(), by: claim.by, measure: claim.measure, cases }
}

impl Claim {
    /// Whether it is about a set; one that nobody judges only lends its prior.
    pub(super) fn is_about(&self, set: &Set) -> bool {
        (self.sets.is_empty() || self.sets.contains(&set.name)) && set.seeds.count > 0
    }

    /// What is kept of a set, each number once; a K that is no choice there says nothing.
    fn kept_of(&self, set: &Set) -> Vec<Kept> {
        let (mut seen, mut kept) = (Vec::new(), Vec::new());
        for at in &self.at {
            let number = match at {
                Kept::Top(k) => match k.of(set.demonstrations) {
                    Some(k) => Some(k),
                    None => continue,
                },
                Kept::Weights | Kept::All => None,
            };
            if number.is_none() || !seen.contains(&number) {
                seen.push(number);
                kept.push(*at);
            }
        }
        kept
    }
}

/// Policies of both sides of a claim.
struct Sides<'a> {
    study: &'a Study,
    set: &'a Set,
    claim: &'a Claim,
    imitator: Rule,
    kept: Kept,
}

impl Sides<'_> {
    fn compared(&self, than: &str, finished: &Finished) -> Case {
        let one = self.trained(&self.claim.better, self.kept, finished);
        let other = self.trained(than, self.claim.than_at.unwrap_or(self.kept), finished);
        let pairs: Vec<(f64, f64)> = one
            .iter()
            .filter_map(|one| {
                let other = other.iter().find(|other| other.seed == one.seed)?;
                Some((self.value(one.result)?, self.value(other.result)?))
            })
            .collect();
        let k = label(self.kept, self.set);
        let kept = match self.claim.than_at {
            Some(of_other) => format!("{k}, beside {}", label(of_other, self.set)),
            None => k,
        };
        case(
            self.set,
            Names::of(&self.claim.better, than),
            Some(kept),
            Some(self.imitator),
            paired_difference(&pairs),
        )
    }

    fn trained<'f>(&self, name: &str, kept: Kept, finished: &'f Finished) -> Vec<Trained<'f>> {
        let kept = if name == WHOLE { Kept::All } else { kept };
        curves::trained(self.study, self.set, name, kept, self.imitator, finished)
    }

    fn value(&self, result: &TrainingResult) -> Option<f64> {
        match self.claim.measure {
            Measure::Success => result.end.success,
            Measure::Best => Some(result.chosen.score),
            Measure::Score => Some(result.end.score),
            // These are about no policy.
            Measure::Distance | Measure::Agreement => None,
        }
    }
}

/// K in words, with the number that it is in this set.
fn label(kept: Kept, set: &Set) -> String {
    match kept {
        Kept::Top(k) => k.of(set.demonstrations).map_or(k.to_string(), |k| k.to_string()),
        Kept::Weights => "by weights".to_owned(),
        Kept::All => set.demonstrations.to_string(),
    }
}

/// Names of both sides.
struct Names {
    better: String,
    than: String,
}

impl Names {
    fn of(better: &str, than: &str) -> Self {
        Self { better: better.to_owned(), than: than.to_owned() }
    }
}

fn case(
    set: &Set,
    names: Names,
    kept: Option<String>,
    imitator: Option<Rule>,
    difference: Option<Difference>,
) -> Case {
    let Names { better, than } = names;
    let found = Said::of(difference.as_ref());
    Case { set: set.name.clone(), imitator, kept, better, than, difference, found }
}

/// Table 1: the lower the better, so the other's distance stands first.
fn by_distance(set: &Set, claim: &Claim, than: &str, finished: &Finished) -> Case {
    let distance =
        |name: &str, seed| Some(finished.judging(&set.name, name, seed)?.adapted_behaviors_distance);
    let pair = |seed| Some((distance(than, seed)?, distance(&claim.better, seed)?));
    let pairs: Vec<(f64, f64)> = set.seeds.each().filter_map(pair).collect();
    case(set, Names::of(&claim.better, than), None, None, paired_difference(&pairs))
}

/// With each oracle that both sides may be held against.
fn by_agreement(study: &Study, set: &Set, claim: &Claim, than: &str, finished: &Finished) -> Vec<Case> {
    let (Some(one), Some(other)) = (study.method(&claim.better), study.method(than)) else {
        return Vec::new();
    };
    let may = |imitator: &&Rule| [one, other].iter().all(|of| study.may_be_held_against(of, **imitator));
    let of = |imitator: &Rule| {
        let scores = |method: &Judge, seed| study.scores(set, method, seed, finished);
        let pair = |seed| Some([scores(one, seed)?, scores(other, seed)?]);
        let pairs: Vec<[Vec<Score>; 2]> = set.seeds.each().filter_map(pair).collect();
        let truth = Truth::oracle(study, set, *imitator, finished);
        let difference = truth.and_then(|truth| truth.compared(&pairs));
        case(set, Names::of(&claim.better, than), None, Some(*imitator), difference)
    };
    study.oracle.iter().filter(may).map(of).collect()
}
