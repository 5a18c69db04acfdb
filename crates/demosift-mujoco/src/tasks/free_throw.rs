//! Free Throw (§5.1, A.1): the part of the task reward that looks ahead along the ball's arc.
//!
//! At every step the ball is asked: if you flew freely from now on, by how much would you miss the hoop?
//! In the hand this pays for moving the ball well, and a throw is nothing but the moment at which that stops mattering;
//! in the air the answer no longer changes, so a good throw is paid until the ball arrives.
//! Nothing of this judges: heuristic and success are in `task.toml`.

use demosift::Result;
use demosift::world::environment::Specification;

use crate::task::reward::{RewardShaping, Transition};

/// m/s², as in the model.
const GRAVITY: f64 = 9.81;

/// Meters of miss for a meter by which the arc stays below the rim.
const MISS_PER_MISSING_HEIGHT: f64 = 2.0;

/// Radii of ball and hoop, m, as in the model.
const BALL_RADIUS: f64 = 0.12;
const HOOP_RADIUS: f64 = 0.25;

/// Meters of miss for a meter by which the hoop, seen along the arc's end, is too narrow for the ball.
const MISS_PER_MISSING_WIDTH: f64 = 4.0;

/// Pairs of reward for a step without a miss, and the miss in m at which it has fallen to 1/e.
/// The first one distinguishes a hit from a near miss, the second one a throw from a drop.
const REWARDS: [(f64, f64); 2] = [(0.5, 0.4), (0.3, 2.0)];

/// Columns of the measurements that the reward needs.
struct FreeThrow {
    position: [usize; 2],
    above_rim: usize,
    velocity: [usize; 3],
}

/// Finds the measurements that the reward is made of.
///
/// # Errors
/// If the task does not measure one of them.
pub(crate) fn shaping(task: &Specification) -> Result<Box<dyn RewardShaping>> {
    let column = |name| task.measurement(name);
    Ok(Box::new(FreeThrow {
        position: [column("x")?, column("y")?],
        above_rim: column("above_rim")?,
        velocity: [column("velocity_x")?, column("velocity_y")?, column("velocity_z")?],
    }))
}

impl RewardShaping for FreeThrow {
    /// Σ weight · exp(−miss / scale), between 0 and 0.8, of the state after the step.
    fn reward(&self, step: &Transition<'_>) -> f64 {
        let [x, y] = self.position.map(|column| step.after[column]);
        let miss = predicted_miss(
            [x, y, step.after[self.above_rim]],
            self.velocity.map(|column| step.after[column]),
        );
        REWARDS.iter().map(|(weight, scale)| weight * (-miss / scale).exp()).sum()
    }
}

/// How far from the hoop's center, m, a ball comes down through the plane of the rim if it flies freely from here:
///
/// t = (v_z + √(v_z² + 2 g z)) / g, miss = ‖(x, y) + (v_x, v_y) t‖.
///
/// If it never does, the miss is taken at the highest point that it still reaches, and what is missing in height is added.
/// A ball that comes at an angle φ to the plane sees the hoop narrowed to R sin φ; what is then missing for its radius is
/// added too, or a thrower whose hand is near the rim would learn to throw flat and bounce off it.
/// Both forms agree where the arc just touches the plane. `position` is relative to the hoop's center, m; `velocity` in m/s.
fn predicted_miss(position: [f64; 3], velocity: [f64; 3]) -> f64 {
    let [x, y, z] = position;
    let [v_x, v_y, v_z] = velocity;
    let rise_secs = v_z.max(0.0) / GRAVITY;
    let top = z + 0.5 * GRAVITY * rise_secs * rise_secs;
    let secs = if top >= 0.0 {
        (v_z + (v_z * v_z + 2.0 * GRAVITY * z).max(0.0).sqrt()) / GRAVITY
    } else {
        rise_secs
    };
    let v_fall = (2.0 * GRAVITY * top.max(0.0)).sqrt();
    let speed = v_fall.hypot(v_x.hypot(v_y));
    let sine = if speed > 0.0 { v_fall / speed } else { 0.0 };
    (x + v_x * secs).hypot(y + v_y * secs)
        + MISS_PER_MISSING_HEIGHT * (-top).max(0.0)
        + MISS_PER_MISSING_WIDTH * (BALL_RADIUS - HOOP_RADIUS * sine).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flies the arc in small steps.
    fn miss_by_flying(mut at: [f64; 3], mut velocity: [f64; 3]) -> f64 {
        let dt = 1e-5;
        loop {
            let from = at;
            for (place, speed) in at.iter_mut().zip(velocity) {
                *place += dt * speed;
            }
            velocity[2] -= dt * GRAVITY;
            if from[2] > 0.0 && at[2] <= 0.0 {
                return at[0].hypot(at[1]);
            }
        }
    }

    #[test]
    fn the_miss_is_where_a_ball_that_flies_comes_down_through_the_rim() {
        for (position, velocity) in [
            ([-2.2, 0.0, -0.4], [2.4, 0.1, 4.0]),
            ([-1.8, 0.1, -0.2], [1.0, -0.3, 3.5]),
            ([-0.5, 0.0, 0.6], [0.4, 0.2, -1.0]),
        ] {
            let (got, wanted) = (predicted_miss(position, velocity), miss_by_flying(position, velocity));
            assert!((got - wanted).abs() < 1e-3, "{got} instead of {wanted}");
        }
    }

    #[test]
    fn the_miss_does_not_jump_where_the_arc_just_reaches_the_rim() {
        let miss = |speed: f64| predicted_miss([-2.0, 0.1, -0.5], [2.0, 0.0, speed]);
        let touching = (2.0 * GRAVITY * 0.5).sqrt();
        assert!((miss(touching + 1e-9) - miss(touching - 1e-9)).abs() < 1e-4);
    }

    #[test]
    fn a_ball_at_rest_in_the_hand_misses_by_its_distance_and_twice_its_depth_and_as_flat_as_can_be() {
        let flat = MISS_PER_MISSING_WIDTH * BALL_RADIUS;
        assert!((predicted_miss([-2.0, 0.0, -0.5], [0.0; 3]) - 3.0 - flat).abs() < 1e-12);
    }

    #[test]
    fn a_flat_arc_through_the_middle_of_the_hoop_misses_and_a_steep_one_does_not() {
        // Both come down through the origin; tan φ = v_z / v_x.
        let through =
            |v_x: f64, fall: f64| predicted_miss([-v_x * fall / GRAVITY * 2.0, 0.0, 0.0], [v_x, 0.0, fall]);
        assert!(through(2.0, 2.0) < 1e-12);
        let angle = 0.5_f64.atan();
        let wanted = MISS_PER_MISSING_WIDTH * (BALL_RADIUS - HOOP_RADIUS * angle.sin());
        assert!(wanted > 0.0 && (through(4.0, 2.0) - wanted).abs() < 1e-12);
    }

    #[test]
    fn a_falling_ball_below_the_rim_gains_nothing_by_falling_toward_the_pole() {
        let miss = |v_x| predicted_miss([-1.0, 0.0, -0.5], [v_x, 0.0, -3.0]);
        assert_eq!(miss(0.0), miss(2.0));
    }
}
