//! Pictures of an environment in Python: the same episodes, played again in one that renders.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use demosift::data::demonstration::DemoId;
use demosift::{Error, Result};
use demosift_gymnasium::pictures::Reel;
use demosift_gymnasium::replay::{Replayed, replayed};
use demosift_gymnasium::task::GymnasiumTask;
use demosift_mujoco::pictures::film::Camera as _;
use demosift_mujoco::pictures::picture::Picture;
use serde::Serialize;

use super::{Caption, Replay, agent};
use crate::arguments::SetArguments;
use crate::job::Job;
use crate::job::as_recorded::AsRecorded;
use crate::job::demonstrations;
use crate::task::reels::Camera;

/// Pixels of a picture at most.
const SIZE: [u32; 2] = [256, 256];
/// Pictures of all episodes together: a page of them has some 5 MB.
const PICTURES: usize = 600;
/// Pictures of one episode.
const FEWEST: usize = 6;
const MOST: usize = 40;
/// So many of the best demonstrations are filmed, and of the worst.
const BEST: usize = 7;
const WORST: usize = 3;

/// An episode in pictures.
#[derive(Serialize)]
pub(super) struct Film {
    #[serde(flatten)]
    caption: Caption,
    /// The step that each picture is of.
    at: Vec<usize>,
    /// Pixels of one picture.
    width: usize,
    height: usize,
    /// PNG of all pictures side by side, in base64.
    strip: String,
}

/// An episode before it is filmed.
struct Cast {
    caption: Caption,
    reel: Reel,
}

/// Films the best and the worst of these demonstrations, which are in the order of their ranks.
pub(super) fn played(task: &GymnasiumTask, job: &mut Job, demos: &[DemoId]) -> Result<Replay> {
    let demos = worth_filming(demos);
    // First, since an environment may not render at all.
    let camera = Camera::open(task, SIZE)?;
    let (mut cast, missing) = match recorded(task, job, &demos) {
        Ok(cast) if cast.is_empty() => (
            cast,
            Some("The set does not say from which seeds or states its episodes began, so demonstrations are not shown.".to_owned()),
        ),
        Ok(cast) => (cast, None),
        Err(error) if !error.is_io() => {
            (Vec::new(), Some(format!("Demonstrations are not shown: {}", error.message())))
        }
        Err(error) => return Err(error),
    };
    cast.extend(agent(job, &demos)?.into_iter().map(|of| Cast {
        caption: of.caption(),
        reel: Reel::of_episode(task, &of.shown.seed, &of.shown.played),
    }));
    Ok(Replay { films: filmed(camera, cast)?, missing, ..Replay::none("") })
}

fn filmed(camera: Camera, cast: Vec<Cast>) -> Result<Vec<Film>> {
    let pictures = (PICTURES / cast.len().max(1)).clamp(FEWEST, MOST);
    let reels = cast.iter().map(|cast| &cast.reel).collect();
    let mut shown = camera.before(reels);
    let mut films = Vec::with_capacity(cast.len());
    for (take, of) in cast.iter().enumerate() {
        let at = spread(of.caption.steps, pictures);
        let pictures: Vec<Picture> =
            at.iter().map(|step| shown.picture(take, *step)).collect::<Result<_>>()?;
        let first = pictures.first().ok_or_else(|| Error::simulation("an episode of no steps"))?;
        films.push(Film {
            caption: of.caption.clone(),
            width: first.width,
            height: first.height,
            strip: STANDARD.encode(Picture::strip(&pictures).to_small_png()?),
            at,
        });
    }
    // A demonstration that its recorded actions do not bring back is shown as far as they go; the agent has to be itself.
    let elsewhere = shown.left().iter().find(|(take, _)| cast[*take].caption.judge.is_some());
    match elsewhere {
        None => Ok(films),
        Some((_, step)) => Err(Error::simulation(format!(
            "an episode of the agent came out differently when it was played again, from step {step} on"
        ))),
    }
}

/// The demonstrations of which is known how they began, with what they scored when they were played again.
fn recorded(task: &GymnasiumTask, job: &Job, demos: &[DemoId]) -> Result<Vec<Cast>> {
    let mut opened = demonstrations::open_unchecked(None, &SetArguments::default(), Some(job.data()))?;
    opened.read_as_taken(task)?;
    let AsRecorded { set, starts } = AsRecorded::of(task, &opened, usize::MAX)?;
    let reel = |demo: &DemoId| Some((*demo, Reel::of_demonstration(&starts, *demo, set.get(*demo))?));
    let (known, reels): (Vec<DemoId>, Vec<Reel>) = demos.iter().filter_map(reel).unzip();
    let replayed = replayed(task, &set, &starts, &known)?;
    let cast = replayed.into_iter().zip(reels).map(|(replayed, reel)| {
        let Replayed { demo, steps, score, succeeded, .. } = replayed;
        let (part, judge, demo, variant) = ("demonstration", None, Some(demo.0), None);
        Cast { caption: Caption { part, judge, demo, variant, steps, score, succeeded }, reel }
    });
    Ok(cast.collect())
}

fn worth_filming(demos: &[DemoId]) -> Vec<DemoId> {
    let is_at_an_end = |place: usize| place < BEST || place + WORST >= demos.len();
    let places = demos.iter().enumerate().filter(|(place, _)| is_at_an_end(*place));
    places.map(|(_, demo)| *demo).collect()
}

/// Steps that are evenly spaced from the first to the last.
fn spread(steps: usize, pictures: usize) -> Vec<usize> {
    let (last, gaps) = (steps.saturating_sub(1), pictures.min(steps).saturating_sub(1));
    (0..=gaps).map(|number| (last * number + gaps / 2).checked_div(gaps).unwrap_or(0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_spread_from_the_first_step_to_the_last() {
        assert_eq!(spread(200, 5), [0, 50, 100, 149, 199]);
        assert_eq!(spread(3, 40), [0, 1, 2]);
        assert_eq!(spread(1, 40), [0]);
    }

    #[test]
    fn of_many_demonstrations_the_best_and_the_worst_are_filmed() {
        let demos: Vec<DemoId> = (0..25).map(DemoId).collect();
        let filmed: Vec<usize> = worth_filming(&demos).into_iter().map(|demo| demo.0).collect();
        assert_eq!(filmed, [0, 1, 2, 3, 4, 5, 6, 22, 23, 24]);
        assert_eq!(worth_filming(&demos[..4]).len(), 4);
    }
}
