//! The command line as it is typed; [`crate::job`] resolves it.

pub(crate) mod examples;
mod names;
mod part;
mod play;
mod reproduce;
mod sets;
mod simulator;
mod study;
mod task;
mod trainer;
pub(crate) mod version;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use demosift::data::demonstration::episode::Format;
use demosift::data::demonstration::numbers::Numbers;
use demosift::stages::referee::Refereeing;
use demosift::stages::select::Keep;

use crate::console::interruption::GoesOn;

pub(crate) use names::{JudgesName, MethodName, PresetName};
pub(crate) use part::{PartArgument, RefereeArguments};
pub(crate) use play::{PictureArguments, PlayArguments};
pub(crate) use reproduce::ReproduceArguments;
pub(crate) use sets::{ConvertArguments, ExportArguments, Form, InspectArguments, Target};
pub(crate) use simulator::SimulatorArguments;
pub(crate) use study::{OnlyThese, StudyArguments};
pub(crate) use task::{TaskCheckArguments, TaskCommand, TaskNewArguments, TasksArguments};
pub(crate) use trainer::TrainerArguments;

/// Which demonstrations should your agent learn from? Finds out by imitating each one.
#[derive(Debug, Parser)]
#[command(name = "demosift", version = version::shown(), arg_required_else_help = true, after_help = examples::DEMOSIFT)]
pub(crate) struct Demosift {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The whole job: rank the demonstrations, keep the best, and show whether this was worth it
    #[command(after_help = examples::SIFT)]
    Sift(JobArguments),
    /// Train a demonstrator and record its episodes at stages from hopeless to successful
    #[command(after_help = examples::RECORD)]
    Record(RecordArguments),
    /// Learn a policy that can imitate any demonstration of the set within a few updates
    #[command(after_help = examples::META_TRAIN)]
    MetaTrain(JobArguments),
    /// Imitate each demonstration and score what comes out
    #[command(after_help = examples::JUDGE)]
    Judge(JudgeArguments),
    /// Rank the demonstrations and keep the best
    #[command(after_help = examples::SELECT)]
    Select(JobArguments),
    /// Increase the weights of demonstrations that help, and keep those with large weights (Algorithm 3 of the paper)
    #[command(after_help = examples::WEIGH)]
    Weigh(JobArguments),
    /// Train final policies on what was kept, on the whole set and on random subsets, several each: does selecting help?
    #[command(after_help = examples::REFEREE)]
    Referee(RefereeArguments),
    /// Imitate from scratch, once: the kept demonstrations beside all of them, or those that you name
    #[command(after_help = examples::IMITATE)]
    Imitate(ImitateArguments),
    /// Imitate each demonstration alone from scratch with the full budget, scored at its end: what a ranking is compared with
    #[command(after_help = examples::ORACLE)]
    Oracle(OracleArguments),
    /// Find out which judge agrees best with the truth, over many sets and seeds
    #[command(after_help = examples::STUDY)]
    Study(StudyArguments),
    /// Repeat an experiment of the paper: its figures, its numbers, and a page that says which of its claims hold here
    #[command(after_help = examples::REPRODUCE)]
    Reproduce(ReproduceArguments),
    /// Write report.html into a run folder: all that the run found as one page to look at, with a 3-D replay
    #[command(after_help = examples::REPORT)]
    Report(ReportArguments),
    /// Play a policy, or recorded demonstrations again: scores, and pictures if you want them
    #[command(after_help = examples::PLAY)]
    Play(PlayArguments),
    /// Show what a file of demonstrations holds, and whether it fits a task
    #[command(after_help = examples::INSPECT)]
    Inspect(InspectArguments),
    /// Write demonstrations in another tool's format
    #[command(after_help = examples::CONVERT)]
    Convert(ConvertArguments),
    /// Export what a run kept, in the form of the tool that its demonstrations came from
    #[command(after_help = examples::EXPORT)]
    Export(ExportArguments),
    /// Make or check a task of your own
    #[command(subcommand)]
    Task(TaskCommand),
    /// List the tasks that come with demosift
    #[command(after_help = examples::TASKS)]
    Tasks(TasksArguments),
    /// Print a script that lets a shell complete demosift's commands and options
    #[command(after_help = examples::COMPLETIONS)]
    Completions(CompletionsArguments),
}

impl Command {
    /// What it says of a run, if it is one that keeps a run folder and can go on.
    pub(crate) fn run(&self) -> Option<&RunArguments> {
        match self {
            Self::Sift(job) | Self::MetaTrain(job) | Self::Select(job) | Self::Weigh(job) => Some(&job.run),
            Self::Referee(arguments) => Some(&arguments.job.run),
            Self::Judge(arguments) => Some(&arguments.job.run),
            Self::Imitate(arguments) => Some(&arguments.job.run),
            Self::Oracle(arguments) => Some(&arguments.job.run),
            Self::Record(arguments) => Some(&arguments.run),
            _ => None,
        }
    }

    /// How it goes on where it was interrupted.
    pub(crate) fn goes_on(&self) -> GoesOn {
        match (self, self.run()) {
            (Self::Study(_) | Self::Reproduce(_), _) => GoesOn::ByItself,
            (_, Some(_)) => GoesOn::WithResume,
            (_, None) => GoesOn::Never,
        }
    }
}

/// What every stage of the job needs.
#[derive(Debug, Args)]
pub(crate) struct JobArguments {
    /// The demonstrations: a file or folder of LeRobot, Minari, robomimic, D4RL, ManiSkill, ALOHA, baselines,
    /// stable-baselines or imitation, or one that
    /// `demosift record` made
    #[arg(value_name = "SET")]
    pub(crate) demonstrations: Option<PathBuf>,
    /// Keep the K most suitable demonstrations; auto keeps those that surely make the agent better and are not surely
    /// nearer to the median of the set than to its best; weights keeps what `demosift weigh` would [default: quarter, that
    /// is a quarter of the set]
    #[arg(long, value_name = "K|auto|weights")]
    pub(crate) keep: Option<Keep>,
    /// Only this goal of a task that has several (`demosift task check` lists them): the agent learns, is judged and imitates
    /// under it alone [default: all]
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Option<String>,
    /// Who judges: an agent that clones each demonstration, in seconds; the paper's, which learns to imitate first; both, and
    /// the mean of their gains decides, of those whose repeats agree; or your own --trainer, which trains three times on each
    /// demonstration [default: both]
    #[arg(long, value_enum)]
    pub(crate) judge: Option<JudgesName>,
    /// How many final policies are trained on what was kept, on the whole set and on random subsets, to say whether
    /// selecting helps; an imitator with fewer than three decides nothing [default: as the preset says: cloning=5,gail=1,
    /// cloning=10,gail=3, or cloning=10,gail=10; with --trainer trainer=N as often as GAIL, and at least 3]
    #[arg(long, value_name = "cloning=N,gail=N,trainer=N|none")]
    pub(crate) referee: Option<Refereeing>,
    /// How the agent of the paper's judge is prepared to imitate; all methods may spend the same environment steps
    /// [default: maml]
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodName>,
    /// How much to spend [default: standard]
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetName>,
    #[command(flatten)]
    pub(crate) trainer: TrainerArguments,
    #[command(flatten)]
    pub(crate) run: RunArguments,
    #[command(flatten)]
    pub(crate) source: SetArguments,
}

/// What `demosift judge` takes.
#[derive(Debug, Args)]
pub(crate) struct JudgeArguments {
    #[command(flatten)]
    pub(crate) job: JobArguments,
    /// Judge from the prior of this earlier run, which its judge of the paper has learned, with its task and values, in seconds a demonstration: its folder; says where
    /// each demonstration, of which one is enough, would stand in the ranking of that run
    #[arg(long, value_name = "RUN", conflicts_with_all = ["preset", "keep", "method", "referee"])]
    pub(crate) prior: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) part: PartArgument,
}

/// Which demonstrations of a set are taken, and how they are stored where it cannot be seen.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct SetArguments {
    /// Only these episodes, by the numbers that the file gives them, such as 0-9,12 (`demosift inspect` shows them)
    #[arg(long, value_name = "LIST", help_heading = "Which of the demonstrations")]
    pub(crate) episodes: Option<Numbers>,
    #[command(flatten)]
    pub(crate) storage: SourceArguments,
}

/// How demonstrations are stored, where it cannot be seen.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "How the demonstrations are stored, where it cannot be seen")]
pub(crate) struct SourceArguments {
    /// The format of the demonstrations, such as robomimic or lerobot-v3 [default: recognized by its content]
    #[arg(long, value_name = "FORMAT")]
    pub(crate) format: Option<Format>,
    /// The columns that make an observation, in this order, such as obs/joints,obs/gripper [default: what is usual in the
    /// format; see `demosift inspect`]
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(crate) observation_columns: Vec<String>,
    /// The columns that make an action, in this order [default: what is usual in the format]
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(crate) action_columns: Vec<String>,
    /// What the numbers of the set are, such as controls or degrees, if the task takes others: see set.toml in docs/formats.md
    /// [default: set.toml in the folder of the set or beside its file, where there is one]
    #[arg(long, value_name = "FILE")]
    pub(crate) set_file: Option<PathBuf>,
    /// All but these episodes, by the numbers that the file gives them, such as 3 or 3,7-9
    #[arg(long, value_name = "LIST", help_heading = "Which of the demonstrations")]
    pub(crate) without: Option<Numbers>,
    /// Leave out, and name, every episode that cannot be learned from: empty, of one step, of another size than the others, or
    /// with a number that is not finite
    #[arg(long, help_heading = "Which of the demonstrations")]
    pub(crate) skip_bad: bool,
    /// Only the episodes of this filter key of a robomimic file, such as better
    #[arg(long, value_name = "NAME", help_heading = "Which of the demonstrations")]
    pub(crate) filter_key: Option<String>,
}

/// What every run needs, whatever it is about.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "The run")]
pub(crate) struct RunArguments {
    /// The task: a name (see `demosift tasks`), or the path of a folder with a task.toml
    #[arg(long, value_name = "NAME|PATH")]
    pub(crate) task: Option<String>,
    #[command(flatten)]
    pub(crate) simulator: SimulatorArguments,
    /// The root of all random numbers [default: 0]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// A TOML file of values that differ from the preset's and the task's; docs/configuration.md says what each key means
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// One value that differs, such as judge.iterations=3 or inner.imitation=behavioral_cloning; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// The run folder [default: runs/<task>, or runs/<task>_<variant>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Go on with a run folder that exists
    #[arg(long)]
    pub(crate) resume: bool,
    /// Check everything and say what it would cost: environment steps, updates and minutes; write nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Threads to play on; the results do not depend on it [default: all processors]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Compute the same bits on every x86-64 processor with AVX2 and FMA (docs/cluster.md); a run keeps to it
    #[arg(long)]
    pub(crate) portable: bool,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ImitateArguments {
    /// Imitate these demonstrations instead, such as 0,3,7
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub(crate) demonstration_ids: Vec<usize>,
    #[command(flatten)]
    pub(crate) job: JobArguments,
}

#[derive(Debug, Args)]
pub(crate) struct OracleArguments {
    /// How often each demonstration is imitated, each time with another seed
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) repeats: usize,
    /// Imitate N random subsets as large as the kept one too, where the run folder holds the policy from the kept, which
    /// `demosift imitate` makes
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) random: usize,
    #[command(flatten)]
    pub(crate) job: JobArguments,
    #[command(flatten)]
    pub(crate) part: PartArgument,
}

#[derive(Debug, Args)]
pub(crate) struct RecordArguments {
    /// How many demonstrations to record, at stages that span the training [default: 8]
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<usize>,
    /// Record a second set of N other demonstrations into unseen.hdf5 [default: 0]
    #[arg(long, value_name = "N")]
    pub(crate) unseen: Option<usize>,
    /// Train nothing: record the demonstrator of this run folder, which another `record` made
    #[arg(long, value_name = "DIR")]
    pub(crate) demonstrator: Option<PathBuf>,
    /// N of the demonstrations are by the demonstrator of this run folder, at stages at which it succeeds; its task may have
    /// another body, but must have the same sizes; may be repeated
    #[arg(long, value_name = "DIR=N")]
    pub(crate) guest: Vec<String>,
    /// Record all at one stage, a set of equals: the stage nearest to this share of the way from the worst to the best, 0 to 1
    #[arg(long, value_name = "SHARE", conflicts_with_all = ["unseen", "guest"])]
    pub(crate) stage: Option<f64>,
    #[command(flatten)]
    pub(crate) run: RunArguments,
}

#[derive(Debug, Args)]
pub(crate) struct ReportArguments {
    /// The run folder, at least judged; `demosift sift` writes its report by itself
    #[arg(value_name = "RUN")]
    pub(crate) run_folder: PathBuf,
    /// Where the demonstrations are now, if they have moved since
    #[arg(long, value_name = "SET")]
    pub(crate) data: Option<PathBuf>,
    /// Threads to play on; the report does not depend on it [default: all processors]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Print the report's numbers as JSON too
    #[arg(long)]
    pub(crate) json: bool,
}

impl ReportArguments {
    /// The run as the other subcommands name it: to go on with, and nothing of it changed.
    pub(crate) fn job(&self) -> JobArguments {
        let run = RunArguments {
            task: None,
            simulator: SimulatorArguments::default(),
            seed: None,
            config: None,
            set: Vec::new(),
            out: Some(self.run_folder.clone()),
            resume: true,
            dry_run: false,
            threads: self.threads,
            portable: false,
            json: self.json,
        };
        let source = SetArguments::default();
        JobArguments {
            demonstrations: self.data.clone(),
            source,
            keep: None,
            variant: None,
            judge: None,
            referee: None,
            method: None,
            preset: None,
            trainer: TrainerArguments::default(),
            run,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct CompletionsArguments {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}
