"""Makes the study of robots that nothing was tuned on, from models of an installed Gymnasium.

python3 docs/results/new_robots.py DEMOSIFT GYMNASIUM RUNS

GYMNASIUM is the folder of the package `gymnasium`, whose models are copied beside our tasks of studies/new_robots; RUNS is where
demonstrators are trained, sets recorded and the study made. What is there already is kept. The results are in RUNS/new_robots.json.
"""

import shutil
import subprocess
import sys
from pathlib import Path

STUDY = Path(__file__).resolve().parents[2] / "studies/new_robots"
# With how many updates the demonstrator of each is trained.
ROBOTS = {"hopper": 150, "swimmer": 100}
RECORDED = ["--count", "12", "--seed", "3", "--set", "demonstrator.batch_steps=8000"]


def main(binary, gymnasium, runs):
    for robot, updates in ROBOTS.items():
        shutil.copytree(STUDY / robot, runs / robot, dirs_exist_ok=True)
        shutil.copy(gymnasium / "envs/mujoco/assets" / f"{robot}.xml", runs / robot)
        out = runs / f"rec_{robot}"
        if not out.exists():
            asked = [*RECORDED, "--set", f"demonstrator.updates={updates}"]
            subprocess.run([binary, "record", "--task", str(runs / robot), *asked, "--out", str(out)], check=True)
    study = runs / "new_robots.toml"
    shutil.copy(STUDY / study.name, study)
    results = str(study.with_suffix(".json"))
    subprocess.run([binary, "study", str(study), "--out", str(runs / "study"), "--write", results], check=True)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
