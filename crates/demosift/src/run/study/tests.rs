use super::summary::summarize;
use super::work::top;
use super::*;
use crate::math::agreement;

mod drawing;

fn seeds(count: usize) -> Seeds {
    Seeds { first: 0, count }
}

fn ids(ids: &[usize]) -> Vec<DemoId> {
    ids.iter().copied().map(DemoId).collect()
}

/// Four demonstrations, two judges and what combines them, three seeds of judging and two of the oracle.
fn study() -> Study {
    let judge = |name: &str, clones, combination| Judge {
        name: name.to_owned(),
        clones,
        own_prior: false,
        combination,
    };
    let of = ["paper", "cloning"].map(str::to_owned).to_vec();
    Study {
        name: "test".to_owned(),
        sets: vec![Set {
            name: "four".to_owned(),
            task: "point_mass".to_owned(),
            variant: None,
            unit: "m".to_owned(),
            episodes: None,
            demonstrations: 4,
            seeds: seeds(3),
            oracle_seeds: seeds(2),
            regret: true,
            known: vec![Known { kind: "return".to_owned(), values: vec![1.0, 2.0, 3.0, 4.0] }],
            prior: None,
            bodies: Vec::new(),
            succeeded: Vec::new(),
            recorded_under: Vec::new(),
            body: None,
        }],
        methods: vec![
            judge("paper", false, None),
            judge("cloning", true, None),
            judge("both", false, Some(Combination { rule: CombinationRule::Ranks, of })),
        ],
        oracle: vec![Rule::Gail],
        hits_at: vec![TopK::Count(1), TopK::Half],
        regret: Some(Regret {
            at: vec![TopK::Count(1), TopK::Count(2)],
            imitators: vec![Rule::Gail],
            trainings: seeds(2),
        }),
        pools: Vec::new(),
        referees: Vec::new(),
        drawn: Drawn::default(),
    }
}

fn judged(method: &str, seed: u64, scores: [f64; 4]) -> Cell {
    let of =
        |score: &f64| JudgedDemonstration { score: *score, after: score + 1.0, repeats: vec![score + 1.0] };
    let cost = |environment_steps| Cost { environment_steps, seconds: environment_steps as f64 / 100.0 };
    Cell {
        work: Work::Judging { set: "four".to_owned(), method: method.to_owned(), seed },
        found: Found::Judging(JudgingResult {
            vote: None,
            demonstrations: scores.iter().map(of).collect(),
            adapted_behaviors_distance: 0.5,
            once: cost(1000),
            judging: cost(400),
            adaptation: None,
            prior: None,
        }),
        fingerprint: Fingerprint::default(),
    }
}

fn trained(demos: &[usize], seed: u64, end: f64) -> Cell {
    let outcome = |score| Outcome { score, success: None, true_return: None, standard_error: 0.0 };
    Cell {
        work: Work::Training { set: "four".to_owned(), demos: ids(demos), imitator: Rule::Gail, seed },
        found: Found::Training(TrainingResult {
            end: outcome(end),
            chosen: outcome(end + 1.0),
            cost: Cost::default(),
            curve: Curve::default(),
        }),
        fingerprint: Fingerprint::default(),
    }
}

const PAPER: [[f64; 4]; 3] = [[0.1, 0.2, 0.3, 0.4], [0.1, 0.3, 0.2, 0.4], [0.4, 0.2, 0.3, 0.1]];
const ORACLE: [[f64; 4]; 2] = [[1.0, 2.0, 4.0, 3.0], [1.0, 3.0, 2.0, 6.0]];

fn finished() -> Finished {
    let mut cells: Vec<Cell> = Vec::new();
    for (seed, scores) in PAPER.into_iter().enumerate() {
        cells.push(judged("paper", seed as u64, scores));
        cells.push(judged("cloning", seed as u64, [5.0, 5.0, 5.0, 5.0]));
    }
    for (seed, ends) in ORACLE.into_iter().enumerate() {
        cells.extend(ends.into_iter().enumerate().map(|(demo, end)| trained(&[demo], seed as u64, end)));
    }
    cells.into_iter().collect()
}

fn close(found: f64, wanted: f64) {
    assert!((found - wanted).abs() < 1e-12, "{found} is not {wanted}");
}

#[test]
fn work_is_named_once_and_the_cheapest_kind_comes_first() {
    let study = study();
    let work = study.work(&Finished::default());
    let names: std::collections::BTreeSet<String> = work.iter().map(Work::name).collect();
    assert_eq!((work.len(), names.len()), (3 * 2 + 4 * 2, 14));
    assert!(matches!(&work[0], Work::Judging { method, .. } if method == "cloning"));
    assert!(matches!(&work[13], Work::Training { demos, seed: 1, .. } if demos == &ids(&[3])));
    // 4 x 2 of the oracle can be named; regret asks for the best and the top of three methods x three seeds, at two K.
    assert_eq!(study.most_unknown_trainings(&Only::default(), &Finished::default()), 2 * 10 * 2);
}

#[test]
fn trainings_on_the_top_1_are_those_of_the_oracle() {
    let (study, finished) = (study(), finished());
    let missing: Vec<Work> = study.work(&finished).into_iter().filter(|work| !finished.holds(work)).collect();
    // Truly best 2: {2, 3} by 3 and 4.5. The paper keeps {2, 3}, {1, 3} and {0, 2}; cloning, which ties, {0, 1}.
    let mut subsets: Vec<Vec<DemoId>> = missing
        .iter()
        .map(|work| match work {
            Work::Training { demos, .. } => demos.clone(),
            _ => panic!("all are judged"),
        })
        .collect();
    subsets.sort();
    subsets.dedup();
    assert_eq!(subsets, [ids(&[0, 1]), ids(&[0, 2]), ids(&[1, 3]), ids(&[2, 3])]);
    assert_eq!(missing.len(), 4 * 2);
}

#[test]
fn an_oracle_that_is_not_finished_does_not_say_what_is_best() {
    let (study, whole) = (study(), finished());
    let part: Finished =
        whole.cells().filter(|cell| cell.work.name() != "training_four_gail_3_1").cloned().collect();
    let best = |finished: &Finished| study.truly_best(&study.sets[0], Rule::Gail, 1, finished);
    assert_eq!(best(&whole), Some(ids(&[3])));
    assert_eq!(best(&part), None);
    let mut failed = part;
    let work = Work::Training { set: "four".to_owned(), demos: ids(&[3]), imitator: Rule::Gail, seed: 1 };
    failed.add(Cell { work, found: Found::Failed("NaN".to_owned()), fingerprint: Fingerprint::default() });
    assert_eq!(best(&failed), Some(ids(&[2])), "by the seed that is left");
    assert_eq!(summarize(&study, &failed).failures.len(), 1);
}

#[test]
fn agreement_leaves_one_seed_out_for_judges_as_for_the_ceiling() {
    let summary = summarize(&study(), &finished());
    let find = |truth: &str, method: Option<&str>| {
        let of =
            |row: &&summary::Agreement| row.truth.to_string() == truth && row.method.as_deref() == method;
        summary.sets[0].agreement.iter().find(of).expect("a row")
    };
    let between = agreement::spearman(&ORACLE[0], &ORACLE[1]);
    close(find("oracle by gail", None).spearman.mean, between);
    // By brute force: each seed of the judge against each oracle without the other one.
    let each = |of: fn(&[f64], &[f64]) -> f64| {
        let all = PAPER.iter().flat_map(|scores| ORACLE.iter().map(move |oracle| of(scores, oracle)));
        all.sum::<f64>() / 6.0
    };
    let paper = find("oracle by gail", Some("paper"));
    close(paper.spearman.mean, each(agreement::spearman));
    close(paper.kendall.mean, each(agreement::kendall));
    close(paper.hit_rates[0].mean, each(|a, b| agreement::hit_rate(a, b, 1)));
    assert_eq!(paper.spearman.seeds, 3);
    close(find("return", Some("paper")).spearman.mean, (1.0 + 0.8 - 0.8) / 3.0);
    close(find("return", Some("cloning")).spearman.mean, 0.0);
    // What ties says nothing, so the combination is the paper's ranking.
    close(find("return", Some("both")).spearman.mean, find("return", Some("paper")).spearman.mean);
    assert!(
        !summary.sets[0]
            .agreement
            .iter()
            .any(|row| row.truth.to_string() == "return" && row.method.is_none())
    );
}

#[test]
fn a_judge_that_clones_is_not_held_against_an_oracle_by_cloning() {
    let mut study = study();
    study.oracle = vec![Rule::BehavioralCloning];
    let gail = finished();
    let cloned = gail.cells().cloned().map(|mut cell| {
        if let Work::Training { imitator, .. } = &mut cell.work {
            *imitator = Rule::BehavioralCloning;
        }
        cell
    });
    let summary = summarize(&study, &cloned.collect());
    let judges: Vec<Option<&str>> = summary.sets[0]
        .agreement
        .iter()
        .filter(|row| row.truth == Against::Oracle(Rule::BehavioralCloning))
        .map(|row| row.method.as_deref())
        .collect();
    assert_eq!(judges, [None, Some("paper")], "a combination with a cloning judge clones too");
}

#[test]
fn differences_are_paired_by_seed() {
    let summary = summarize(&study(), &finished());
    let of = |row: &&summary::Compared| row.truth.to_string() == "return" && row.other == "cloning";
    let found = summary.sets[0].differences.iter().find(of).expect("a row");
    close(found.difference.mean, 1.0 / 3.0);
    assert!(!found.separable && found.difference.pairs == 3);
    let over = &summary.over_sets.iter().find(|row| of(&&row.compared)).expect("a row");
    close(over.compared.difference.mean, 1.0 / 3.0);
    assert_eq!(over.sets, 1);
}

/// What chose as the oracle does is trained first: without the others' policies a judge would seem to lose nothing.
#[test]
fn regret_waits_for_the_policies_of_all_seeds() {
    let (study, mut finished) = (study(), finished());
    let rows = |finished: &Finished| {
        let summary = summarize(&study, finished);
        let of_two = summary.sets[0].regret.iter().filter(|row| row.k == 2).map(|row| row.method.clone());
        of_two.collect::<Vec<_>>()
    };
    for demos in [&[2, 3], &[1, 3]] {
        (0..2).for_each(|seed| finished.add(trained(demos, seed, 5.0)));
    }
    assert!(!rows(&finished).contains(&"paper".to_owned()), "its last seed chose 0 and 2");
    (0..2).for_each(|seed| finished.add(trained(&[0, 2], seed, 1.0)));
    assert!(rows(&finished).contains(&"paper".to_owned()));
}

/// The first demonstration is the best by one lucky training, which must not say what it is worth as well.
#[test]
fn the_truly_best_one_is_chosen_by_other_trainings_than_the_one_that_scores_it() {
    let (study, mut finished) = (study(), Finished::default());
    for (demo, ends) in [[9.0, 0.0], [4.0, 4.0], [1.0, 1.0], [2.0, 2.0]].into_iter().enumerate() {
        (0..2).for_each(|seed| finished.add(trained(&[demo], seed, ends[seed as usize])));
    }
    let (set, imitator) = (&study.sets[0], study.oracle[0]);
    let best = |k, seed| study.truly_best_without(seed, set, imitator, k, &finished);
    assert_eq!([0, 1].map(|seed| best(1, seed)), [Some(vec![DemoId(1)]), Some(vec![DemoId(0)])]);
    assert_eq!(best(1, 7), Some(vec![DemoId(0)]), "a training that is none of the oracle's");
    assert_eq!(best(2, 0), Some(vec![DemoId(0), DemoId(1)]), "trainings on two choose nothing");
}

/// A seed of the oracle that failed is none, so those after it must not be taken for it.
#[test]
fn the_truly_best_one_is_chosen_by_others_where_an_earlier_seed_failed() {
    let (mut study, mut finished) = (study(), Finished::default());
    study.sets[0].oracle_seeds = seeds(3);
    for (demo, ends) in [[9.0, 0.0], [4.0, 4.0], [1.0, 1.0], [2.0, 2.0]].into_iter().enumerate() {
        (1..3).for_each(|seed| finished.add(trained(&[demo], seed, ends[seed as usize - 1])));
        let alone = trained(&[demo], 0, 0.0);
        let found = if demo == 3 { Found::Failed("NaN".to_owned()) } else { alone.found };
        finished.add(Cell { found, ..alone });
    }
    let best = |seed| study.truly_best_without(seed, &study.sets[0], Rule::Gail, 1, &finished);
    assert_eq!([1, 2].map(best), [Some(ids(&[1])), Some(ids(&[0]))]);
}

#[test]
fn regret_is_the_mean_over_paired_trainings() {
    let (study, mut finished) = (study(), finished());
    let pairs = [(&[2, 3], [5.0, 7.0]), (&[1, 3], [4.0, 5.0]), (&[0, 2], [1.0, 1.0]), (&[0, 1], [0.0, 2.0])];
    for (demos, ends) in pairs {
        ends.into_iter().enumerate().for_each(|(seed, end)| finished.add(trained(demos, seed as u64, end)));
    }
    let summary = summarize(&study, &finished);
    let find = |k: usize, method: &str| {
        let of = |row: &&summary::RegretSummary| (row.k, row.method.as_str()) == (k, method);
        summary.sets[0].regret.iter().find(of).expect("a row")
    };
    // Each training finds the other's best one, with 3 and 2; the paper's first are 3, 3 and 0, with 4.5 and 1 in the mean.
    close(find(1, "paper").regret.mean, ((2.5 - 4.5) + (2.5 - 4.5) + (2.5 - 1.0)) / 3.0);
    // Alone: 1, 2.5, 3 and 4.5, so the best is 1.75 above their mean.
    close(find(1, "paper").share.expect("an oracle").mean, -2.5 / 3.0 / 1.75);
    close(find(2, "paper").regret.mean, ((6.0 - 6.0) + (6.0 - 4.5) + (6.0 - 1.0)) / 3.0);
    close(find(2, "cloning").regret.mean, 6.0 - 1.0);
    let costs = &summary.sets[0].costs;
    close(costs[0].steps_each, 100.0);
    close(costs[2].seconds_once, 20.0);
    assert_eq!(summary.finished[0], summary.finished[1]);
}

#[test]
fn combinations_are_means_of_ranks_or_of_standardized_scores() {
    let mut study = study();
    let mut finished = finished();
    finished.add(judged("cloning", 0, [40.0, 10.0, 20.0, 10.0]));
    let scores =
        |study: &Study| study.scores(&study.sets[0], &study.methods[2], 0, &finished).expect("finished");
    assert_eq!(scores(&study), [(1.0 + 4.0) / 2.0, (2.0 + 1.5) / 2.0, (3.0 + 3.0) / 2.0, (4.0 + 1.5) / 2.0]);
    study.methods[2].combination.as_mut().expect("it is one").rule = CombinationRule::Scores;
    // numpy: (z([.1, .2, .3, .4]) + z([40, 10, 20, 10])) / 2 with the population's spread.
    let wanted = [0.14567619, -0.63185509, 0.2236068, 0.2625721];
    for (found, wanted) in scores(&study).into_iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-6, "{found} is not {wanted}");
    }
}

#[test]
fn the_mean_of_scores_is_that_of_the_methods_with_a_vote() {
    let mut study = study();
    study.methods[2].combination.as_mut().expect("it is one").rule = CombinationRule::Votes;
    let of = |votes: [Option<Vote>; 2]| {
        let mut finished = Finished::default();
        for ((name, scores), vote) in
            [("paper", [1.0, 2.0, 3.0, 4.0]), ("cloning", [2.0, 2.0, 3.0, 4.0])].into_iter().zip(votes)
        {
            let mut cell = judged(name, 0, scores);
            let Found::Judging(judging) = &mut cell.found else { panic!("a cell of judging") };
            judging.vote = vote;
            finished.add(cell);
        }
        study.scores(&study.sets[0], &study.methods[2], 0, &finished)
    };
    let (yes, no) = (Some(Vote::Counts), Some(Vote::TaughtNothing));
    assert_eq!(of([yes, yes]), Some(vec![1.5, 2.0, 3.0, 4.0]));
    assert_eq!(of([no, yes]), Some(vec![2.0, 2.0, 3.0, 4.0]));
    assert_eq!(of([no, no]), Some(vec![1.0, 2.0, 3.0, 4.0]));
    assert_eq!(of([None, yes]), None, "an older cell does not say");
}

#[test]
fn random_subsets_differ_by_seed_and_not_by_anything_else() {
    let (study, finished) = (study(), Finished::default());
    let draw =
        |seed| study.chosen(&study.sets[0], &Choice::Random(TopK::Count(2)), seed, &finished).expect("drawn");
    let draws: std::collections::BTreeSet<Vec<DemoId>> = (0..40).map(draw).collect();
    assert_eq!(draws.len(), 6, "all pairs of four");
    assert_eq!(draw(3), draw(3));
    let kept = Choice::KeptBy { method: "paper".to_owned(), k: TopK::Half, seed: Some(2) };
    assert_eq!(study.chosen(&study.sets[0], &kept, 9, &finished), None, "not judged yet");
    assert_eq!(study.chosen(&study.sets[0], &kept, 9, &self::finished()), Some(ids(&[0, 2])));
    assert_eq!(top(&[1.0, 2.0, 2.0, 0.0], 1), ids(&[1]), "ties by id");
}

#[test]
fn choices_are_written_as_they_are_read() {
    for words in ["all", "random 3", "random half", "kept-by mean of ranks 2", "kept-by paper quarter seed 7"]
    {
        assert_eq!(words.parse::<Choice>().expect("a choice").to_string(), words);
        let json = serde_json::json!(words);
        let back: Choice = serde_json::from_value(json.clone()).expect("a choice");
        assert_eq!(serde_json::to_value(&back).expect("plain data"), json);
    }
    let listed: Choice = serde_json::from_value(serde_json::json!([3, 0, 3])).expect("ids");
    assert_eq!(listed, Choice::Ids(vec![0, 3]));
    for wrong in
        ["some", "random", "random few", "kept-by paper", "kept-by paper 0", "kept-by paper 1 seed x"]
    {
        assert!(wrong.parse::<Choice>().expect_err(wrong).is_bad_config());
    }
}

#[test]
fn a_part_of_a_study_has_what_it_needs_and_no_more() {
    let (study, finished) = (study(), finished());
    let only = |methods: &[&str]| Only {
        sets: None,
        methods: Some(methods.iter().map(|&name| name.to_owned()).collect()),
    };
    let count = |methods: &[&str], finished: &Finished| study.work_only(&only(methods), finished).len();
    let nothing = Finished::default();
    assert_eq!(count(&["both"], &nothing), 6, "a combination needs its parts");
    assert_eq!(count(&["paper", "oracle"], &nothing), 3 + 8);
    // By the oracle, which is not made here, the best one is 3 and the best two are {2, 3}; the paper's first are 3, 3 and 0,
    // and its first two {2, 3}, {1, 3} and {0, 2}.
    assert_eq!(count(&["paper", "regret"], &finished), 3 + 2 * (2 + 3));
    assert_eq!(study.most_unknown_trainings(&only(&["paper", "regret"]), &nothing), 2 * 4 * 2);
    let elsewhere = Only { sets: Some(vec!["five".to_owned()]), methods: None };
    assert_eq!(study.work_only(&elsewhere, &nothing), []);
    for (only, wanted) in [
        (only(&["papier"]), "no method 'papier'; it has: paper, cloning, both, oracle, regret, pools"),
        (elsewhere, "no set 'five'; it has: four"),
    ] {
        let error = study.check_only(&only).expect_err("unknown").to_string();
        assert!(error.contains(wanted), "{error}");
    }
    study.check_only(&only(&["both", "pools"])).expect("known");
}

#[test]
fn what_does_not_fit_together_is_told() {
    let complaint = |change: fn(&mut Study)| {
        let mut study = study();
        change(&mut study);
        let error = study.check().expect_err("does not fit");
        assert!(error.is_bad_config());
        error.to_string()
    };
    study().check().expect("fits");
    let two = complaint(|study| study.methods[1].name = "paper".to_owned());
    assert!(two.contains("two methods called 'paper'"), "{two}");
    let alike = complaint(|study| study.methods.extend(study.methods[0].clone().renamed(["a b", "a-b"])));
    assert!(alike.contains("'a b' and 'a-b' would have the same files"), "{alike}");
    let reserved = complaint(|study| study.methods[0].name = "oracle".to_owned());
    assert!(reserved.contains("names trainings"), "{reserved}");
    let of =
        complaint(|study| study.methods[2].combination.as_mut().expect("it is one").of.push("x".to_owned()));
    assert!(of.contains("combines 'x', and can combine: paper, cloning"), "{of}");
    let known = complaint(|study| study.sets[0].known[0].values.truncate(3));
    assert!(known.contains("has 4 demonstrations, and its return 3"), "{known}");
    let pool = complaint(|study| {
        let subsets = vec![Choice::Ids(vec![1, 4])];
        let set = "four".to_owned();
        study.pools.push(Pool { set, subsets, imitator: Rule::Gail, trainings: seeds(2) });
    });
    assert!(pool.contains("the ids [1, 4]; there are 0 to 3"), "{pool}");
}

#[test]
fn the_referee_draws_from_pools_again() {
    let mut study = study();
    let written = |trainings: &str| trainings.parse().expect("well written");
    study.referees.push(Refereed {
        set: "four".to_owned(),
        kept: vec![Choice::Ids(vec![2, 3]), "random 2".parse().expect("a choice")],
        pools: written("gail=4"),
        with: vec![written("gail=3")],
        first: 0,
    });
    study.check().expect("fits");
    let only = Only { methods: Some(vec![Only::POOLS.to_owned()]), ..Only::default() };
    // Four trainings on the whole set, on the kept and on random pairs, which are the control of both.
    let work = study.work_only(&only, &Finished::default());
    let mut finished = Finished::default();
    for work in &work {
        let Work::Training { demos, seed, .. } = work else { panic!("nothing is judged: {work:?}") };
        let kept = *demos == ids(&[2, 3]);
        let end = if kept { 10.0 } else { 0.0 } + 0.1 * *seed as f64;
        finished.add(trained(&demos.iter().map(|demo| demo.0).collect::<Vec<_>>(), *seed, end));
    }
    let drawn_alike =
        work.iter().filter(|work| matches!(work, Work::Training { demos, .. } if *demos == ids(&[2, 3])));
    let drawn_alike = drawn_alike.count() - 4;
    assert_eq!(work.len() + drawn_alike, 12, "a random pair may be the kept one, which is trained once");
    let found = summarize(&study, &finished).referees;
    assert_eq!(
        found.iter().map(|of| (of.kept.as_str(), of.pool)).collect::<Vec<_>>(),
        [("2, 3", 4), ("random 2", 4)]
    );
    let RefereedSummary { rates, .. } = &found[1];
    assert!(rates.helps <= 0.05 && rates.resamples == 1000, "{rates:?}");
    let total = rates.helps + rates.fewer_helps + rates.cannot_tell + rates.does_not_help;
    assert!((total - 1.0).abs() < 1e-12, "{rates:?}");
    if drawn_alike == 0 {
        assert_eq!(found[0].rates.helps, 1.0, "ten standard deviations are seen");
    }

    let complaint = |change: &dyn Fn(&mut Refereed)| {
        let mut wrong = study.clone();
        change(&mut wrong.referees[0]);
        wrong.check().expect_err("does not fit").to_string()
    };
    let nothing = complaint(&|of| of.with = vec![written("gail=2")]);
    assert!(nothing.contains("gail=2 decides nothing") || nothing.contains("at least 3"), "{nothing}");
    let lacks = complaint(&|of| of.with = vec![written("cloning=5")]);
    assert!(lacks.contains("lack an imitator"), "{lacks}");
    let all = complaint(&|of| of.kept = vec![Choice::All]);
    assert!(all.contains("leaves nothing to compare"), "{all}");
    let ids = complaint(&|of| of.kept = vec![Choice::Ids(vec![9])]);
    assert!(ids.contains("there are 0 to 3"), "{ids}");
}

impl Judge {
    fn renamed(self, names: [&str; 2]) -> [Self; 2] {
        names.map(|name| Self { name: name.to_owned(), ..self.clone() })
    }
}

#[test]
fn a_compact_file_comes_back_and_a_bad_one_is_told() {
    let (study, mut finished) = (study(), finished());
    let mut cell = trained(&[0, 1], 0, 0.123_456_789);
    if let Found::Training(result) = &mut cell.found {
        result.curve.score = vec![1.0, 2.0];
    }
    cell.fingerprint.task = "another".to_owned();
    let (work, other) = (cell.work.clone(), cell.fingerprint.clone());
    finished.add(cell);
    let compact =
        compact::Compact { demosift: "0".to_owned(), study, notes: vec!["a note".to_owned()], finished };
    let bytes = compact::write(&compact, &[]);
    let text = String::from_utf8(bytes.clone()).expect("JSON is UTF-8");
    assert_eq!(text.lines().filter(|line| line.starts_with("{\"found\"")).count(), 15, "a line a cell");
    let back = compact::read(&bytes).expect("just written");
    assert_eq!(compact::write(&back, &[]), bytes);
    let rounded = back.finished.training("four", &ids(&[0, 1]), Rule::Gail, 0).expect("kept");
    assert_eq!(rounded.end.score, 0.123_457);
    assert_eq!(back.finished.cell(&work).expect("kept").fingerprint, other);
    assert!(back.finished.cells().filter(|cell| cell.fingerprint == Fingerprint::default()).count() == 14);
    assert!(rounded.curve.is_empty(), "a compact file has no curves");
    assert_eq!((back.study, back.notes), (compact.study, compact.notes));
    let beyond = text.replace("\"of\":1", "\"of\":7");
    assert_ne!(beyond, text);
    for bad in ["", "{}", "{\"version\": 9}", "[1]", &beyond] {
        assert!(compact::read(bad.as_bytes()).expect_err("bad").is_bad_input());
    }
}

#[test]
fn a_cell_is_what_a_run_finds() {
    use crate::basics::ledger::InMemory;
    use crate::basics::observer::Silent;
    use crate::basics::seed::Seed;
    use crate::run::experiment::{self, Run};
    use crate::world::point_mass::{PointMass, planted_set};
    use crate::world::rollout::Playground;

    let set = planted_set(&[180.0, 5.0, 90.0], Seed::new(1)).expect("planted");
    let mut config = crate::run::preset::Preset::Quick.config();
    (config.meta_train.rounds, config.inner.batch_steps, config.judge.iterations) = (2, 120, 2);
    (config.imitate.environment_steps, config.imitate.update.batch_steps) = (900, 300);
    config.judges = crate::results::panel::Judges::Paper;
    let task = PointMass::new();
    let means = make::Means { set: &set, task: &task, config: &config, prior: None };
    let mut ticks = 0.0;
    let mut clock = || {
        ticks += 1.0;
        ticks
    };
    let judged = make::judging(&means, 7, &mut clock).expect("judges");
    let trained = make::training(&means, &ids(&[0, 1]), Rule::Gail, 7, &mut clock).expect("learns");

    let config = experiment::Config { seed: 7, ..config.clone() };
    let playground = Playground::new(&task);
    let mut ledger = InMemory::default();
    let mut run = Run {
        set: &set,
        playground: &playground,
        config: &config,
        ledger: &mut ledger,
        observer: &mut Silent,
    };
    experiment::prior(&mut run).expect("learns");
    let once = playground.steps_taken();
    let table = experiment::scores(&mut run, crate::results::panel::Judge::Paper).expect("judges");
    let scores: Vec<f64> = table.suitabilities.iter().map(|of| of.gain()).collect();
    assert_eq!(judged.scores(), scores);
    assert_eq!(judged.once, Cost { environment_steps: once, seconds: 1.0 });
    assert_eq!(once + judged.judging.environment_steps, playground.steps_taken());
    let curve = experiment::learning_curve(&mut run, "some", &ids(&[0, 1])).expect("learns");
    assert_eq!(trained.chosen.score, curve.outcome.score);
    assert_eq!(trained.end.score, curve.end.score);
    assert_eq!(trained.curve, Curve::of(&curve.points));
    assert!(!trained.curve.is_empty() && trained.curve.success.len() == trained.curve.score.len());
    assert_eq!(trained.cost.environment_steps, make::planned_training(&means, Rule::Gail));
    assert!(make::planned_judging(&means) >= playground.steps_taken() - trained.cost.environment_steps);
}
