//! Whether what a study draws fits its sets and methods, and whether a cell has all that is to be shown of it.

use super::choice::{Kept, TopK};
use super::drawn::{Claim, Drawn, Draws, Measure, WHOLE, Weights};
use super::plan::{Judge, Study};
use super::{Cell, Finished, Found, Work};
use crate::basics::error::{Error, Result};

impl Study {
    /// Whether a cell of a file of results still has all that this study shows of it: such a file has curves only where its own
    /// figures show them. More may be shown of it once more is judged, so it is asked again then.
    pub fn has_all_to_show(&self, cell: &Cell, finished: &Finished) -> bool {
        match &cell.found {
            Found::Training(training) => {
                !training.curve.is_empty() || !self.shows_the_curve_of(&cell.work, finished)
            }
            // A judge by cloning plays nothing on the way, so that it never has any.
            Found::Judging(judging) => {
                let is_followed = self.method_of(&cell.work).is_some_and(|method| !method.clones);
                !(is_followed && self.drawn.shows(Draws::Adaptation)) || judging.adaptation.is_some()
            }
            Found::Weighing(_) | Found::Failed(_) => true,
        }
    }

    fn shows_the_curve_of(&self, training: &Work, finished: &Finished) -> bool {
        let Work::Training { set, imitator, .. } = training else { return false };
        let Some(set) = self.set(set).filter(|_| self.drawn.shows(Draws::TopK)) else { return false };
        let methods: Vec<&Judge> = self.methods.iter().collect();
        let mut drawn = Vec::new();
        self.curve_work(set, &methods, *imitator, finished, &mut drawn);
        drawn.contains(training)
    }

    fn method_of(&self, work: &Work) -> Option<&Judge> {
        match work {
            Work::Judging { method, .. } | Work::Weighing { method, .. } => self.method(method),
            Work::Training { .. } => None,
        }
    }

    /// Whether what is drawn is of sets and methods of the study.
    pub(super) fn check_drawn(&self) -> Result<()> {
        let Drawn { curves, weights, figures, claims, .. } = &self.drawn;
        if let Some(curves) = curves
            && curves.imitators.is_empty()
        {
            return Err(Error::bad_config("curves.imitators is empty, and must name who learns"));
        }
        if let Some(Weights { methods, sets }) = weights {
            self.check_methods(methods, &[])?;
            self.check_sets(sets)?;
            if let Some(name) = methods.iter().find(|name| !self.has_cells(name)) {
                return Err(Error::bad_config(format!("'{name}' combines others, so it has no weights")));
            }
        }
        for figure in figures {
            self.check_methods(&figure.methods, &[])?;
            self.check_sets(&figure.sets)?;
        }
        for claim in claims {
            self.check_claim(claim).map_err(|error| error.during(&format!("the claim '{}'", claim.says)))?;
        }
        Ok(())
    }

    fn check_claim(&self, claim: &Claim) -> Result<()> {
        let wants_k = claim.measure.is_of_policies();
        let also: &[&str] = if wants_k { &[WHOLE] } else { &[] };
        self.check_methods(std::slice::from_ref(&claim.better), also)?;
        self.check_methods(&claim.than, also)?;
        self.check_sets(&claim.sets)?;
        if claim.measure == Measure::Agreement && self.oracle.is_empty() {
            return Err(Error::bad_config(
                "it is about agreement, and the study has no [oracle] to agree with",
            ));
        }
        if claim.than.is_empty() || wants_k == claim.at.is_empty() {
            let what = if wants_k { "than and at, which may not be empty" } else { "than, and no at" };
            return Err(Error::bad_config(format!("it needs {what}")));
        }
        self.check_kept(claim)
    }

    /// Whether what either side keeps is weighed, or trained on, at all.
    fn check_kept(&self, claim: &Claim) -> Result<()> {
        let trains = claim.measure.is_of_policies();
        let curves = match &self.drawn.curves {
            None if trains => {
                return Err(Error::bad_config(
                    "it is about policies, and the study has no [curves] to train any",
                ));
            }
            curves => curves.as_ref().filter(|_| trains),
        };
        let sides = claim.at.iter().flat_map(|at| {
            let others = claim.than.iter().map(move |than| (than, claim.than_at.unwrap_or(*at)));
            std::iter::once((&claim.better, *at)).chain(others)
        });
        let of_methods = sides.filter(|(name, _)| *name != WHOLE);
        for ((name, kept), set) in of_methods
            .flat_map(|side| self.sets.iter().filter(|set| claim.is_about(set)).map(move |set| (side, set)))
        {
            let weighed = self.drawn.weights.as_ref();
            let is_weighed =
                weighed.is_some_and(|weights| weights.methods.contains(name) && weights.is_about(&set.name));
            if kept == Kept::Weights && !is_weighed {
                return Err(Error::bad_config(format!(
                    "[weights] does not name '{name}' for the set '{}'",
                    set.name
                )));
            }
            if let (Kept::Top(k), Some(curves)) = (kept, curves)
                && let Some(count) = k.of(set.demonstrations)
                && !TopK::all_of(&curves.at, set.demonstrations).contains(&count)
            {
                return Err(Error::bad_config(format!(
                    "K = {k}, and policies are trained on the top K of [curves] at alone, which does not have it"
                )));
            }
        }
        Ok(())
    }

    fn has_cells(&self, method: &str) -> bool {
        self.method(method).is_some_and(|method| method.combination.is_none())
    }
}
