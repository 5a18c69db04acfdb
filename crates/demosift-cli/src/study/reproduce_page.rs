//! The page of an experiment, made of its results and of words: no number in it is typed by hand.

use demosift::run::study::claims::{Case, Decided, Said};
use demosift::run::study::compact::Compact;
use demosift::run::study::estimate::ENOUGH_SEEDS;
use demosift::run::study::summary::Summary;
use demosift::run::study::told::Told;
use demosift::run::study::{By, Measure, imitator_name};

use crate::study::{experiments, in_short};
use crate::tables::differences::{signed, with_ends};
use crate::tables::study::{Section, in_markdown};
use crate::tables::{percent, rounded, wrapped};

/// What was found.
pub(crate) struct Shown<'a> {
    pub(crate) compact: &'a Compact,
    pub(crate) told: &'a Told,
    pub(crate) summary: &'a Summary,
    pub(crate) decided: &'a [Decided],
}

/// What only the user knows of how it was made.
#[derive(Clone, Copy)]
pub(crate) struct Made<'a> {
    pub(crate) commit: Option<&'a str>,
    pub(crate) machine: Option<&'a str>,
}

/// A page in Markdown.
pub(crate) struct Page<'a> {
    pub(crate) shown: &'a Shown<'a>,
    pub(crate) made: Made<'a>,
}

impl Shown<'_> {
    /// For a terminal.
    pub(crate) fn plainly(&self) -> String {
        let mut text = format!("{}\n\n{}\n", self.title(), wrapped(&self.extent()));
        for decided in self.decided {
            let claim = self.claim(decided);
            text += &Section { title: wrapped(&claim.title), ..claim }.plainly();
            text += &format!("\n{}\n", wrapped(&verdict(decided)));
        }
        self.numbers().iter().for_each(|section| text += &section.plainly());
        for note in self.notes() {
            text += &format!("\n{}\n", wrapped(&note));
        }
        text
    }

    pub(crate) fn title(&self) -> String {
        let study = &self.compact.study;
        study.drawn.title.clone().unwrap_or_else(|| study.name.clone())
    }

    /// How much of it is finished.
    fn extent(&self) -> String {
        let Told { finished: [there, all], seeds: [asked, whole], .. } = self.told;
        format!(
            "{there} of {all} cells are finished, all that can be named so far of {whole} of {asked} seeds."
        )
    }

    fn claim(&self, decided: &Decided) -> Section {
        let who = match decided.by {
            By::Paper => "The paper",
            By::Us => "Our question",
        };
        let of_policies = decided.measure.is_of_policies();
        let row = |case: &Case| {
            let mut row = vec![case.set.clone()];
            row.extend(case.kept.clone());
            // Of what is better when it is less, the other stands first, as in the difference.
            let [one, other] = match decided.measure {
                Measure::Distance => [&case.than, &case.better],
                _ => [&case.better, &case.than],
            };
            let than = match (case.imitator.map(imitator_name), decided.measure) {
                (Some(imitator), Measure::Agreement) => {
                    format!("{one} − {other}, with the oracle by {imitator}")
                }
                (Some(imitator), _) => format!("{one} − {other}, {imitator}"),
                (None, _) => format!("{one} − {other}"),
            };
            row.push(than);
            row.push(self.difference(case, decided.measure));
            row.push(case.difference.map_or(0, |difference| difference.pairs).to_string());
            row.push(found(case, decided.by));
            row
        };
        let mut header = vec!["set"];
        if of_policies {
            header.push("K");
        }
        header.extend(["better by", "difference", "pairs", "found"]);
        Section::of(&format!("{who}: {}", decided.says), &header, decided.cases.iter().map(row).collect())
    }

    fn difference(&self, case: &Case, measure: Measure) -> String {
        let Some(difference) = &case.difference else { return "-".to_owned() };
        match measure {
            Measure::Score | Measure::Best => {
                signed(difference, self.compact.study.set(&case.set).map_or("", |set| set.unit.as_str()))
            }
            Measure::Distance | Measure::Agreement => signed(difference, ""),
            Measure::Success => with_ends(difference, percent),
        }
    }

    fn notes(&self) -> Vec<String> {
        let failure = |(name, error): (String, String)| format!("The cell {name} failed: {error}.");
        let failures = self.compact.finished.failures().into_iter().map(failure);
        self.compact.notes.iter().cloned().chain(failures).collect()
    }
}

impl Page<'_> {
    /// The whole page.
    pub(crate) fn text(&self) -> String {
        let Self { shown, .. } = self;
        let Shown { compact, told, decided, .. } = shown;
        let study = &compact.study;
        let mut text = format!("# {}\n\n", shown.title());
        if told.is_partial() {
            text += &sentences(&format!(
                "**This result is partial.** {} A claim takes {ENOUGH_SEEDS} seeds, so nothing is concluded from fewer.",
                shown.extent()
            ));
            text += "\n";
        }
        if let Some(paper) = &study.drawn.paper {
            text += &sentences(&format!("What the paper says: {}", paper.trim()));
            text += "\n";
        }
        text += &self.how();
        for figure in &study.drawn.figures {
            text += &format!(
                "\n![{}]({}.svg)\n\nIts numbers are in [{}.csv]({}.csv).\n",
                figure.title, figure.name, figure.name, figure.name
            );
        }
        if !decided.is_empty() {
            text += "\n## What holds here\n\n";
            text += &sentences(
                "Differences are paired by seed, with a 95 % interval by Student's t. \
                 An interval above 0 agrees with the claim, one below 0 disagrees, and one that holds 0 is not separable. \
                 Of twenty comparisons between equals one is separable by luck.",
            );
        }
        for decided in *decided {
            let says = decided.says.trim_end_matches('.');
            text += &format!("\n### {says}\n\n{}", shown.claim(decided).in_markdown());
            let whose = match decided.by {
                By::Paper => "The paper says so.",
                By::Us => "The question is ours and not the paper's.",
            };
            text += &format!("\n{}", sentences(&format!("{whose} {}", verdict(decided))));
        }
        if let Some(reading) = study.drawn.reading.as_ref().filter(|_| !told.is_partial()) {
            text += &format!("\n## How it is read\n\n{}", sentences(reading));
        }
        for section in shown.numbers() {
            text += &format!("\n## {}\n\n{}", section.title.trim_end_matches(':'), section.in_markdown());
            if !section.below.is_empty() {
                text += &format!("\n{}", sentences(&section.below));
            }
        }
        let notes = shown.notes();
        if !notes.is_empty() {
            text += "\n## What is to be said besides\n\n";
            notes.iter().for_each(|note| text += &sentences(note));
        }
        text
    }

    /// The command and the price.
    fn how(&self) -> String {
        let Self { shown: Shown { compact, told, .. }, made } = self;
        let study = &compact.study;
        let preset = study.drawn.preset.as_deref().unwrap_or("standard");
        let commit =
            made.commit.map_or("a commit that was not named".to_owned(), |commit| format!("commit {commit}"));
        let machine = made.machine.unwrap_or("a machine that was not named");
        let version = &compact.demosift;
        let [there, all] = told.finished;
        let [asked, _] = told.seeds;
        let what = match experiments::named(&study.name) {
            Ok(_) => study.name.clone(),
            Err(_) => format!("{}.toml", study.name),
        };
        let only = if study.drawn.in_part {
            let sets: Vec<&str> = study.sets.iter().map(|set| set.name.as_str()).collect();
            format!(" --only {}", sets.join(","))
        } else {
            String::new()
        };
        let mut text = format!(
            "```sh\n# demosift {version}, {commit}, {machine}\ndemosift reproduce {what} --preset {preset} --seeds {asked}{only}\n```\n\n"
        );
        text += &sentences(&format!(
            "{there} of {all} cells with up to {asked} seeds a set took {} environment steps and {} of a processor. \
             They are in [{name}.json]({name}.json), from which `demosift reproduce {name}.json --page {name}.md` makes this page again.",
            rounded(told.cost.environment_steps as f64),
            hours(told.cost.processor_hours()),
            name = study.name,
        ));
        text
    }
}

/// What one experiment decided.
pub(crate) struct Summarized {
    pub(crate) name: String,
    pub(crate) title: String,
    pub(crate) is_partial: bool,
    pub(crate) decided: Vec<Decided>,
    pub(crate) in_short: Vec<in_short::Line>,
}

/// A page about several experiments.
pub(crate) fn summary(all: &[Summarized]) -> String {
    let mut text = "# What of the paper holds here\n\n".to_owned();
    text += &sentences(&format!(
        "`demosift reproduce` made this page from results, and no number in it is typed by hand. \
         A claim is compared for each set, K and other method, and the 95 % interval of the difference that is paired by seed decides. \
         Fewer than {ENOUGH_SEEDS} pairs decide nothing, and an experiment in part lacks sets or methods. \
         Of twenty comparisons between equals one is separable by luck, so where one of many agrees or disagrees, little is said.",
    ));
    for by in [By::Paper, By::Us] {
        let row = |of: &Summarized, decided: &Decided| {
            let counts = [Said::Agrees, Said::Disagrees, Said::NotSeparable, Said::TooFew];
            let name = if of.is_partial { format!("{}, in part", of.name) } else { of.name.clone() };
            let mut row = vec![name, decided.says.trim_end_matches('.').to_owned()];
            row.extend(counts.map(|said| decided.count(said).to_string()));
            row.push(pairs(decided));
            row
        };
        let of_one = |of: &Summarized| {
            let decided = of.decided.iter().filter(|decided| decided.by == by);
            decided.map(|decided| row(of, decided)).collect::<Vec<_>>()
        };
        let rows: Vec<Vec<String>> = all.iter().flat_map(of_one).collect();
        let (title, yes, no) = match by {
            By::Paper => ("What the paper claims", "agree", "disagree"),
            By::Us => ("What we ask besides", "better", "worse"),
        };
        let header = ["experiment", "claim", yes, no, "not separable", "too few seeds", "pairs"];
        if !rows.is_empty() {
            text += &format!("\n## {title}\n\n{}", in_markdown(&header, &rows));
        }
    }
    let mut lines: Vec<&in_short::Line> = Vec::new();
    for line in all.iter().flat_map(|of| &of.in_short).filter(|line| line.pairs >= ENOUGH_SEEDS) {
        if !lines.iter().any(|told| told.is_about_the_same(line)) {
            lines.push(line);
        }
    }
    lines.sort_by_key(|line| &line.set);
    if !lines.is_empty() {
        let rows: Vec<Vec<String>> = lines.iter().map(|line| line.row()).collect();
        text += &format!("\n## In short\n\n{}\n", in_markdown(&in_short::HEADER, &rows));
        text += &sentences(in_short::BELOW);
    }
    text += "\n## The pages\n\n";
    all.iter().for_each(|of| text += &format!("- [{}]({}.md)\n", of.title, of.name));
    text
}

/// Of how many pairs its comparisons are.
fn pairs(decided: &Decided) -> String {
    let each = || decided.cases.iter().map(|case| case.difference.map_or(0, |difference| difference.pairs));
    match (each().min().unwrap_or(0), each().max().unwrap_or(0)) {
        (fewest, most) if fewest == most => most.to_string(),
        (fewest, most) => format!("{fewest} to {most}"),
    }
}

/// Markdown has one sentence per line.
fn sentences(words: &str) -> String {
    const ABBREVIATIONS: [&str; 2] = ["Eq.", "Fig."];
    let mut lines = String::new();
    let mut words = words.split_whitespace().peekable();
    while let Some(word) = words.next() {
        lines += word;
        let is_last = word.ends_with('.') && !ABBREVIATIONS.contains(&word) || word.ends_with(".**");
        let is_followed = words.peek().is_some_and(|next| next.starts_with(','));
        lines.push(if is_last && !is_followed || words.peek().is_none() { '\n' } else { ' ' });
    }
    lines
}

fn hours(hours: f64) -> String {
    match hours {
        ..1.0 => "less than an hour".to_owned(),
        1.0..1.5 => "an hour".to_owned(),
        _ => format!("{hours:.0} hours"),
    }
}

/// What a case says, in a word or two.
fn found(case: &Case, by: By) -> String {
    match (case.found, by) {
        (Said::Agrees, By::Paper) => "agrees".to_owned(),
        (Said::Disagrees, By::Paper) => "disagrees".to_owned(),
        (Said::Agrees, By::Us) => format!("{} is better", case.better),
        (Said::Disagrees, By::Us) => format!("{} is better", case.than),
        (Said::NotSeparable, _) => "not separable".to_owned(),
        (Said::TooFew, _) => "too few seeds".to_owned(),
    }
}

/// How many cases say what.
fn verdict(decided: &Decided) -> String {
    let kinds = match decided.by {
        By::Paper => ["agree", "disagree"],
        By::Us => ["are better so", "are worse so"],
    };
    let counts = [
        (decided.count(Said::Agrees), kinds[0]),
        (decided.count(Said::Disagrees), kinds[1]),
        (decided.count(Said::NotSeparable), "are not separable"),
        (decided.count(Said::TooFew), "have too few seeds"),
    ];
    let said: Vec<String> = counts
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    format!("Of {} comparisons {}.", decided.cases.len(), said.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_has_a_line_of_its_own() {
        let text = "**In part.** Of Fig. 3 and\n Eq. 9 one holds.  The other, 0.5, does not.";
        assert_eq!(
            sentences(text),
            "**In part.**\nOf Fig. 3 and Eq. 9 one holds.\nThe other, 0.5, does not.\n"
        );
    }
}
