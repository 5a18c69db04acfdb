"""The part of demosift that is Rust; arrays cross as bytes of little-endian 32-bit floats."""

from collections.abc import Callable, Sequence
from os import PathLike

VERSION: str
PLAYER: str

def run(typed: Sequence[str]) -> int: ...
def read(
    path: str | PathLike[str],
    format: str | None,
    observation_columns: Sequence[str],
    action_columns: Sequence[str],
    episodes: str | None,
) -> list[tuple[int, str, bytes, int, bytes, int]]: ...
def play(request: bytes, player: object, beat: Callable[[], None]) -> bytes: ...

class Policy:
    def __init__(
        self, safetensors: bytes, name: str, bounds: Sequence[tuple[float, float]] | None
    ) -> None: ...
    @property
    def observation_size(self) -> int: ...
    @property
    def action_size(self) -> int: ...
    def act(self, observation: bytes) -> bytes: ...
