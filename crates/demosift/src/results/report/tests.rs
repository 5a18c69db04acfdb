use super::*;
use crate::basics::ledger::InMemory;
use crate::basics::observer::Silent;
use crate::basics::seed::Seed;
use crate::data::observation_filter::ObservationFilter;
use crate::learning::adapt::{InnerUpdate, Learner, Rule};
use crate::learning::advantage::AdvantageEstimation;
use crate::learning::behavioral_cloning::{Cloning, Descent};
use crate::learning::gail::Fitting;
use crate::learning::trpo::{StepEnd, TrustRegion};
use crate::results::data_only::Column;
use crate::results::panel::{Found, panel};
use crate::stages::judge::{
    self, AdaptedPolicy, Imitating, Judging, JudgingState, ScoredOn, Start, Threads, Trial,
};
use crate::stages::method::{Account, Budget, Method, Spent};
use crate::stages::select::Ranked;
use crate::world::point_mass::{PointMass, planted_set};
use crate::world::policy::{Policy, PolicyShape};
use crate::world::rollout::{Acting, Playground};

/// One update of which only the score is known.
fn update(score: Option<f64>) -> UpdateReport {
    UpdateReport {
        score,
        discriminator_loss: None,
        discriminator_accuracy: None,
        reward_mean: None,
        reward_std: None,
        kl: None,
        natural_step: None,
        cloning_loss: None,
        cloning_loss_after: None,
        end: StepEnd::Moved,
    }
}

/// The agent scores −2 and −4 before, and `after` after, on two evaluation seeds; two repeats.
fn suitability(demo: usize, after: [[f64; 2]; 2]) -> Suitability {
    Suitability {
        demo: DemoId(demo),
        variant: EnvVariant(0),
        before: vec![vec![-2.0, -4.0]],
        after: after.map(|scores| scores.to_vec()).to_vec(),
        distances: vec![1.0, 2.0],
        curves: vec![
            vec![update(Some(-3.0)), update(Some(-1.0))],
            vec![update(Some(-5.0)), update(Some(-2.0))],
        ],
        evaluated: None,
    }
}

fn table() -> ScoreTable {
    let scores = [[[-6.0, -6.5], [-6.0, -6.5]], [[-1.0, -2.0], [-1.0, -1.5]], [[-3.0, -3.5], [-3.0, -4.0]]];
    ScoreTable::new(scores.into_iter().enumerate().map(|(demo, after)| suitability(demo, after)).collect())
}

fn judged() -> Judged {
    let shape = PolicyShape { hidden: vec![2], initial_std: 0.5 };
    let adapted = |of: &Suitability| AdaptedPolicy {
        demo: of.demo,
        variant: of.variant,
        policy: Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(of.demo.0 as u64)),
    };
    let scores = table();
    Judged { adapted: scores.suitabilities.iter().map(adapted).collect(), scores }
}

fn found(kept: Option<&[usize]>) -> Result<Report> {
    let (mut ledger, set) = (InMemory::default(), planted_set(&[180.0, 0.0, 90.0], Seed::new(1))?);
    judged().store(&mut ledger, "cloning")?;
    if let Some(kept) = kept {
        Subset { demos: kept.iter().copied().map(DemoId).collect() }.store(&mut ledger, "")?;
    }
    let column = |name: &str, scores: [f64; 3]| Column {
        name: name.to_owned(),
        meaning: String::new(),
        scores: scores.to_vec(),
    };
    report(&Sources {
        ledger: &ledger,
        set: &set,
        task: &PointMass::new(),
        keep: Keep::Quarter,
        kept_part: "subset",
        panel: &panel(&[Found { judge: Judge::Cloning, scores: &table() }], 1, &Seed::new(2))?,
        own_heuristic: None,
        data_only: &DataOnly { columns: vec![column("right", [1.0, 9.0, 3.0]), column("alike", [2.0; 3])] },
        costs: &Costs {
            method: Method::Maml,
            budget: Budget { quota: 100, updates: 1, iterations: 2 },
            judging: "judge_paper".to_owned(),
            spent: vec![
                ("meta_train".to_owned(), Spent { environment_steps: 60, ..Spent::default() }),
                ("judge_paper".to_owned(), Spent { environment_steps: 30, ..Spent::default() }),
                ("imitate_all".to_owned(), Spent { environment_steps: 500, ..Spent::default() }),
            ],
            demonstrations: 3,
        },
    })
}

#[test]
fn entries_stand_in_the_order_of_the_ranking_with_their_doubts() {
    let report = found(Some(&[1, 2])).expect("judged");
    let demos: Vec<usize> = report.entries.iter().map(|entry| entry.demo.0).collect();
    assert_eq!((demos, report.k, report.has_subset), (vec![1, 2, 0], 2, true));
    let [best, _, worst] = &report.entries[..] else { panic!("three demonstrations") };
    // The mean of −1, −2, −1, −1.5, less the mean of −2, −4.
    assert!((best.after + 1.375).abs() < 1e-12 && (best.gain - 1.625).abs() < 1e-12);
    assert!(best.low < best.gain && best.gain < best.high && best.kept && !worst.kept);
    assert!(best.top > worst.top && best.group == 1 && worst.group == report.groups);
    assert_eq!((report.before, report.adapted_behaviors_distance), (-3.0, 1.5));
    assert!(best.by_variant.is_empty(), "there is one variant only");
    assert_eq!(
        best.steps,
        planted_set(&[180.0, 0.0, 90.0], Seed::new(1)).expect("valid").get(DemoId(1)).steps()
    );
}

#[test]
fn what_a_run_has_not_found_yet_is_not_there() {
    let report = found(None).expect("judged");
    assert_eq!((report.k, report.has_subset), (1, false), "a quarter of three, rounded up");
    assert!(report.learning.is_none() && report.weights.is_none());
    let error = super::judged(&InMemory::default(), Judge::Paper).expect_err("nothing is there");
    assert!(error.is_bad_input() && error.hint().is_some(), "{error}");
}

#[test]
fn a_band_is_the_mean_and_the_range_of_the_repeats() {
    let report = found(None).expect("judged");
    let curve = &report.curves[0];
    let bands = [Band { low: -5.0, mean: -4.0, high: -3.0 }, Band { low: -2.0, mean: -1.5, high: -1.0 }];
    assert_eq!(curve.score, bands);
    assert!(curve.accuracy.is_empty(), "cloning has no discriminator");
    // An update that not every repeat made, or knows, ends the band.
    let uneven = [vec![update(Some(1.0)), update(Some(1.0))], vec![update(Some(1.0))]];
    assert_eq!(super::bands(&uneven, |update| update.score).len(), 1);
    assert!(super::bands(&[], |update| update.score).is_empty());
}

#[test]
fn columns_have_places_and_an_agreement_where_they_tell_anything_apart() {
    let report = found(None).expect("judged");
    let [right, alike] = &report.data_only[..] else { panic!("two columns") };
    assert_eq!((&right.scores, &right.places), (&vec![9.0, 3.0, 1.0], &vec![1.0, 2.0, 3.0]));
    assert!((right.spearman.expect("they differ") - 1.0).abs() < 1e-12);
    assert_eq!((&alike.places, alike.spearman), (&vec![2.0; 3], None));
}

#[test]
fn costs_name_the_stages_and_count_the_quota() {
    let costs = found(None).expect("judged").costs;
    assert_eq!((costs.quota, costs.of_quota, costs.stages.len()), (100, 90, 3));
    assert_eq!(costs.account, Some(Account { once: 60, each: 10 }));
}

#[test]
fn the_typical_evaluation_is_the_one_nearest_to_the_means() {
    // Away from the means, over the agent before and all three after: the two seeds of each lie as far on either side.
    assert_eq!(typical_evaluation(&table(), EnvVariant(0)), 0, "the first of those alike");
    let mut scores = table();
    for of in &mut scores.suitabilities {
        of.before = vec![vec![-9.0, -3.0, -3.1]];
        of.after = vec![vec![-9.0, -3.0, -3.1]];
    }
    // The mean is −5.03: −3.1 is nearer to it than −3 and −9 are.
    assert_eq!(typical_evaluation(&scores, EnvVariant(0)), 2);
}

/// What is played again must be what was scored: by judging itself, on the point mass.
#[test]
fn an_evaluation_is_played_again_to_the_bit_and_a_changed_one_is_refused() {
    [ScoredOn::Evaluations, ScoredOn::LastBatches].into_iter().for_each(plays_again);
}

fn plays_again(scored_on: ScoredOn) {
    let task = PointMass::new();
    let playground = Playground::new(&task);
    let set = planted_set(&[180.0, 0.0], Seed::new(1)).expect("valid");
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
    let prior = Learner::untrained(&set, &shape, &[8], &Seed::new(4));
    let acting = Acting::Sampled;
    let judging = Judging {
        iterations: 3,
        averaged: 2,
        scored_on,
        evaluations: 3,
        repeats: 2,
        most_repeats: 2,
        acting,
    };
    let seed = Seed::new(5);
    let trial = Trial {
        set: &set,
        demos: &set.ids(),
        playground: &playground,
        start: Start::Prior(&prior),
        imitating: Imitating::Updates(&inner()),
        judging: &judging,
        cut: 1,
        part: "",
        seed: &seed,
    };
    let judged = judge::judge(&trial, &Threads, &mut JudgingState::default(), &mut Silent).expect("judged");
    for (of, adapted) in judged.scores.suitabilities.iter().zip(&judged.adapted) {
        for evaluation in 0..3 {
            let again = |policy| {
                let (variant, seed) = (of.variant, &seed);
                let rollout = judge::replay(&playground, policy, &judging, variant, evaluation, seed);
                rollout.expect("played").rollout.trajectory
            };
            assert_eq!(playground.score(&again(&prior.policy)), of.evaluated_before()[evaluation]);
            assert_eq!(playground.score(&again(&adapted.policy)), of.evaluated_after()[evaluation]);
        }
    }
    // There is nothing to draw of a point mass, yet all is played and compared.
    let look = |seed: &Seed| agent_episodes(&playground, &prior.policy, &judged, &judging, seed, &set.ids());
    let shown = look(&seed).expect("the same scores");
    assert_eq!(shown.len(), 1 + set.len(), "the agent before, and after each");
    assert!(shown.iter().all(|shown| shown.states.is_none()));
    let error = look(&Seed::new(6)).expect_err("other luck");
    assert!(error.is_bad_input() && error.to_string().contains("when it was judged"), "{error}");
}

/// A ranking of so many: the demonstration of place p has the number 7 p modulo their number, which is no multiple of 7.
fn ranking_of(count: usize) -> Ranking {
    let ranked = |place: usize| Ranked {
        demo: DemoId(7 * place % count),
        before: 0.0,
        after: 0.0,
        gain: -(place as f64),
    };
    Ranking { entries: (0..count).map(ranked).collect() }
}

#[test]
fn of_a_large_set_the_best_the_worst_and_those_near_the_cut_are_looked_at() {
    let places = |count: usize, kept: usize| -> Vec<usize> {
        let ranking = ranking_of(count);
        let shown = worth_a_look(&ranking, kept);
        let place =
            |demo: &DemoId| ranking.entries.iter().position(|entry| entry.demo == *demo).expect("ranked");
        shown.iter().map(place).collect()
    };
    assert_eq!(places(40, 10), (0..40).collect::<Vec<_>>());
    assert_eq!(places(1000, 250), (0..8).chain(236..264).chain(996..1000).collect::<Vec<_>>());
    // At either end the cut has neighbors on one side only.
    assert_eq!(places(1000, 3), (0..36).chain(996..1000).collect::<Vec<_>>());
    assert_eq!(places(1000, 1000), (0..8).chain(968..1000).collect::<Vec<_>>());
}

/// By counting, as it was done before.
#[test]
fn a_column_is_put_into_the_order_of_the_ranking() {
    let ranking = ranking_of(100);
    let of_set: Vec<f64> = (0..100).map(f64::from).collect();
    let counted = |entry: &Ranked| ranking.entries.iter().filter(|other| other.demo < entry.demo).count();
    assert_eq!(ranking.places_in_set(), ranking.entries.iter().map(counted).collect::<Vec<_>>());
    assert_eq!(ranking.ordered(&of_set)[1], 7.0);
}

/// An inner update that takes no time.
fn inner() -> InnerUpdate {
    let descent = Descent::Gradient;
    InnerUpdate {
        imitation: Rule::Gail,
        batch_steps: 60,
        alphas: vec![1.0],
        trust_region: TrustRegion::default(),
        discriminator: Fitting { learning_rate: 0.01, steps: 2, batch: 20, entropy: 0.1, most_told: 1.0 },
        advantage: AdvantageEstimation::default(),
        cloning: Cloning { descent, learning_rate: 0.1, steps: 1, batch: 10, curve_episodes: 0 },
    }
}
