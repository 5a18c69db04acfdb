use std::sync::Mutex;

use super::*;
use crate::basics::error::Error;
use crate::learning::adapt::{self, InnerUpdate};
use crate::run::experiment::Config;
use crate::run::preset::Preset;
use crate::world::point_mass::{PointMass, planted_set};

#[test]
fn an_evaluation_has_as_many_episodes_as_their_length_allows() {
    let acting = Acting::Sampled;
    let judging = |evaluations| Judging {
        iterations: 1,
        averaged: 1,
        scored_on: ScoredOn::Evaluations,
        evaluations,
        repeats: 1,
        most_repeats: 0,
        acting,
    };
    assert_eq!(judging(20).episodes(60), 20);
    assert_eq!(judging(20).episodes(500), 10);
    assert_eq!(judging(20).episodes(1000), 5);
    assert_eq!(judging(20).episodes(100_000), 5, "never fewer");
    assert_eq!(judging(3).episodes(1000), 3, "unless fewer are asked for");
}

/// What a crew led to: the result, the state it is made of, and the numbers that were told, in order.
#[derive(Debug, PartialEq)]
struct Came {
    judged: Judged,
    state: JudgingState,
    told: Vec<String>,
}

/// Keeps what is told of units, and each checkpoint as bytes.
#[derive(Default)]
struct Listening {
    told: Vec<String>,
    checkpoints: Vec<Vec<u8>>,
}

impl Observer for Listening {
    fn on(&mut self, event: Event<'_>) -> Result<()> {
        match event {
            Event::Measured { part, iteration, numbers, .. } => {
                self.told.push(format!("{part} {iteration} {numbers:?}"));
            }
            Event::Checkpoint { state, .. } => self.checkpoints.push(state.to_bytes()),
            _ => {}
        }
        Ok(())
    }
}

/// Three demonstrations under two goals, two to four repeats each: rounds of racing, starts that are drawn again.
fn with_trial<T>(work: impl FnOnce(&Trial<'_>) -> T) -> T {
    let task = PointMass::with_goals(2);
    let set = planted_set(&[180.0, 10.0, 0.0], Seed::new(1)).expect("a valid set");
    let config = Preset::Quick.config();
    let inner = InnerUpdate { batch_steps: 60, ..config.inner };
    let acting = Acting::Sampled;
    let scored_on = ScoredOn::Evaluations;
    let judging = Judging {
        iterations: 2,
        averaged: 1,
        scored_on,
        evaluations: 3,
        repeats: 2,
        most_repeats: 4,
        acting,
    };
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
    work(&Trial {
        set: &set,
        demos: &set.ids(),
        playground: &Playground::new(&task),
        start: Start::Untrained {
            shape: &shape,
            discriminator_hidden: &[8],
            filter: &adapt::filter_of(&set),
        },
        imitating: Imitating::Updates(&inner),
        judging: &judging,
        cut: 1,
        part: "paper",
        seed: &Seed::new(5),
    })
}

fn inner_of<'a>(trial: &Trial<'a>) -> &'a InnerUpdate {
    trial.imitating.inner().expect("it is ours")
}

fn came(trial: &Trial<'_>, crew: &dyn Crew) -> Came {
    let (mut state, mut listening) = (JudgingState::default(), Listening::default());
    let judged = judge(trial, crew, &mut state, &mut listening).expect("the point mass is judged");
    Came { judged, state, told: listening.told }
}

/// The last unit first, one after the other.
struct Backwards;

impl Crew for Backwards {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        units.iter().rev().try_for_each(|unit| {
            hand_in(*unit, one(unit)?)?;
            Ok(())
        })
    }
}

/// Judges each unit twice, on two threads that do not wait for each other, and drops one outcome of each at random.
struct TwiceAndOneIsLost;

impl Crew for TwiceAndOneIsLost {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        let hand_in = Mutex::new(hand_in);
        let twice = |keeps: usize| -> Result<()> {
            for (place, unit) in units.iter().enumerate() {
                let outcome = one(unit)?;
                if place % 2 == keeps {
                    let mut hand_in = hand_in.lock().expect("no panic");
                    hand_in(*unit, outcome)?;
                }
            }
            Ok(())
        };
        std::thread::scope(|scope| {
            let other = scope.spawn(|| twice(1));
            twice(0)?;
            other.join().expect("no panic")
        })
    }
}

/// Judges some of what it is asked for, hands in each of these twice, and forgets the rest.
struct Forgetful;

impl Crew for Forgetful {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        for unit in &units[..units.len().div_ceil(2)] {
            let outcome = one(unit)?;
            hand_in(*unit, outcome.clone())?;
            hand_in(*unit, outcome)?;
        }
        Ok(())
    }
}

/// Hands in a unit that nobody asked for before those that it was asked for.
struct Officious;

impl Crew for Officious {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        let unasked = Unit { repeat: 99, ..units[0] };
        hand_in(unasked, one(&unasked)?)?;
        Threads.judge(units, one, hand_in)
    }
}

#[test]
fn algorithm_2_what_comes_out_does_not_depend_on_who_judges() {
    with_trial(|trial| {
        let wanted = came(trial, &Threads);
        let adaptations = wanted.judged.scores.suitabilities.iter().map(|of| of.after.len()).sum::<usize>();
        assert!(adaptations > 12, "{adaptations}: there are rounds of racing");
        assert!(!wanted.told.is_empty());
        assert_eq!(came(trial, &Backwards), wanted);
        assert_eq!(came(trial, &TwiceAndOneIsLost), wanted);
        assert_eq!(came(trial, &Forgetful), wanted);
        assert_eq!(came(trial, &Officious), wanted);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        assert_eq!(alone.install(|| came(trial, &Threads)), wanted);
    });
}

#[test]
fn algorithm_2_a_unit_is_a_function_of_its_arguments() {
    with_trial(|trial| {
        let wanted = came(trial, &Threads).state.finished;
        // Each by itself, on a playground where nothing was played before.
        for (unit, outcome) in wanted.iter().rev() {
            let task = PointMass::with_goals(2);
            let elsewhere = Trial { playground: &Playground::new(&task), ..*trial };
            assert_eq!(&judge_unit(&elsewhere, unit).expect("judged"), outcome, "{unit:?}");
        }
    });
}

/// Judges two units of what it is asked for and then fails, or does nothing at all.
struct Failing {
    judges: usize,
    with: fn() -> Result<()>,
}

impl Crew for Failing {
    fn judge(&self, units: &[Unit], one: &JudgeUnit<'_>, hand_in: &mut HandIn<'_>) -> Result<()> {
        for unit in &units[..self.judges] {
            hand_in(*unit, one(unit)?)?;
        }
        (self.with)()
    }
}

#[test]
fn a_crew_that_fails_leaves_what_is_finished_and_judging_goes_on_to_the_same() {
    with_trial(|trial| {
        let wanted = came(trial, &Threads);
        let lost = Failing { judges: 2, with: || Err(Error::simulation("the other machine is gone")) };
        let (mut state, mut listening) = (JudgingState::default(), Listening::default());
        let error = judge(trial, &lost, &mut state, &mut listening).expect_err("it fails");
        assert_eq!(error.to_string(), "the other machine is gone");
        assert_eq!(state.done(), 2);
        let stored = listening.checkpoints.last().expect("a checkpoint");
        let mut stored: JudgingState = postcard::from_bytes(stored).expect("a state");
        assert_eq!(stored, state);
        let judged = judge(trial, &Backwards, &mut stored, &mut Listening::default()).expect("judged");
        assert_eq!(judged, wanted.judged);

        let idle = Failing { judges: 0, with: || Ok(()) };
        let error = judge(trial, &idle, &mut JudgingState::default(), &mut Listening::default());
        let error = error.expect_err("nobody judges");
        assert!(error.to_string().starts_with("none of 16 units came back"), "{error}");
    });
}

#[test]
fn of_a_large_set_policies_and_curves_are_made_for_those_that_are_looked_at_alone() {
    with_trial(|trial| {
        let bearings: Vec<f32> = (0..201_u8).map(f32::from).collect();
        let set = planted_set(&bearings, Seed::new(1)).expect("a valid set");
        let judging =
            Judging { iterations: 1, evaluations: 1, repeats: 1, most_repeats: 0, ..*trial.judging };
        let inner = InnerUpdate { batch_steps: 30, ..inner_of(trial).clone() };
        let demos = &set.ids();
        let trial =
            Trial { set: &set, demos, judging: &judging, imitating: Imitating::Updates(&inner), ..*trial };
        let Came { judged, mut state, told } = came(&trial, &Threads);
        let bare = |of: &Suitability| of.curves.iter().all(Vec::is_empty);
        assert!(judged.adapted.is_empty() && told.is_empty());
        assert!(judged.scores.suitabilities.iter().all(bare));

        let (played, mut listening) = (state.played(), Listening::default());
        let looked = look_at(&trial, &[DemoId(7), DemoId(3)], &mut state, &mut listening).expect("judged");
        let found: Vec<(usize, usize)> = looked.adapted.iter().map(|of| (of.variant.0, of.demo.0)).collect();
        assert_eq!(found, [(0, 3), (0, 7), (1, 3), (1, 7)]);
        assert_eq!(listening.told.len(), 4, "an update each");
        assert!(state.played() > played, "what was played again counts");
        for adapted in &looked.adapted {
            let unit = Unit { variant: adapted.variant, repeat: 0, demo: Some(adapted.demo) };
            let whole = unit::judged_whole(&trial, &unit).expect("judged");
            assert_eq!(whole.policy.as_ref(), Some(&adapted.policy));
        }
        for (before, after) in judged.scores.suitabilities.iter().zip(&looked.scores.suitabilities) {
            assert_eq!(bare(after), ![3, 7].contains(&after.demo.0));
            assert_eq!(*before, Suitability { curves: before.curves.clone(), ..after.clone() });
        }
    });
}

/// Line 11 by batches: they are those that the last updates learned from, and before imitating they have the same random numbers.
#[test]
fn algorithm_2_the_last_batches_score_where_they_are_asked_to() {
    with_trial(|trial| {
        let judging = Judging {
            iterations: 3,
            averaged: 2,
            scored_on: ScoredOn::LastBatches,
            most_repeats: 2,
            ..trial.judging.clone()
        };
        let by_batches = came(&Trial { judging: &judging, ..*trial }, &Threads);
        let episodes = Judging { scored_on: ScoredOn::Evaluations, ..judging.clone() };
        let by_episodes = came(&Trial { judging: &episodes, ..*trial }, &Threads).judged;
        assert_eq!(by_batches.judged.adapted, by_episodes.adapted, "they learn the same");
        for (of, other) in
            by_batches.judged.scores.suitabilities.iter().zip(&by_episodes.scores.suitabilities)
        {
            for (scores, curve) in of.after.iter().zip(&of.curves) {
                let played: Vec<Option<Score>> = curve[1..].iter().map(|report| report.score).collect();
                assert_eq!(played, scores.iter().copied().map(Some).collect::<Vec<_>>());
            }
            let shapes =
                [&of.before, &of.after].map(|scores| scores.iter().map(Vec::len).collect::<Vec<_>>());
            assert_eq!(shapes, [vec![2, 2], vec![2, 2]], "of each repeat two batches, before and after");
            assert_eq!(
                (of.evaluated_before(), of.evaluated_after()),
                (&other.before[0][..], &other.after[0][..])
            );
            assert_eq!((&of.distances, &of.curves), (&other.distances, &other.curves));
        }
        let task = trial.playground.specification();
        let steps =
            |judging| Effort::of(trial.demos.len(), task, judging, Some(inner_of(trial)), true).steps();
        assert_eq!(by_batches.state.played(), steps(&judging));
        assert!(steps(&judging) > steps(&episodes), "the agent before plays batches on top");

        // The first batch of all is played by the agent before.
        let all = Judging { averaged: 3, ..judging.clone() };
        let judged = came(&Trial { judging: &all, ..*trial }, &Threads).judged;
        for of in &judged.scores.suitabilities {
            let first = |scores: &[Vec<Score>]| scores.iter().map(|repeat| repeat[0]).collect::<Vec<_>>();
            assert_eq!(first(&of.before), first(&of.after));
        }
    });
}

#[test]
fn what_plays_no_batches_is_scored_on_evaluation_episodes() {
    let Config { inner, judge, .. } = Preset::Quick.config();
    assert_eq!(judge.scoring_batches(&inner), 20..30, "the last ten of thirty");
    assert!(
        judge
            .scoring_batches(&InnerUpdate { imitation: Rule::BehavioralCloning, ..inner.clone() })
            .is_empty()
    );
    let literally = Preset::Paper.config();
    assert!(literally.judge.scoring_batches(&literally.inner).is_empty(), "M episodes of the last θ");
    let one = Judging { averaged: 1, ..judge.clone() };
    assert!(one.scoring_batches(&inner).is_empty(), "θ before its last update would be what counts");
    let few = Judging { iterations: 4, ..judge.clone() };
    assert_eq!(few.scoring_batches(&inner), 0..4, "the batches that there are");
    assert!(
        Judging { iterations: 1, ..judge }.scoring_batches(&inner).is_empty(),
        "one says nothing of its spread"
    );
}

#[test]
fn the_effort_of_a_large_set_counts_what_is_repeated_and_looked_at() {
    with_trial(|trial| {
        let (task, inner) = (trial.playground.specification(), inner_of(trial));
        let judging = Judging { repeats: 2, most_repeats: 4, ..trial.judging.clone() };
        let of = |demos| Effort::of(demos, task, &judging, Some(inner), true);
        // Two goals, and a start for each of four repeats; of two thousand two hundred get further repeats.
        assert_eq!(of(10).units, 2 * (10 * 4 + 4));
        assert_eq!(of(2000).units, 2 * (2000 * 2 + 200 * 2 + 4));
        let looked = of(2000).and_looking_at(40, task, &judging, inner);
        assert_eq!(looked.updates - of(2000).updates, 40 * 2 * judging.iterations);
        let once = judging.episodes(task.horizon) * task.horizon;
        assert_eq!(looked.evaluating_steps - of(2000).evaluating_steps, (40 * 2 * once) as u64);
    });
}

/// What took long is stored at once, however many were finished before; what took no time waits for its share.
#[test]
fn a_unit_that_took_long_is_stored_as_soon_as_it_is_finished() {
    let unit = |demo| Unit { variant: EnvVariant(0), repeat: 0, demo: Some(DemoId(demo)) };
    let outcome = |played| Outcome {
        scores: Vec::new(),
        evaluated: None,
        distance: 0.0,
        curve: Vec::new(),
        policy: None,
        played,
    };
    let units: Vec<Unit> = (0..103).map(unit).collect();
    let checkpoints = |steps: u64| {
        let (mut state, mut listening) = (JudgingState::default(), Listening::default());
        state.finished.extend((0..100).map(|demo| (unit(demo), outcome(0))));
        with_trial(|trial| {
            let mut collecting =
                Collecting::new(trial, &units, &mut state, &mut listening).expect("nothing fails");
            (100..103).for_each(|demo| collecting.take(unit(demo), outcome(steps)).expect("nothing fails"));
        });
        listening.checkpoints.len()
    };
    assert_eq!(checkpoints(85_000), 3);
    assert_eq!(checkpoints(1_600), 1, "after 3,200 steps");
    assert_eq!(checkpoints(10), 0);
}
