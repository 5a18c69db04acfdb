"""Measures what judging costs as a set grows: processor time, memory, files, and how well the ranking agrees with the stages of
training. It makes the sets that it measures, and keeps in scale.json what scale.md and docs/images/scale.svg are made of.

python3 docs/results/scale.py set N FILE                          writes N demonstrations (needs numpy and h5py)
python3 docs/results/scale.py measure DEMOSIFT FOLDER NAME N ...  makes, inspects and judges a set of N, with further options of
                                                                  `demosift judge`, and keeps what it took under NAME
python3 docs/results/scale.py prior DEMOSIFT FOLDER N ...         learns a prior from free_throw_8 and judges sets of N copies of
                                                                  these throws from it, by the judge of the paper
python3 docs/results/scale.py agree NAME SET RUN...               keeps how well finished runs of a set agree with its stages under
                                                                  NAME
python3 docs/results/scale.py threads DEMOSIFT FOLDER N ...       judges martial_arts_10 by each judge on N threads, counts how many
                                                                  of these are busy, and says how long as many cores would take
python3 docs/results/scale.py                                     prints the tables and draws the figure from scale.json
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_suffix(".json")
FIGURE = ROOT / "docs/images/scale.svg"
SOURCE = "martial_arts_100"
THROWS = "free_throw_8"
# Of the spread of each number over the whole set.
NOISE = 0.02
# How many of each demonstration's repeats count, and how many episodes of each.
COUNTED = {"three": (3, None), "three, four episodes": (3, 4), "three, three episodes": (3, 3), "two": (2, None)}


def set_of(source):
    return ROOT / "data" / source / "demonstrations.hdf5"


def stages_of(source):
    """Of each demonstration the mean score of the stage of training that it was recorded at."""
    found = json.loads((ROOT / "data/provenance" / f"{source}.json").read_text())
    return [one["stage_score"] for one in found["demonstrations"]]


def write_set(count, path, source=SOURCE):
    """Demonstration i is a copy of one of the source, which come in turn; the first ones too have noise of their own."""
    import h5py
    import numpy

    with h5py.File(set_of(source)) as file:
        tables = {name: file[name][:] for name in ("observations", "actions")}
        ends = numpy.flatnonzero(file["timeouts"][:] | file["terminals"][:]) + 1
    starts = numpy.concatenate([[0], ends[:-1]])
    random = numpy.random.default_rng(1)
    chosen = [numpy.arange(starts[i % len(ends)], ends[i % len(ends)]) for i in range(count)]
    rows = numpy.concatenate(chosen)
    with h5py.File(path, "w") as file:
        for name, table in tables.items():
            noise = random.standard_normal((len(rows), table.shape[1]), dtype=numpy.float32)
            file[name] = table[rows] + (NOISE * table.std(axis=0)).astype(numpy.float32) * noise
        timeouts = numpy.zeros(len(rows), dtype=bool)
        timeouts[numpy.cumsum([len(one) for one in chosen]) - 1] = True
        file["timeouts"] = timeouts
        file["terminals"] = numpy.zeros(len(rows), dtype=bool)


def cost(command):
    """Processor seconds and the largest memory of a command, which must succeed."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)} failed")
    return {"seconds": round(used.ru_utime + used.ru_stime, 1), "mib": round(used.ru_maxrss / 1024)}


def keep(kind, name, found):
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    kept.setdefault(kind, {})[name] = found
    KEPT.write_text(json.dumps(kept, indent=1) + "\n")


def measure(binary, folder, name, count, options):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"set_{count}.hdf5"
    if not path.exists():
        write_set(count, path)
    run = folder / name
    judge = [binary, "judge", str(path), "--task", "martial_arts", "--judge", "cloning", "--preset", "quick"]
    judged = cost([*judge, "--out", str(run), *options])
    files = {file.name: file.stat().st_size for file in sorted(run.iterdir())}
    steps = json.loads((run / "spent_judge_cloning.json").read_text())["environment_steps"]
    table = json.loads((run / "scores_cloning.json").read_text())["suitabilities"]
    repeats = sum(len(one["after"]) for one in table)
    looked = cost([binary, "inspect", str(path), "--task", "martial_arts"])
    kept = {"n": count, "options": options, "judge": judged, "inspect": looked, "files": files}
    keep("costs", name, {**kept, "environment_steps": steps, "imitations": repeats, "set": path.stat().st_size})


def ranks(values):
    order = sorted(range(len(values)), key=values.__getitem__)
    found = [0.0] * len(values)
    while order:
        alike = [index for index in order if values[index] == values[order[0]]]
        for index in alike:
            found[index] = len(values) - len(order) + (len(alike) - 1) / 2
        order = order[len(alike) :]
    return found


def spearman(one, other):
    one, other = ranks(one), ranks(other)
    mean = (len(one) - 1) / 2
    product = lambda a, b: sum((x - mean) * (y - mean) for x, y in zip(a, b))
    return product(one, other) / (product(one, one) * product(other, other)) ** 0.5


def mean(numbers):
    return sum(numbers) / len(numbers)


def judge_from_prior(binary, folder, counts):
    """One prior, learned by a run that judges its own set too, and sets of several sizes judged from it."""
    folder.mkdir(parents=True, exist_ok=True)
    first = folder / "prior"
    by = ["--judge", "paper"]
    threads = ["--threads", "2"]
    set_and_task = [str(set_of(THROWS)), "--task", "free_throw"]
    if not first.exists():
        whole = cost([binary, "judge", *set_and_task, *by, "--preset", "quick", "--out", str(first), *threads])
        once = json.loads((first / "spent_meta_train.json").read_text())["environment_steps"]
        keep("prior", "learned", {"judge": whole, "once": once})
    stages = stages_of(THROWS)
    for count in counts:
        path, run = folder / f"throws_{count}.hdf5", folder / f"judged_{count}"
        if not path.exists():
            write_set(count, path, THROWS)
        judged = cost([binary, "judge", str(path), *by, "--prior", str(first), "--out", str(run), *threads])
        steps = json.loads((run / "spent_judge_paper.json").read_text())["environment_steps"]
        table = json.loads((run / "scores_paper.json").read_text())["suitabilities"]
        truth = [stages[one["demo"] % len(stages)] for one in table]
        gains = [mean([mean(scores) for scores in one["after"]]) for one in table]
        size = sum(file.stat().st_size for file in run.iterdir())
        found = {"n": count, "judge": judged, "environment_steps": steps, "folder": size}
        keep("prior", f"n_{count}", {**found, "agreement": round(spearman(gains, truth), 4)})


def count_threads(binary, folder, numbers):
    """Threads that could run are counted fifty times a second. While b threads could run on c cores, these did min(b, c) seconds
    of work a second, which b cores would do in min(b, c) / b of the time: so a clock is simulated where cores are fewer."""
    folder.mkdir(parents=True, exist_ok=True)
    cores = os.cpu_count()
    for judge in ("cloning", "paper"):
        for threads in numbers:
            out = folder / f"{judge}_{threads}"
            judging = ["judge", str(set_of("martial_arts_10")), "--task", "martial_arts", "--judge", judge]
            command = [binary, *judging, "--preset", "quick", "--threads", str(threads), "--out", str(out)]
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
            counted, work, clock, last = [], 0.0, 0.0, time.monotonic()
            while process.poll() is None:
                time.sleep(0.02)
                now = time.monotonic()
                busy = busy_threads(process.pid)
                if busy:
                    done = min(busy, cores) * (now - last)
                    counted.append(busy)
                    work, clock = work + done, clock + done / busy
                last = now
            if process.returncode:
                sys.exit(f"{' '.join(command)} failed")
            keep("threads", f"{judge}_{threads}", {"busy": round(mean(counted), 2), "work": round(work, 1), "clock": round(clock, 1)})


def busy_threads(pid):
    states = []
    for stat in Path(f"/proc/{pid}/task").glob("*/stat"):
        try:
            states.append(stat.read_text().rsplit(")", 1)[1].split()[0])
        except OSError:  # It has ended.
            pass
    return states.count("R")


def agree(name, source, runs):
    """Of each run, by the first repeats of everybody alone, and by fewer episodes of these."""
    stages = stages_of(source)
    found = []
    for run in runs:
        table = json.loads((Path(run) / "scores_cloning.json").read_text())["suitabilities"]
        truth = [stages[one["demo"] % len(stages)] for one in table]
        gain = lambda one, repeats, episodes: mean([mean(scores[:episodes]) for scores in one["after"][:repeats]])
        by = lambda counted: spearman([gain(one, *counted) for one in table], truth)
        found.append({name: round(by(counted), 4) for name, counted in COUNTED.items()})
    keep("agreement", name, {"set": source, "runs": found})


def tables():
    kept = json.loads(KEPT.read_text())
    print("| run | n | imitations | judge, s | s a demonstration | judge, MiB | inspect, s | inspect, MiB | run folder, MB |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, of in kept["costs"].items():
        judge, looked, n = of["judge"], of["inspect"], of["n"]
        folder = sum(of["files"].values()) / 1e6
        each = judge["seconds"] / n
        print(
            f"| {name} | {n:,} | {of['imitations']:,} | {judge['seconds']:.0f} | {each:.3f} | {judge['mib']} "
            f"| {looked['seconds']:.1f} | {looked['mib']} | {folder:.1f} |"
        )
    print("\n| run | " + " | ".join(sorted({file for of in kept["costs"].values() for file in of["files"]})) + " |")
    for name, of in kept["costs"].items():
        sizes = (of["files"].get(file, 0) / 1e3 for file in sorted({f for o in kept["costs"].values() for f in o["files"]}))
        print(f"| {name} | " + " | ".join(f"{size:.0f}" for size in sizes) + " |")
    print()
    print("| set | judged with | seeds | " + " | ".join(COUNTED) + " |")
    for name, of in kept.get("agreement", {}).items():
        means = (f"{mean([run[key] for run in of['runs']]):.3f}" for key in COUNTED)
        print(f"| {of['set']} | {name} | {len(of['runs'])} | " + " | ".join(means) + " |")
    print("\n| set | of | less | mean | 95 % interval |\n" + "|---" * 5 + "|")
    for row in differences(kept.get("agreement", {})):
        print(row)
    print("\n| demonstrations from one prior | s | s each | steps each | MiB | run folder, MB | Spearman with the stage |\n" + "|---" * 7 + "|")
    for name, of in kept.get("prior", {}).items():
        if name != "learned":
            n, seconds, folder = of["n"], of["judge"]["seconds"], of["folder"] / 1e6
            steps = of["environment_steps"] / n
            print(f"| {n} | {seconds:.0f} | {seconds / n:.2f} | {steps:.0f} | {of['judge']['mib']} | {folder:.1f} | {of['agreement']:.2f} |")
    print("\n| judge, threads | busy | work, s | clock, s |\n" + "|---" * 4 + "|")
    for name, of in kept.get("threads", {}).items():
        print(f"| {name} | {of['busy']:.2f} | {of['work']:.0f} | {of['clock']:.1f} |")
    FIGURE.write_text(figure([of for name, of in kept["costs"].items() if name.startswith("n_")]))


def differences(agreement):
    """Of each set what sparing loses, paired by seed: each way to count beside three repeats, and fewer updates beside the rules'."""
    by_set = {}
    for name, of in agreement.items():
        by_set.setdefault(of["set"], {})[int(name.split()[0])] = of["runs"]
    for name, by_updates in by_set.items():
        rules = next(updates for updates in (36, 30) if updates in by_updates)
        sides = [(rules, way) for way in COUNTED if way != "three"] + [(updates, "three") for updates in by_updates if updates != rules]
        for updates, way in sides:
            pairs = zip(by_updates[updates], by_updates[rules])
            apart = [one[way] - other["three"] for one, other in pairs]
            middle = mean(apart)
            # Student's t at 95 % with nine degrees of freedom.
            half = 2.262 * (sum((one - middle) ** 2 for one in apart) / (len(apart) - 1) / len(apart)) ** 0.5
            yield f"| {name} | {updates} updates, {way} | {rules} updates, three | {middle:+.3f} | [{middle - half:+.3f}, {middle + half:+.3f}] |"


def figure(costs):
    """Seconds a demonstration, and megabytes of memory, against n on two logarithmic axes."""
    from math import log10

    x = lambda n: 70 + 110 * log10(n / 10)
    y = lambda value, top: 210 - 45 * log10(value / top * 1e4)
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 520 260" font-family="sans-serif" font-size="12">']
    parts.append('<rect width="520" height="260" fill="white"/>')
    for n in (10, 100, 1000, 10000):
        parts.append(f'<text x="{x(n):.0f}" y="235" text-anchor="middle">{n:,}</text>')
        parts.append(f'<line x1="{x(n):.0f}" y1="30" x2="{x(n):.0f}" y2="215" stroke="#ddd"/>')
    for index, (name, color, of) in enumerate(
        [("processor seconds", "#0072b2", lambda of: of["judge"]["seconds"]), ("MiB of memory", "#d55e00", lambda of: of["judge"]["mib"])]
    ):
        for exponent in range(0, 5) if index == 0 else ():
            parts.append(f'<text x="40" y="{y(10**exponent, 1e4) + 4:.0f}" text-anchor="end">{10**exponent:,}</text>')
        points = " ".join(f"{x(one['n']):.1f},{y(of(one), 1e4):.1f}" for one in sorted(costs, key=lambda one: one["n"]))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts.append(f'<text x="{90 + 160 * index}" y="20" fill="{color}">{name}</text>')
    parts.append('<text x="270" y="253" text-anchor="middle">demonstrations</text></svg>')
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["set", count, path]:
            write_set(int(count), path)
        case ["measure", binary, folder, name, count, *options]:
            measure(binary, Path(folder), name, int(count), options)
        case ["prior", binary, folder, *counts]:
            judge_from_prior(binary, Path(folder), [int(count) for count in counts])
        case ["threads", binary, folder, *numbers]:
            count_threads(binary, Path(folder), [int(number) for number in numbers])
        case ["agree", name, source, *runs]:
            agree(name, source, runs)
        case []:
            tables()
        case _:
            sys.exit(__doc__)
