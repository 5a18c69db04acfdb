use super::*;
use crate::stages::select;
use crate::world::environment::EnvVariant;
use rand_distr::{Distribution as _, StandardNormal};

/// A table of one variant: `after[demonstration][repeat][evaluation]`, nothing scored before.
fn table(after: &[Vec<Vec<f64>>]) -> ScoreTable {
    let suitability = |(demo, after): (usize, &Vec<Vec<f64>>)| Suitability {
        demo: DemoId(demo),
        variant: EnvVariant(0),
        before: vec![vec![0.0; after[0].len()]],
        after: after.clone(),
        distances: Vec::new(),
        curves: Vec::new(),
        evaluated: None,
    };
    ScoreTable::new(after.iter().enumerate().map(suitability).collect())
}

/// Where the noise of a synthetic judgment comes from, as standard deviations.
struct Noise {
    repeat: f64,
    /// Luck of an evaluation seed that falls on all demonstrations alike.
    episode_of_all: f64,
    /// Luck of a seed with one demonstration, the same in each of its repeats.
    episode_of_demo: f64,
    episode_of_one: f64,
}

impl Noise {
    const NONE: Self = Self { repeat: 0.0, episode_of_all: 0.0, episode_of_demo: 0.0, episode_of_one: 0.0 };
}

/// How often each demonstration is adapted to, and on how many episodes each time.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    repeats: usize,
    evaluations: usize,
}

fn sized(repeats: usize, evaluations: usize) -> Sizes {
    Sizes { repeats, evaluations }
}

fn synthetic(truth: &[f64], sizes: Sizes, noise: &Noise, seed: Seed) -> ScoreTable {
    let Sizes { repeats, evaluations } = sizes;
    let mut rng = seed.into_rng();
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let of_all: Vec<f64> = (0..evaluations).map(|_| noise.episode_of_all * normal()).collect();
    let mut after = Vec::new();
    for &truth in truth {
        let mut of_demo = Vec::new();
        let luck: Vec<f64> = of_all.iter().map(|all| all + noise.episode_of_demo * normal()).collect();
        for _ in 0..repeats {
            let center = truth + noise.repeat * normal();
            of_demo.push(luck.iter().map(|luck| center + luck + noise.episode_of_one * normal()).collect());
        }
        after.push(of_demo);
    }
    table(&after)
}

/// Share of the intervals of 300 judgments that hold the truth.
fn coverage(sizes: Sizes, noise: &Noise) -> f64 {
    let truth = [0.0, 0.1, 0.2, 0.5, 0.9, 1.0];
    let resampling = Resampling { draws: 400, ..Resampling::default() };
    let mut held = 0;
    for index in 0..300 {
        let table = synthetic(&truth, sizes, noise, Seed::new(index));
        let found = uncertainty(&table, &resampling, &Seed::new(index)).unwrap();
        let holds = |doubt: &&Doubt| (doubt.low..=doubt.high).contains(&truth[doubt.demo.0]);
        held += found.demonstrations.iter().filter(holds).count();
    }
    held as f64 / (300 * truth.len()) as f64
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    // The presets' sizes, with adaptations the larger noise.
    for sizes in [sized(2, 20), sized(2, 5), sized(4, 50)] {
        let noise = Noise { repeat: 0.3, episode_of_one: 0.3, ..Noise::NONE };
        let held = coverage(sizes, &noise);
        assert!((0.87..0.96).contains(&held), "{sizes:?}: {held}");
    }
    // Luck in a reset that falls on all alike, which paired differences are free of, still counts in each score.
    let held = coverage(
        sized(3, 20),
        &Noise { repeat: 0.01, episode_of_all: 0.5, episode_of_one: 0.1, ..Noise::NONE },
    );
    assert!((0.85..0.96).contains(&held), "{held}");
    // Of five episodes luck that a demonstration has with a seed in every repeat is what counts most.
    let luck = Noise { repeat: 0.1, episode_of_demo: 0.5, episode_of_one: 0.1, ..Noise::NONE };
    let held = coverage(sized(6, 5), &luck);
    assert!((0.87..0.96).contains(&held), "{held}");
}

/// Untrained policies are not alike, and each repeat of cloning begins with another.
#[test]
fn intervals_hold_the_truth_where_the_agents_before_differ() {
    let truth = [0.0; 6];
    let resampling = Resampling { draws: 400, ..Resampling::default() };
    let noise = Noise { repeat: 0.3, episode_of_one: 0.3, ..Noise::NONE };
    let (mut held, mut order) = (0, Vec::new());
    for index in 0..300 {
        let mut table = synthetic(&truth, sized(3, 5), &noise, Seed::new(index));
        let mut normal = {
            let mut rng = Seed::new(index).of("starts").into_rng();
            move || -> f64 { StandardNormal.sample(&mut rng) }
        };
        let one = uncertainty(&table, &resampling, &Seed::new(index)).unwrap();
        let before: Vec<Vec<f64>> = (0..3).map(|_| vec![0.5 * normal(); 5]).collect();
        table.suitabilities.iter_mut().for_each(|of| of.before = before.clone());
        let found = uncertainty(&table, &resampling, &Seed::new(index)).unwrap();
        held += found.demonstrations.iter().filter(|doubt| doubt.low <= 0.0 && doubt.high >= 0.0).count();
        order.push(one.groups == found.groups);
    }
    let held = held as f64 / (300 * truth.len()) as f64;
    assert!((0.85..0.97).contains(&held), "{held}");
    assert!(order.iter().all(|same| *same), "what moves all alike parts nobody");
}

#[test]
fn one_repeat_is_said_to_be_too_narrow_and_is() {
    let noise = Noise { repeat: 0.3, episode_of_one: 0.3, ..Noise::NONE };
    assert!(coverage(sized(1, 20), &noise) < 0.5);
    let judge = |sizes| {
        let table = synthetic(&[0.0, 1.0], sizes, &noise, Seed::new(1));
        uncertainty(&table, &Resampling::default(), &Seed::new(1)).unwrap()
    };
    let once = judge(sized(1, 20));
    assert!(once.too_narrow && once.caveat().unwrap().contains("With repeats of 2 or more in judge, "));
    assert!(judge(sized(2, 1)).caveat().unwrap().contains("With evaluations of 2 or more"));
    assert!(judge(sized(1, 1)).caveat().unwrap().contains("With repeats and evaluations of"));
    let twice = judge(sized(2, 20));
    assert!(!twice.too_narrow && twice.caveat().is_none());
}

/// All 27 ways to pick three of three evaluation seeds, each as probable, by brute force, and each with two hundred widenings: χ² of
/// two degrees of freedom is −2 ln u of a uniform u.
#[test]
fn top_k_probabilities_are_those_of_exact_enumeration() {
    let gains = [[0.0, 3.0, 1.0], [2.0, 0.5, 1.2], [0.9, 1.1, 1.4]];
    let mut exact = [[0.0; 3]; 3];
    for case in 0..27 * 200 {
        let pick = case % 27;
        let uniform = (f64::from(case as u32 / 27) + 0.5) / 200.0;
        let widening = (-uniform.ln()).powf(-0.5);
        let picks = [pick % 3, pick / 3 % 3, pick / 9];
        let drawn = gains.map(|of_demo| {
            let center = of_demo.iter().sum::<f64>() / 3.0;
            let picked = picks.iter().map(|&index| of_demo[index]).sum::<f64>() / 3.0;
            center + widening * (picked - center) * 1.5_f64.sqrt()
        });
        for (demo, score) in drawn.iter().enumerate() {
            let above = drawn.iter().filter(|other| *other > score).count();
            (above..3).for_each(|place| exact[demo][place] += 1.0 / (27.0 * 200.0));
        }
    }
    let table = table(&gains.map(|of_demo| vec![of_demo.to_vec()]));
    let resampling = Resampling { draws: 40_000, ..Resampling::default() };
    let found = uncertainty(&table, &resampling, &Seed::new(5)).unwrap();
    for doubt in &found.demonstrations {
        for (k, exact) in (1..=3).zip(&exact[doubt.demo.0]) {
            let found = doubt.top.at(k).unwrap();
            assert!((found - exact).abs() < 0.01, "{doubt:?}, {exact}");
        }
    }
}

/// With two repeats and no pooling a score moves by a Cauchy variable, and so does the difference of two.
#[test]
fn the_probability_to_be_best_is_that_of_the_closed_form() {
    let table = table(&[vec![vec![1.0; 3], vec![2.0; 3]], vec![vec![0.8; 3], vec![1.2; 3]]]);
    let resampling = Resampling { draws: 40_000, pooling: 0.0, ..Resampling::default() };
    let found = uncertainty(&table, &resampling, &Seed::new(5)).unwrap();
    // Standard errors of the means of 1 and 2, and of 0.8 and 1.2.
    let exact = 0.5 + (0.5 / (0.5 + 0.2_f64)).atan() / std::f64::consts::PI;
    assert!((found.of(DemoId(0)).unwrap().top.at(1).unwrap() - exact).abs() < 0.01, "{exact}");
    assert!((found.top_set[0] - exact).abs() < 0.01);
}

#[test]
fn the_order_of_demonstrations_does_not_count_and_the_seed_does() {
    let noise = Noise { repeat: 0.3, episode_of_all: 0.2, episode_of_one: 0.3, ..Noise::NONE };
    let table = synthetic(&[0.3, 0.1, 0.2, 0.25], sized(2, 6), &noise, Seed::new(3));
    let found = uncertainty(&table, &Resampling::default(), &Seed::new(7)).unwrap();
    assert_eq!(uncertainty(&table, &Resampling::default(), &Seed::new(7)).unwrap(), found);
    assert_ne!(uncertainty(&table, &Resampling::default(), &Seed::new(8)).unwrap(), found);
    let renamed = [2, 0, 3, 1];
    let mut shuffled = table.clone();
    shuffled
        .suitabilities
        .iter_mut()
        .for_each(|suitability| suitability.demo.0 = renamed[suitability.demo.0]);
    shuffled.suitabilities.rotate_left(1);
    let again = uncertainty(&shuffled, &Resampling::default(), &Seed::new(7)).unwrap();
    assert_eq!(again.top_set, found.top_set);
    for (before, after) in found.demonstrations.iter().zip(again.demonstrations) {
        assert_eq!(after, Doubt { demo: DemoId(renamed[before.demo.0]), ..before.clone() });
    }
}

#[test]
fn the_same_demonstration_twice_shares_its_places() {
    let scores = vec![vec![1.0, 2.0, 1.5, 1.2, 1.8, 1.6], vec![3.0, 2.5, 2.6, 2.9, 2.7, 2.8]];
    let bad = vec![vec![-9.0, -9.5, -9.1, -9.2, -9.3, -9.4], vec![-9.2, -9.1, -9.0, -9.3, -9.4, -9.2]];
    let table = table(&[scores.clone(), scores, bad]);
    let found = uncertainty(&table, &Resampling::default(), &Seed::new(1)).unwrap();
    assert_eq!(found.of(DemoId(0)).unwrap().top.at(1).unwrap(), 0.5);
    let top = &found.of(DemoId(1)).unwrap().top;
    assert_eq!([0, 1, 2, 3, 4].map(|k| top.at(k)), [None, Some(0.5), Some(1.0), Some(1.0), None]);
    assert_eq!(found.groups, [vec![DemoId(0), DemoId(1)], vec![DemoId(2)]]);
}

#[test]
fn the_order_is_that_of_the_ranking_and_the_sums_are_right() {
    let noise = Noise { repeat: 0.3, episode_of_one: 0.3, ..Noise::NONE };
    let mut table = synthetic(&[0.3, 0.1, 0.2, 0.3], sized(2, 6), &noise, Seed::new(3));
    let mut other = synthetic(&[0.1, 0.5, 0.2, 0.0], sized(2, 6), &noise, Seed::new(4));
    other.suitabilities.iter_mut().for_each(|suitability| suitability.variant = EnvVariant(1));
    table.suitabilities.append(&mut other.suitabilities);
    let found = uncertainty(&table, &Resampling::default(), &Seed::new(7)).unwrap();
    let ranking = select::rank(&table);
    for (doubt, ranked) in found.demonstrations.iter().zip(&ranking.entries) {
        assert_eq!((doubt.demo, doubt.gain), (ranked.demo, ranked.gain));
        assert!(doubt.low < doubt.gain && doubt.gain < doubt.high);
        assert!((1..=4).map(|k| doubt.top.at(k).unwrap()).is_sorted());
    }
    for k in 1..=4 {
        // K of them are among the K best, in every draw.
        let sum: f64 = found.demonstrations.iter().map(|doubt| doubt.top.at(k).unwrap()).sum();
        assert!((sum - k as f64).abs() < 1e-9);
    }
}

/// For each demonstration the share of draws in which fewer than K are above it, counted draw by draw.
#[test]
fn chances_are_the_shares_of_draws_for_every_k() {
    let mut rng = Seed::new(9).into_rng();
    let draw = |_| (0..30).map(|_| StandardNormal.sample(&mut rng)).collect::<Vec<f64>>();
    let draws: Vec<Vec<f64>> = (0..50).map(draw).collect();
    for (demo, chances) in top_probabilities(&draws).iter().enumerate() {
        for k in 1..=30 {
            let above = |draw: &&Vec<f64>| draw.iter().filter(|score| **score > draw[demo]).count() < k;
            assert_eq!(chances.at(k), Some(draws.iter().filter(above).count() as f64 / 50.0));
        }
    }
}

/// All alike, and a first: each of the others has the same share of the places that are left.
#[test]
fn those_alike_share_their_places_however_many_they_are() {
    let draw: Vec<f64> = (0..2000).map(|demo| if demo == 7 { 1.0 } else { 0.0 }).collect();
    let chances = top_probabilities(&vec![draw; 20]);
    assert_eq!([1, 2, 2000].map(|k| chances[7].at(k)), [Some(1.0); 3]);
    assert_eq!(chances[0].at(1), Some(0.0));
    for k in [2, 1000, 2000] {
        let share = (k - 1) as f64 / 1999.0;
        assert!((chances[0].at(k).unwrap() - share).abs() < 1e-12, "{k}");
    }
}

#[test]
fn a_large_set_is_drawn_less_often_and_never_less_than_a_thousand_times() {
    let draws = |count| Resampling::default().draws_of(count);
    assert_eq!([2, 100, 2500, 5000, 10_000, 1_000_000].map(draws), [4000, 4000, 4000, 2000, 1000, 1000]);
    assert_eq!(Resampling { draws: 10, ..Resampling::default() }.draws_of(1_000_000), 10);
}

/// Differences of 0.3 between neighbors drown in a noise of 0.14 a mean; differences of 0.6 and more do not.
#[test]
fn a_group_holds_what_cannot_be_told_from_its_leader() {
    let truth = [1.2, 0.9, 0.6, 0.3, 0.0];
    let noise = Noise { repeat: 0.2, episode_of_all: 0.5, ..Noise::NONE };
    let mut sizes = vec![0; 5];
    let mut wrong = 0;
    for index in 0..100 {
        let table = synthetic(&truth, sized(2, 20), &noise, Seed::new(index));
        let found =
            uncertainty(&table, &Resampling { draws: 400, ..Resampling::default() }, &Seed::new(index))
                .unwrap();
        let flat: Vec<DemoId> = found.groups.concat();
        assert_eq!(flat, found.demonstrations.iter().map(|doubt| doubt.demo).collect::<Vec<_>>());
        sizes[found.groups.len() - 1] += 1;
        // A leader above a later leader is a claim that it is better.
        let leaders: Vec<f64> = found.groups.iter().map(|group| truth[group[0].0]).collect();
        wrong += usize::from(leaders.windows(2).any(|pair| pair[0] <= pair[1]));
    }
    // Episodes that are lucky for all alike do not blur the differences: never is all one group.
    assert_eq!(sizes[0], 0, "{sizes:?}");
    assert!(sizes[4] < 5 && sizes[1] + sizes[2] > 70, "{sizes:?}");
    assert!(wrong <= 10, "{wrong}");
}

fn kept(truth: &[f64], noise: f64) -> Vec<usize> {
    let noise = Noise { repeat: noise, episode_of_one: noise, ..Noise::NONE };
    let table = synthetic(truth, sized(2, 20), &noise, Seed::new(2));
    let found = uncertainty(&table, &Resampling::default(), &Seed::new(2)).unwrap();
    let mut kept: Vec<usize> = found.worth_keeping().iter().map(|demo| demo.0).collect();
    kept.sort_unstable();
    kept
}

#[test]
fn auto_keeps_what_surely_helps_and_is_not_surely_mediocre() {
    // Two that teach the same, one that teaches little, one nothing, one harm.
    let truth = [1.0, -0.5, 0.95, 0.2, 0.0];
    assert_eq!(kept(&truth, 0.05), [0, 2]);
    // Without any noise the second best is still kept: keeping more than one does not need ignorance.
    assert_eq!(kept(&truth, 0.0), [0, 2]);
    // All alike: all are kept, and about half of those that look a little different by chance.
    assert_eq!(kept(&[0.5, 0.5, 0.5], 0.0), [0, 1, 2]);
    let equals = kept(&[0.5; 10], 0.02).len();
    assert!((4..=8).contains(&equals), "{equals} of ten equals");
    // All help far more than they differ, as where gains count from a policy that knows nothing.
    assert_eq!(kept(&[10.0, 8.8, 10.1, 9.0, 9.2], 0.02), [0, 2]);
    // None helps: the one that does least harm.
    assert_eq!(kept(&[-1.0, -0.2, -3.0], 0.02), [1]);
}

#[test]
fn a_table_that_is_not_whole_is_told() {
    let whole = table(&[vec![vec![1.0, 2.0]; 2], vec![vec![1.0, 2.0]; 2]]);
    let complaint = |change: fn(&mut ScoreTable)| {
        let mut broken = whole.clone();
        change(&mut broken);
        let error = uncertainty(&broken, &Resampling::default(), &Seed::new(1)).unwrap_err();
        assert!(error.is_bad_input());
        error.to_string()
    };
    assert!(complaint(|table| table.suitabilities.clear()).contains("is empty"));
    assert!(
        complaint(|table| table.suitabilities[1].variant.0 = 1).contains("demonstration 0 under variant 1")
    );
    assert!(complaint(|table| table.suitabilities[1].demo.0 = 0).contains("exactly once"));
    assert!(
        complaint(|table| table.suitabilities[1].after[0].truncate(1))
            .contains("2 evaluations in each repeat")
    );
    assert!(complaint(|table| table.suitabilities[0].after.clear()).contains("at least 1 repeat"));
}
