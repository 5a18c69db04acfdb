//! `demosift oracle`: each demonstration alone from scratch, what rankings are compared with.

use demosift::results::oracle::{Agreement, Alone, HitRate, Oracle, Worth};
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use demosift::{Error, Result};

use super::{dry_run, kept_in, part};
use crate::answers::OfRun;
use crate::arguments::OracleArguments;
use crate::console::terminal;
use crate::job::{Job, Prior};
use crate::tables::{self, Scale};

pub(crate) fn run(arguments: &OracleArguments) -> Result<()> {
    let OracleArguments { repeats, random, .. } = *arguments;
    if repeats == 0 {
        return Err(Error::bad_config("--repeats 0: must be at least 1"));
    }
    let mut job = Job::open_part(&arguments.job, Prior::NotNeeded, arguments.part.part)?;
    if arguments.job.run.dry_run {
        job.run(|run| experiment::policy_from_kept(run, random))?;
        return dry_run::of_job(&mut job, Goal::Oracle { repeats, random }, &arguments.job.run);
    }
    let oracle = job.run(|run| experiment::oracle(run, repeats, random));
    if arguments.part.part.is_some() {
        let left = part::left(oracle)?;
        let options = match random {
            0 => format!(" --repeats {repeats}"),
            _ => format!(" --repeats {repeats} --random {random}"),
        };
        part::done(&job, "oracle", &options, left.as_slice(), arguments.job.run.json);
        return Ok(());
    }
    let oracle = oracle?;
    if arguments.job.run.json {
        terminal::show_json(&OfRun::new(&job, &oracle));
        return Ok(());
    }
    let Oracle { alone, agreement, kept } = oracle;
    terminal::show(&table(alone, job.unit()));
    terminal::show(&match agreement {
        Some(agreement) => agreement_in_words(&agreement),
        None => "\nThe run folder holds no ranking to compare with; `demosift select` makes it.\n".to_owned(),
    });
    terminal::show(&kept.map_or(String::new(), |worth| worth_in_words(&worth, job.unit())));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}

fn worth_in_words(worth: &Worth, unit: &str) -> String {
    let Worth { score, best_alone, share_of_best, random, against_random } = worth;
    let scale = Scale::of(random.iter().copied().chain([*score]), unit);
    let way = match share_of_best {
        Some(share) => format!(
            "The policy from the kept demonstrations went {} of the way from an untrained policy to that from \
             demonstration {best_alone} alone, the best by the same trainings, which flatters it.",
            tables::percent(*share)
        ),
        None => format!(
            "No demonstration alone taught anything; the best is demonstration {best_alone}. The policy from the kept \
             demonstrations scores {}.",
            scale.with_unit(*score)
        ),
    };
    let beside = against_random.map(|against| {
        format!(
            "It scores {}, which is {} beside the mean of {} random subsets of the same size, and beats {} of them.",
            scale.with_unit(*score),
            scale.signed(against.gain),
            random.len(),
            tables::percent(against.beaten)
        )
    });
    [way].into_iter().chain(beside).map(|said| format!("\n{}\n", tables::wrapped(&said))).collect()
}

fn agreement_in_words(agreement: &Agreement) -> String {
    let Agreement { spearman, kendall, hit_rates } = agreement;
    let mut said =
        format!("\nSpearman's rank correlation with the ranking: {spearman:.2}\nKendall's: {kendall:.2}\n");
    for HitRate { k, rate } in hit_rates {
        let share = tables::percent(*rate);
        said += &format!("Of the ranking's first {k}, among the first {k} here: {share}\n");
    }
    said
}

fn table(mut alone: Vec<Alone>, unit: &str) -> String {
    alone.sort_by(|a, b| b.mean.total_cmp(&a.mean).then(a.demo.cmp(&b.demo)));
    let scale = Scale::of(alone.iter().flat_map(|alone| alone.scores.iter().copied()), unit);
    let title = scale.title("heuristic");
    let rows: Vec<Vec<String>> = alone
        .iter()
        .enumerate()
        .map(|(place, Alone { demo, scores, mean })| {
            let each: Vec<String> = scores.iter().map(|score| scale.plain(*score)).collect();
            vec![(place + 1).to_string(), demo.to_string(), scale.plain(*mean), each.join(", ")]
        })
        .collect();
    let what = "What a policy learns from scratch from each demonstration alone (higher is better):";
    format!("{what}\n\n{}", tables::table(&["rank", "demonstration", &title, "each seed"], &rows))
}
