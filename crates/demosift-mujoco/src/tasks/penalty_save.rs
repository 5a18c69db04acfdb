//! Penalty Save (§5.1, A.1): the part of the task reward that looks ahead along the ball's way.
//!
//! Every state has a worth: that of a save where no goal is coming, and where one is, the more the closer to the ball the
//! keeper will be if both fly freely until the ball is at the keeper.
//! A step is paid what it changed in that (Ng, Harada and Russell 1999), so a dive is paid when the keeper pushes itself off and a
//! save when the ball turns, not at the end when success is certain; what is lent on the way is taken back at the end.
//! Nothing of this judges: heuristic and success are in `task.toml`.

use demosift::Result;
use demosift::world::environment::Specification;

use crate::task::reward::{RewardShaping, Transition};

/// m/s², as in the model.
const GRAVITY: f64 = 9.81;
/// Of the ball, m.
const RADIUS: f64 = 0.15;
/// The mouth of the goal, m: half its width, and its height.
const MOUTH: [f64; 2] = [1.5, 1.4];
/// The height of the keeper's middle, m, below which the ground holds it.
const STANCE: f64 = 0.4;

/// For how long, s, a keeper on the ground is trusted to go on as fast sideways as it does: its legs brake it.
const GLIDE_SECS: f64 = 0.3;

/// The worth of a state in which no goal is coming: the reward of success in `task.toml`.
const SAVED: f64 = 20.0;

/// Pairs of worth without a miss, and the miss in m at which it has fallen to 1/e.
/// The first one distinguishes a save from a near miss, the second one a dive to the right side from one to the wrong side.
const WORTHS: [(f64, f64); 2] = [(6.0, 0.3), (6.0, 1.0)];

/// Columns of the measurements that the reward needs.
struct PenaltySave {
    ball: [usize; 3],
    ball_velocity: [usize; 3],
    keeper: [usize; 3],
    keeper_velocity: [usize; 2],
    control_step_secs: f64,
}

/// Finds the measurements that the reward is made of.
///
/// # Errors
/// If the task does not measure one of them.
pub(crate) fn shaping(task: &Specification) -> Result<Box<dyn RewardShaping>> {
    let column = |name| task.measurement(name);
    Ok(Box::new(PenaltySave {
        ball: [column("ball_x")?, column("ball_y")?, column("ball_z")?],
        ball_velocity: [column("ball_velocity_x")?, column("ball_velocity_y")?, column("ball_velocity_z")?],
        keeper: [column("keeper_x")?, column("keeper_y")?, column("keeper_z")?],
        keeper_velocity: [column("keeper_velocity_y")?, column("keeper_velocity_z")?],
        control_step_secs: task.control_step_secs,
    }))
}

impl RewardShaping for PenaltySave {
    /// What the step changed in the worth of the state; the last one leaves nothing.
    fn reward(&self, step: &Transition<'_>) -> f64 {
        let steps_left = step.horizon.saturating_sub(step.steps);
        let after = if steps_left == 0 { 0.0 } else { self.worth(step.after, steps_left) };
        // Where the episode starts from is nobody's merit, but the same for all actions.
        after - self.worth(step.before, steps_left + 1)
    }
}

impl PenaltySave {
    /// [`SAVED`] where no goal is coming; else Σ worth · exp(−miss / scale), which is 0 where the ball has passed.
    fn worth(&self, measurements: &[f64], steps_left: usize) -> f64 {
        let ball = Flight {
            position: self.ball.map(|column| measurements[column]),
            velocity: self.ball_velocity.map(|column| measurements[column]),
            lowest: RADIUS,
        };
        if !is_goal(&ball, steps_left as f64 * self.control_step_secs) {
            return SAVED;
        }
        let [across, up] = self.keeper_velocity.map(|column| measurements[column]);
        let keeper = Flight {
            position: self.keeper.map(|column| measurements[column]),
            velocity: [0.0, across, up],
            lowest: STANCE,
        };
        let miss = predicted_miss(&ball, &keeper);
        WORTHS.iter().map(|(worth, scale)| worth * (-miss / scale).exp()).sum()
    }
}

/// Something that flies freely and cannot fall below a height, m and m/s.
struct Flight {
    position: [f64; 3],
    velocity: [f64; 3],
    lowest: f64,
}

impl Flight {
    /// Seconds until it comes to this x while it moves into the goal; infinite if it does not.
    fn secs_until(&self, x: f64) -> f64 {
        let ahead = self.position[0] - x;
        if self.velocity[0] < 0.0 && ahead >= 0.0 { -ahead / self.velocity[0] } else { f64::INFINITY }
    }

    /// Its y and z after some seconds.
    fn after(&self, secs: f64) -> [f64; 2] {
        let [_, y, z] = self.position;
        let [_, v_y, v_z] = self.velocity;
        [y + v_y * secs, (z + v_z * secs - 0.5 * GRAVITY * secs * secs).max(self.lowest)]
    }
}

/// Whether the ball is in the goal, or will be within the seconds that are left if nobody touches it.
fn is_goal(ball: &Flight, secs_left: f64) -> bool {
    let is_in_mouth = |[y, z]: [f64; 2]| y.abs() < MOUTH[0] && z < MOUTH[1];
    if ball.position[0] < -RADIUS {
        return is_in_mouth([ball.position[1], ball.position[2]]);
    }
    let secs = ball.secs_until(-RADIUS);
    secs <= secs_left && is_in_mouth(ball.after(secs))
}

/// How far from the keeper's middle, m, a ball passes that comes to where the keeper is; infinite if it has passed.
fn predicted_miss(ball: &Flight, keeper: &Flight) -> f64 {
    let secs = ball.secs_until(keeper.position[0]);
    if secs.is_infinite() {
        return f64::INFINITY;
    }
    let [y, z] = ball.after(secs);
    let ([keeper_y, _], [_, keeper_z]) = (keeper.after(secs.min(GLIDE_SECS)), keeper.after(secs));
    (y - keeper_y).hypot(z - keeper_z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(position: [f64; 3], velocity: [f64; 3], lowest: f64) -> Flight {
        Flight { position, velocity, lowest }
    }

    /// Where something is after it flew in small steps; on the ground it slides.
    fn by_flying(mut at: [f64; 3], mut velocity: [f64; 3], secs: f64) -> [f64; 3] {
        let dt = 1e-5;
        for _ in 0..(secs / dt).round() as usize {
            at.iter_mut().zip(velocity).for_each(|(place, speed)| *place += dt * speed);
            velocity[2] -= dt * GRAVITY;
        }
        at
    }

    #[test]
    fn the_miss_is_the_distance_at_which_a_flying_ball_passes_a_flying_keeper() {
        let (ball, speed) = ([2.6, 0.4, 0.9], [-5.0, 1.0, 1.5]);
        let (keeper, leap) = ([0.6, 0.3, 0.6], [0.0, 1.5, 2.0]);
        let secs = 0.4;
        let (there, here) = (by_flying(ball, speed, secs), by_flying(keeper, leap, secs));
        // Sideways a keeper is trusted for a shorter time only.
        let aside = keeper[1] + leap[1] * GLIDE_SECS;
        let wanted = (there[1] - aside).hypot(there[2] - here[2]);
        let got = predicted_miss(&flight(ball, speed, RADIUS), &flight(keeper, leap, STANCE));
        assert!((there[0] - keeper[0]).abs() < 1e-9);
        assert!((got - wanted).abs() < 1e-3, "{got} instead of {wanted}");
    }

    #[test]
    fn a_ball_that_has_passed_can_no_longer_be_reached() {
        let keeper = flight([0.6, 0.0, 0.5], [0.0; 3], STANCE);
        assert_eq!(
            predicted_miss(&flight([0.5, 0.0, 0.5], [-5.0, 0.0, 0.0], RADIUS), &keeper),
            f64::INFINITY
        );
    }

    #[test]
    fn a_goal_is_seen_coming_and_a_shot_that_is_wide_high_late_or_turned_away_is_none() {
        let shot = |position, velocity| flight(position, velocity, RADIUS);
        assert!(is_goal(&shot([5.0, 0.0, 0.15], [-5.5, 1.0, 4.0]), 1.5));
        assert!(!is_goal(&shot([5.0, 0.0, 0.15], [-5.5, 2.0, 4.0]), 1.5), "wide");
        assert!(!is_goal(&shot([1.0, 0.0, 1.5], [-5.5, 0.0, 2.0]), 1.5), "over the bar");
        assert!(!is_goal(&shot([5.0, 0.0, 0.15], [-5.5, 1.0, 4.0]), 0.5), "too late");
        assert!(!is_goal(&shot([1.0, 0.0, 0.5], [0.1, 0.0, 0.0]), 1.5), "turned away");
        assert!(is_goal(&shot([-0.5, 0.0, 0.2], [0.1, 0.0, 0.0]), 0.0), "in the net");
        assert!(!is_goal(&shot([-0.5, 1.8, 0.2], [0.1, 0.0, 0.0]), 1.0), "beside the net");
    }
}
