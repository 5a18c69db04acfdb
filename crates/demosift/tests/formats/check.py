"""Opens what demosift wrote with the tool whose format it is, and compares it with what demosift read.

    demosift convert tests/formats/minari_hdf5 --to lerobot --fps 50 OUT/lerobot
    demosift convert tests/formats/minari_hdf5 --to minari OUT/minari
    python check.py lerobot OUT/lerobot
    python check.py minari OUT/minari
    python check.py minari-rewards FOLDER 0,2   a subset of minari_hdf5 that `demosift export --as minari` made of these
    python check.py robomimic FILE KEY N     a copy of robomimic.hdf5 with a filter key of N demonstrations

The versions with which this ran stand in docs/formats.md.
"""

import sys

import numpy as np

from make import LENGTHS, actions, observations


def same(found, wanted):
    np.testing.assert_allclose(np.asarray(found), wanted, atol=1e-6)


def lerobot(root):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset("demosift/check", root=root)
    assert dataset.meta.total_episodes == 3 and len(dataset) == sum(LENGTHS), len(dataset)
    row = 0
    for i, steps in enumerate(LENGTHS):
        for step in range(steps):
            frame = dataset[row]
            same(frame["observation.state"], observations(i, steps)[step])
            same(frame["action"], actions(i, steps)[step])
            assert int(frame["episode_index"]) == i and int(frame["frame_index"]) == step
            assert isinstance(frame["task"], str)
            row += 1
    same(dataset.meta.stats["action"]["mean"], np.concatenate([actions(i, n) for i, n in enumerate(LENGTHS)]).mean(0))
    some = LeRobotDataset("demosift/check", root=root, episodes=[0, 2])
    assert len(some) == LENGTHS[0] + LENGTHS[2], len(some)
    windows = LeRobotDataset("demosift/check", root=root, delta_timestamps={"action": [0.0, 0.02]})
    assert windows[0]["action"].shape == (2, 2)


def minari_episodes(root):
    import pathlib

    from minari.dataset.minari_dataset import MinariDataset

    dataset = MinariDataset(pathlib.Path(root) / "data")
    return dataset, list(dataset.iterate_episodes())


def minari(root):
    dataset, episodes = minari_episodes(root)
    assert dataset.total_episodes == 3 and dataset.total_steps == sum(LENGTHS)
    assert dataset.observation_space.shape == (3,) and dataset.action_space.shape == (2,)
    for i, (steps, episode) in enumerate(zip(LENGTHS, episodes)):
        same(episode.observations, observations(i, steps + 1))
        same(episode.actions, actions(i, steps))
        assert np.isnan(episode.rewards).all() and episode.truncations[-1] and not episode.terminations.any()
        assert dataset.observation_space.contains(episode.observations[0])


def minari_rewards(root, ids):
    ids = [int(i) for i in ids.split(",")]
    dataset, episodes = minari_episodes(root)
    assert dataset.total_episodes == len(ids) and dataset.total_steps == sum(LENGTHS[i] for i in ids)
    for place, (i, episode) in enumerate(zip(ids, episodes)):
        assert episode.id == place
        same(episode.observations, observations(i, LENGTHS[i] + 1))
        same(episode.actions, actions(i, LENGTHS[i]))
        same(episode.rewards, np.full(LENGTHS[i], float(i)))


def robomimic(path, key, count):
    from robomimic.utils.dataset import SequenceDataset

    dataset = SequenceDataset(
        path, obs_keys=["joint", "wrist"], dataset_keys=["actions"], filter_by_attribute=key, load_next_obs=False,
        hdf5_cache_mode=None,
    )
    assert dataset.n_demos == int(count), dataset.n_demos
    for name in dataset.demos:
        i = int(name.removeprefix("demo_"))
        same(dataset.get_dataset_for_ep(name, "actions"), actions(i, LENGTHS[i]))


if __name__ == "__main__":
    {"lerobot": lerobot, "minari": minari, "minari-rewards": minari_rewards, "robomimic": robomimic}[sys.argv[1]](*sys.argv[2:])
    print("ok")
