"""What the wheel promises, tried in an environment of Python that holds nothing else; `cargo xtask wheel` runs this.

Packages that are not there leave out the tests that need them.
"""

import concurrent.futures
import contextlib
import importlib.util
import io
import json
import os
import pathlib
import pickle
import signal
import stat
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from unittest import mock

import demosift
import demosift.parts
import numpy

CHECKOUT = pathlib.Path(__file__).resolve().parents[3]
ENVIRONMENTS = CHECKOUT / "crates/demosift-gymnasium/tests/environments/point.py"
#: So few updates and episodes that a run takes a moment.
TINY = {
    "cloning_judge.judging.iterations": 3,
    "cloning_judge.judging.averaged": 1,
    "cloning_judge.judging.evaluations": 2,
    "cloning_judge.judging.repeats": 2,
    "cloning_judge.judging.most_repeats": 2,
    "cloning_judge.cloning.steps": 30,
    "imitate.cloning_updates": 3,
    "imitate.evaluations": 2,
}
FAST = {"preset": "quick", "judge": "cloning", "referee": "cloning=1", "values": TINY, "threads": 2}


#: The best linear map from observations to actions.
LEAST_SQUARES = """
import numpy

def train(demonstrations, seed):
    observations = numpy.concatenate([one.observations for one in demonstrations])
    actions = numpy.concatenate([one.actions for one in demonstrations])
    weights, *_ = numpy.linalg.lstsq(numpy.c_[observations, numpy.ones(len(observations))], actions, rcond=None)
    return lambda observation: numpy.append(observation, 1.0) @ weights
"""


def has(*modules):
    return all(importlib.util.find_spec(module) is not None for module in modules)


def drives(directions):
    """Drives of the point mass: each pushes with all its might in a direction, in degrees from the goal in the east."""
    pairs = []
    for number, direction in enumerate(directions):
        angle = numpy.radians(direction)
        action = numpy.array([numpy.cos(angle), numpy.sin(angle)], dtype=numpy.float32)
        position, velocity = 0.05 * numpy.array([number % 3 - 1, number % 2]), numpy.zeros(2)
        observations, actions = [], []
        for _ in range(30):
            observations.append(numpy.concatenate([position, velocity]))
            actions.append(action)
            velocity = velocity + (2.0 * action - velocity) * 0.1
            position = position + velocity * 0.1
        pairs.append((numpy.array(observations), numpy.array(actions)))
    return pairs


class InScratch(unittest.TestCase):
    """In an empty folder."""

    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(scratch.name)


class TheCommand(InScratch):
    def test_the_program_is_installed(self):
        program = pathlib.Path(sys.executable).with_name("demosift")
        said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
        self.assertIn(f"demosift {demosift.__version__} (MuJoCo 3.", said)
        module = subprocess.run([sys.executable, "-m", "demosift", "tasks"], capture_output=True, text=True, check=True)
        self.assertIn("half_cheetah", module.stdout)
        wrong = subprocess.run([program, "sift"], capture_output=True, text=True)
        self.assertEqual(wrong.returncode, 2)

    def test_a_task_of_demosift_needs_no_simulator_of_yours(self):
        result = demosift.sift(drives([0, 10, 170]), task="point_mass", out="run", progress=False, **FAST)
        best = result.ranking["demonstration"][0] if has("pandas") else result.ranking[0]["demonstration"]
        self.assertIn(best, [0, 1])
        self.assertLess(set(result.kept), {0, 1, 2})
        self.assertEqual(result.policy(numpy.zeros(4)).shape, (2,))
        self.assertEqual(result.policy(numpy.zeros((5, 4))).shape, (5, 2))
        self.assertIn("srcdoc", result.report()._repr_html_())
        self.assertEqual(demosift.load("run").kept, result.kept)
        self.assertEqual([episode.number for episode in result.of(drives([0, 10, 170]))], result.kept)
        with self.assertRaisesRegex(demosift.Mistake, "give the set that was sifted"):
            result.of([(observations[:20], actions[:20]) for observations, actions in drives([0, 10, 170])])
        with self.assertRaisesRegex(demosift.Mistake, "the run folder|already|exists"):
            demosift.sift(drives([0, 10, 170]), task="point_mass", out="run", progress=False, **FAST)
        out = demosift.export(result, "minari", out="kept")
        self.assertEqual(len(demosift.open(out)), len(result.kept))
        self.assertIn("demonstration", demosift.export(result, "csv"))

    def test_parts_of_a_dict_are_taken_in_the_order_of_the_columns(self):
        arrays = dict(numpy.load(demosift.Set.from_arrays(drives([0, 10, 170])).path))
        where, speed = arrays["obs"][:, :2], arrays["obs"][:, 2:]
        numpy.savez("parts.npz", **arrays, where=where, speed=speed)
        asked = {"task": "point_mass", "progress": False, **FAST}
        result = demosift.sift(demosift.open("parts.npz", columns=["where", "speed"]), out="run", **asked)
        policy = result.policy
        self.assertEqual(policy.columns, ("where", "speed"))
        # By their names they would stand the other way round.
        numpy.testing.assert_array_equal(policy({"speed": [3, 4], "where": [1, 2]}), policy(numpy.array([1, 2, 3, 4])))
        with self.assertRaisesRegex(demosift.Mistake, "has no part 'speed', which the policy learned from; it has: velocity, where"):
            policy({"velocity": [3, 4], "where": [1, 2]})
        with self.assertRaisesRegex(demosift.Mistake, "has 3 numbers, and the policy takes 4") as caught:
            policy({"speed": 1, "where": [1, 2]})
        self.assertIn("zeros and ones", caught.exception.hint)
        grouped = demosift.Policy(policy.path, columns=["obs/b", "obs/a/_index_1", "obs/a/_index_0[1:]"])
        parts = {"a": (numpy.array([9, 4]), 3.0), "b": [1, 2], "c": "none of it"}
        numpy.testing.assert_array_equal(grouped(parts), policy(numpy.array([1, 2, 3, 4])))
        # One column that has another name is all of an observation, whose parts stand by their names.
        whole = demosift.Policy(policy.path, columns=["observations"])
        numpy.testing.assert_array_equal(whole({"y": [3, 4], "x": [1, 2]}), policy(numpy.array([1, 2, 3, 4])))

    def test_what_is_kept_of_some_episodes_is_found_by_its_number(self):
        some = demosift.open(demosift.Set.from_arrays(drives([170, 175, 160, 0, 10])).path, episodes="2-4")
        result = demosift.sift(some, task="point_mass", out="run", keep=1, progress=False, **{**FAST, "referee": "none"})
        self.assertIn(result.kept, [[3], [4]])
        kept = result.of(some)
        self.assertEqual([episode.number for episode in kept], result.kept)
        # The drives to the goal push to the east.
        self.assertGreater(kept[0].actions[0, 0], 0.9)
        with self.assertRaisesRegex(demosift.Mistake, "the set has no demonstration"):
            result.of(demosift.open(some.path, episodes="0-2"))

    def test_a_dry_run_says_what_it_would_cost_and_begins_nothing(self):
        asked = {"task": "point_mass", "out": pathlib.Path("run"), "progress": False, **FAST}
        for more in [{}, {"map": map, "parts": 2}]:
            forecast = demosift.sift(drives([0, 10, 170]), dry_run=True, **asked, **more)
            self.assertTrue(forecast["dry_run"])
            self.assertEqual([stage["stage"] for stage in forecast["stages"]], ["judge_cloning", "referee"])
            self.assertFalse(pathlib.Path("run").exists())
        demosift.sift(drives([0, 10, 170]), **asked)
        self.assertEqual(demosift.sift(drives([0, 10, 170]), dry_run=True, resume=True, **asked)["stages"], [])

    def test_one_demonstration_is_judged_afterwards(self):
        few = {"meta_train.rounds": 2, "judge.iterations": 1, "judge.averaged": 1, "judge.evaluations": 2, "judge.repeats": 1}
        asked = {**FAST, "judge": "paper", "referee": "none", "values": {**TINY, **few, "inner.batch_steps": 120}}
        result = demosift.sift(drives([0, 10, 170]), task="point_mass", out="run", progress=False, **asked)
        standing = demosift.judge(drives([5]), prior=result, progress=False)
        self.assertEqual(len(standing), 1)
        self.assertTrue(demosift.judge(drives([5]), prior=result, dry_run=True, progress=False)["dry_run"])
        with self.assertRaisesRegex(demosift.Mistake, "the run has no policy"):
            result.policy

    def test_mistakes_are_exceptions_with_the_same_words(self):
        with self.assertRaisesRegex(demosift.Mistake, "no task is given") as caught:
            demosift.sift(drives([0, 10]), progress=False)
        self.assertIn("--env", caught.exception.hint)
        self.assertIsInstance(caught.exception, ValueError)
        with self.assertRaises(demosift.Mistake):
            len(demosift.open("nowhere.hdf5"))
        with self.assertRaisesRegex(demosift.Mistake, "demonstration 0 has 30 observations and 31 actions"):
            demosift.Set.from_arrays([(numpy.zeros((30, 4)), numpy.zeros((31, 2)))])
        for observed, acted in [(30, 28), (1, 0)]:
            with self.assertRaisesRegex(demosift.Mistake, f"0 has .* observations and {acted} actions") as caught:
                demosift.Set.from_arrays([(numpy.zeros((observed, 4)), numpy.zeros((acted, 2)))])
            self.assertIn("or one observation more", caught.exception.hint)

    def test_ctrl_c_stops_the_run_and_it_goes_on(self):
        asked = {**FAST, "values": {**TINY, "cloning_judge.judging.iterations": 100000}}
        # Whoever starts a program in the background lets it ignore Ctrl-C.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        timer = threading.Timer(4.0, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        begun = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            demosift.sift(drives([0, 10, 170]), task="point_mass", out="run", progress=False, **asked)
        self.assertLess(time.monotonic() - begun, 60)
        self.assertTrue(pathlib.Path("run/run.json").is_file())


class Trainers(InScratch):
    """A trainer of the user's own, as a third imitator of the referee and as a judge."""

    def test_the_referee_says_what_it_should_see(self):
        pathlib.Path("my_train.py").write_text(LEAST_SQUARES)
        asked = {**FAST, "referee": "trainer=3", "task": "point_mass", "progress": False}
        result = demosift.sift(drives([0, 10, 170, 175]), trainer="my_train.py:train", out="run", **asked)
        self.assertIn("by my_train.py:train", result.verdict)
        self.assertLessEqual(set(result.kept), {0, 1, 2, 3})
        with self.assertRaisesRegex(demosift.Mistake, "those of your own trainer, my_train.py:train"):
            result.policy
        self.assertIn("my_train.py:train", result.report()._repr_html_())
        # Of one process, as much as of many.
        shared = demosift.sift(
            drives([0, 10, 170, 175]), trainer="my_train.py:train", out=pathlib.Path("shared"), map=map, parts=2, **asked
        )
        self.assertEqual((shared.folder / "verdict.json").read_bytes(), (result.folder / "verdict.json").read_bytes())

    def test_it_judges_too(self):
        pathlib.Path("my_train.py").write_text(LEAST_SQUARES)
        asked = {**FAST, "judge": "trainer", "referee": "none", "keep": 2, "task": "point_mass", "progress": False}
        with self.assertRaisesRegex(demosift.Mistake, "a trainer of yours is to judge") as caught:
            demosift.sift(drives([0, 10, 170, 175]), out="run", **asked)
        self.assertIn("--trainer", caught.exception.hint)
        result = demosift.sift(drives([0, 10, 170, 175]), trainer="my_train.py:train", out="run", **asked)
        scores = json.loads((result.folder / "scores_trainer.json").read_text())
        self.assertEqual(scores["trainer"]["name"], "my_train.py:train")
        self.assertEqual([len(one["after"]) for one in scores["suitabilities"]], [3] * 4)
        self.assertEqual(result.kept, [0, 1])
        shared = demosift.sift(
            drives([0, 10, 170, 175]), trainer="my_train.py:train", out=pathlib.Path("shared"), map=map, parts=2, **asked
        )
        self.assertFalse((shared.folder / "prior.safetensors").exists(), "it starts from nothing")
        self.assertEqual((shared.folder / "scores_trainer.json").read_bytes(), (result.folder / "scores_trainer.json").read_bytes())

    def test_a_judge_that_fails_goes_on_when_it_is_mended(self):
        counts = "import pathlib\ncount = pathlib.Path('count')\n"
        fails = "    n = len(count.read_text()) if count.exists() else 0\n    count.write_text('x' * (n + 1))\n    assert n != 2, 'the third'\n"
        broken = LEAST_SQUARES.replace("import numpy\n", f"import numpy\n{counts}")
        broken = broken.replace("def train(demonstrations, seed):\n", f"def train(demonstrations, seed):\n{fails}")
        pathlib.Path("my_train.py").write_text(broken)
        asked = {**FAST, "judge": "trainer", "referee": "none", "task": "point_mass", "progress": False, "threads": 1}
        asked["trainer"] = "my_train.py:train"
        with self.assertRaisesRegex(demosift.Failed, "judging demonstration 2: .* AssertionError: the third"):
            demosift.sift(drives([0, 10, 170]), out="run", **asked)
        result = demosift.sift(drives([0, 10, 170]), out="run", resume=True, **asked)
        self.assertEqual(len(pathlib.Path("count").read_text()), 3 * 3 + 1, "none was made twice but the one that failed")
        pathlib.Path("my_train.py").write_text(LEAST_SQUARES)
        with self.assertRaisesRegex(demosift.Mistake, "were judged by the trainer my_train.py:train"):
            demosift.sift(drives([0, 10, 170]), out="run", resume=True, **{**asked, "referee": "trainer=3"})
        self.assertEqual(len(result.ranking), 3)

    @unittest.skipUnless(has("cloudpickle"), "cloudpickle is not installed")
    def test_a_function_of_a_program_travels(self):
        shift = numpy.array([1.0, 0.0])

        def east(demonstrations, seed):
            return lambda observation: shift

        asked = {**FAST, "referee": "cloning=3,trainer=3", "task": "point_mass", "progress": False}
        result = demosift.sift(drives([0, 10, 170, 175]), trainer=east, out="run", **asked)
        trained = [pair for pair in json.loads((result.folder / "verdict.json").read_text())["pairs"]]
        of_trainer = {pair["mean"] for pair in trained if pair["imitator"] == "trainer"}
        self.assertEqual(len(of_trainer), 1, "it learns nothing, whatever it is to learn from")

    def test_what_goes_wrong_is_an_exception(self):
        pathlib.Path("my_train.py").write_text("def train(demonstrations, seed):\n    raise RuntimeError('the loss is a fish')\n")
        asked = {**FAST, "referee": "trainer=3", "task": "point_mass", "progress": False}
        with self.assertRaisesRegex(demosift.Failed, r"RuntimeError: the loss is a fish \(my_train.py, line 2"):
            demosift.sift(drives([0, 10, 170]), trainer="my_train.py:train", out="run", **asked)
        pathlib.Path("my_train.py").write_text(LEAST_SQUARES)
        result = demosift.sift(drives([0, 10, 170]), trainer="my_train.py:train", out="run", resume=True, **asked)
        self.assertIn("by my_train.py:train", result.verdict)
        with self.assertRaisesRegex(demosift.Mistake, "trainer is a int"):
            demosift.sift(drives([0, 10, 170]), trainer=3, **asked)


class InParts(InScratch):
    """What several find together is what one process finds, to the bit."""

    def shared(self, map, out="shared"):
        asked = {**FAST, "referee": "cloning=3", "threads": 1}
        alone = demosift.sift(drives([0, 10, 170, 90]), task="point_mass", out="undivided", progress=False, **asked)
        shared = demosift.sift(
            drives([0, 10, 170, 90]), task="point_mass", out=out, progress=False, map=map, parts=2, **asked
        )
        self.assertTrue(list(pathlib.Path(out, "parts").glob("*/learning_curve_referee_*")))
        for name in ["scores_cloning.json", "verdict.json", "policy_best.safetensors"]:
            self.assertEqual(pathlib.Path(out, name).read_bytes(), (alone.folder / name).read_bytes(), name)
        self.assertEqual(shared.kept, alone.kept)

    def test_a_pool_of_processes(self):
        with concurrent.futures.ProcessPoolExecutor(2) as pool:
            self.shared(pool.map)

    def test_a_prior_is_learned_only_where_a_judge_starts_from_it(self):
        few = {"meta_train.rounds": 2, "judge.iterations": 1, "judge.averaged": 1, "judge.evaluations": 2, "judge.repeats": 1}
        values = {**TINY, **few, "inner.batch_steps": 120}
        asked = {"preset": "quick", "referee": "none", "threads": 2, "task": "point_mass", "progress": False}
        for judges, is_learned in [("cloning", False), ("paper", True)]:
            shared = demosift.sift(
                drives([0, 10, 170]), out=judges, map=map, parts=2, values={**values, "judges": judges}, **asked
            )
            self.assertEqual((shared.folder / "prior.safetensors").exists(), is_learned)
            self.assertTrue((shared.folder / f"scores_{judges}.json").exists())

    def test_names_of_here_are_found_from_elsewhere(self):
        pathlib.Path("my_train.py").write_text(LEAST_SQUARES)
        pathlib.Path("elsewhere").mkdir()

        def elsewhere(function, items):
            before = os.getcwd()
            os.chdir("elsewhere")
            try:
                return [function(item) for item in items]
            finally:
                os.chdir(before)

        asked = {**FAST, "referee": "trainer=3", "task": "point_mass", "progress": False, "trainer": "my_train.py:train"}
        demosift.sift(drives([0, 10, 170]), out="shared", map=elsewhere, parts=2, **asked)
        self.assertTrue(list(pathlib.Path("shared/inputs").glob("arrays-*.npz")), "what is in memory goes where all see it")
        self.assertFalse(pathlib.Path("runs").exists())

    def test_words_name_files_from_any_folder(self):
        for name in ["my_env.py", "set.hdf5", "values.toml", "set.toml"]:
            pathlib.Path(name).touch()
        for name in ["gymnasium", "handstand", "my_task"]:
            pathlib.Path(name).mkdir()
        here = os.getcwd()
        for typed, wanted in [
            ("set.hdf5", f"{here}/set.hdf5"),
            ("--env=my_env.py:make", f"--env={here}/my_env.py:make"),
            ("--heuristic=my_env.py:score", f"--heuristic={here}/my_env.py:score"),
            ("--config=values.toml", f"--config={here}/values.toml"),
            ("--set-file=set.toml", f"--set-file={here}/set.toml"),
            ("--task=my_task", f"--task={here}/my_task"),
            ("--task=handstand", None),
            ("--env=gymnasium:HalfCheetah-v5", None),
            ("--heuristic=negated min gap", None),
            ("--python=python3", None),
            ("--trainer=no_file.py:train", None),
            ("--keep=5", None),
        ]:
            self.assertEqual(demosift.parts.absolute(typed), wanted or typed)

    def test_a_part_that_fails_takes_no_other_with_it(self):
        def loses(function, items):
            return [RuntimeError("the machine is lost") if item == "1/2" else function(item) for item in items]

        def breaks(function, items):
            yield function(items[1])
            raise RuntimeError("a process of the pool was killed")

        for out, way in [("lost", loses), ("broken", breaks)]:
            with self.assertWarnsRegex(UserWarning, "a part of the run failed, and the others go on: .* (lost|killed)"):
                self.shared(way, out)
            os.rename("undivided", f"undivided-{out}")
        asked = {**FAST, "task": "point_mass", "progress": False, "parts": 2}
        with self.assertRaisesRegex(RuntimeError, "the machine is lost"):
            demosift.sift(drives([0, 10]), out="all", map=lambda function, items: [RuntimeError("the machine is lost")] * 2, **asked)
        demosift.sift(drives([0, 10]), task="point_mass", out="other", progress=False, **FAST)
        with self.assertRaisesRegex(demosift.Mistake, "the run folder is of another run") as caught:
            demosift.sift(drives([0, 170]), out="other", map=map, **asked)
        self.assertIn("another folder", caught.exception.hint)

    def test_what_does_not_wait_is_refused(self):
        class Future:
            cancelled = 0

            def cancel(self):
                Future.cancelled += 1

        with self.assertRaisesRegex(demosift.Mistake, "map returned a Future in the place of what a part found") as caught:
            demosift.sift(
                drives([0, 10]), task="point_mass", out="run", progress=False, parts=2,
                map=lambda function, items: [Future() for _ in items], **FAST,
            )
        self.assertIn("client.get_executor().map", caught.exception.hint)
        self.assertEqual(Future.cancelled, 2)

    def asked_of(self, stages, goals, left):
        """What the command is asked where so much is open, the parts leaving `left` to others, one round each."""
        asked, rounds = [], iter(left)

        def ask(words, **_):
            asked.append(words[0])

        def ask_json(words, **_):
            if "--dry-run" in words:
                return {"stages": [{"stage": stage} for stage in stages], "goals": goals}
            asked.append(f"{words[0]} {words[-1]}")
            return {"left": next(rounds)}

        with mock.patch.multiple("demosift.command", ask=ask, ask_json=ask_json):
            demosift.parts.in_parts(["set"], pathlib.Path("run"), 1, map)
        return asked

    def test_each_stage_is_asked_for_where_something_of_it_is_left(self):
        judge, referee = "judge --part=1/1", "referee --part=1/1"
        self.assertEqual(self.asked_of([], [], []), [])
        self.assertEqual(self.asked_of(["judge_cloning", "referee"], [], [[], []]), [judge, referee])
        # The folders of the goals are made by who collects.
        self.assertEqual(self.asked_of(["judge_cloning", "referee"], ["left", "right"], [[]]), [judge])
        self.assertEqual(self.asked_of(["meta_train", "judge_paper"], [], [[]]), ["meta-train", judge])
        weights = ["subset_selection", "referee"]
        self.assertEqual(self.asked_of(weights, [], [[]]), ["meta-train", "weigh", referee])
        # Whoever shares out judges what no part has judged.
        self.assertEqual(self.asked_of(["judge_cloning", "referee"], [], [["1 is left"]] * 2 + [[]]), [judge, judge, "judge", referee])
        # What changes nothing any more is not asked for a hundred times.
        self.assertEqual(self.asked_of(["referee"], [], [["3 are left"]] * 5), [referee] * 2)

    def test_ctrl_c_ends_the_jobs_of_submitit_and_one_at_its_limit_goes_on(self):
        from demosift import engines

        class Job:
            cancelled = False

            def result(self):
                raise KeyboardInterrupt

            def cancel(self):
                self.cancelled = True

        jobs, sent = [Job(), Job()], []
        executor = mock.Mock(map_array=lambda function, items: sent.append(function) or jobs)
        with self.assertRaises(KeyboardInterrupt):
            engines.submitit(executor)(str, [1, 2])
        self.assertTrue(all(job.cancelled for job in jobs))
        again = pickle.loads(pickle.dumps(sent[0]))
        helpers = mock.Mock(DelayedSubmission=lambda *submitted: submitted)
        with mock.patch.dict(sys.modules, {"submitit": mock.Mock(helpers=helpers), "submitit.helpers": helpers}):
            self.assertEqual(again.__submitit_checkpoint__(7), (again, 7))
        self.assertEqual(again(7), "7")

    @unittest.skipUnless(has("ray"), "Ray is not installed")
    def test_ray(self):
        import ray
        from demosift import engines

        ray.init(num_cpus=2, include_dashboard=False, configure_logging=False)
        self.addCleanup(ray.shutdown)
        self.shared(engines.ray(num_cpus=1))

    @unittest.skipUnless(has("submitit"), "submitit is not installed")
    def test_submitit(self):
        import submitit
        from demosift import engines

        executor = submitit.AutoExecutor(folder="jobs", cluster="local")
        executor.update_parameters(timeout_min=5)
        self.shared(engines.submitit(executor))

    def test_what_goes_together_is_told(self):
        with self.assertRaisesRegex(demosift.Mistake, "map, parts and out go together"):
            demosift.sift(drives([0, 10]), task="point_mass", map=map, parts=2)


class Sets(InScratch):
    def test_arrays_become_a_set_and_come_back(self):
        pairs = drives([0, 90])
        demonstrations = demosift.Set.from_arrays(pairs)
        self.assertEqual(demosift.Set.from_arrays(pairs), demonstrations, "the same arrays are the same file")
        self.assertEqual(len(demonstrations), 2)
        for (observations, actions), episode in zip(pairs, demonstrations):
            numpy.testing.assert_array_equal(episode.observations, observations.astype(numpy.float32))
            numpy.testing.assert_array_equal(episode.actions, actions)
        # The last observation, on which nothing was done, may be there.
        longer = [(numpy.vstack([observations, observations[-1:]]), actions) for observations, actions in pairs]
        self.assertEqual(demosift.Set.from_arrays(longer), demonstrations)

    def test_files_of_other_tools_are_arrays(self):
        file = CHECKOUT / "crates/demosift/tests/formats/robomimic.hdf5"
        demonstrations = demosift.open(file, columns=["obs/wrist"])
        self.assertEqual([len(episode) for episode in demonstrations], [4, 3, 5])
        some = demosift.open(file, columns=["obs/wrist"], episodes="1-2")
        self.assertEqual([len(episode) for episode in some], [3, 5])
        self.assertEqual([(episode.number, episode.label) for episode in some], [(1, "demo_1"), (2, "demo_2")])
        self.assertEqual([episode.number for episode in some.numbered([2, 1])], [2, 1])
        with self.assertRaisesRegex(demosift.Mistake, "has no demonstration 0; its 2 have numbers from 1 to 2"):
            some.numbered([0])
        self.assertEqual(demonstrations.inspect()["inspection"]["format"], "robomimic")


@unittest.skipUnless(has("gymnasium", "nbconvert", "ipykernel", "sklearn", "pandas", "cloudpickle"), "what it needs is not there")
class TheNotebook(InScratch):
    def test_it_runs_from_its_first_cell_to_its_last(self):
        text = (CHECKOUT / "docs/guides/notebook.ipynb").read_text(encoding="utf-8")
        self.assertFalse([cell["outputs"] for cell in json.loads(text)["cells"] if cell.get("outputs")], "of no machine")
        pathlib.Path("notebook.ipynb").write_text(text, encoding="utf-8")
        words = ["nbconvert", "--to", "notebook", "--execute", "--output", "run.ipynb", "notebook.ipynb"]
        ran = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        shown = pathlib.Path("run.ipynb").read_text(encoding="utf-8")
        for words in ["demonstration", "srcdoc", "train on", ".py:train"]:
            self.assertIn(words, shown)


@unittest.skipUnless(has("gymnasium"), "gymnasium is not installed")
class Environments(InScratch):
    def setUp(self):
        super().setUp()
        sys.path.insert(0, str(ENVIRONMENTS.parent))
        self.addCleanup(sys.path.remove, str(ENVIRONMENTS.parent))

    def stepped(self):
        """An interpreter that cannot import demosift: there each step goes over the pipe."""
        pathlib.Path("blocked/demosift").mkdir(parents=True)
        pathlib.Path("blocked/demosift/__init__.py").write_text("raise ImportError('blocked')")
        stepped = pathlib.Path("stepped")
        stepped.write_text(f"#!/bin/sh\nPYTHONPATH={os.getcwd()}/blocked exec {sys.executable} \"$@\"\n")
        stepped.chmod(stepped.stat().st_mode | stat.S_IXUSR)
        return stepped.absolute()

    def test_whole_episodes_play_the_same_bits_as_single_steps(self):
        import point

        stepped = self.stepped()
        wanted = {"env": point.Point, "horizon": 30, "heuristic": "negated last distance", "progress": False, **FAST}
        whole = demosift.sift(drives([0, 10, 170]), out="whole", **wanted)
        single = demosift.sift(drives([0, 10, 170]), out="single", python=stepped, **wanted)
        scores = [json.loads((run.folder / "scores_cloning.json").read_text()) for run in (whole, single)]
        self.assertEqual(scores[0], scores[1])
        self.assertEqual(whole.kept, single.kept)
        # In the environment's own unit, which is from -2 to 2.
        plain = demosift.Policy(whole.folder / "policy_best.safetensors")
        seen = numpy.ones((3, 4), dtype=numpy.float32)
        numpy.testing.assert_allclose(whole.policy(seen), 2.0 * plain(seen), rtol=1e-6)
        with self.assertRaisesRegex(demosift.Mistake, "has 3 numbers, and the policy takes 4"):
            plain(numpy.zeros(3))

    def test_measures_and_scores_are_the_same_whole_and_stepped(self):
        import point

        stepped = self.stepped()
        for name, own in [
            ("words", {"heuristic": "negated min distance"}),
            ("measure", {"measure": point.measure, "heuristic": "negated min gap"}),
            ("score", {"heuristic": point.nearest}),
        ]:
            wanted = {"env": point.Point, "horizon": 30, "progress": False, **own, **FAST}
            runs = [
                demosift.sift(drives([0, 10, 170]), out=f"{name}-whole", **wanted),
                demosift.sift(drives([0, 10, 170]), out=f"{name}-single", python=stepped, **wanted),
            ]
            scores = [json.loads((run.folder / "scores_cloning.json").read_text()) for run in runs]
            self.assertEqual(scores[0], scores[1])
            if name == "words":
                words = scores[0]
            if name == "measure":
                self.assertEqual(scores[0], words)
        findings = demosift.check(env=point.Point, horizon=30, measure=point.measure, heuristic="negated min gap")
        self.assertIn("gap", findings["info"])
        with self.assertRaisesRegex(demosift.Failed, r"score_raises failed on an episode of 30 steps: ValueError"):
            demosift.sift(drives([0, 10]), env=point.Point, horizon=30, heuristic=point.score_raises, progress=False, **FAST)

    def test_what_goes_wrong_in_whole_episodes_is_one_sentence(self):
        import point

        asked = {"horizon": 30, "progress": False, **FAST}
        with self.assertRaisesRegex(demosift.Failed, r"RuntimeError: the arm is gone \(point.py, line "):
            demosift.sift(drives([0, 10]), env=point.raises_late, out="raises", **asked)
        with self.assertRaisesRegex(demosift.Failed, "did not finish a step of an episode within 5 s"):
            demosift.sift(drives([0, 10]), env=point.hangs, out="hangs", time_limit=5, **asked)

    def test_an_episode_that_takes_longer_than_the_limit_of_a_step_is_none_that_hangs(self):
        import point

        quick = demosift.sift(drives([0, 10]), env=point.Still, horizon=30, out="run", progress=False, **FAST)
        path = quick.folder / "policy_best.safetensors"
        lines = ["import time", "import point", "def make():", "    return point.Point(lambda env: time.sleep(0.2))"]
        pathlib.Path("slow.py").write_text("\n".join(lines))
        os.environ["PYTHONPATH"] = str(ENVIRONMENTS.parent)
        self.addCleanup(os.environ.pop, "PYTHONPATH")
        asked = ["play", "--policy", path, "--env", "slow.py:make", "--horizon", "50", "--time-limit", "8", "--episodes", "1"]
        played = demosift.command.ask_json([*asked, "--python", sys.executable])
        self.assertEqual(played["episodes"][0]["steps"], 50)

    @unittest.skipUnless(has("cloudpickle"), "cloudpickle is not installed")
    def test_a_function_without_a_name_travels(self):
        import point

        shift = 2.0
        found = demosift.check(drives([0, 10]), env=lambda: point.limited() if shift else None)
        self.assertTrue(any("repeats" in json.dumps(finding) for finding in found["findings"]), found)

    def test_a_function_of_a_package_is_imported_with_the_package(self):
        os.mkdir("mylab")
        pathlib.Path("mylab/arm.py").write_text("from point import limited\n")
        pathlib.Path("mylab/__init__.py").write_text("def make():\n    from .arm import limited\n    return limited()\n")
        sys.path.insert(0, os.getcwd())
        self.addCleanup(sys.path.remove, os.getcwd())
        os.environ["PYTHONPATH"] = str(ENVIRONMENTS.parent)
        self.addCleanup(os.environ.pop, "PYTHONPATH")
        import mylab

        self.addCleanup(sys.modules.pop, "mylab")
        found = demosift.check(env=mylab.make)
        self.assertEqual(found["environment"], "mylab:make")

    def test_a_line_of_progress_is_no_note(self):
        import point

        told = io.StringIO()
        with contextlib.redirect_stderr(told):
            demosift.sift(drives([0, 10]), env=point.limited, out="run", **FAST)
        self.assertNotIn("progress: ", told.getvalue())


if __name__ == "__main__":
    unittest.main(verbosity=2)
