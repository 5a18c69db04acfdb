//! Which work a study is, as far as it can be known: trainings on subsets depend on what judging found.

use std::collections::BTreeSet;

use rand::seq::IndexedRandom as _;

use super::choice::{Choice, Kept, TopK};
use super::parts::Set;
use super::plan::{Combination, Judge, Only, Regret, Rule, Study};
use super::{Finished, JudgingResult, Work};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::learning::adapt;
use crate::math::agreement;
use crate::math::statistics;
use crate::results::panel::Vote;
use crate::world::heuristic::Score;

impl Study {
    /// All work that can be named by now, the cheapest kind first: judging by cloning, other judging, trainings.
    pub fn work(&self, finished: &Finished) -> Vec<Work> {
        self.work_only(&Only::default(), finished)
    }

    /// The part of it that is to be done.
    pub fn work_only(&self, only: &Only, finished: &Finished) -> Vec<Work> {
        let sets: Vec<&Set> = self.sets.iter().filter(|set| only.is_about(&set.name)).collect();
        let mut work = Vec::new();
        let mut methods: Vec<&Judge> =
            self.methods.iter().filter(|method| method.combination.is_none()).collect();
        methods.retain(|method| self.needs(only, method));
        methods.sort_by_key(|method| !method.clones);
        for method in methods {
            for set in &sets {
                let judging =
                    |seed| Work::Judging { set: set.name.clone(), method: method.name.clone(), seed };
                work.extend(set.seeds.each().map(judging));
            }
        }
        for set in sets.iter().filter(|_| only.names(Only::WEIGHTS)) {
            work.extend(self.weighing_work(set, only));
        }
        for imitator in [adapt::Rule::BehavioralCloning, adapt::Rule::Gail] {
            for set in &sets {
                // The same subset may be asked for several times.
                let mut seen = BTreeSet::new();
                let mut trainings = Vec::new();
                if only.names(Only::ORACLE) {
                    self.oracle_work(set, imitator, &mut trainings);
                }
                let methods: Vec<&Judge> =
                    self.methods.iter().filter(|method| only.names(&method.name)).collect();
                if only.names(Only::CURVES) {
                    self.curve_work(set, &methods, imitator, finished, &mut trainings);
                }
                if only.names(Only::REGRET) {
                    self.regret_work(set, &methods, imitator, finished, &mut trainings);
                }
                if only.names(Only::POOLS) {
                    self.pool_work(set, imitator, finished, &mut trainings);
                }
                work.extend(trainings.into_iter().filter(|work| seen.insert(work.name())));
            }
        }
        work
    }

    fn oracle_work(&self, set: &Set, imitator: adapt::Rule, work: &mut Vec<Work>) {
        if self.oracle.contains(&imitator) {
            for demo in 0..set.demonstrations {
                let of = |seed| training(set, &[DemoId(demo)], imitator, seed);
                work.extend(set.oracle_seeds.each().map(of));
            }
        }
    }

    fn regret_work(
        &self,
        set: &Set,
        methods: &[&Judge],
        imitator: adapt::Rule,
        finished: &Finished,
        work: &mut Vec<Work>,
    ) {
        let Some(regret) = self.regret_of(set).filter(|regret| regret.imitators.contains(&imitator)) else {
            return;
        };
        for k in TopK::all_of(&regret.at, set.demonstrations) {
            let best = self.truly_best(set, imitator, k, finished);
            let tops = methods.iter().flat_map(|method| {
                set.seeds.each().filter_map(|seed| Some(top(&self.scores(set, method, seed, finished)?, k)))
            });
            for demos in best.into_iter().chain(tops) {
                work.extend(regret.trainings.each().map(|seed| training(set, &demos, imitator, seed)));
            }
        }
    }

    fn weighing_work(&self, set: &Set, only: &Only) -> Vec<Work> {
        let Some(weights) = self.drawn.weights.as_ref().filter(|weights| weights.is_about(&set.name)) else {
            return Vec::new();
        };
        let methods = weights.methods.iter().filter(|method| only.names(method));
        let of = |method: &String| {
            let (set, method) = (set.clone(), method.clone());
            set.seeds.each().map(move |seed| Work::Weighing {
                set: set.name.clone(),
                method: method.clone(),
                seed,
            })
        };
        methods.flat_map(of).collect()
    }

    /// What is kept with a seed is learned with the same seed.
    pub(super) fn curve_work(
        &self,
        set: &Set,
        methods: &[&Judge],
        imitator: adapt::Rule,
        finished: &Finished,
        work: &mut Vec<Work>,
    ) {
        let curves = self.drawn.curves.as_ref().filter(|curves| curves.imitators.contains(&imitator));
        let Some(curves) = curves else { return };
        let mut kept: Vec<Kept> = vec![Kept::All];
        let at = TopK::all_of(&curves.at, set.demonstrations);
        kept.extend(at.into_iter().map(|k| Kept::Top(TopK::Count(k))));
        kept.push(Kept::Weights);
        for kept in kept {
            for method in methods {
                let of = |seed| {
                    let demos = self.kept(set, &method.name, kept, seed, finished)?;
                    Some(training(set, &demos, imitator, seed))
                };
                work.extend(set.seeds.each().filter_map(of));
            }
        }
        for k in self.compared_with_best(set, imitator) {
            let of = |seed| {
                let demos = self.truly_best_without(seed, set, imitator, k, finished)?;
                Some(training(set, &demos, imitator, seed))
            };
            work.extend(set.seeds.each().filter_map(of));
        }
    }

    /// Each K of `[curves]` at which policies are held against those from the truly best K, where an oracle tells these.
    pub(super) fn compared_with_best(&self, set: &Set, imitator: adapt::Rule) -> Vec<usize> {
        let curves = self.drawn.curves.as_ref().filter(|curves| curves.imitators.contains(&imitator));
        match curves.filter(|_| self.oracle.contains(&imitator) && set.oracle_seeds.count > 0) {
            Some(curves) => TopK::all_of(&curves.at, set.demonstrations),
            None => Vec::new(),
        }
    }

    /// What a method keeps of a set with a seed, in the order of the set; `None` until it is known, and where there is none.
    pub fn kept(
        &self,
        set: &Set,
        method: &str,
        kept: Kept,
        seed: u64,
        finished: &Finished,
    ) -> Option<Vec<DemoId>> {
        match kept {
            Kept::All => Some((0..set.demonstrations).map(DemoId).collect()),
            Kept::Top(k) => {
                let scores = self.scores(set, self.method(method)?, seed, finished)?;
                Some(top(&scores, k.of(set.demonstrations)?))
            }
            Kept::Weights => Some(finished.weighing(&set.name, method, seed)?.demos.clone()),
        }
    }

    fn pool_work(&self, set: &Set, imitator: adapt::Rule, finished: &Finished, work: &mut Vec<Work>) {
        let pools = self.all_pools();
        for pool in pools.iter().filter(|pool| pool.set == set.name && pool.imitator == imitator) {
            for choice in &pool.subsets {
                let of =
                    |seed| Some(training(set, &self.chosen(set, choice, seed, finished)?, imitator, seed));
                work.extend(pool.trainings.each().filter_map(of));
            }
        }
    }

    /// Regret, where the set has some.
    pub(super) fn regret_of(&self, set: &Set) -> Option<&Regret> {
        self.regret.as_ref().filter(|_| set.regret)
    }

    /// How many trainings there may be at most besides those that [`Study::work_only`] can name by now.
    pub fn most_unknown_trainings(&self, only: &Only, finished: &Finished) -> usize {
        let work = self.work_only(only, finished);
        let named = work.iter().filter(|work| matches!(work, Work::Training { .. })).count();
        let methods = self.methods.iter().filter(|method| only.names(&method.name)).count();
        let mut most = 0;
        for set in self.sets.iter().filter(|set| only.is_about(&set.name)) {
            if only.names(Only::ORACLE) {
                most += self.oracle.len() * set.demonstrations * set.oracle_seeds.count;
            }
            if let Some(regret) = self.regret_of(set).filter(|_| only.names(Only::REGRET)) {
                let subsets = methods * set.seeds.count + 1;
                let ks = TopK::all_of(&regret.at, set.demonstrations).len();
                most += regret.imitators.len() * ks * subsets * regret.trainings.count;
            }
            if let Some(curves) = self.drawn.curves.as_ref().filter(|_| only.names(Only::CURVES)) {
                let weighed = self.drawn.weights.as_ref().filter(|weights| weights.is_about(&set.name));
                let by_weights = weighed
                    .map_or(0, |weights| weights.methods.iter().filter(|method| only.names(method)).count());
                let at = TopK::all_of(&curves.at, set.demonstrations).len();
                let whole = methods.min(1);
                most += curves.imitators.len() * set.seeds.count * (at * methods + by_weights + whole);
                let with_best = curves.imitators.iter().map(|of| self.compared_with_best(set, *of).len());
                most += with_best.sum::<usize>() * set.seeds.count * whole;
            }
            if only.names(Only::POOLS) {
                let pools = self.all_pools();
                let pools = pools.iter().filter(|pool| pool.set == set.name);
                most += pools.map(|pool| pool.subsets.len() * pool.trainings.count).sum::<usize>();
            }
        }
        most.saturating_sub(named)
    }

    /// Scores of all demonstrations by a method, made of others' where it is a combination; `None` until it is finished.
    pub fn scores(&self, set: &Set, method: &Judge, seed: u64, finished: &Finished) -> Option<Vec<Score>> {
        let direct = |name: &str| Some(finished.judging(&set.name, name, seed)?.scores());
        match &method.combination {
            None => direct(&method.name),
            Some(Combination { rule, of }) => {
                let found = |name: &String| finished.judging(&set.name, name, seed);
                let parts: Vec<&JudgingResult> = of.iter().map(found).collect::<Option<_>>()?;
                combined(*rule, &parts)
            }
        }
    }

    /// The demonstrations of a choice with a seed; `None` until they are known.
    pub(super) fn chosen(
        &self,
        set: &Set,
        choice: &Choice,
        seed: u64,
        finished: &Finished,
    ) -> Option<Vec<DemoId>> {
        let all: Vec<DemoId> = (0..set.demonstrations).map(DemoId).collect();
        match choice {
            Choice::All => Some(all),
            Choice::Ids(ids) => Some(ids.iter().copied().map(DemoId).collect()),
            Choice::Random(k) => {
                let k = k.of(set.demonstrations)?;
                let mut rng = Seed::new(seed).of("study").of("random").at(k).into_rng();
                let mut drawn: Vec<DemoId> = all.sample(&mut rng, k).copied().collect();
                drawn.sort_unstable();
                Some(drawn)
            }
            Choice::KeptBy { method, k, seed } => {
                let judged = seed.unwrap_or(set.seeds.first);
                let scores = self.scores(set, self.method(method)?, judged, finished)?;
                Some(top(&scores, k.of(set.demonstrations)?))
            }
        }
    }
}

fn training(set: &Set, demos: &[DemoId], imitator: adapt::Rule, seed: u64) -> Work {
    Work::Training { set: set.name.clone(), demos: demos.to_vec(), imitator, seed }
}

/// The K highest, ties by id, in the order of the set.
pub(super) fn top(scores: &[Score], k: usize) -> Vec<DemoId> {
    let mut demos: Vec<DemoId> = (0..scores.len()).map(DemoId).collect();
    demos.sort_by(|a, b| scores[b.0].total_cmp(&scores[a.0]).then(a.cmp(b)));
    demos.truncate(k);
    demos.sort_unstable();
    demos
}

/// The scores of several methods as one; `None` where votes count and a cell does not say whether it has one.
fn combined(rule: Rule, parts: &[&JudgingResult]) -> Option<Vec<Score>> {
    let scores = parts.iter().map(|part| part.scores());
    let alike: Vec<Vec<f64>> = match rule {
        Rule::Ranks => scores.map(|scores| agreement::ranks(&scores)).collect(),
        Rule::Scores => scores.map(|scores| standardized(&scores)).collect(),
        Rule::Votes => {
            let votes = parts.iter().map(|part| part.vote).collect::<Option<Vec<Vote>>>()?;
            let scores: Vec<Vec<Score>> = scores.collect();
            let with = scores.iter().zip(&votes).filter(|(_, vote)| vote.counts());
            let with: Vec<Vec<Score>> = with.map(|(scores, _)| scores.clone()).collect();
            if with.is_empty() { scores.into_iter().take(1).collect() } else { with }
        }
    };
    let demonstrations = alike.first()?.len();
    Some(
        (0..demonstrations)
            .map(|demo| statistics::mean_of(alike.iter().map(|scores| scores[demo])))
            .collect(),
    )
}

/// With mean 0 and standard deviation 1; equal scores say nothing, and become 0.
fn standardized(scores: &[Score]) -> Vec<f64> {
    let (center, spread) = statistics::mean_and_deviation(scores.iter().copied());
    scores.iter().map(|score| if spread > 0.0 { (score - center) / spread } else { 0.0 }).collect()
}
