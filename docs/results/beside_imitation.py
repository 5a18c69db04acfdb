"""Judging HalfCheetah's ten demonstrations with imitation 1.0.1, beside demosift: what a judged demonstration costs, and how well
the order agrees with the true returns.

python docs/results/beside_imitation.py DIR/half_cheetah_noisy.hdf5 bc SEEDS        imitation's behavioral cloning
python docs/results/beside_imitation.py DIR/half_cheetah_noisy.hdf5 gail SEEDS      its GAIL with the TRPO of sb3-contrib
python docs/results/beside_imitation.py DIR/half_cheetah_noisy.hdf5 DEMOSIFT SEEDS  demosift, both judges, presets standard and quick
python docs/results/beside_imitation.py                                             prints the table from beside_imitation.json

Needs imitation 1.0.1, sb3-contrib 2.2.1, gymnasium 0.29.1, mujoco and h5py. SEEDS is a range such as 0:10; each seed judges all ten
from scratch on one thread, and what it took and found is kept in beside_imitation.json beside this file.
The score of an imitation is the distance that it runs, the mean over five episodes of 1000 steps, as in demosift.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

KEPT = Path(__file__).with_suffix(".json")
RETURNS = [1090, 1853, 268, -178, 4312, -399, 4020, 3979, 568, -46]
EPISODES = 5
# The steps of Adam that demosift clones for; imitation counts epochs of 1000 pairs in batches of 32.
CLONING_STEPS = 2000
BATCH = 32
# What demosift's judge of the paper played for a demonstration at `quick`, prior apart, when this was written; 130,000 now.
GAIL_STEPS = 86_000


def environment():
    import gymnasium

    return gymnasium.make("HalfCheetah-v4")


def demonstrations(path):
    import h5py
    import numpy
    from imitation.data.types import TrajectoryWithRew

    with h5py.File(path) as file:
        observations, actions = file["observations"][:], numpy.clip(file["actions"][:], -1, 1)
    for start in range(0, len(actions), 1000):
        seen, acted = observations[start : start + 1000], actions[start : start + 999]
        yield TrajectoryWithRew(obs=seen, acts=acted, infos=None, terminal=False, rews=numpy.zeros(len(acted), dtype=float))


def distance(policy, seed):
    """How far the policy runs, the mean over the episodes."""
    env, ran = environment(), []
    for episode in range(EPISODES):
        observation, _ = env.reset(seed=1000 * seed + episode)
        first = env.unwrapped.data.qpos[0]
        for _ in range(1000):
            observation = env.step(policy.predict(observation, deterministic=True)[0])[0]
        ran.append(env.unwrapped.data.qpos[0] - first)
    return sum(ran) / len(ran)


def by_bc(demonstration, seed):
    import numpy
    from imitation.algorithms import bc
    from imitation.data.rollout import flatten_trajectories

    env = environment()
    learner = bc.BC(
        observation_space=env.observation_space,
        action_space=env.action_space,
        demonstrations=flatten_trajectories([demonstration]),
        batch_size=BATCH,
        rng=numpy.random.default_rng(seed),
    )
    learner.train(n_batches=CLONING_STEPS, progress_bar=False, log_interval=10**9)
    return learner.policy


def by_gail(demonstration, seed):
    from imitation.algorithms.adversarial.gail import GAIL
    from imitation.data.wrappers import RolloutInfoWrapper
    from imitation.rewards.reward_nets import BasicRewardNet
    from imitation.util.networks import RunningNorm
    from sb3_contrib import TRPO
    from stable_baselines3.common.vec_env import DummyVecEnv

    venv = DummyVecEnv([lambda: RolloutInfoWrapper(environment())])
    venv.seed(seed)
    learner = TRPO("MlpPolicy", venv, n_steps=2000, batch_size=500, seed=seed, device="cpu")
    net = BasicRewardNet(venv.observation_space, venv.action_space, normalize_input_layer=RunningNorm)
    gail = GAIL(
        demonstrations=[demonstration],
        demo_batch_size=500,
        gen_replay_buffer_capacity=2000,
        n_disc_updates_per_round=4,
        venv=venv,
        gen_algo=learner,
        reward_net=net,
        allow_variable_horizon=True,
    )
    gail.train(GAIL_STEPS)
    return learner.policy


def used(who=resource.RUSAGE_SELF):
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def with_imitation(path, learn, seed):
    import torch
    from imitation.util import logger

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    logger.configure(tempfile.mkdtemp(), [])
    before = used()
    scores = [distance(learn(demonstration, seed), seed) for demonstration in demonstrations(path)]
    return {"seconds": (used() - before) / len(scores), "scores": scores}


def with_demosift(path, demosift, judge, preset, seed):
    folder = tempfile.mkdtemp()
    line = [demosift, "judge", path, "--task", "half_cheetah", "--judge", judge, "--preset", preset, "--seed", str(seed)]
    before = used(resource.RUSAGE_CHILDREN)
    answer = subprocess.run([*line, "--threads", "1", "--json", "--out", folder + "/run"], stdout=subprocess.PIPE, check=True)
    seconds = used(resource.RUSAGE_CHILDREN) - before
    found = json.loads(answer.stdout)["judges"][0]["uncertainty"]["demonstrations"]
    scores = {one["demo"]: one["score"] for one in found}
    return {"seconds": seconds / len(scores), "scores": [scores[demo] for demo in sorted(scores)]}


def keep(name, seed, found):
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    kept.setdefault(name, {})[str(seed)] = found
    KEPT.write_text(written(kept))
    print(name, seed, found, flush=True)


def written(kept):
    """One line a seed, numbers with two digits."""
    rounded = lambda found: {"seconds": round(found["seconds"], 2), "scores": [round(float(score), 2) for score in found["scores"]]}
    line = lambda seed, found: f'  "{seed}": {json.dumps(rounded(found))}'
    of = lambda by_seed: ",\n".join(line(seed, found) for seed, found in by_seed.items())
    return "{\n" + ",\n".join(f' "{name}": {{\n{of(by_seed)}\n }}' for name, by_seed in kept.items()) + "\n}\n"


def ranks(values):
    order = sorted(range(len(values)), key=values.__getitem__)
    return [order.index(place) for place in range(len(values))]


def spearman(one, other):
    count, apart = len(one), sum((a - b) ** 2 for a, b in zip(ranks(one), ranks(other)))
    return 1 - 6 * apart / (count * (count**2 - 1))


def table():
    print("| judged by | seconds of a processor a demonstration, median | Spearman with the true return, mean (least, most) | seeds |")
    print("|---|---|---|---|")
    for name, by_seed in json.loads(KEPT.read_text()).items():
        seconds = sorted(found["seconds"] for found in by_seed.values())
        agree = [spearman(found["scores"], RETURNS) for found in by_seed.values()]
        said = f"{sum(agree) / len(agree):.2f} ({min(agree):.2f}, {max(agree):.2f})"
        print(f"| {name} | {seconds[len(seconds) // 2]:.1f} | {said} | {len(agree)} |")


def main():
    if len(sys.argv) == 1:
        return table()
    path, by, seeds = sys.argv[1:]
    os.environ["OMP_NUM_THREADS"] = "1"
    for seed in range(*map(int, seeds.split(":"))):
        if by == "bc":
            keep("imitation, behavioral cloning", seed, with_imitation(path, by_bc, seed))
        elif by == "gail":
            keep("imitation, GAIL", seed, with_imitation(path, by_gail, seed))
        else:
            keep("demosift, cloning, standard", seed, with_demosift(path, by, "cloning", "standard", seed))
            keep("demosift, the paper's, quick", seed, with_demosift(path, by, "paper", "quick", seed))


if __name__ == "__main__":
    main()
