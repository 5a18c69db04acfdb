"""Plays one Gymnasium environment for demosift, or trains and plays policies by a trainer of the user's own.

demosift asks over standard input and is answered over standard output.
It hands this file and those beside it to the user's own interpreter, so they need numpy, for environments gymnasium, and
nothing of demosift.
Where the wheel of demosift can be imported too, whole episodes are played here by the same code that steps it otherwise.
What is asked and answered are frames: the length of the payload (u32), one letter, the payload; all numbers little-endian.

| asked | payload | answered | payload |
|---|---|---|---|
| `O` open | JSON: environment | `G` greeting | JSON: versions, sizes, names |
| `M` measure | JSON: names of numbers in info, steps of an episode, steps in which to look for them | `K` done | JSON: names of all that were seen; before it may stand any number of `H` |
| `R` reset | seed, u64 | `T` turn | see `turn` |
| `S` step | action in the environment's own unit, f64 each | `T` turn | see `turn` |
| `I` into a recorded state | length of the model's text, u32, 0 if there is none; the text; the state, f64 each | `T` turn | see `turn` |
| `Q` which state | none | `A` state | f64 each |
| `V` view | the most columns and rows of a picture, u32 each | `V` view | columns and rows, u32 each; red, green, blue of each pixel, u8 each |
| `P` play | policy and seeds, see `src/whole.rs` | `W` played | episodes; before it may stand any number of `H`, for "still playing" |
| `L` learn with | JSON: trainer, sizes of an observation and an action | `K` done | JSON: versions |
| `D` demonstration | its number of steps, u32; observations and actions, f32 each | `K` done | none |
| `N` now train | seed, u64 | `K` done | JSON: the path of an ONNX file, if the policy is one |
| `B` begin an episode | none | `K` done | none |
| `A` act | observation, f32 each | `A` action | f64 each |
| | | `E` error | JSON: what was wrong |

It ends when standard input does, and with its parent.
"""

import ctypes
import json
import os
import signal
import struct
import sys

from demosift_worker.environment import follow, make
from demosift_worker.learner import Learner
from demosift_worker.player import Player
from demosift_worker.problems import problem

PROTOCOL = 6
LETTERS = {"open": b"O", "measure": b"M", "reset": b"R", "step": b"S", "play": b"P", "put": b"I", "state": b"Q", "view": b"V"}
LEARNING = {"learn": b"L", "demonstration": b"D", "train": b"N", "begin": b"B", "act": b"A"}
PR_SET_PDEATHSIG = 1


def end_with_parent(parent):
    """The kernel ends this process with its parent, even in the middle of a step."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    except (OSError, AttributeError):
        return
    # It may have ended before that; whoever has lost its parent belongs to the first process.
    if os.getppid() == 1 and parent != 1:
        os._exit(1)


def take_streams():
    """The streams of the frames. What the environment prints goes to standard error, and it finds nothing to read.

    A child that the environment forks closes them: held open there, they would hide that this process has died.
    """
    asked, answers = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    held = [asked, answers]

    def close_held():
        # Once: in a child of a child these numbers may be of other files.
        while held:
            os.close(held.pop())

    os.register_at_fork(after_in_child=close_held)
    return os.fdopen(asked, "rb", closefd=False), answers


def player_of_episodes():
    """What plays whole episodes: demosift's own code, where the wheel is installed here; its version tells whether it is the same."""
    try:
        from demosift import _demosift

        return _demosift, _demosift.PLAYER
    except Exception:  # Whatever is wrong with it, the environment can be stepped.
        return None, None


class Desk:
    """Answers one frame after the other; `beat` says that an answer is still worked on."""

    def __init__(self, beat):
        self.player = None
        self.learner = None
        self.beat = beat
        self.episodes = None

    def answer(self, letter, payload):
        if letter in LEARNING.values():
            return self.learn(letter, payload)
        if letter == LETTERS["step"]:
            return b"T", self.player.step(payload)
        if letter == LETTERS["play"]:
            return b"W", self.episodes.play(payload, self.player, self.beat)
        if letter == LETTERS["reset"]:
            return b"T", self.player.reset(struct.unpack("<Q", payload)[0])
        if letter == LETTERS["put"]:
            return b"T", self.player.put(payload)
        if letter == LETTERS["state"]:
            return b"A", self.player.state()
        if letter == LETTERS["view"]:
            return b"V", self.player.view(*struct.unpack("<II", payload))
        asked = json.loads(payload)
        if letter == LETTERS["measure"]:
            return b"K", self.measure(asked)
        if letter == LETTERS["open"]:
            self.player = Player(make(asked), asked.get("own"))
            if asked.get("pictures"):
                follow(self.player.env)
            greeting = {"protocol": PROTOCOL, **self.player.greeting(asked.get("limit"))}
            # After the environment, which may bring a MuJoCo of its own.
            self.episodes, greeting["player"] = player_of_episodes()
            return b"G", json.dumps(greeting).encode()
        raise ValueError(f"the request {letter!r} is unknown to a worker of protocol {PROTOCOL}")

    def learn(self, letter, payload):
        if letter == LEARNING["act"]:
            return b"A", self.learner.act(payload)
        if letter == LEARNING["begin"]:
            return b"K", self.learner.begin()
        if letter == LEARNING["train"]:
            return b"K", self.learner.train(struct.unpack("<Q", payload)[0])
        if letter == LEARNING["demonstration"]:
            self.learner.add(payload)
            return b"K", b"null"
        self.learner = Learner(json.loads(payload))
        return b"K", json.dumps({"protocol": PROTOCOL, "versions": self.learner.versions()}).encode()

    def measure(self, asked):
        """Measures these from now on, if all of them are there; the answer lists those that were seen."""
        player, names, look = self.player, asked["names"], asked["look"]
        player.horizon = asked["limit"]
        if look is None:
            # Another process has seen them.
            player.known.update(names)
        elif not player.known.issuperset(names):
            # Some are there only at the end of an episode.
            player.numbers_in_info(True, look, self.beat)
        if player.known.issuperset(names):
            player.measured = names
        return json.dumps(sorted(player.known)).encode()


def exactly(stream, count):
    """So many bytes; None where the stream has ended."""
    data = stream.read(count)
    return data if data is not None and len(data) == count else None


def send(descriptor, letter, payload):
    frame = memoryview(struct.pack("<I", len(payload)) + letter + payload)
    while frame:
        frame = frame[os.write(descriptor, frame) :]


def main():
    # An environment that reads its arguments finds none.
    end_with_parent(int(sys.argv.pop(1)))
    asked, answers = take_streams()
    worker = os.getpid()
    desk = Desk(lambda: send(answers, b"H", b""))
    while True:
        head = exactly(asked, 5)
        payload = None if head is None else exactly(asked, struct.unpack("<I", head[:4])[0])
        if payload is None:
            break
        try:
            letter, answer = desk.answer(head[4:], payload)
        except BaseException as error:  # Also SystemExit: whatever it is, it is told and not lost.
            if os.getpid() != worker:
                # A forked child that ends itself answers nobody.
                raise
            letter, answer = b"E", json.dumps({**problem(error), "made": desk.player is not None}).encode()
        if os.getpid() != worker:
            os._exit(0)
        sys.stdout.flush()
        send(answers, letter, answer)
    if desk.player is not None and hasattr(desk.player.env, "close"):
        desk.player.env.close()
