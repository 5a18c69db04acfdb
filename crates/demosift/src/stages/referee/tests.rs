#![allow(clippy::print_stdout, reason = "with --nocapture the tests show the rates of docs/design.md")]

use rand::RngExt as _;

use super::Imitator::{BehavioralCloning, Gail};
use super::*;
use crate::basics::seed::Rng;

/// Trainings with these outcomes.
pub(super) fn scored(scores: &[Score], standard_error: f64) -> Vec<Training> {
    let point = |score| CurvePoint {
        updates: 0,
        environment_steps: 0,
        score,
        standard_error,
        success: None,
        true_return: None,
    };
    let training = |score: &Score| Training { outcome: point(*score), end: point(*score), chosen_by: *score };
    scores.iter().map(training).collect()
}

fn ids(count: usize) -> Vec<DemoId> {
    (0..count).map(DemoId).collect()
}

fn named(name: &str, demos: &[usize]) -> NamedSubset {
    NamedSubset::new(name, &demos.iter().copied().map(DemoId).collect::<Vec<_>>())
}

fn field(kept: &[NamedSubset]) -> Vec<Candidate> {
    candidates(&ids(6), kept).expect("not empty")
}

fn pair(candidate: usize, imitator: Imitator, scores: &[Score]) -> Trained {
    Trained { candidate, imitator, trainings: scored(scores, 0.02), dropped: false }
}

const HIGH: [Score; 5] = [0.90, 0.95, 0.93, 0.88, 0.91];
const LOW: [Score; 5] = [0.10, 0.18, 0.12, 0.15, 0.09];

/// Of the kept, the whole set and random subsets, by cloning alone.
fn said(kept: &[Score], whole: &[Score], random: &[Score]) -> Verdict {
    let trained = [kept, whole, random].into_iter().enumerate();
    let trained = trained.map(|(candidate, scores)| pair(candidate, BehavioralCloning, scores)).collect();
    decide(field(&[named("kept", &[3, 1])]), trained, "m")
}

#[test]
fn each_conclusion_has_its_case() {
    let helps = said(&HIGH, &LOW, &LOW);
    assert_eq!((helps.conclusion, helps.winner, helps.compared), (Conclusion::Helps, Some(0), 1));
    let difference = helps.difference.expect("compared");
    assert!((difference.of, difference.over) == (0, 1) && difference.low > 0.5 && difference.high < 1.0);
    assert!(
        helps.sentence.starts_with("Selecting helps: train on the 2 demonstrations kept (1, 3) by cloning. ")
    );
    assert!(helps.sentence.ends_with("random subsets of 2."), "{}", helps.sentence);
    assert!(helps.sentence.contains("Policies from them score +0.786 m beside"), "{}", helps.sentence);

    let fewer = said(&HIGH, &LOW, &HIGH);
    assert_eq!((fewer.conclusion, fewer.winner), (Conclusion::FewerHelps, Some(0)));
    assert!(fewer.sentence.contains("but not surely more than those from random subsets of 2."));

    let not = said(&LOW, &HIGH, &LOW);
    assert_eq!((not.conclusion, not.winner), (Conclusion::DoesNotHelp, Some(1)));
    assert!(not.sentence.contains("take the whole set: train on all 6 demonstrations by cloning;"));

    let same = said(&HIGH, &HIGH, &LOW);
    assert_eq!((same.conclusion, same.winner), (Conclusion::CannotTell, Some(1)), "the whole set is simpler");
    assert!(same.sentence.contains("cannot be told"), "{}", same.sentence);
    let ahead = said(&[0.9, 0.8, 0.5, 0.7, 0.6], &[0.55, 0.65, 0.45, 0.75, 0.35], &LOW);
    assert_eq!(
        (ahead.conclusion, ahead.winner),
        (Conclusion::CannotTell, Some(0)),
        "a good guess all the same"
    );

    // Where nobody ever succeeds nothing was found out.
    let nothing = said(&[0.0; 5], &[0.0; 5], &[0.0; 5]);
    assert_eq!(
        (nothing.conclusion, nothing.winner),
        (Conclusion::CannotTell, Some(1)),
        "{}",
        nothing.sentence
    );
    let everything = said(&[1.0; 5], &[1.0; 5], &[1.0; 5]);
    assert_eq!(everything.conclusion, Conclusion::CannotTell);

    let few = said(&HIGH[..2], &LOW[..2], &LOW[..2]);
    assert_eq!((few.conclusion, few.winner, few.compared), (Conclusion::NothingToCompare, Some(0), 0));
    assert!(few.sentence.starts_with("Too few trainings"), "{}", few.sentence);
    let none = decide(field(&[named("kept", &[1])]), Vec::new(), "m");
    assert_eq!((none.conclusion, none.winner), (Conclusion::NothingToCompare, None));
}

#[test]
fn all_that_is_kept_leaves_nothing_to_compare() {
    let candidates = field(&[named("kept", &[5, 4, 3, 2, 1, 0])]);
    assert_eq!(candidates.len(), 1, "no random subsets of all");
    let verdict = decide(candidates, vec![pair(0, BehavioralCloning, &HIGH), pair(0, Gail, &LOW)], "");
    assert_eq!((verdict.conclusion, verdict.winner), (Conclusion::NothingToCompare, Some(0)));
    assert_eq!(
        verdict.sentence,
        "All demonstrations were kept, so there is nothing to compare: train on all 6 demonstrations by cloning."
    );
}

#[test]
fn who_would_keep_the_same_is_one_candidate_with_both_names() {
    let found =
        field(&[named("kept by cloning", &[3, 1]), named("kept by GAIL", &[1, 3]), named("auto", &[2])]);
    let names: Vec<String> = found.iter().map(|candidate| candidate.names.join(" and ")).collect();
    assert_eq!(names, ["kept by cloning and kept by GAIL", "auto", "all", "random 1", "random 2"]);
    let keys: Vec<&str> = found.iter().map(|candidate| candidate.key.as_str()).collect();
    assert_eq!(keys, ["kept_by_cloning", "kept_auto", "all", "random_1", "random_2"]);
    assert!(candidates(&ids(3), &[named("kept", &[])]).expect_err("empty").is_bad_input());
    // Of a set of two the control is one of the two.
    let pair = candidates(&ids(2), &[named("kept", &[1])]).expect("not empty");
    let drawn: Vec<usize> = (0..9).map(|at| pair[2].demos_of(&ids(2), &Seed::new(1).at(at))[0].0).collect();
    assert!(drawn.contains(&0) && drawn.contains(&1), "another for each training: {drawn:?}");
}

#[test]
fn the_kept_must_beat_the_whole_set_by_each_imitator() {
    let candidates = field(&[named("kept", &[1])]);
    let trained = |whole_by_gail: &[Score]| {
        let cloned = [&HIGH, &LOW, &LOW].into_iter().enumerate();
        let mut trained: Vec<Trained> =
            cloned.map(|(candidate, scores)| pair(candidate, BehavioralCloning, scores)).collect();
        trained.extend([pair(0, Gail, &LOW[..3]), pair(1, Gail, whole_by_gail), pair(2, Gail, &LOW[..3])]);
        trained
    };
    let helps = decide(candidates.clone(), trained(&LOW[..3]), "");
    assert_eq!((helps.conclusion, helps.compared), (Conclusion::Helps, 2));
    let other = decide(candidates.clone(), trained(&HIGH[..3]), "");
    assert_eq!(other.conclusion, Conclusion::CannotTell, "the whole set by GAIL is as good");
    // A single training of GAIL is shown and decides nothing, however good it is.
    let mut shown = trained(&HIGH[..1]);
    shown.remove(5);
    shown[3].trainings.truncate(1);
    let verdict = decide(candidates, shown, "");
    assert_eq!((verdict.conclusion, verdict.compared), (Conclusion::Helps, 1));
    assert!(!verdict.pairs[4].is_compared && verdict.pairs[4].low.is_none());
}

#[test]
fn the_policy_is_that_of_the_training_that_the_choosing_episodes_like_best() {
    let mut kept = pair(0, BehavioralCloning, &HIGH);
    kept.trainings[3].chosen_by = 2.0;
    let others = [1, 2].map(|candidate| pair(candidate, BehavioralCloning, &LOW));
    let verdict = decide(field(&[named("kept", &[1])]), [vec![kept], others.to_vec()].concat(), "");
    assert_eq!((verdict.winner, verdict.best_training), (Some(0), Some(3)));
}

/// Plays a contest with these scores, and returns its units round by round and what was decided.
fn played(kept: &[NamedSubset], how: &str, score: impl Fn(Unit) -> Score) -> (Vec<Vec<Unit>>, Verdict) {
    let mut contest = Contest::new(field(kept), how.parse().expect("well written"));
    let mut rounds = Vec::new();
    loop {
        let units = contest.next_units();
        if units.is_empty() {
            return (rounds, contest.decide("", None));
        }
        for unit in &units {
            contest.add(*unit, scored(&[score(*unit)], 0.02)[0]);
        }
        rounds.push(units);
    }
}

#[test]
fn nobody_is_dropped_before_three_trainings_and_the_best_never() {
    let two = [named("a", &[1]), named("b", &[2])];
    // The first of the kept is hopeless, and so is the whole set by GAIL.
    let score = |unit: Unit| {
        let bad = unit.candidate == 0 || (unit.candidate == 2 && unit.imitator == Gail);
        if bad { -9.0 } else { 0.0 + 0.01 * (unit.training % 3) as f64 }
    };
    let (rounds, verdict) = played(&two, "cloning=5,gail=4", score);
    assert_eq!(rounds.len(), 3, "three trainings at first, then one by one");
    assert_eq!(rounds[0].len(), 8 * 3);
    let by =
        |index: usize| (verdict.pairs[index].trained.trainings.len(), verdict.pairs[index].trained.dropped);
    assert_eq!((by(0), by(1), by(2)), ((3, true), (5, false), (5, false)));
    assert_eq!((by(4), by(5), by(6)), ((3, true), (4, false), (3, true)));
    assert_eq!(verdict.compared, 4, "the dropped count all the same");
    let counted = meant(&verdict.candidates, &"cloning=5,gail=4".parse().expect("well written"));
    assert_eq!(counted.len(), 4 * 5 + 4 * 4 + 1);
}

#[test]
fn the_whole_set_gets_as_many_trainings_where_only_those_can_still_decide() {
    let kept = [named("kept", &[1])];
    // By cloning the kept are far ahead; by GAIL the whole set scatters, so that three trainings of it say little.
    let score = |whole_by_gail: fn(usize) -> Score| {
        move |unit: Unit| match (unit.candidate, unit.imitator) {
            (0, _) => 1.0 + 0.01 * (unit.training % 3) as f64,
            (1, Gail) => whole_by_gail(unit.training),
            // As good as the kept, but by GAIL: the control of the kept by cloning is imitated by cloning.
            (2, Gail) => 1.0,
            _ => 0.1 * (unit.training % 2) as f64,
        }
    };
    let trainings = |verdict: &Verdict| -> Vec<usize> {
        verdict.pairs.iter().map(|pair| pair.trained.trainings.len()).collect()
    };
    let (_, helps) = played(&kept, "cloning=10,gail=3", score(|training| 0.3 * (training % 3) as f64));
    assert_eq!(trainings(&helps), [10, 10, 10, 3, 10, 3]);
    assert_eq!((helps.conclusion, helps.winner), (Conclusion::Helps, Some(0)));
    // What the further trainings show counts, whatever the first three were.
    let (_, level) = played(
        &kept,
        "cloning=10,gail=3",
        score(|training| if training < 3 { 0.3 * training as f64 } else { 1.0 }),
    );
    assert_eq!((trainings(&level)[4], level.conclusion), (10, Conclusion::CannotTell));
    // Where the kept are not ahead by cloning, nothing can still be decided.
    let (_, alike) = played(&kept, "cloning=10,gail=3", |unit| 0.1 * (unit.training % 2) as f64);
    assert_eq!(trainings(&alike), [10, 10, 10, 3, 3, 3]);
}

#[test]
fn what_is_meant_is_what_is_trained_at_most() {
    let kept = [named("a", &[1]), named("b", &[2, 3])];
    for (how, wanted, evened) in [
        ("cloning=5,gail=1", 5 * 5 + 2, 0),
        ("cloning=4,gail=3", 5 * 7, 1),
        ("cloning=1,gail=2", 3 * 3, 0),
        ("gail=3", 5 * 3, 0),
        ("none", 0, 0),
    ] {
        let (rounds, verdict) = played(&kept, how, |unit| 0.1 * (unit.training % 2) as f64);
        assert_eq!(rounds.concat().len(), wanted, "{how}");
        let meant = meant(&verdict.candidates, &how.parse().expect("well written"));
        assert_eq!(meant.len(), wanted + evened, "{how}");
    }
    // All is kept: the whole set alone.
    let (rounds, _) = played(&[named("kept", &[0, 1, 2, 3, 4, 5])], "cloning=5,gail=1", |_| 0.0);
    assert_eq!(rounds.concat().len(), 6);
    // What decides nothing trains the best of the kept.
    let (rounds, _) =
        played(&kept, "cloning=3,gail=1", |unit| unit.candidate as f64 + 0.1 * unit.training as f64);
    assert_eq!(rounds[1].iter().map(|unit| unit.candidate).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn what_the_referee_is_to_do_is_written_as_it_is_read() {
    for text in ["none", "cloning=10,gail=3", "cloning=10", "gail=1", "trainer=5", "cloning=10,trainer=3"] {
        assert_eq!(text.parse::<Refereeing>().expect("its own words").to_string(), text);
    }
    assert_eq!(
        "gail=3".parse::<Refereeing>().expect("one of them"),
        Refereeing { cloning: 0, gail: 3, trainer: 0 }
    );
    for bad in ["", "ten", "cloning", "cloning=-1", "cloning=3,cloning=4", "trpo=3", "cloning=3;gail=1"] {
        let error = bad.parse::<Refereeing>().expect_err("no such words");
        assert!(error.is_bad_config());
        assert_eq!(
            error.to_string(),
            format!(
                "referee = {bad}, and must be none, or numbers of trainings such as cloning=10,gail=3 or \
                 cloning=10,trainer=5"
            )
        );
    }
}

#[test]
fn a_trainer_is_one_of_the_imitators_and_has_a_name_of_its_own() {
    let refereeing: Refereeing = "cloning=3,trainer=3".parse().expect("its own words");
    let mut contest = Contest::new(field(&[named("kept", &[0, 1])]), refereeing);
    let mut trained = Vec::new();
    loop {
        let units = contest.next_units();
        if units.is_empty() {
            break;
        }
        for unit in units {
            // What it makes of the kept is the best there is.
            let is_best = unit.imitator == Imitator::Trainer && unit.candidate == 0;
            let score = 0.01 * unit.training as f64 + if is_best { 1.0 } else { 0.0 };
            contest.add(unit, scored(&[score], 0.02)[0]);
            trained.push((unit.imitator, unit.candidate));
        }
    }
    for candidate in 0..3 {
        for imitator in [BehavioralCloning, Imitator::Trainer] {
            assert_eq!(trained.iter().filter(|unit| **unit == (imitator, candidate)).count(), 3);
        }
    }
    let trainer = TrainerIdentity { name: "my_train.py:train".to_owned(), sha256: None };
    let verdict = contest.decide("", Some(trainer));
    assert_eq!(verdict.conclusion, Conclusion::Helps);
    assert_eq!(verdict.winning_imitator(), Some(Imitator::Trainer));
    assert!(verdict.sentence.contains("kept (0, 1) by my_train.py:train."), "{}", verdict.sentence);
    // One that is not asked is not named.
    let contest = Contest::new(field(&[]), "cloning=3".parse().expect("its own words"));
    assert_eq!(contest.decide("", verdict.trainer).trainer, None);
}

/// Pools of trainings, one per pair: the same scores for all, but for what a pair is better by.
fn pools(candidates: &[Candidate], draw: Draw, better_by: impl Fn(Side, Imitator) -> Score) -> Vec<Trained> {
    let mut rng = Seed::new(11).into_rng();
    let drawn: Vec<Score> = (0..POOL).map(|_| draw(&mut rng)).collect();
    let of = |candidate: usize, imitator: Imitator| {
        let better_by = better_by(candidates[candidate].side, imitator);
        let scores: Vec<Score> = drawn.iter().map(|score| score + better_by).collect();
        Trained { candidate, imitator, trainings: scored(&scores, 0.0), dropped: false }
    };
    let pairs = IMITATORS.into_iter().flat_map(|rule| (0..candidates.len()).map(move |index| (index, rule)));
    pairs.map(|(candidate, imitator)| of(candidate, imitator)).collect()
}

fn normal(rng: &mut Rng) -> f64 {
    rand_distr::Distribution::sample(&rand_distr::StandardNormal, rng)
}

type Draw = fn(&mut Rng) -> Score;

/// Distributions of the scores of trainings that are alike: normal, skewed to either side, and all or nothing.
const ALIKE: [(&str, Draw); 5] = [
    ("normal", normal),
    ("skewed up", |rng| normal(rng).exp()),
    ("skewed down", |rng| -normal(rng).exp()),
    ("all or nothing, half", |rng| f64::from(rng.random_bool(0.5))),
    ("all or nothing, a fifth", |rng| f64::from(rng.random_bool(0.2))),
];

const POOL: usize = 5000;

const RESAMPLES: usize = 2000;

/// How far below the others a pair is that is hopeless.
const HOPELESS: Score = 99.0;

/// Who is hopeless, so that others stand alone against a wrong verdict.
type Worse = fn(Side, Imitator) -> bool;

const SITUATIONS: [(&str, Worse); 3] = [
    ("all alike", |_, _| false),
    ("random subsets hopeless", |side, _| side == Side::Random),
    ("and all by cloning from the whole set", |side, rule| {
        side == Side::Random || (side == Side::Whole && rule == BehavioralCloning)
    }),
];

/// Nobody is better than the best of the whole set: *helps* is an error. `docs/design.md` has these rates.
#[test]
fn helps_is_said_wrongly_in_at_most_one_of_twenty() {
    for kept in [&[named("kept", &[1, 2])][..], &[named("a", &[1]), named("b", &[2, 3])]] {
        let candidates = field(kept);
        for how in ["cloning=3", "cloning=5", "cloning=10", "cloning=10,gail=3", "cloning=10,gail=10"] {
            let how: Refereeing = how.parse().expect("well written");
            for (name, draw) in ALIKE {
                for (situation, is_worse) in SITUATIONS {
                    if how.gail == 0 && is_worse(Side::Whole, BehavioralCloning) {
                        continue;
                    }
                    let worse = |side, rule| if is_worse(side, rule) { -HOPELESS } else { 0.0 };
                    let pools = pools(&candidates, draw, worse);
                    let found =
                        conclusion_rates(&candidates, &pools, how, RESAMPLES, &Seed::new(5)).expect("pools");
                    let ConclusionRates { helps, helps_upper, .. } = found;
                    println!(
                        "{} kept, {how}: {name}, {situation}: {helps} (below {helps_upper:.4})",
                        kept.len()
                    );
                    assert!(helps <= LEVEL, "{name}, {how}, {situation}: {found:?}");
                }
            }
        }
    }
}

#[test]
fn a_clear_difference_is_found() {
    let candidates = field(&[named("kept", &[1, 2])]);
    let better = pools(&candidates, normal, |side, _| if side == Side::Kept { 3.0 } else { 0.0 });
    let mut before = 0.0;
    for (how, least) in [("cloning=3", 0.5), ("cloning=5", 0.9), ("cloning=10", 0.99)] {
        let found =
            conclusion_rates(&candidates, &better, how.parse().expect("written"), 1000, &Seed::new(5));
        let rate = found.expect("pools").helps;
        println!("three standard deviations, {how}: found in {rate}");
        assert!(rate >= least && rate >= before, "{how}: {rate}");
        before = rate;
    }
}

/// scipy.stats.beta.ppf(0.95, k + 1, n - k).
#[test]
fn the_upper_bound_is_clopper_and_pearsons() {
    for ((happened, of), wanted) in
        [((0, 1000), 0.002_991_2), ((50, 1000), 0.062_863_4), ((3, 10), 0.606_624)]
    {
        assert!((upper_bound(happened, of) - wanted).abs() < 1e-6, "{}", upper_bound(happened, of));
    }
    assert_eq!(upper_bound(5, 5), 1.0);
}
