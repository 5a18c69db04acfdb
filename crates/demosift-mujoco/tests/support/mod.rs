//! Episodes that are scripted, and their results.

use demosift::basics::seed::Seed;
use demosift::math::rows::Rows;
use demosift::world::environment::{EnvVariant, Environment, Task};
use demosift_mujoco::environment::MujocoEnvironment;
use demosift_mujoco::mujoco_task::MujocoTask;

pub(crate) struct Episode {
    pub(crate) score: f64,
    pub(crate) succeeded: bool,
    pub(crate) rewards: Vec<f32>,
    pub(crate) measurements: Rows,
}

/// Plays an episode; `act` sees the environment and the number of the step, and fills in the actions, which are 0 before.
pub(crate) fn play(
    task: &MujocoTask,
    variant: EnvVariant,
    seed: u64,
    mut act: impl FnMut(&MujocoEnvironment, usize, &mut [f32]),
) -> Episode {
    let specification = task.specification();
    let mut environment = task.mujoco_environment().unwrap();
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    environment.reset(variant, Seed::new(seed), &mut observation, &mut now);
    let (mut all, mut rewards) = (now.clone(), Vec::new());
    for step in 0..specification.horizon {
        let mut action = vec![0.0; specification.action_size];
        act(&environment, step, &mut action);
        let outcome = environment.step(&action, &mut observation, &mut now);
        assert!(!outcome.terminated && outcome.task_reward.is_finite());
        assert!(observation.iter().all(|value| value.is_finite()));
        rewards.push(outcome.task_reward);
        all.extend_from_slice(&now);
    }
    assert_eq!(environment.warnings(), 0, "MuJoCo warned in the episode of seed {seed}");
    let measurements = Rows::from_flat(all, now.len()).unwrap();
    let score = task.heuristic().score(&measurements);
    Episode { score, succeeded: task.succeeded(&measurements).unwrap(), rewards, measurements }
}
