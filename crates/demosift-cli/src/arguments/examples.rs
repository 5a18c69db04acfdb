//! The examples below each subcommand's help, by the question that a user has.

pub(crate) const DEMOSIFT: &str = "\
Examples:
  Which of my demonstrations are worth learning from? First what it would cost, then the answer:
    demosift sift my_set.hdf5 --task half_cheetah --dry-run
    demosift sift my_set.hdf5 --task half_cheetah
  What is in this file?
    demosift inspect my_set.hdf5

`demosift COMMAND --help` has examples of each command.";

pub(crate) const SIFT: &str = "\
Examples:
  Does it work on my set at all? In minutes:
    demosift sift data/free_throw_8 --task free_throw --preset quick
  What would the real thing cost?
    demosift sift data/free_throw_8 --task free_throw --preset standard --dry-run
  Keep what surely helps, however many that are:
    demosift sift data/free_throw_8 --task free_throw --keep auto --out runs/throws
  My task has several goals, and I want a subset for each:
    demosift sift data/penalty_save_12 --task penalty_save --out runs/saves
  I want one of them only:
    demosift sift data/penalty_save_12 --task penalty_save --variant low_left --out runs/low_left
  Some episodes of a set; those that nobody can learn from are left out, and named:
    demosift sift my_lerobot_set --task half_cheetah --episodes 0-49 --without 3,17 --skip-bad
  My simulator is an environment of Gymnasium, in Python of its own:
    demosift sift my_set.hdf5 --env my_env.py:make --python .venv/bin/python --horizon 200
  What should my own learner see? train(demonstrations, seed) in Python returns a policy:
    demosift sift my_set.hdf5 --task half_cheetah --trainer my_train.py:train --python .venv/bin/python
  It was interrupted; go on:
    demosift sift --out runs/throws --resume";

pub(crate) const RECORD: &str = "\
Examples:
  I have a task and no demonstrations; make eight, from hopeless to successful:
    demosift record --task free_throw --out runs/thrower
  The same demonstrator in another, larger set, without training again:
    demosift record --demonstrator runs/thrower --count 20 --out runs/more_throws
  Ten equals, halfway up, in which there is nothing to select:
    demosift record --demonstrator runs/thrower --count 10 --stage 0.5 --out runs/equals
  How long would the training take at most?
    demosift record --task handstand --dry-run
  In an environment of Gymnasium:
    demosift record --env gymnasium:HalfCheetah-v5 --python .venv/bin/python --out runs/cheetah";

pub(crate) const META_TRAIN: &str = "\
Examples:
  The first stage of `demosift sift` alone:
    demosift meta-train data/free_throw_8 --task free_throw --preset quick --out runs/throws
  With mutual information:
    demosift meta-train data/free_throw_8 --task free_throw --method maml-mi --out runs/informed";

pub(crate) const JUDGE: &str = "\
Examples:
  How much does imitating each demonstration help?
    demosift judge data/free_throw_8 --task free_throw --preset quick --out runs/throws
  In the environment that a set of Minari or robomimic names:
    demosift judge my_minari_set --env from-set --python .venv/bin/python --out runs/minari
  By cloning alone, in seconds:
    demosift judge data/free_throw_8 --task free_throw --judge cloning --out runs/by_cloning
  As the paper does, each demonstration four times, to be surer:
    demosift judge data/free_throw_8 --task free_throw --judge paper --set judge.repeats=4 --out runs/surer
  Does the demonstration that I have just recorded help? With what an earlier run learned, in seconds:
    demosift judge new.hdf5 --prior runs/throws --out runs/new";

pub(crate) const SELECT: &str = "\
Examples:
  Which ones should I keep?
    demosift select data/free_throw_8 --task free_throw --preset quick --keep auto --out runs/throws
  For a script, the ids alone:
    demosift select --out runs/throws --resume --json | jq .kept";

pub(crate) const WEIGH: &str = "\
Examples:
  Find a subset by weights, from a run that has learned to imitate already:
    demosift weigh --out runs/throws --resume";

pub(crate) const REFEREE: &str = "\
Examples:
  What to train on, of a run that has selected or will:
    demosift referee --out runs/throws --resume
  Only by cloning, which is quick, in a run of its own:
    demosift referee data/free_throw_8 --task free_throw --referee cloning=10 --out runs/cloned";

pub(crate) const IMITATE: &str = "\
Examples:
  One policy from the kept demonstrations beside one from all:
    demosift imitate --out runs/throws --resume
  What would these three teach?
    demosift imitate --out runs/throws --resume --demonstration-ids 0,3,7";

pub(crate) const ORACLE: &str = "\
Examples:
  Was the ranking right? The slow way to know:
    demosift oracle --out runs/throws --resume --repeats 1 --dry-run
    demosift oracle --out runs/throws --resume --repeats 1
  And are the kept better than five random subsets of their size? First a policy from the kept, then the others:
    demosift imitate --out runs/throws --resume
    demosift oracle --out runs/throws --resume --repeats 1 --random 5";

pub(crate) const STUDY: &str = "\
Examples:
  What would it take to compare the judges on all sets?
    demosift study studies/verdict.toml --data public_sets --dry-run
  Do it; the same line goes on after an interruption:
    demosift study studies/verdict.toml --data public_sets --write docs/results/verdict.json
  Two machines that share a folder, half of the work each:
    demosift study studies/verdict.toml --out /mnt/verdict --part 1/2
    demosift study studies/verdict.toml --out /mnt/verdict --part 2/2
  Only the cells of one method on one set, and its oracle:
    demosift study studies/verdict.toml --only free_throw_8/cloning,oracle
  The tables of a result page, from a file of results:
    demosift study docs/results/verdict.json --table --markdown";

pub(crate) const REPRODUCE: &str = "\
Examples:
  Does it run here? Figure 3 with two seeds and small budgets, in minutes:
    demosift reproduce fig3 --preset quick
  What would all experiments cost?
    demosift reproduce all --dry-run
  Figure 3 with ten seeds, shared out over two machines; the same lines go on after an interruption:
    demosift reproduce fig3 --out /mnt/reproduce --part 1/2
    demosift reproduce fig3 --out /mnt/reproduce --part 2/2
  The figure with the seeds that are there by now:
    demosift reproduce fig3 --out /mnt/reproduce --table
  The page of a result, with the figure and its numbers beside it:
    demosift reproduce fig3 --page docs/results/fig3.md --commit 4344517 --machine lab7
  The same from the file of results alone, on any machine:
    demosift reproduce docs/results/fig3.json --page docs/results/fig3.md
  What of the paper holds, from all results in a folder:
    demosift reproduce docs/results --summary docs/results/README.md";

pub(crate) const REPORT: &str = "\
Examples:
  Write the page again, such as after another stage:
    demosift report runs/throws
  The set has moved since:
    demosift report runs/throws --data /mnt/sets/free_throw_8
  The numbers behind the page:
    demosift report runs/throws --json";

pub(crate) const PLAY: &str = "\
Examples:
  The worst and the best of a set, one per row of a contact sheet:
    demosift play --task free_throw --data data/free_throw_8 --demonstration 1,4 --sheet
  A clip of the best policy that a run found:
    demosift play --task free_throw --policy runs/throws/policy_best.safetensors --clip
  How often does that policy succeed?
    demosift play --policy runs/throws/policy_best.safetensors --episodes 50";

pub(crate) const INSPECT: &str = "\
Examples:
  What a set holds, and whether the free thrower could learn from it:
    demosift inspect data/free_throw_8 --task free_throw
  A robomimic file, with the columns that make an observation named:
    demosift inspect lift.hdf5 --observation-columns obs/robot0_eef_pos,obs/object
  A page to look at, the oddest episodes first:
    demosift inspect lift.hdf5 --html lift.html
  A part of a column, and none of the episodes that nobody can learn from:
    demosift inspect door.hdf5 --observation-columns observations[0:35] --skip-bad";

pub(crate) const CONVERT: &str = "\
Examples:
  A set for LeRobot, at the rate of its task:
    demosift convert data/free_throw_8 --task free_throw --to lerobot free_throw_lerobot
  A set for Minari:
    demosift convert expert.npz --to minari expert_minari";

pub(crate) const EXPORT: &str = "\
Examples:
  Train on what was kept, in LeRobot:
    lerobot-train --dataset.episodes=\"$(demosift export runs/reach --as lerobot-episodes)\" ...
  A filter key for robomimic, written into the file of the demonstrations:
    demosift export runs/lift --as robomimic-filter-key --edit-my-file
  Scores, intervals and weights as a table:
    demosift export runs/lift --as csv --out lift.csv
  The learned policies for another runtime:
    demosift export runs/lift --as onnx --out lift_policies";

pub(crate) const TASK_CHECK: &str = "\
Examples:
  A task of your own, as soon as it has a model and a task.toml:
    demosift task check my_robot
  Whether demonstrations fit it, and their actions lead where they led when they were recorded:
    demosift task check my_robot --data my_demonstrations.hdf5

  An environment of Gymnasium: does it repeat, how fast is it, and do the demonstrations fit?
    demosift task check --env gymnasium:HalfCheetah-v5 --python .venv/bin/python --data my_demonstrations.hdf5

Exit code 2 if there is an error among the findings.";

pub(crate) const TASK_NEW: &str = "\
Examples:
  A first task file beside a model, made to fit a set; what it marks with TODO is yours to say:
    demosift task new my_robot/arm.xml --data my_demonstrations.hdf5
    demosift task check my_robot --data my_demonstrations.hdf5";

pub(crate) const TASKS: &str = "\
Examples:
  Which names does --task know? Anything else is taken for the path of a folder with a task.toml:
    demosift tasks";

pub(crate) const COMPLETIONS: &str = "\
Examples:
  For bash, where bash-completion is installed:
    mkdir -p ~/.local/share/bash-completion/completions
    demosift completions bash > ~/.local/share/bash-completion/completions/demosift
  For zsh, into a folder of your $fpath:
    demosift completions zsh > ~/.zfunc/_demosift
  For fish:
    demosift completions fish > ~/.config/fish/completions/demosift.fish";

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, Parser as _};

    use crate::arguments::Demosift;

    /// What a shell would run of a line: its call of demosift, if it has one.
    fn call(line: &str) -> Option<&str> {
        let from = line.find("demosift ").filter(|&at| at == 0 || line[..at].ends_with("$("))?;
        line[from..].split([')', '|', '>']).next()
    }

    #[test]
    fn every_example_is_understood() {
        let mut texts = vec![super::DEMOSIFT.to_owned()];
        texts.extend(
            Demosift::command()
                .get_subcommands()
                .flat_map(|of| std::iter::once(of).chain(of.get_subcommands()))
                .filter_map(|of| of.get_after_help())
                .map(ToString::to_string),
        );
        let calls: Vec<&str> =
            texts.iter().flat_map(|text| text.lines()).filter_map(|line| call(line.trim())).collect();
        assert!(calls.len() > 30, "{calls:?}");
        for call in calls {
            if let Err(error) = Demosift::try_parse_from(call.split_whitespace()) {
                panic!("{call}: {error}");
            }
        }
    }
}
