//! Golden cells: a few cells of the result pages, made again. Where one differs, a default has changed, or what the code does,
//! and the pages say what the program no longer finds: make the page again, or say on it which commit it is about.
//!
//! The pages were made with AVX-512; what learns by GAIL finds something else of the same seed with another arithmetic, so these
//! cells are made again only where a processor has it.

#![cfg(target_arch = "x86_64")]

use std::fs;

use demosift::math::arithmetic::Arithmetic;
use serde_json::Value;
use toml::{Table, Value as Toml};

use crate::support::{Scratch, in_repository};

/// One judging of a page.
struct Golden {
    study: &'static str,
    page: &'static str,
    set: &'static str,
    method: &'static str,
}

/// The judge by cloning, the judge of the paper by GAIL, and meta-training by cloning: the first seed of each.
const CELLS: [Golden; 3] = [
    Golden {
        study: "studies/verdict.toml",
        page: "docs/results/verdict.json",
        set: "free_throw_8",
        method: "cloning",
    },
    Golden {
        study: "studies/verdict.toml",
        page: "docs/results/verdict.json",
        set: "free_throw_8",
        method: "paper",
    },
    Golden {
        study: "reproduce/fig8.toml",
        page: "docs/results/fig8.json",
        set: "martial_arts_10",
        method: "MAML, cloned",
    },
];

#[test]
fn the_pages_say_what_the_program_finds() {
    let arithmetic = Arithmetic::of_this_process();
    if arithmetic != Arithmetic::X86V4 {
        eprintln!("left out: the pages were made by {}, and here is {arithmetic}", Arithmetic::X86V4);
        return;
    }
    for golden in CELLS {
        let (wanted, made) = (golden.on_the_page(), golden.made_again());
        let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-5 * b.abs().max(1e-3);
        assert!(
            wanted.len() == made.len() && made.iter().zip(&wanted).all(close),
            "{} judges {} otherwise than {} says: it finds gains of\n  {made:?}\nwhere the page has\n  {wanted:?}",
            golden.method,
            golden.set,
            golden.page
        );
    }
}

impl Golden {
    /// Gains of all demonstrations, as the page has them, `[n]`.
    fn on_the_page(&self) -> Vec<f64> {
        self.gains(&fs::read(in_repository(self.page)).unwrap())
    }

    /// The same, made now.
    fn made_again(&self) -> Vec<f64> {
        let scratch = Scratch::new("golden");
        fs::write(scratch.0.join("golden.toml"), self.cut_out().to_string()).unwrap();
        scratch.succeed("study golden.toml --threads 1 --out golden");
        self.gains(&fs::read(scratch.0.join("golden/study.json")).unwrap())
    }

    /// The study with nothing in it but the one set, the one method and the first seed.
    fn cut_out(&self) -> Table {
        let path = in_repository(self.study);
        let study: Table = fs::read_to_string(&path).unwrap().parse().unwrap();
        let named = |list: &str, name: &str| -> Table {
            let all = study[list].as_array().unwrap().iter().filter_map(Toml::as_table);
            all.clone().find(|entry| entry["name"].as_str() == Some(name)).unwrap().clone()
        };
        let mut set = named("sets", self.set);
        for key in ["data", "stage"] {
            if let Some(file) = set.get(key).and_then(Toml::as_str) {
                let file = path.parent().unwrap().join(file);
                set.insert(key.to_owned(), Toml::from(file.display().to_string()));
            }
        }
        let method = named("methods", self.method);
        let seeds = Table::from_iter([("count".to_owned(), Toml::from(1))]);
        let judging = study.get("judging").map(|judging| ("judging".to_owned(), judging.clone()));
        let own = [
            ("preset".to_owned(), study["preset"].clone()),
            ("seeds".to_owned(), Toml::from(seeds)),
            ("sets".to_owned(), Toml::from(vec![set])),
            ("methods".to_owned(), Toml::from(vec![method])),
        ];
        own.into_iter().chain(judging).collect()
    }

    fn gains(&self, results: &[u8]) -> Vec<f64> {
        let results: Value = serde_json::from_slice(results).unwrap();
        let is_it = |cell: &&Value| {
            let work = &cell["work"];
            work["kind"] == "judging"
                && work["set"] == self.set
                && work["method"] == self.method
                && work["seed"] == 0
        };
        let cell = results["cells"].as_array().unwrap().iter().find(is_it).unwrap();
        let judged = cell["found"]["judging"]["demonstrations"].as_array().unwrap();
        judged.iter().map(|judged| judged["score"].as_f64().unwrap()).collect()
    }
}
