"""Writes the small files of this folder, each by the tool whose format it is.

    python make.py TOOL [...]                          with TOOL one of those below
    python make.py robomimic-of-minari FOLDER FILE     for check.py

Each tool needs its own package; they do not all install beside each other.
The versions that made the files here stand in docs/formats.md.
Every file holds the same three episodes of 4, 3 and 5 steps, so that one test reads them all:

    observation j of step t of episode i:  sin(i + 0.1 t + j)     (three numbers)
    action k of step t of episode i:       cos(i + 0.1 t + k) / 2 (two numbers)
"""

import pathlib
import shutil
import sys

import numpy as np

HERE = pathlib.Path(__file__).parent
LENGTHS = [4, 3, 5]


def observations(i, steps):
    t, j = np.meshgrid(np.arange(steps), np.arange(3), indexing="ij")
    return np.sin(i + 0.1 * t + j).astype(np.float32)


def actions(i, steps):
    t, k = np.meshgrid(np.arange(steps), np.arange(2), indexing="ij")
    return (np.cos(i + 0.1 * t + k) / 2).astype(np.float32)


def fresh(name):
    path = HERE / name
    shutil.rmtree(path, ignore_errors=True)
    path.unlink(missing_ok=True)
    return path


def lerobot(name):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    features = {
        "observation.state": {"dtype": "float32", "shape": (3,), "names": ["x", "y", "z"]},
        "action": {"dtype": "float32", "shape": (2,), "names": ["a", "b"]},
        "next.reward": {"dtype": "float32", "shape": (1,), "names": None},
    }
    root = fresh(name)
    dataset = LeRobotDataset.create("demosift/fixture", fps=50, features=features, root=root, use_videos=False)
    for i, steps in enumerate(LENGTHS):
        for o, a in zip(observations(i, steps), actions(i, steps)):
            reward = np.array([float(i)], dtype=np.float32)
            dataset.add_frame({"observation.state": o, "action": a, "next.reward": reward, "task": "reach"}
                              if name == "lerobot_v3" else {"observation.state": o, "action": a, "next.reward": reward},
                              **({} if name == "lerobot_v3" else {"task": "reach"}))
        dataset.save_episode()
    if hasattr(dataset, "finalize"):
        dataset.finalize()
    shutil.rmtree(root / "images", ignore_errors=True)


def lerobot_jump(name):
    """Two observed numbers and one action at 25 steps a second; three seconds are missing in the second episode."""
    import json

    import pyarrow as pa
    import pyarrow.parquet as pq

    root = fresh(name)
    (root / "meta").mkdir(parents=True)
    (root / "data/chunk-000").mkdir(parents=True)
    for i in range(3):
        steps = 6
        seconds = np.arange(steps) / 25 + (3.0 * (np.arange(steps) >= 4) if i == 1 else 0.0)
        floats = lambda rows: pa.array(rows.tolist(), pa.list_(pa.float32()))
        table = pa.table({
            "observation.state": floats(np.zeros((steps, 2))),
            "action": floats(np.full((steps, 1), 0.1 * i)),
            "timestamp": pa.array(seconds, pa.float32()),
            "frame_index": pa.array(np.arange(steps), pa.int64()),
            "episode_index": pa.array(np.full(steps, i), pa.int64()),
        })
        pq.write_table(table, root / f"data/chunk-000/episode_{i:06d}.parquet")
    info = {"codebase_version": "v2.1", "total_episodes": 3, "total_frames": 18, "fps": 25, "features": {}}
    (root / "meta/info.json").write_text(json.dumps(info))


def lerobot_ragged(name):
    """Five episodes in one table: an action is missing in 1, one of 2 is too short, and a step of 3 is gone."""
    import json

    import pyarrow as pa
    import pyarrow.parquet as pq

    root = fresh(name)
    (root / "meta").mkdir(parents=True)
    (root / "data/chunk-000").mkdir(parents=True)
    rows = [(i, t, observations(i, 4)[t].tolist(), actions(i, 4)[t].tolist()) for i in range(5) for t in range(4)]
    change = {(1, 2): None, (2, 1): [0.5]}
    rows = [(i, t + (i == 3 and t > 1), o, change.get((i, t), a)) for i, t, o, a in rows]
    of = lambda place: [row[place] for row in rows]
    table = pa.table({
        "observation.state": pa.array(of(2), pa.list_(pa.float32())),
        "action": pa.array(of(3), pa.list_(pa.float32())),
        "frame_index": pa.array(of(1), pa.int64()),
        "episode_index": pa.array(of(0), pa.int64()),
    })
    pq.write_table(table, root / "data/chunk-000/file-000.parquet")
    info = {"codebase_version": "v3.0", "total_episodes": 5, "total_frames": 20, "fps": 12.5, "features": {}}
    (root / "meta/info.json").write_text(json.dumps(info))


def lerobot_sentences(name):
    """The list of episodes of lerobot_v3, in which the second has two sentences and the third none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    whole = HERE / "lerobot_v3/meta/episodes/chunk-000/file-000.parquet"
    table = pq.read_table(whole, columns=["episode_index", "tasks", "length"])
    sentences = pa.array([["reach"], ["grasp", "lift"], []], pa.list_(pa.string()))
    pq.write_table(table.set_column(table.column_names.index("tasks"), "tasks", sentences), fresh(name))


def minari(name, data_format):
    import gymnasium as gym
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage

    root = fresh(name)
    data = root / "data"
    data.parent.mkdir(parents=True)
    space = gym.spaces.Dict({
        "position": gym.spaces.Box(-np.inf, np.inf, (1,), np.float32),
        "velocity": gym.spaces.Box(-np.inf, np.inf, (2,), np.float32),
    }) if "dict" in name else gym.spaces.Box(-np.inf, np.inf, (3,), np.float32)
    storage = MinariStorage.new(
        data, observation_space=space, action_space=gym.spaces.Box(-1, 1, (2,), np.float32), data_format=data_format
    )
    for i, steps in enumerate(LENGTHS):
        o = observations(i, steps + 1)
        ends = np.arange(steps) == steps - 1
        storage.update_episodes([EpisodeBuffer(
            id=i, observations={"position": o[:, :1], "velocity": o[:, 1:]} if "dict" in name else o,
            actions=actions(i, steps), rewards=np.full(steps, float(i)), terminations=np.zeros(steps, bool), truncations=ends,
            infos={},
        )])
    storage.update_metadata({
        "dataset_id": "demosift/fixture-v0",
        "algorithm_name": "none", "author": {"demosift"}, "author_email": {"none"}, "code_permalink": "none",
    })


def minari_infos(name):
    """A `main_data.hdf5` with infos and attributes of other kinds, of which h5py writes what Minari hands it."""
    import h5py

    with h5py.File(fresh(name), "w") as file:
        for i, steps in enumerate(LENGTHS):
            group = file.create_group(f"episode_{i}")
            group.create_dataset("observations", data=observations(i, steps + 1))
            group.create_dataset("actions", data=actions(i, steps))
            group.create_dataset("infos/half", data=observations(i, steps + 1).astype(np.float16))
            group["infos/half"].attrs["unit"] = "m"
            group.create_dataset("infos/big", data=np.arange(steps + 1, dtype=">i2"))
            group.create_dataset("infos/flags", data=np.arange(steps + 1) % 2 == 0)
            group.create_dataset("infos/raw", data=np.full(steps + 1, b"ab", dtype="V2"))
            group.create_dataset("infos/once", data=np.float32(0.5))
            group.create_dataset("infos/nothing", data=h5py.Empty("f4"))
            group.attrs["id"] = i
            group.attrs["seed"] = 7 + i
            group.attrs["success"] = np.bool_(i == 2)
            group.attrs["half"] = np.float16(0.25)
            group.attrs["options"] = h5py.Empty("S1")


def robomimic(name):
    """robomimic has no writer of its own: its converters write this layout with h5py, as is done here."""
    import h5py

    with h5py.File(fresh(name), "w") as file:
        data = file.create_group("data")
        for i, steps in enumerate(LENGTHS):
            group = data.create_group(f"demo_{i}")
            o = observations(i, steps + 1)
            group.create_dataset("actions", data=actions(i, steps).astype(np.float64))
            group.create_dataset("rewards", data=np.full(steps, float(i)))
            group.create_dataset("dones", data=(np.arange(steps) == steps - 1).astype(np.int64))
            group.create_dataset("states", data=np.zeros((steps, 4)))
            for key, part in [("obs", o[:-1]), ("next_obs", o[1:])]:
                group.create_dataset(f"{key}/joint", data=part[:, :1].astype(np.float64))
                group.create_dataset(f"{key}/wrist", data=part[:, 1:].astype(np.float64), compression="gzip")
                group.create_dataset(f"{key}/camera_image", data=np.zeros((steps, 2, 2, 3), np.uint8))
            group.attrs["num_samples"] = steps
            group.attrs["model_file"] = "<mujoco/>"
        data.attrs["total"] = sum(LENGTHS)
        data.attrs["env_args"] = '{"env_name": "Fixture", "type": 2, "env_kwargs": {}}'


def imitation(name):
    from imitation.data import types

    types.save(fresh(name), [
        types.TrajectoryWithRew(
            obs=observations(i, steps + 1), acts=actions(i, steps), infos=None, terminal=True, rews=np.full(steps, float(i))
        )
        for i, steps in enumerate(LENGTHS)
    ])


def baselines(name):
    """baselines publishes files of this layout and reads them; like its users, we save it with numpy. Episodes of one length."""
    steps = 4
    np.savez(
        fresh(name),
        obs=np.stack([observations(i, steps) for i in range(3)]),
        acs=np.stack([actions(i, steps) for i in range(3)]),
        ep_rets=np.arange(3.0), rews=np.ones((3, steps)),
    )


def stable_baselines(name):
    """stable-baselines 2 saves these with numpy (`generate_expert_traj`), as is done here."""
    starts = np.concatenate([np.arange(steps) == 0 for steps in LENGTHS])
    np.savez(
        fresh(name),
        actions=np.concatenate([actions(i, steps) for i, steps in enumerate(LENGTHS)]),
        obs=np.concatenate([observations(i, steps) for i, steps in enumerate(LENGTHS)]),
        rewards=np.ones(sum(LENGTHS)), episode_returns=np.ones(3), episode_starts=starts,
    )


def orders(name):
    """The same observations with other byte orders, and column by column, as numpy writes what was sliced or transposed."""
    rows = np.concatenate([observations(i, steps) for i, steps in enumerate(LENGTHS)])
    np.savez(
        fresh(name), obs=rows, obs_big=rows.astype(">f4"), obs_columns=np.asfortranarray(rows.astype("<f8")),
        obs_both=np.asfortranarray(rows.astype(">f8")),
        actions=np.concatenate([actions(i, steps) for i, steps in enumerate(LENGTHS)]),
        episode_starts=np.concatenate([np.arange(steps) == 0 for steps in LENGTHS]),
    )


def maniskill(name):
    """The layout of the trajectories of ManiSkill with `-o state`, written by h5py as ManiSkill does."""
    import h5py

    with h5py.File(fresh(name), "w") as file:
        for i, steps in enumerate(LENGTHS):
            group = file.create_group(f"traj_{i}")
            group.create_dataset("obs", data=observations(i, steps + 1))
            group.create_dataset("actions", data=actions(i, steps))
            group.create_dataset("success", data=np.arange(steps) == steps - 1)


def aloha(name):
    """The layout of the recordings of ALOHA, written by h5py as its `record_episodes.py` does."""
    import h5py

    root = fresh(name)
    root.mkdir()
    for i, steps in enumerate(LENGTHS):
        with h5py.File(root / f"episode_{i}.hdf5", "w") as file:
            file.create_dataset("observations/qpos", data=observations(i, steps).astype(np.float64))
            file.create_dataset("observations/qvel", data=np.zeros((steps, 3)))
            file.create_dataset("observations/images/top", data=np.zeros((steps, 2, 2, 3), np.uint8))
            file.create_dataset("action", data=actions(i, steps).astype(np.float64))


def zstd(source, name):
    """A set of LeRobot compressed by zstd, as newer recordings are; both versions of pages."""
    import pyarrow.parquet as parquet

    root = fresh(name)
    shutil.copytree(HERE / source, root)
    for index, path in enumerate(sorted((root / "data").rglob("*.parquet"))):
        version = "2.0" if index % 2 else "1.0"
        parquet.write_table(parquet.read_table(path), path, compression="zstd", data_page_version=version)


def kinds():
    """Files of D4RL whose numbers are of other kinds, or stored in ways that are read or are not."""
    import h5py
    import hdf5plugin

    steps = 12
    ends = np.arange(steps) % 4 == 3
    rows = np.concatenate([observations(i, 4) for i in range(3)])

    def write(name, libver="earliest", **how):
        with h5py.File(fresh(name), "w", libver=libver) as file:
            # Filters leave alone what they cannot make smaller.
            file.create_dataset("observations", data=np.ones((120, 3)), chunks=(60, 3), **how)
            file.create_dataset("actions", data=np.zeros((120, 2), np.int8))
            file.create_dataset("timeouts", data=np.arange(120) % 60 == 59)

    with h5py.File(fresh("kinds.hdf5"), "w") as file:
        file.create_dataset("half", data=rows.astype(np.float16))
        file.create_dataset("integers", data=np.arange(2 * steps, dtype=np.int8).reshape(steps, 2) - 12)
        file.create_dataset("flags", data=np.stack([ends, ~ends], axis=1))
        file.create_dataset("one", data=np.arange(steps, dtype=np.float32))
        file.create_dataset("words", data=[b"grasp"] * steps)
        file.create_dataset("image", data=np.zeros((steps, 2, 2, 3), np.uint8))
        file.create_dataset("timeouts", data=ends)
    write("blosc.hdf5", **hdf5plugin.Blosc())
    write("zstd.hdf5", **hdf5plugin.Zstd())
    write("newest.hdf5", libver="latest", compression="gzip")


def linked():
    """A file of robomimic in which an observation, or an episode, is a soft link."""
    import h5py

    for name, link, target in [("link_column.hdf5", "demo_0/obs/arm", "state"), ("link_episode.hdf5", "demo_2", "demo_0")]:
        with h5py.File(fresh(name), "w") as file:
            for i in range(2):
                file[f"data/demo_{i}/obs/state"] = observations(i, 3)
                file[f"data/demo_{i}/actions"] = actions(i, 3)
            place = link.rpartition("/")[0]
            file[f"data/{link}"] = h5py.SoftLink(f"/data/{place}/{target}".replace("//", "/"))


def packed():
    """The same numbers under every filter that is taken back outside of the HDF5 reader, and once without any."""
    import h5py
    import hdf5plugin

    steps = 120
    luck = np.random.default_rng(1)
    # Half of it cannot be made smaller, half of it can.
    rows = np.where(np.arange(steps)[:, None] < 60, luck.normal(size=(steps, 3)), 0.25)
    ways = {
        "plain": {},
        "zstd": hdf5plugin.Zstd(),
        "shuffled_zstd": dict(shuffle=True, **hdf5plugin.Zstd(clevel=9)),
        "lz4": hdf5plugin.LZ4(),
        "lz4_blocks": dict(shuffle=True, **hdf5plugin.LZ4(nbytes=64)),
        "checked": dict(fletcher32=True, shuffle=True, **hdf5plugin.LZ4()),
    }
    with h5py.File(fresh("packed.hdf5"), "w") as file:
        for name, how in ways.items():
            # Chunks hang over both edges.
            chunks = dict(chunks=(50, 2)) if how else {}
            file.create_dataset(f"observed/{name}", data=rows.astype(np.float32), **chunks, **how)
            file.create_dataset(f"other_end/{name}", data=rows.astype(">f8"), **chunks, **how)
        file.create_dataset("actions", data=rows[:, :2].astype(np.float32), chunks=(50, 2), **hdf5plugin.Zstd())
        file.create_dataset("timeouts", data=np.arange(steps) % 40 == 39, chunks=(50,), **hdf5plugin.LZ4())
        file.create_dataset("image", data=np.zeros((steps, 2, 2, 3), np.uint8), chunks=(50, 2, 2, 3), **hdf5plugin.Zstd())
    with h5py.File(fresh("bitshuffle.hdf5"), "w") as file:
        file.create_dataset("observations", data=np.ones((steps, 3)), chunks=(60, 3), **hdf5plugin.Bitshuffle())
        file.create_dataset("actions", data=np.zeros((steps, 2)))
        file.create_dataset("timeouts", data=np.arange(steps) % 60 == 59)


def robomimic_of_minari(source, path):
    """A robomimic file of a Minari data set, to try filter keys on a set of any task."""
    import h5py

    with h5py.File(pathlib.Path(source) / "data/main_data.hdf5") as old, h5py.File(path, "w") as new:
        for i in range(len(old)):
            episode, group = old[f"episode_{i}"], new.create_group(f"data/demo_{i}")
            group.create_dataset("actions", data=episode["actions"][:])
            group.create_dataset("obs/flat", data=episode["observations"][:-1])
            group.attrs["num_samples"] = len(episode["actions"])
        new["data"].attrs["total"] = sum(group.attrs["num_samples"] for group in new["data"].values())
        new["data"].attrs["env_args"] = "{}"


def flat(name):
    """The arrays of an npz file as OGBench saves them."""
    ends = np.concatenate([np.arange(steps) == steps - 1 for steps in LENGTHS])
    both = [np.concatenate([part(i, steps) for i, steps in enumerate(LENGTHS)]) for part in (observations, actions)]
    np.savez(fresh(name), observations=both[0], actions=both[1], terminals=ends)


def starts_of_vectors(name):
    """Starts as stable-baselines stores them of environments that play side by side: the first alone is no array."""
    starts = np.empty(5, dtype=object)
    starts[:] = [True, *(np.array([step == 3]) for step in range(1, 5))]
    np.savez(fresh(name), obs=observations(0, 5), actions=actions(0, 5), episode_starts=starts)


TOOLS = {
    "lerobot-v3": lambda: lerobot("lerobot_v3"),
    "lerobot-v2": lambda: lerobot("lerobot_v2"),
    "lerobot-jump": lambda: lerobot_jump("lerobot_jump"),
    "lerobot-ragged": lambda: lerobot_ragged("lerobot_ragged"),
    "lerobot-sentences": lambda: lerobot_sentences("lerobot_sentences.parquet"),
    "minari": lambda: (minari("minari_hdf5", "hdf5"), minari("minari_parquet", "parquet"),
                       minari("minari_parquet_dict", "parquet")),
    "minari-infos": lambda: minari_infos("minari_infos.hdf5"),
    "robomimic": lambda: robomimic("robomimic.hdf5"),
    "imitation": lambda: imitation("imitation.npz"),
    "baselines": lambda: baselines("baselines.npz"),
    "stable-baselines": lambda: stable_baselines("stable_baselines.npz"),
    "flat": lambda: flat("flat.npz"),
    "starts": lambda: starts_of_vectors("starts_of_vectors.npz"),
    "orders": lambda: orders("orders.npz"),
    "maniskill": lambda: maniskill("maniskill.h5"),
    "aloha": lambda: aloha("aloha"),
    "zstd": lambda: (zstd("lerobot_v3", "lerobot_v3_zstd"), zstd("lerobot_v2", "lerobot_v2_zstd")),
    "kinds": kinds,
    "linked": linked,
    "packed": packed,
}

if __name__ == "__main__":
    if sys.argv[1] == "robomimic-of-minari":
        robomimic_of_minari(*sys.argv[2:])
    else:
        for tool in sys.argv[1:]:
            TOOLS[tool]()
