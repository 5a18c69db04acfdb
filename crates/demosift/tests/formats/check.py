"""Opens what demosift wrote with the tool whose format it is, and compares it with what demosift read.

    demosift convert tests/formats/minari_hdf5 --to lerobot --fps 50 OUT/lerobot
    demosift convert tests/formats/minari_hdf5 --to minari OUT/minari
    python check.py lerobot OUT/lerobot
    python check.py minari OUT/minari
    python check.py minari-subset ORIGINAL SUBSET 0,2   what `demosift export --as minari` made of episodes 0 and 2
    python check.py robomimic FILE KEY 0,2              a file to which `--as robomimic-filter-key` added these

The versions with which this ran stand in docs/formats.md.
"""

import sys

import numpy as np

sys.dont_write_bytecode = True
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


def minari_subset(original, subset, ids):
    ids = [int(i) for i in ids.split(",")]
    _, all_episodes = minari_episodes(original)
    dataset, episodes = minari_episodes(subset)
    wanted = [all_episodes[i] for i in ids]
    assert dataset.total_episodes == len(ids) and dataset.total_steps == sum(len(e.actions) for e in wanted)
    for place, (found, of) in enumerate(zip(episodes, wanted)):
        assert found.id == place
        for what in ["observations", "actions", "rewards", "terminations", "truncations"]:
            np.testing.assert_array_equal(getattr(found, what), getattr(of, what))


def robomimic(path, key, ids):
    import h5py
    from robomimic.utils.dataset import SequenceDataset

    with h5py.File(path) as file:
        observation_keys = [name for name, item in file["data/demo_0/obs"].items() if item.ndim == 2]
        recorded = {f"demo_{i}": file[f"data/demo_{i}/actions"][:] for i in ids.split(",")}
    dataset = SequenceDataset(
        path, obs_keys=observation_keys, dataset_keys=["actions"], filter_by_attribute=key, load_next_obs=False,
        hdf5_cache_mode=None,
    )
    assert sorted(dataset.demos) == sorted(recorded), dataset.demos
    for name in dataset.demos:
        same(dataset.get_dataset_for_ep(name, "actions"), recorded[name])


if __name__ == "__main__":
    {"lerobot": lerobot, "minari": minari, "minari-subset": minari_subset, "robomimic": robomimic}[sys.argv[1]](*sys.argv[2:])
    print("ok")
