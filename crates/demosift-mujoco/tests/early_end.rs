//! Episodes that end early, from playing to what is written of them.

use demosift::basics::seed::Seed;
use demosift::data::demonstration::d4rl::{self, Episode, States};
use demosift::data::observation_filter::ObservationFilter;
use demosift::world::environment::{EnvVariant, Episode as Asked, OneVariant, Rollout, Task};
use demosift::world::policy::{Policy, PolicyShape};
use demosift::world::rollout::{self, Acting, Playground};
use demosift_mujoco::{registry, replay};

const EPISODES: usize = 8;

fn untrained(task: &dyn Task) -> Policy {
    let specification = task.specification();
    let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
    let filter = ObservationFilter::identity(specification.observation_size);
    Policy::untrained(&shape, filter, specification.action_size, Seed::new(1))
}

fn with_states(playground: &Playground<'_>, seed: u64, count: usize) -> Vec<Rollout> {
    let policy = untrained(playground.task());
    let seeds = Seed::new(seed).many(count);
    let episodes = seeds.iter().map(|seed| Asked {
        policy: &policy,
        acting: Acting::Sampled,
        variant: EnvVariant(0),
        seed,
        keep_states: true,
    });
    rollout::play_episodes(playground, &episodes.collect::<Vec<_>>()).unwrap()
}

#[test]
fn an_episode_stops_where_it_ends_and_all_that_is_made_of_it_is_of_what_was_played() {
    let task = registry::load("walker2d").unwrap();
    let playground = Playground::new(&task);
    let played = with_states(&playground, 4, EPISODES);
    let column = |name: &str| task.specification().measurement(name).unwrap();
    let (x, height, lean) = (column("x"), column("height"), column("lean"));
    let is_up = |row: &[f32]| row[height] > 0.8 && row[height] < 2.0 && row[lean].abs() < 1.0;
    let mut lengths = Vec::new();
    for Rollout { trajectory, states } in &played {
        let rows = trajectory.measurements();
        let steps = trajectory.steps();
        assert!(trajectory.terminated() && steps < 1000);
        assert!((0..steps).all(|step| is_up(rows.row(step))) && !is_up(rows.row(steps)));
        let gone = f64::from(rows.row(steps)[x]) - f64::from(rows.row(0)[x]);
        assert_eq!(playground.score(trajectory), gone);
        // Up at all steps but the last: what is left of the return is speed, which is a distance, and effort.
        let effort: f64 = (1..=steps).map(|step| f64::from(rows.row(step)[column("effort")])).sum();
        let wanted = (steps - 1) as f64 + gone / 0.008 - 0.001 * effort;
        let found = task.true_return(rows).unwrap();
        assert!((found - wanted).abs() < 1e-3 * wanted.abs().max(1.0), "{found} {wanted}");
        // The same from the states, as of a recorded set.
        let states = states.as_ref().unwrap();
        assert_eq!(states.qpos.len(), steps * 9);
        let again = replay::measurements(&task, states, trajectory.actions()).unwrap();
        assert_eq!(again.head(steps), rows.head(steps));
        assert!(!is_up(again.row(steps)));
        lengths.push(steps);
    }
    assert_eq!(playground.steps_taken(), lengths.iter().sum::<usize>() as u64);
}

#[test]
fn recorded_episodes_of_several_lengths_come_back_as_they_were() {
    let task = registry::load("walker2d").unwrap();
    let playground = Playground::new(&task);
    let (played, logs): (Vec<_>, Vec<_>) = with_states(&playground, 5, 3)
        .into_iter()
        .map(|Rollout { trajectory, states }| (trajectory, states.unwrap()))
        .unzip();
    let observations: Vec<_> = played.iter().map(|one| one.observations().head(one.steps())).collect();
    let episodes: Vec<Episode<'_>> = (0..3)
        .map(|id| Episode {
            observations: &observations[id],
            actions: played[id].actions(),
            states: Some(States { qpos: &logs[id].qpos, qvel: &logs[id].qvel }),
            terminated: played[id].terminated(),
        })
        .collect();
    let path = std::env::temp_dir().join(format!("demosift-early-end-{}.hdf5", std::process::id()));
    d4rl::write(&path, &episodes).unwrap();
    let (set, states) = (d4rl::read(&path).unwrap(), d4rl::read_states(&path).unwrap().unwrap());
    std::fs::remove_file(&path).unwrap();
    for (id, demonstration) in set.iter() {
        assert_eq!(demonstration.observations(), &observations[id.0]);
        assert_eq!(demonstration.actions(), played[id.0].actions());
    }
    assert_eq!(states, logs);
}

/// A task under one of its goals ends and pays as the whole one does.
#[test]
fn a_task_under_one_variant_ends_as_the_whole() {
    let whole = registry::load("walker2d").unwrap();
    let one = OneVariant::new(Box::new(registry::load("walker2d").unwrap()), "default").unwrap();
    assert!(one.may_end_early());
    let play = |task: &dyn Task| {
        let playground = Playground::new(task);
        rollout::play(&playground, &untrained(task), Acting::Sampled, EnvVariant(0), Seed::new(6).many(2))
            .unwrap()
    };
    let (alone, together) = (play(&one), play(&whole));
    assert_eq!(alone, together);
    assert!(one.true_return(alone[0].measurements()).is_some());
    assert_eq!(one.true_return(alone[0].measurements()), whole.true_return(together[0].measurements()));
}
