from robosuite.environments.base import REGISTERED_ENVS

ALL_ENVIRONMENTS = REGISTERED_ENVS.keys()
