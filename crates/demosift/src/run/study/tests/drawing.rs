//! What a study draws, by numbers that can be worked out by hand.

use super::*;
use crate::run::study::claims::{self, Said};
use crate::run::study::{bodies, compact, curves, draw, told};

/// Ten seeds of two judges on four demonstrations; the paper's judge keeps 3, the other one 0.
fn drawn_study() -> Study {
    let mut study = study();
    study.methods.truncate(2);
    (study.oracle, study.regret) = (Vec::new(), None);
    (study.sets[0].seeds, study.sets[0].oracle_seeds) = (seeds(10), seeds(0));
    let bodies = ["point_mass", "point_mass", "point_mass", "taller"];
    study.sets[0].bodies = bodies.map(str::to_owned).to_vec();
    let claim = |better: &str, than: &str, measure, at: &[Kept]| Claim {
        says: format!("{better} is better than {than}."),
        by: By::Paper,
        better: better.to_owned(),
        than: vec![than.to_owned()],
        measure,
        at: at.to_vec(),
        than_at: None,
        sets: Vec::new(),
    };
    let top = |k| Kept::Top(TopK::Count(k));
    let figure = |name: &str, draws| Figure {
        name: name.to_owned(),
        title: name.to_owned(),
        draws,
        methods: Vec::new(),
        sets: Vec::new(),
    };
    study.drawn = Drawn {
        title: Some("A figure".to_owned()),
        preset: Some("quick".to_owned()),
        in_part: false,
        paper: None,
        reading: None,
        curves: Some(Curves { at: vec![TopK::Count(1), TopK::Half], imitators: vec![Rule::Gail] }),
        weights: Some(Weights { methods: vec!["paper".to_owned()], sets: Vec::new() }),
        figures: vec![
            figure("curves", Draws::TopK),
            figure("adaptation", Draws::Adaptation),
            figure("weights", Draws::Weights),
            figure("bodies", Draws::Bodies),
        ],
        claims: vec![
            claim("paper", "cloning", Measure::Score, &[top(1)]),
            claim("cloning", "paper", Measure::Score, &[top(1)]),
            claim("paper", "all", Measure::Score, &[top(1), Kept::Weights]),
            claim("paper", "cloning", Measure::Distance, &[]),
        ],
    };
    study
}

fn with_curve(mut cell: Cell, scores: &[f64]) -> Cell {
    if let Found::Training(result) = &mut cell.found {
        result.curve = Curve {
            updates: (0..scores.len()).collect(),
            environment_steps: (0..scores.len()).map(|point| 100 * point).collect(),
            score: scores.to_vec(),
            success: Vec::new(),
        };
    }
    cell
}

fn drawn_cells(count: u64) -> Finished {
    let mut cells = Vec::new();
    for seed in 0..count {
        let wobble = if seed % 2 == 0 { 0.1 } else { -0.1 };
        let mut of_paper = judged("paper", seed, [0.1, 0.2, 0.3, 0.4]);
        if let Found::Judging(result) = &mut of_paper.found {
            result.adapted_behaviors_distance = 0.4;
            let score = (0..4).map(|demo| vec![f64::from(demo), f64::from(demo) + wobble]).collect();
            result.adaptation = Some(Adaptation { updates: vec![0, 1], score });
        }
        cells.push(of_paper);
        cells.push(judged("cloning", seed, [0.4, 0.3, 0.2, 0.1]));
        cells.push(with_curve(trained(&[3], seed, 5.0 + wobble), &[0.0, 5.0 + wobble]));
        cells.push(with_curve(trained(&[0], seed, 4.0), &[0.0, 4.0]));
        cells.push(with_curve(trained(&[2, 3], seed, 5.0), &[0.0, 5.0]));
        cells.push(with_curve(trained(&[0, 1], seed, 4.0), &[0.0, 4.0]));
        cells.push(with_curve(trained(&[0, 1, 2, 3], seed, 5.0 - wobble), &[0.0, 5.0 - wobble]));
        cells.push(Cell {
            work: Work::Weighing { set: "four".to_owned(), method: "paper".to_owned(), seed },
            found: Found::Weighing(WeighingResult {
                // The odd seeds end a round earlier.
                weights: vec![vec![0.5, 0.5, 1.0, 2.0]; if seed % 2 == 0 { 2 } else { 1 }],
                end: WeighingEnd::Converged,
                demos: ids(&[2, 3]),
                once: Cost::default(),
                weighing: Cost { environment_steps: 10, seconds: 3600.0 },
            }),
            fingerprint: Fingerprint::default(),
        });
    }
    cells.into_iter().collect()
}

#[test]
fn what_is_kept_with_a_seed_is_learned_with_that_seed() {
    let study = drawn_study();
    study.check().expect("fits");
    let nothing = study.work(&Finished::default());
    let of = |work: &[Work], kind: fn(&Work) -> bool| work.iter().filter(|work| kind(work)).count();
    let trains = |work: &Work| matches!(work, Work::Training { .. });
    let weighs = |work: &Work| matches!(work, Work::Weighing { .. });
    // Before judging, only the whole set can be learned from.
    assert_eq!((nothing.len(), of(&nothing, trains), of(&nothing, weighs)), (2 * 10 + 10 + 10, 10, 10));
    let only = Only::default();
    // K = 1 and 2 of two methods, by weights of one: 50, of which 10 are known to be the same only afterwards.
    assert_eq!(study.most_unknown_trainings(&only, &Finished::default()), 50);

    let mut judged_once: Finished = drawn_cells(1);
    judged_once.add(judged("paper", 7, [0.9, 0.2, 0.3, 0.4]));
    let work = study.work(&judged_once);
    let is = |work: &&Work, wanted: &[usize], with: u64| match work {
        Work::Training { demos, seed, .. } => *demos == ids(wanted) && *seed == with,
        _ => false,
    };
    assert_eq!(work.iter().filter(|work| is(work, &[0], 7)).count(), 1, "the top 1 of seed 7");
    assert!(!work.iter().any(|work| is(&work, &[3], 7)), "the top 1 of seed 0 is not learned with seed 7");
    let whole = study.work(&drawn_cells(10));
    assert_eq!(of(&whole, trains), 50, "what weights keep is the top 2, which is trained once");
    assert_eq!(study.most_unknown_trainings(&only, &drawn_cells(10)), 10);

    let named = |names: &[&str]| Only {
        methods: Some(names.iter().map(|&name| name.to_owned()).collect()),
        ..Only::default()
    };
    assert_eq!(study.work_only(&named(&["paper", "weights"]), &Finished::default()).len(), 20);
    assert_eq!(study.work_only(&named(&["cloning", "curves"]), &drawn_cells(10)).len(), 10 + 10 + 20);
}

#[test]
fn claims_are_decided_by_the_paired_interval() {
    let study = drawn_study();
    let decided = claims::decide(&study, &drawn_cells(10));
    let found: Vec<Vec<Said>> =
        decided.iter().map(|of| of.cases.iter().map(|case| case.found).collect()).collect();
    use Said::{Agrees, Disagrees, NotSeparable};
    assert_eq!(found, [vec![Agrees], vec![Disagrees], vec![NotSeparable, NotSeparable], vec![Agrees]]);
    // 5 ± 0.1 less 4: the mean is 1; ten values of ±0.1 have a standard error of 0.1 / 3, and t with 9 degrees is 2.262157.
    let difference = decided[0].cases[0].difference.expect("ten pairs");
    let [low, high] = difference.interval.expect("ten pairs");
    close(difference.mean, 1.0);
    assert!((high - low - 2.0 * 2.262157 * 0.1 / 3.0).abs() < 1e-6, "{low} to {high}");
    // Lower is better: 0.5 less 0.4.
    close(decided[3].cases[0].difference.expect("ten pairs").mean, 0.1);
    assert_eq!(decided[2].cases[1].kept.as_deref(), Some("by weights"));

    let few = claims::decide(&study, &drawn_cells(9));
    assert!(few.iter().flat_map(|of| &of.cases).all(|case| case.found == Said::TooFew), "nine are too few");
    let none = claims::decide(&study, &Finished::default());
    assert!(none[0].cases[0].difference.is_none() && none[0].count(Said::TooFew) == 1);
}

#[test]
fn courses_are_means_with_the_deviation_of_a_sample() {
    let study = drawn_study();
    let (set, finished) = (&study.sets[0], drawn_cells(2));
    let top = Kept::Top(TopK::Count(1));
    let trained = curves::trained(&study, set, "paper", top, Rule::Gail, &finished);
    let course = curves::of_trainings(&trained, Rule::Gail).expect("two seeds");
    assert_eq!((course.at.as_slice(), course.seeds), (&[0.0, 100.0][..], 2));
    close(course.mean[1], 5.0);
    // Of 5.1 and 4.9.
    close(course.deviation[1], 0.02_f64.sqrt());
    assert_eq!(course.deviation[0], 0.0);

    let adapted = curves::of_adaptations(set, "paper", &finished);
    assert_eq!(adapted.iter().map(|of| of.demo).collect::<Vec<_>>(), [3, 2, 1, 0], "the best first");
    assert!(curves::of_adaptations(set, "cloning", &finished).is_empty(), "cloning plays nothing on the way");
    let weighed = curves::of_weights(set, "paper", &finished);
    assert_eq!((weighed[0].demo, weighed[0].course.at.len()), (3, 3), "from 1, and both rounds");
    assert_eq!(weighed[0].course.mean, [1.0, 2.0, 2.0], "what has ended stays");
    let many: Vec<curves::Followed> =
        (0..9).map(|demo| curves::Followed { demo, ..weighed[0].clone() }).collect();
    let ends: Vec<usize> = curves::both_ends(many).iter().map(|of| of.demo).collect();
    assert_eq!(ends, [0, 1, 2, 6, 7, 8]);
}

#[test]
fn a_figure_has_a_row_a_set_and_a_column_a_method() {
    let study = drawn_study();
    let finished = drawn_cells(3);
    let [top_k, adaptation, weights, bodies] = study.drawn.figures.as_slice() else { panic!("four") };
    let grid = draw::draw(&study, top_k, &finished);
    assert_eq!((grid.columns.len(), grid.rows.len()), (2, 1));
    let names = |panel: usize| {
        grid.rows[0].panels[panel].lines.iter().map(|line| line.name.as_str()).collect::<Vec<_>>()
    };
    assert_eq!(names(0), ["top 1", "top half", "all", "by weights"]);
    assert_eq!(names(1), ["top 1", "top half", "all"], "the judge by cloning has no weights");
    assert_eq!(
        grid.note,
        "Mean and one standard deviation over 3 of 10 seeds; the first 25 % of the way may be cut off"
    );
    let none = draw::draw(&study, top_k, &Finished::default());
    assert!(none.is_empty() && none.note.contains("2 panels are not begun"), "{}", none.note);
    assert_eq!(draw::draw(&study, adaptation, &finished).rows[0].panels[0].lines.len(), 4);
    assert_eq!(draw::draw(&study, weights, &finished).rows[0].panels[1].lines.len(), 0);
    let marked = draw::draw(&study, bodies, &finished);
    let other = &marked.rows[0].panels[1].lines[1];
    assert_eq!(
        (other.name.as_str(), other.x.as_slice()),
        ("another body", &[4.0][..]),
        "cloning ranks it last"
    );
}

#[test]
fn numbers_beside_figures_are_those_of_the_cells() {
    let study = drawn_study();
    let told = told::tell(&study, &drawn_cells(10));
    assert_eq!((told.finished, told.seeds), ([80, 80], [10, 10]));
    assert!(!told.is_partial());
    let line = |kept: &str, method: Option<&str>| {
        let of = |line: &&told::PolicyLine| line.kept == kept && line.method.as_deref() == method;
        told.policies.iter().find(of).expect("a line").score
    };
    close(line("1", Some("paper")).mean, 5.0);
    close(line("1", Some("paper")).deviation, (0.1_f64 * 0.1 * 10.0 / 9.0).sqrt());
    close(line("4", None).mean, 5.0);
    close(line("by weights", Some("paper")).mean, 5.0);
    close(told.distances[0].distance.mean, 0.4);
    let taller: Vec<f64> = told.bodies.iter().map(|of| of.share.mean).collect();
    assert_eq!(taller, [1.0, 0.0, 0.5, 0.0], "of K = 1 and 2, by both");
    let [paper, cloning] = told.firsts.as_slice() else { panic!("two methods judge") };
    let first = |demo, times| told::First { demo, times, recorded_under: None };
    assert_eq!((&paper.firsts, paper.fitting, paper.seeds), (&vec![first(3, 10)], None, 10));
    assert_eq!(cloning.firsts, [first(0, 10)]);
    let mut under = study.clone();
    under.sets[0].variant = Some("left".to_owned());
    under.sets[0].recorded_under = ["right", "right", "left", "left"].map(str::to_owned).to_vec();
    let fits = |of: &told::FirstLine| (of.fitting, of.fitting_in_set);
    let told_under = told::tell(&under, &drawn_cells(10));
    assert_eq!(
        told_under.firsts.iter().map(fits).collect::<Vec<_>>(),
        [(Some(10), Some(2)), (Some(0), Some(2))]
    );
    close(told.cost.processor_hours(), 10.0 + 10.0 * 28.0 / 3600.0);
    // 1000 and 400 steps took 14 seconds.
    let one = [judged("paper", 0, [0.0; 4])];
    close(told::hours_at_the_pace_of(one.iter(), 2800).expect("a pace"), 28.0 / 3600.0);
    assert_eq!(told::hours_at_the_pace_of([].iter(), 2800), None);
    let part = told::tell(&study, &drawn_cells(9));
    assert!(part.is_partial() && part.seeds == [10, 9], "{part:?}");
}

#[test]
fn a_compact_file_keeps_what_figures_show_and_no_more() {
    let mut study = drawn_study();
    let mut finished = drawn_cells(1);
    let long: Vec<f64> = (0..101).map(f64::from).collect();
    finished.add(with_curve(trained(&[3], 0, 1.0), &long));
    let write = |study: &Study| {
        let compact = compact::Compact {
            demosift: "0".to_owned(),
            study: study.clone(),
            notes: Vec::new(),
            finished: finished.clone(),
        };
        compact::read(&compact::write(&compact, &[])).expect("just written").finished
    };
    let kept = write(&study);
    let curve = &kept.training("four", &ids(&[3]), Rule::Gail, 0).expect("kept").curve;
    assert_eq!((curve.score.len(), curve.score[0], curve.score[24]), (25, 0.0, 100.0));
    assert_eq!(curve.environment_steps[1], 400);
    assert!(kept.judging("four", "paper", 0).expect("kept").adaptation.is_some());
    assert_eq!(kept.weighing("four", "paper", 0).expect("kept").demos, ids(&[2, 3]));
    let cell = |finished: &Finished, work: &Work| finished.cell(work).expect("there").clone();
    let training = Work::Training { set: "four".to_owned(), demos: ids(&[3]), imitator: Rule::Gail, seed: 0 };
    assert!(study.has_all_to_show(&cell(&kept, &training), &kept));
    let shows = study.clone();
    study.drawn.figures.retain(|figure| figure.draws == Draws::Weights);
    let kept = write(&study);
    assert!(kept.training("four", &ids(&[3]), Rule::Gail, 0).expect("kept").curve.is_empty());
    assert!(kept.judging("four", "paper", 0).expect("kept").adaptation.is_none());
    // Such a file cannot serve a study whose figures show curves, but for trainings whose curves these do not show.
    assert!(!shows.has_all_to_show(&cell(&kept, &training), &kept));
    let alone = Work::Training { set: "four".to_owned(), demos: ids(&[1]), imitator: Rule::Gail, seed: 0 };
    let mut judged = drawn_cells(10);
    judged.add(trained(&[1], 0, 1.0));
    assert!(shows.has_all_to_show(&cell(&judged, &alone), &judged));
    judged.add(self::judged("paper", 0, [0.1, 0.4, 0.3, 0.2]));
    assert!(!shows.has_all_to_show(&cell(&judged, &alone), &judged), "it comes first now");
    judged.forget(&alone);
    assert!(!judged.holds(&alone));
    let judging = |method: &str| Work::Judging { set: "four".to_owned(), method: method.to_owned(), seed: 0 };
    assert!(!shows.has_all_to_show(&cell(&kept, &judging("paper")), &kept));
    assert!(shows.has_all_to_show(&cell(&kept, &judging("cloning")), &kept), "it never has any");
}

#[test]
fn a_claim_counts_a_k_once() {
    let mut study = drawn_study();
    // Half of four are two, and four of four are no choice.
    study.drawn.curves.as_mut().expect("some").at = vec![TopK::Half];
    study.drawn.claims.truncate(1);
    study.drawn.claims[0].at = [TopK::Count(2), TopK::Half, TopK::Count(4)].map(Kept::Top).to_vec();
    study.check().expect("fits");
    let decided = claims::decide(&study, &drawn_cells(10));
    let cases: Vec<(&str, Option<&str>)> =
        decided[0].cases.iter().map(|case| (case.set.as_str(), case.kept.as_deref())).collect();
    assert_eq!(cases, [("four", Some("2"))]);
}

#[test]
fn bodies_are_told_beside_the_oracle_and_those_that_succeeded() {
    let mut study = drawn_study();
    // The agent's body may be that of a task by another name.
    assert_eq!(study.sets[0].by_others(), [false, false, false, true]);
    study.sets[0].body = Some("taller".to_owned());
    assert_eq!(study.sets[0].by_others(), [true, true, true, false]);
    study.sets[0].body = None;
    study.sets[0].succeeded = vec![false, true, false, true];
    (study.oracle, study.sets[0].oracle_seeds) = (vec![Rule::Gail], seeds(2));
    let mut finished = drawn_cells(10);
    // Alone they teach 2, 1, 6 and 5, or 4 with the other seed.
    for seed in 0..2 {
        for (demo, end) in [2.0, 1.0, 6.0, 5.0 - seed as f64].into_iter().enumerate() {
            finished.add(trained(&[demo], seed, end));
        }
    }
    let told = told::tell(&study, &finished);
    let line = |kept: usize, method: Option<&str>| {
        let of = |line: &&bodies::BodyLine| line.kept == kept && line.method.as_deref() == method;
        told.bodies.iter().find(of).expect("a line").clone()
    };
    let alone = line(1, None);
    assert_eq!((alone.oracle, alone.share.mean, alone.share.seeds), (Some(Rule::Gail), 0.0, 2));
    assert_eq!(line(2, None).share.mean, 0.5);
    let paper = line(1, Some("paper"));
    assert_eq!((paper.share.mean, paper.of_set, paper.of_successful), (1.0, 0.25, Some(0.5)));
    let taught: Vec<(bool, Option<bool>, usize, f64)> =
        told.taught.iter().map(|of| (of.by_other, of.succeeded, of.demonstrations, of.mean)).collect();
    assert_eq!(
        taught,
        [(false, Some(true), 1, 1.0), (false, Some(false), 2, 4.0), (true, Some(true), 1, 4.5)]
    );
    study.sets[0].succeeded.clear();
    let unknown = told::tell(&study, &finished);
    assert_eq!(unknown.bodies[0].of_successful, None);
    assert_eq!(unknown.taught.iter().map(|of| of.succeeded).collect::<Vec<_>>(), [None, None]);
}

#[test]
fn what_is_lost_beside_the_truly_best_is_paired_by_seed() {
    let mut study = drawn_study();
    (study.oracle, study.sets[0].oracle_seeds) = (vec![Rule::Gail], seeds(3));
    let mut finished = drawn_cells(10);
    // Of all seeds the truly best one is 2, and the best two are 2 and 3.
    for seed in 0..10 {
        let alone = [4.0, 1.0, 6.0].into_iter().enumerate();
        for (demo, end) in alone.filter(|(demo, _)| *demo == 2 || seed < 3) {
            finished.add(trained(&[demo], seed, end));
        }
    }
    let told = told::tell(&study, &finished);
    let lost = |kept: usize, method: Option<&str>| {
        let of = |line: &&told::LostLine| line.kept == kept && line.method.as_deref() == method;
        told.lost.iter().find(of).expect("a line").lost
    };
    close(lost(1, Some("cloning")).mean, 2.0);
    close(lost(1, Some("paper")).mean, 1.0);
    close(lost(2, Some("paper")).mean, 0.0);
    close(lost(2, None).mean, 0.0);
    assert!(lost(1, Some("paper")).is_separable() && lost(1, Some("paper")).pairs == 10);
    // The trainings on the truly best are work as soon as the oracle is there, and are named once.
    let wanted = Work::Training { set: "four".to_owned(), demos: ids(&[2]), imitator: Rule::Gail, seed: 9 };
    assert_eq!(study.work(&finished).iter().filter(|work| **work == wanted).count(), 1);
    assert!(!study.work(&drawn_cells(10)).contains(&wanted));
    assert!(drawn_study().work(&finished).iter().all(|work| *work != wanted), "there is no oracle");
}

#[test]
fn policies_are_compared_at_the_end_and_by_the_best_on_the_way() {
    let mut study = drawn_study();
    (study.oracle, study.sets[0].oracle_seeds) = (vec![Rule::Gail], seeds(3));
    let at_the_end = claims::decide(&study, &drawn_cells(10));
    let mut claim = study.drawn.claims[0].clone();
    assert_eq!(
        at_the_end[0].cases[0].found,
        claims::Said::Agrees,
        "at the end 3, which paper keeps, teaches more than 0"
    );
    claim.measure = Measure::Best;
    study.drawn.claims = vec![claim];
    let mut finished = drawn_cells(10);
    for seed in 0..10 {
        // What 0 teaches is best on the way and lost again.
        let mut on_0 = trained(&[0], seed, 4.0);
        if let Found::Training(result) = &mut on_0.found {
            result.chosen.score = 9.0;
        }
        finished.add(on_0);
        finished.add(trained(&[2], seed, 6.0));
        if seed < 3 {
            finished.add(trained(&[1], seed, 1.0));
        }
    }
    let decided = claims::decide(&study, &finished);
    assert_eq!(decided[0].cases[0].found, claims::Said::Disagrees);
    close(decided[0].cases[0].difference.expect("ten pairs").mean, 6.0 - 9.0);
    let told = told::tell(&study, &finished);
    let cloning = |of: &&told::LostLine| of.kept == 1 && of.method.as_deref() == Some("cloning");
    let lost = told.lost.iter().find(cloning).expect("a line");
    close(lost.lost.mean, 6.0 - 4.0);
    close(lost.lost_by_best.mean, 7.0 - 9.0);
    let policy = told.policies.iter().find(|of| of.kept == "1" && of.method.as_deref() == Some("cloning"));
    close(policy.expect("a line").best.mean, 9.0);
}

#[test]
fn rankings_are_compared_by_their_agreement_with_the_oracle() {
    let mut study = drawn_study();
    let agreement = Claim { measure: Measure::Agreement, at: Vec::new(), ..study.drawn.claims[0].clone() };
    study.drawn.claims = vec![agreement];
    let told = study.check().expect_err("there is no oracle").to_string();
    assert!(told.contains("no [oracle] to agree with"), "{told}");
    (study.oracle, study.sets[0].oracle_seeds) = (vec![Rule::Gail, Rule::BehavioralCloning], seeds(3));
    study.check().expect("fits");
    let mut finished = drawn_cells(10);
    for seed in 0..3 {
        finished.add(trained(&[1], seed, 1.0));
        finished.add(trained(&[2], seed, 6.0));
    }
    let decided = claims::decide(&study, &finished);
    // The oracle has 2 before 3, 0 and 1; paper has 3, 2, 1, 0, and cloning the reverse: 0.6 and -0.6.
    let [case] = decided[0].cases.as_slice() else {
        panic!("cloning is not held against an oracle by cloning")
    };
    assert_eq!((case.found, case.imitator), (claims::Said::Agrees, Some(Rule::Gail)));
    close(case.difference.expect("ten pairs").mean, 1.2);
    study.drawn.claims[0].better = "all".to_owned();
    assert!(study.check().is_err(), "the whole set ranks nothing");
}

#[test]
fn what_weights_keep_is_told_with_how_alike_seeds_are() {
    let mut study = drawn_study();
    let told = told::tell(&study, &drawn_cells(10));
    let [weighed] = told.weighed.as_slice() else { panic!("one method is weighed") };
    assert_eq!((weighed.kept.mean, weighed.times.as_slice()), (2.0, [0, 0, 10, 10].as_slice()));
    assert_eq!((weighed.alike, weighed.environment_steps), (Some(1.0), 10.0));
    assert_eq!((weighed.rounds.mean, weighed.converged), (1.5, 10));
    // What is known holds the heavier two for the better half, and tells the lighter two apart, which weigh alike.
    let truth = weighed.truth.as_ref().expect("the return is known");
    close(truth.parting.mean, 1.0);
    close(truth.spearman.mean, 0.9_f64.sqrt());
    assert_eq!((&truth.truth, truth.parting.pairs), (&Against::Known("return".to_owned()), 10));
    assert!(!told.is_partial());
    study.drawn.in_part = true;
    assert!(told::tell(&study, &drawn_cells(10)).is_partial(), "sets were left out");
}

#[test]
fn what_priors_are_is_told_of_cells_that_know() {
    let (study, mut finished) = (drawn_study(), drawn_cells(3));
    for (seed, explained) in [(0, 0.2), (1, 0.4)] {
        let mut cell = judged("paper", seed, [0.1, 0.2, 0.3, 0.4]);
        if let Found::Judging(result) = &mut cell.found {
            result.prior = Some(PriorLearned { meta_updates: 15, explained: Some(explained) });
        }
        finished.add(cell);
    }
    let told = told::tell(&study, &finished);
    let [prior] = told.priors.as_slice() else { panic!("cloning and combinations have none") };
    close(prior.score.mean, 1.0);
    assert_eq!((prior.score.seeds, prior.meta_updates.map(|of| (of.mean, of.seeds))), (3, Some((15.0, 2))));
    close(prior.explained.expect("of two").mean, 0.3);
}

#[test]
fn another_variant_is_told_from_another_seed() {
    let mut study = drawn_study();
    study.sets[0].variant = Some("low".to_owned());
    let other = Set { name: "high".to_owned(), variant: Some("high".to_owned()), ..study.sets[0].clone() };
    study.sets.push(other);
    let mut finished = drawn_cells(2);
    for seed in 0..2 {
        // The paper's judge turns around under the other shot, and cloning does not.
        for (method, scores) in [("paper", [0.4, 0.3, 0.2, 0.1]), ("cloning", [0.4, 0.3, 0.2, 0.1])] {
            let mut cell = judged(method, seed, scores);
            cell.work = Work::Judging { set: "high".to_owned(), method: method.to_owned(), seed };
            finished.add(cell);
        }
    }
    let told = told::tell(&study, &finished);
    let of = |method: &str| {
        let lines: Vec<_> = told.variants.iter().filter(|of| of.method == method).collect();
        let [low, high] = lines.as_slice() else { panic!("one of each variant") };
        assert_eq!([&low.variant, &low.others[0].variant, &high.others[0].variant], ["low", "high", "low"]);
        assert_eq!((low.seeds, low.others.len(), low.others[0].spearman), (2, 1, high.others[0].spearman));
        [low.same, low.others[0].spearman]
    };
    let [same, other] = of("paper");
    close(same, 1.0);
    close(other, -1.0);
    close(of("cloning")[1], 1.0);
    assert!(told::tell(&drawn_study(), &finished).variants.is_empty(), "there is one variant");

    let mut twice = study.clone();
    twice.sets[1].variant = twice.sets[0].variant.clone();
    assert!(told::tell(&twice, &finished).variants.is_empty(), "one variant under two names");
    let mut others = judged("paper", 0, [0.4, 0.3, 0.2, 0.1]);
    others.work = Work::Judging { set: "high".to_owned(), method: "paper".to_owned(), seed: 0 };
    others.fingerprint.set = "of other demonstrations".to_owned();
    let mut unlike = drawn_cells(2);
    unlike.add(others);
    assert!(told::tell(&study, &unlike).variants.is_empty(), "as many demonstrations of another file");
}

#[test]
fn what_does_not_fit_together_is_told() {
    let complaint = |change: &dyn Fn(&mut Study)| {
        let mut study = drawn_study();
        change(&mut study);
        study.check().expect_err("wrong").to_string()
    };
    let lent = |set: &str, of: &str| {
        let (set, of) = (set.to_owned(), of.to_owned());
        move |study: &mut Study| {
            let mut other = study.sets[0].clone();
            (other.name, other.task) = ("other".to_owned(), "reacher".to_owned());
            study.sets.push(other);
            let lent = study.sets.iter_mut().find(|known| known.name == set).expect("there");
            lent.prior = Some(of.clone());
        }
    };
    let tells = |change: &dyn Fn(&mut Study), wanted: &str| {
        let found = complaint(change);
        assert!(found.contains(wanted), "{found} does not say {wanted}");
    };
    tells(&|study| study.drawn.curves = None, "no [curves]");
    tells(&|study| study.drawn.claims[0].than.clear(), "it needs than and at");
    tells(&|study| study.drawn.claims[3].at = vec![Kept::All], "it needs than, and no at");
    let nobody = "no method 'nobody'; it has: paper, cloning, all";
    tells(&|study| study.drawn.claims[0].better = "nobody".to_owned(), nobody);
    tells(&|study| study.drawn.weights = None, "[weights] does not name 'paper'");
    let of_cloning = |study: &mut Study| {
        study.drawn.claims[1].than_at = Some(Kept::Weights);
        study.drawn.claims[0].than_at = Some(Kept::Weights);
    };
    tells(&of_cloning, "[weights] does not name 'cloning' for the set 'four'");
    // The one that is better keeps its top 1 there.
    let mut of_paper = drawn_study();
    of_paper.drawn.claims[1].than_at = Some(Kept::Weights);
    of_paper.check().expect("cloning need not be weighed");
    let three = |study: &mut Study| study.drawn.claims[0].at = vec![Kept::Top(TopK::Count(3))];
    tells(&three, "K = 3, and policies are trained on the top K of [curves] at alone");
    let no_set = "no set 'five'; it has: four";
    tells(&|study| study.drawn.figures[0].sets = vec!["five".to_owned()], no_set);
    let with_no =
        |study: &mut Study| study.drawn.weights.as_mut().expect("some").methods.push("no".to_owned());
    tells(&with_no, "no method 'no'");
    tells(&lent("four", "four"), "must be another set");
    tells(&lent("four", "five"), "no set 'five'");
    tells(&lent("four", "other"), "of another task or variant");
}

#[test]
fn a_cell_judges_from_the_prior_of_another_set_as_a_run_does() {
    use crate::basics::ledger::InMemory;
    use crate::basics::observer::Silent;
    use crate::basics::seed::Seed;
    use crate::results::panel::{Judge, Judges};
    use crate::run::experiment::{self, Config, Run};
    use crate::world::point_mass::{PointMass, planted_set};
    use crate::world::rollout::Playground;

    let (other, set) = (
        planted_set(&[180.0, 5.0, 90.0], Seed::new(1)).expect("planted"),
        planted_set(&[170.0, 15.0], Seed::new(2)).expect("planted"),
    );
    let mut config = crate::run::preset::Preset::Quick.config();
    (config.meta_train.rounds, config.inner.batch_steps, config.judge.iterations) = (2, 120, 3);
    (config.subset_selection.rounds, config.subset_selection.meta_updates) = (2, 1);
    config.judges = Judges::Paper;
    let task = PointMass::new();
    let prior = Some(make::PriorOf { set: &other, config: &config });
    let means = make::Means { set: &set, task: &task, config: &config, prior };
    let mut clock = || 0.0;
    let judged = make::judging(&means, 7, &mut clock).expect("judges");
    let weighed = make::weighing(&means, 7, &mut clock).expect("weighs");

    let config = Config { seed: 7, ..config.clone() };
    let playground = Playground::new(&task);
    let (mut lender, mut ledger) = (InMemory::default(), InMemory::default());
    let (config, playground) = (&config, &playground);
    let mut run = Run { set: &other, playground, config, ledger: &mut lender, observer: &mut Silent };
    experiment::prior(&mut run).expect("learns");
    assert_eq!(judged.once.environment_steps, playground.steps_taken());
    experiment::hand_on_prior(&lender, &mut ledger).expect("kept");
    let mut run = Run { set: &set, playground, config, ledger: &mut ledger, observer: &mut Silent };
    let table = experiment::scores(&mut run, Judge::Paper).expect("judges");
    assert_eq!(judged.scores(), table.suitabilities.iter().map(|of| of.gain()).collect::<Vec<_>>());
    let adaptation = judged.adaptation.expect("GAIL plays");
    assert_eq!(adaptation.updates, [0, 1, 2]);
    let played = table.suitabilities[1].curves[0][2].score.expect("GAIL plays");
    assert_eq!(adaptation.score[1][2], played, "there is one repeat");

    let prior = experiment::prior(&mut run).expect("there");
    let before = playground.steps_taken();
    let weighing = experiment::weighing(&mut run, &prior).expect("weighs");
    let last = weighing.rounds.last().expect("some");
    assert_eq!(
        weighed.weights.last().expect("some"),
        &last.weights.iter().map(|(_, of)| of).collect::<Vec<_>>()
    );
    assert_eq!(weighed.weighing.environment_steps, playground.steps_taken() - before);
    let planned = make::planned_weighing(&means).expect("has weights");
    assert!(planned >= weighed.once.environment_steps + weighed.weighing.environment_steps);
    assert_eq!(
        make::planned_judging(&means),
        judged.once.environment_steps + judged.judging.environment_steps
    );
}
