//! The tables of an experiment's page below its claims, of which nothing is decided.

use demosift::run::study::estimate::Spread;
use demosift::run::study::{bodies, imitator_name, told, variants, weighed};

use super::in_short;
use super::reproduce_page::Shown;
use crate::tables::differences::{marked, signed};
use crate::tables::study::{Section, of_experiment};
use crate::tables::{Scale, percent, rounded};

impl Shown<'_> {
    pub(super) fn numbers(&self) -> Vec<Section> {
        let own = [
            self.in_short(),
            self.policies(),
            self.lost(),
            self.firsts(),
            self.variants(),
            self.weighed(),
            self.bodies(),
            self.taught(),
            self.distances(),
            self.priors(),
        ];
        let mut sections: Vec<Section> = own.into_iter().chain(of_experiment(self.summary)).collect();
        sections.retain(|section| !section.rows.is_empty());
        sections
    }

    fn in_short(&self) -> Section {
        let lines = in_short::lines(self.told, self.summary);
        let rows = lines.iter().map(in_short::Line::row).collect();
        Section { below: in_short::BELOW.to_owned(), ..Section::of("In short:", &in_short::HEADER, rows) }
    }

    fn policies(&self) -> Section {
        let row = |of: &told::PolicyLine| {
            vec![
                of.set.clone(),
                imitator_name(of.imitator).to_owned(),
                of.kept.clone(),
                of.method.clone().unwrap_or_else(|| "(whole set)".to_owned()),
                spread(&of.score, Scale::of([of.score.mean], &of.unit)),
                of.success.map_or("-".to_owned(), share),
                spread(&of.best, Scale::of([of.best.mean], &of.unit)),
                of.score.seeds.to_string(),
            ]
        };
        let header = ["set", "imitator", "K", "kept by", "score", "success", "best on the way", "seeds"];
        let rows = self.told.policies.iter().map(row).collect();
        let title = "What policies from the kept are worth:";
        let below = format!(
            "Score and success are those of the last policy. The best on the way is the one that `demosift imitate` hands over, on \
             episodes that did not choose it; the heuristic chooses it, so it hides that learning went on to worse ones. {DEVIATION}"
        );
        Section { below, ..Section::of(title, &header, rows) }
    }

    fn lost(&self) -> Section {
        let row = |of: &told::LostLine| {
            vec![
                of.set.clone(),
                imitator_name(of.imitator).to_owned(),
                of.kept.to_string(),
                of.method.clone().unwrap_or_else(|| "(whole set)".to_owned()),
                marked(&of.lost, &signed(&of.lost, &of.unit)),
                marked(&of.lost_by_best, &signed(&of.lost_by_best, &of.unit)),
                of.lost.pairs.to_string(),
            ]
        };
        let header = ["set", "imitator", "K", "kept by", "lost", "by the best on the way", "pairs"];
        let rows = self.told.lost.iter().map(row).collect();
        let below = "It is the score of the last policies from the truly best K, those of the oracle, less that of those from the \
                     kept, and the same of the best policies on the way, paired by seed, with a 95 % interval by Student's t; bold is what does not hold 0. The truly best one is \
                     chosen by other trainings than the one that is compared, so a method can do better.";
        let title = "What is lost beside the truly best K:";
        Section { below: below.to_owned(), ..Section::of(title, &header, rows) }
    }

    fn firsts(&self) -> Section {
        let knows_variants = self.told.firsts.iter().any(|of| of.fitting.is_some());
        let row = |of: &told::FirstLine| {
            let first = |first: &told::First| match &first.recorded_under {
                Some(variant) => format!("{} ({variant}): {}", first.demo, first.times),
                None => format!("{}: {}", first.demo, first.times),
            };
            let firsts: Vec<String> = of.firsts.iter().map(first).collect();
            let gain = of
                .gain
                .as_ref()
                .map_or("-".to_owned(), |gain| spread(gain, Scale::of([gain.mean], &of.unit)));
            let mut row = vec![of.set.clone(), of.method.clone(), firsts.join(", "), gain];
            if knows_variants {
                row.extend(
                    [of.fitting, of.fitting_in_set].map(|of| of.map_or("-".to_owned(), |of| of.to_string())),
                );
            }
            row.push(of.seeds.to_string());
            row
        };
        let mut header = vec!["set", "method", "first: with how many seeds", "its gain"];
        if knows_variants {
            header.extend(["first is of this variant", "of this variant in the set"]);
        }
        header.push("seeds");
        let rows = self.told.firsts.iter().map(row).collect();
        let under = "In brackets is the variant under which a demonstration was recorded. ";
        let below = format!(
            "{}The gain is how much better the agent is after imitating it, by the judging that put it first, which flatters it. {DEVIATION}",
            if knows_variants { under } else { "" }
        );
        let title = "Which demonstration comes first:";
        Section { below, ..Section::of(title, &header, rows) }
    }

    fn variants(&self) -> Section {
        let row = |of: &variants::VariantLine| {
            let others: Vec<String> =
                of.others.iter().map(|other| format!("{} {:.2}", other.variant, other.spearman)).collect();
            vec![
                of.task.clone(),
                of.method.clone(),
                of.variant.clone(),
                format!("{:.2}", of.same),
                others.join(", "),
                of.seeds.to_string(),
            ]
        };
        let header = ["task", "method", "variant", "with itself", "with others", "seeds"];
        let rows = self.told.variants.iter().map(row).collect();
        let below = "It is Spearman's correlation of the scores of two seeds, the mean over all pairs. Where it is as high with another \
                     variant as with itself, a method ranks both alike.";
        let title = "Whether another variant is ranked otherwise:";
        Section { below: below.to_owned(), ..Section::of(title, &header, rows) }
    }

    fn weighed(&self) -> Section {
        let row = |of: &weighed::WeighedLine| {
            let times = of.times.iter().enumerate().filter(|(_, times)| **times > 0);
            let times: Vec<String> = times.map(|(demo, times)| format!("{demo}: {times}")).collect();
            let truth = of.truth.as_ref();
            vec![
                of.set.clone(),
                of.method.clone(),
                spread(&of.kept, Scale::of([of.kept.mean], "")),
                times.join(", "),
                of.alike.map_or("-".to_owned(), |alike| format!("{alike:.2}")),
                truth.map_or("-".to_owned(), |of| correlation(&of.spearman)),
                truth.map_or("-".to_owned(), |of| marked(&of.parting, &signed(&of.parting, ""))),
                format!("{:.1}, {} of {} settled", of.rounds.mean, of.converged, of.kept.seeds),
                rounded(of.environment_steps),
                of.kept.seeds.to_string(),
            ]
        };
        let header = [
            "set",
            "method",
            "kept",
            "with how many seeds",
            "two seeds",
            "truth",
            "parted by",
            "rounds",
            "steps",
            "seeds",
        ];
        let rows = self.told.weighed.iter().map(row).collect();
        let truth = self.told.weighed.iter().find_map(|of| of.truth.as_ref());
        let of_truth = truth.map_or(String::new(), |of| {
            format!(
                " Truth is the same with the {}. Weights are parted by the mean of its better half less that of the others, where \
                 the mean of all is 1, with a 95 % interval by Student's t over seeds; bold is what does not hold 0.",
                of.truth
            )
        });
        let below = format!(
            "Last weights are compared: those of two seeds by Spearman's correlation, the mean over all pairs.{of_truth} A selection \
             is settled when the same subset came out several times in a row. Steps are those of a selection, its prior apart; \
             methods have as many meta-updates, and not as many steps."
        );
        Section { below, ..Section::of("What is kept by weights:", &header, rows) }
    }

    fn priors(&self) -> Section {
        // Cells of before do not say what was learned.
        let told_by = |words: String, told: &Spread, of: &told::PriorLine| match told.seeds {
            all if all == of.score.seeds => words,
            1 => format!("{words} (1 seed)"),
            some => format!("{words} ({some} seeds)"),
        };
        let row = |of: &told::PriorLine| {
            vec![
                of.set.clone(),
                of.method.clone(),
                of.meta_updates.map_or("-".to_owned(), |told| told_by(rounded(told.mean), &told, of)),
                spread(&of.score, Scale::of([of.score.mean], &of.unit)),
                of.explained.map_or("-".to_owned(), |told| told_by(correlation(&told), &told, of)),
                of.score.seeds.to_string(),
            ]
        };
        let header = ["set", "method", "meta-updates", "score", "encoding explained", "seeds"];
        let rows = self.told.priors.iter().map(row).collect();
        let below = format!(
            "The score is that of the agent before it imitates anything. All methods have the same budget, and what a meta-update \
             costs differs. The posterior of mutual information explains this share of the spread of the encodings, on \
             trajectories that it was not trained on, in the last half of the updates; at 0 or below it tells nothing. {DEVIATION}"
        );
        Section { below, ..Section::of("What judging starts from:", &header, rows) }
    }

    fn distances(&self) -> Section {
        let row = |of: &told::DistanceLine| {
            let distance = spread(&of.distance, Scale::of([of.distance.mean], ""));
            vec![of.set.clone(), of.method.clone(), distance, of.distance.seeds.to_string()]
        };
        let title = "The adapted behaviors distance, lower is better:";
        let rows = self.told.distances.iter().map(row).collect();
        let below = format!(
            "{DEVIATION} Agents of the judge by cloning act by their mean, the others sample, and what is sampled is farther from \
             anything, so the two kinds cannot be compared. In raw units a few columns outweigh all \
             others, and an agent that keeps still can be nearer than one that imitates (docs/paper.md, reading 11)."
        );
        Section { below, ..Section::of(title, &["set", "method", "ABD", "seeds"], rows) }
    }

    fn bodies(&self) -> Section {
        let row = |of: &bodies::BodyLine| {
            let by = match (&of.method, of.oracle) {
                (Some(method), _) => method.clone(),
                (None, oracle) => format!("(oracle by {})", oracle.map_or("-", imitator_name)),
            };
            let successful = of.of_successful.map_or("-".to_owned(), percent);
            let shares = [percent(of.share.mean), percent(of.of_set), successful];
            let mut row = vec![of.set.clone(), of.kept.to_string(), by];
            row.extend(shares);
            row.push(of.share.seeds.to_string());
            row
        };
        let header = ["set", "K", "kept by", "of the kept", "of the set", "of the successful", "seeds"];
        let rows = self.told.bodies.iter().map(row).collect();
        let below = "Whose a demonstration is was drawn once, and seeds draw only how it is judged, so nothing is decided of these \
                     shares.";
        let title = "How many of the kept were made by another body:";
        Section { below: below.to_owned(), ..Section::of(title, &header, rows) }
    }

    fn taught(&self) -> Section {
        let row = |of: &bodies::TaughtLine| {
            let scale = Scale::of([of.mean, of.least, of.most], &of.unit);
            vec![
                of.set.clone(),
                imitator_name(of.imitator).to_owned(),
                if of.by_other { "another body" } else { "the task's body" }.to_owned(),
                of.succeeded.map_or("-", |succeeded| if succeeded { "yes" } else { "no" }).to_owned(),
                of.demonstrations.to_string(),
                scale.with_unit(of.mean),
                format!("{} to {}", scale.plain(of.least), scale.with_unit(of.most)),
                of.seeds.to_string(),
            ]
        };
        let header =
            ["set", "imitator", "made by", "succeeded", "demonstrations", "score, mean", "from", "seeds"];
        let rows = self.told.taught.iter().map(row).collect();
        let below = "Of each demonstration the score is the mean over the oracle's seeds, at the end of a training on it alone.";
        let title = "What demonstrations teach alone, by the body that made them:";
        Section { below: below.to_owned(), ..Section::of(title, &header, rows) }
    }
}

const DEVIATION: &str = "± is one standard deviation over seeds.";

fn spread(of: &Spread, scale: Scale<'_>) -> String {
    if of.seeds == 1 {
        return scale.with_unit(of.mean);
    }
    format!("{} ± {} {}", scale.plain(of.mean), scale.plain(of.deviation), scale.unit).trim_end().to_owned()
}

fn share(of: Spread) -> String {
    match of.seeds {
        1 => percent(of.mean),
        _ => format!("{} ± {}", percent(of.mean), percent(of.deviation)),
    }
}

fn correlation(of: &Spread) -> String {
    match of.seeds {
        1 => format!("{:.2}", of.mean),
        _ => format!("{:.2} ± {:.2}", of.mean, of.deviation),
    }
}
