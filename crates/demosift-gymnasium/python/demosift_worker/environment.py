"""Makes the environment that is asked for, and reads off it what it says of itself."""

import json
import os

from demosift_worker.naming import named, takes, versions_of
from demosift_worker.problems import Refused


def make(asked):
    """The environment that is asked for; one that is to be looked at draws into arrays."""
    look = {"render_mode": "rgb_array"} if asked.get("pictures") else {}
    if look and not os.environ.get("DISPLAY"):
        # Where there is no screen, MuJoCo draws off it.
        os.environ.setdefault("MUJOCO_GL", "egl")
    if asked.get("kind") == "robosuite":
        from demosift_worker import robosuite_env

        return robosuite_env.make(asked["robosuite"], asked["longest"], bool(look))
    import gymnasium

    if asked.get("spec") is not None:
        spec = spec_of(asked["spec"])
        if not asked.get("trust"):
            check_registered(spec)
        return gymnasium.make(spec, disable_env_checker=True, **look)
    if asked["kind"] == "gymnasium":
        return gymnasium.make(asked["name"], disable_env_checker=True, **look)
    found = named(asked)
    if not callable(found):
        return found
    return found(**look) if look and takes(found, "render_mode") else found()


def follow(env):
    """Looks from the camera that follows the robot, where a model of MuJoCo has one and nobody chose another."""
    try:
        import mujoco

        inner = env.unwrapped
        camera = mujoco.mj_name2id(inner.model, mujoco.mjtObj.mjOBJ_CAMERA, "track")
        if camera >= 0 and inner.camera_id is None and inner.camera_name is None:
            inner.mujoco_renderer.camera_id = camera
    except (ImportError, AttributeError):
        return


def spec_of(text):
    """A specification as a set holds it, which may be of another version of Gymnasium."""
    import dataclasses

    from gymnasium.envs.registration import EnvSpec

    known = {field.name for field in dataclasses.fields(EnvSpec) if field.init}
    parsed = {"additional_wrappers": [], **json.loads(text)}
    return EnvSpec.from_json(json.dumps({name: value for name, value in parsed.items() if name in known}))


def check_registered(spec):
    """Refuses code that a set names and that nobody registered here: of the environment, or of a wrapper around it."""
    import gymnasium

    known = gymnasium.registry.get(spec.id)
    named = [] if known is not None and known.entry_point == spec.entry_point else [spec.entry_point]
    named += [wrapper.entry_point for wrapper in spec.additional_wrappers]
    for entry_point in named:
        if not str(entry_point).startswith("gymnasium.wrappers."):
            raise Refused(
                f"the set names the environment '{spec.id}' with the code '{entry_point}', which is not registered here",
                "install the package that registers it, or add --trust-set to run the code that the set names",
            )


def limit_of(env):
    """After how many steps the environment stops an episode by itself, if that can be seen."""
    spec = getattr(env, "spec", None)
    limits = [getattr(spec, "max_episode_steps", None)]
    while env is not None:
        # What TimeLimit keeps; a spec is missing where the environment is not registered.
        limits.append(vars(env).get("_max_episode_steps") if hasattr(env, "__dict__") else None)
        env = vars(env).get("env") if hasattr(env, "__dict__") else None
    return min((int(limit) for limit in limits if isinstance(limit, int) and limit > 0), default=None)


def step_secs(env):
    """Simulated seconds of a step by `dt`, which is the environment's word."""
    dt = getattr(getattr(env, "unwrapped", env), "dt", None)
    return seconds(lambda: dt() if callable(dt) else dt)


def picture_secs(env):
    """Seconds of a picture, most often those of a step; but a rate of pictures is easily copied from elsewhere."""
    metadata = getattr(getattr(env, "unwrapped", env), "metadata", None) or {}
    return seconds(lambda: 1.0 / float(metadata["render_fps"]))


def seconds(found):
    """A number that can be the seconds of a step, or None."""
    try:
        secs = float(found())
        return secs if 0.0 < secs < 1e6 else None
    except Exception:
        return None


def versions(env):
    """Of all that the physics depend on."""
    import gymnasium

    own = type(getattr(env, "unwrapped", env)).__module__.split(".")[0]
    simulators = ["mujoco", "pybullet", "robosuite", "dm_control", "Box2D", "sapien", "torch", "jax"]
    return {"gymnasium": gymnasium.__version__, **versions_of([*simulators, own])}
