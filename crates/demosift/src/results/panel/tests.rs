use rand_distr::{Distribution as _, StandardNormal};

use super::*;
use crate::stages::judge::Suitability;
use crate::world::environment::EnvVariant;

/// Repeats with noise around what each demonstration is worth; the agent before scores 0.
fn table(worth: &[f64], noise: f64, repeats: usize, seed: u64) -> ScoreTable {
    let mut rng = Seed::new(seed).into_rng();
    let mut repeat = |worth: f64| {
        let drawn: f64 = StandardNormal.sample(&mut rng);
        vec![worth + noise * drawn; 2]
    };
    let suitability = |(demo, worth): (usize, &f64)| Suitability {
        demo: DemoId(demo),
        variant: EnvVariant(0),
        before: vec![vec![0.0; 2]],
        after: (0..repeats).map(|_| repeat(*worth)).collect(),
        distances: Vec::new(),
        curves: Vec::new(),
        evaluated: None,
    };
    ScoreTable::new(worth.iter().enumerate().map(suitability).collect())
}

fn judged(cloning: &ScoreTable, paper: &ScoreTable) -> Panel {
    let found =
        [Found { judge: Judge::Cloning, scores: cloning }, Found { judge: Judge::Paper, scores: paper }];
    panel(&found, 2, &Seed::new(1)).expect("two whole tables")
}

#[test]
fn a_judge_that_does_not_agree_with_itself_has_no_vote() {
    let good = table(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0.1, 4, 1);
    let chance = table(&[3.0; 6], 1.0, 4, 2);
    let panel = judged(&chance, &good);
    assert_eq!(panel.of(Judge::Cloning).map(|opinion| opinion.vote), Some(Vote::DisagreesWithItself));
    assert_eq!(panel.decides, Judges::Paper);
    assert_eq!(judged(&good, &chance).decides, Judges::Cloning);
    assert_eq!(judged(&good, &chance).together, None);
    assert_eq!(judged(&chance, &chance).decides, Judges::Cloning, "somebody must");
}

/// Where success is all that counts, a repeat in which nobody succeeds is usual, and says nothing against the others.
#[test]
fn a_repeat_in_which_nobody_succeeds_costs_no_vote() {
    let succeeds = |repeats: usize| {
        let mut found = table(&[0.0; 8], 0.0, 6, 1);
        found.suitabilities[3].after[..repeats].iter_mut().for_each(|scores| *scores = vec![1.0; 2]);
        let judged = judged(&found, &table(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], 0.1, 4, 1));
        let opinion = judged.of(Judge::Cloning).expect("it judged").clone();
        (opinion.vote, opinion.agrees_with_itself)
    };
    let (vote, agreement) = succeeds(5);
    assert_eq!(vote, Vote::Counts);
    assert!((agreement.expect("some") - 5.0 / 6.0).abs() < 1e-9, "{agreement:?}");
    assert_eq!(succeeds(0).1, None, "all alike");
    assert!(!succeeds(0).0.counts());
}

#[test]
fn one_repeat_that_shows_no_help_has_no_vote() {
    let good = table(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0.1, 4, 1);
    let harms = table(&[-1.0, -2.0, -3.0, -4.0, -5.0, -6.0], 0.1, 1, 2);
    let panel = judged(&good, &harms);
    assert_eq!(panel.of(Judge::Paper).map(|opinion| opinion.vote), Some(Vote::TaughtNothing));
    assert_eq!(panel.decides, Judges::Cloning);
}

/// Two repeats of four agree in everything by chance in one of 24 cases, which is counted and not drawn.
#[test]
fn whether_few_repeats_agree_is_no_matter_of_the_seed() {
    let clear = table(&[1.0, 2.0, 3.0, 4.0], 0.01, 2, 1);
    let found = [Found { judge: Judge::Cloning, scores: &clear }];
    let vote = |seed| panel(&found, 1, &Seed::new(seed)).expect("a whole table").opinions[0].vote;
    assert!((0..100).all(|seed| vote(seed) == Vote::Counts));
}

/// Repeats of two demonstrations agree by chance too often to tell anything, which is no reason to hear the other judge alone.
#[test]
fn of_too_few_demonstrations_no_agreement_is_asked() {
    let vote = |worth: &[f64], repeats| {
        let clear = table(worth, 0.01, repeats, 1);
        judged(&clear, &clear).of(Judge::Cloning).map(|opinion| opinion.vote)
    };
    assert_eq!(vote(&[1.0, 2.0], 4), Some(Vote::TooFewToTell), "by chance in one of eight cases");
    assert_eq!(vote(&[1.0, 2.0], 6), Some(Vote::Counts), "in one of 32");
    assert_eq!(vote(&[1.0, 2.0, 3.0], 2), Some(Vote::TooFewToTell), "in one of six");
    let ties = table(&[0.0, 0.0, 0.0, 0.0, 1.0], 0.0, 2, 1);
    let judged_twice = judged(&ties, &table(&[1.0, 2.0, 3.0, 4.0, 5.0], 0.1, 4, 1));
    let of_ties = judged_twice.of(Judge::Cloning).map(|opinion| opinion.vote);
    assert_eq!(of_ties, Some(Vote::TooFewToTell), "only one succeeds, so both agree in one of five cases");
    assert_eq!(vote(&[1.0, 2.0, 3.0], 3), Some(Vote::Counts), "in one of 36");
    assert_eq!(vote(&[-1.0, -2.0], 4), Some(Vote::TaughtNothing));
    let (clear, once) = (table(&[1.0, 2.0], 0.01, 4, 1), table(&[0.2, 0.1], 0.01, 1, 2));
    assert_eq!(judged(&clear, &once).decides, Judges::Both);
}

#[test]
fn where_both_have_a_vote_the_mean_of_their_gains_is_the_order() {
    let one = table(&[6.0, 5.0, 1.0, 2.0, 3.0], 0.05, 4, 1);
    let other = table(&[0.6, 0.1, 9.0, 0.2, 0.3], 0.05, 4, 2);
    let panel = judged(&one, &other);
    assert_eq!(panel.decides, Judges::Both);
    let Order { ranking, uncertainty } = panel.deciding();
    let order: Vec<usize> = ranking.entries.iter().map(|entry| entry.demo.0).collect();
    assert_eq!(order, [2, 0, 1, 4, 3]);
    let gain = |opinion: &Opinion| opinion.uncertainty.of(DemoId(2)).expect("judged").gain;
    let doubt = uncertainty.of(DemoId(2)).expect("judged");
    assert!((doubt.gain - (gain(&panel.opinions[0]) + gain(&panel.opinions[1])) / 2.0).abs() < 1e-12);
    assert_eq!(ranking.entries[0].gain, doubt.gain);
    // Independent judges of equal noise: the interval of a mean is narrower than either of theirs.
    let width = |uncertainty: &Uncertainty| {
        let doubt = uncertainty.of(DemoId(2)).expect("judged");
        doubt.high - doubt.low
    };
    let both = width(uncertainty);
    assert!(panel.opinions.iter().all(|opinion| both < width(&opinion.uncertainty)), "{both}");
    assert_eq!(panel.others().count(), 2, "neither alone is taken");
}

/// A judge under which all imitations come out alike moves nothing, whatever its order.
#[test]
fn a_judge_that_learned_little_says_little() {
    let strong = table(&[10.0, 20.0, 30.0, 40.0, 50.0], 0.05, 4, 1);
    let weak = table(&[1.5, 1.4, 1.3, 1.2, 1.1], 0.01, 4, 2);
    let panel = judged(&strong, &weak);
    assert_eq!((panel.decides, panel.agreement), (Judges::Both, Some(-1.0)));
    let (both, one) = (panel.deciding().ranking.demos(), panel.opinions[0].ranking.demos());
    assert_eq!(both, one);
}

#[test]
fn a_judge_under_which_nothing_surely_helps_has_no_vote() {
    let harm = table(&[-1.0, -2.0, -3.0, -4.0, -5.0, -6.0], 0.1, 4, 1);
    let good = table(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0.1, 4, 1);
    let panel = judged(&harm, &good);
    assert_eq!(panel.of(Judge::Cloning).map(|opinion| opinion.vote), Some(Vote::TaughtNothing));
    assert_eq!(panel.decides, Judges::Paper);
}

#[test]
fn of_one_repeat_nobody_can_say_how_well_it_agrees_with_itself() {
    let once = table(&[1.0, 2.0, 3.0], 0.1, 1, 1);
    let panel = judged(&once, &once);
    assert_eq!(panel.opinions[0].vote, Vote::Unrepeated);
    assert_eq!(panel.opinions[0].agrees_with_itself, None);
}

/// Chance gets a vote about as often as it is said: in at most one of twenty sets of equals.
#[test]
fn equals_seldom_get_a_judge_a_vote() {
    let votes = (0..200)
        .filter(|&number| {
            let equals = table(&[3.0; 8], 1.0, 4, 100 + number);
            judged(&equals, &equals).opinions[0].vote.counts()
        })
        .count();
    assert!(votes <= 18, "{votes} of 200; one of twenty would be 10");
}

#[test]
fn a_judge_of_those_near_the_cut_decides_nothing_and_is_heard_about_them() {
    let worth: Vec<f64> = (0..12).map(|demo| 12.0 - f64::from(demo)).collect();
    let all = table(&worth, 0.05, 4, 1);
    // The best K are 0 to 5; of 4 to 7 the other judge would put the last two above.
    let mut near = table(&[0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0], 0.05, 4, 2);
    near.suitabilities.retain(|of| of.demo.0 >= 4);
    let judged = |first: &ScoreTable| {
        let found =
            [Found { judge: Judge::Cloning, scores: first }, Found { judge: Judge::Paper, scores: &near }];
        panel(&found, 6, &Seed::new(1)).expect("whole tables")
    };
    let panel = judged(&all);
    let near_cut = panel.of(Judge::Paper).expect("it was asked");
    assert!(panel.judged_all(&panel.opinions[0]) && !panel.judged_all(near_cut));
    assert_eq!((near_cut.judged(), panel.places_above(near_cut, 6)), (4, 2));
    assert_eq!((panel.decides, panel.agreement), (Judges::Cloning, Some(-1.0)));
    let found: Vec<(usize, Judge)> =
        panel.disagreements.iter().map(|found| (found.demo.0, found.kept_by)).collect();
    let (cloning, paper) = (Judge::Cloning, Judge::Paper);
    assert_eq!(found, [(4, cloning), (5, cloning), (6, paper), (7, paper)]);

    let chance = table(&[3.0; 12], 1.0, 4, 3);
    assert_eq!(judged(&chance).decides, Judges::Cloning, "the other has a vote, but no order of all");
}

#[test]
fn judges_disagree_where_each_is_sure_of_the_other_side() {
    let one = table(&[6.0, 5.0, 1.0, 2.0, 3.0], 0.05, 4, 1);
    let other = table(&[6.0, 1.0, 5.0, 2.0, 3.0], 0.05, 4, 2);
    let panel = judged(&one, &other);
    let found: Vec<(usize, Judge)> =
        panel.disagreements.iter().map(|found| (found.demo.0, found.kept_by)).collect();
    assert_eq!(found, [(1, Judge::Cloning), (2, Judge::Paper)]);
    // scipy.stats.spearmanr([5, 4, 1, 2, 3], [5, 1, 4, 2, 3])
    assert!((panel.agreement.expect("two judges") - 0.1).abs() < 1e-9);
}
