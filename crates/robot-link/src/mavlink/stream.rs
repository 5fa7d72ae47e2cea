//! A steady stream of set-points from a planner that is not steady.
//!
//! A planner hands over points of its trajectory when it has them, mostly every 20 ms, at times late, at times not at all. An
//! autopilot wants a reference whose velocity is the derivative of its position and whose acceleration it can fly. So what is
//! streamed is a point of our own that follows the planner's:
//!
//! ```text
//! wanted, carried on to now:   p_w + v_w t + a_w t^2/2,   v_w + a_w t,   a_w        at rest once it is older than `stale`
//! v' = v_w + k1 (p_w - p)      cut to the limits of speed and climb
//! a  = a_w + k2 (v' - v)       cut to the limit of acceleration
//! ```
//!
//! and `p`, `v` are the integrals of `a`. Where the wanted point moves as it says, the difference dies out and the planner's own
//! trajectory is streamed; where it jumps, the reference goes there within its limits; where it stays away, the reference brakes.

use nalgebra::Vector3;

use crate::frames::wrapped;

/// A point to fly through, in a level world (ENU).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// Position, m.
    pub position_in_world: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity_in_world_mps: Vector3<f64>,
    /// Acceleration, m/s^2.
    pub acceleration_in_world_mps2: Vector3<f64>,
    /// Heading, counter-clockwise from x.
    pub yaw_rad: f64,
    /// Its rate.
    pub yaw_rate_radps: f64,
}

impl Reference {
    /// At rest.
    pub fn resting_at(position_in_world: Vector3<f64>, yaw_rad: f64) -> Reference {
        let (zero, yaw_rate_radps) = (Vector3::zeros(), 0.0);
        Reference {
            position_in_world,
            velocity_in_world_mps: zero,
            acceleration_in_world_mps2: zero,
            yaw_rad,
            yaw_rate_radps,
        }
    }

    /// Whether every number can be sent.
    pub fn is_finite(&self) -> bool {
        let vectors = [self.position_in_world, self.velocity_in_world_mps, self.acceleration_in_world_mps2];
        // The wire carries single precision: what overflows there is as bad as infinity.
        let fits = |x: &f64| (*x as f32).is_finite();
        vectors.iter().flat_map(|vector| vector.iter()).chain([&self.yaw_rad, &self.yaw_rate_radps]).all(fits)
    }
}

/// Limits of the streamed reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamConfig {
    /// Speed in the plane (3).
    pub max_speed_mps: f64,
    /// Speed up and down, for what the planner does not ask for itself (0.8).
    pub max_climb_mps: f64,
    /// Acceleration (6).
    pub max_accel_mps2: f64,
    /// Turning rate (1.5).
    pub max_yaw_rate_radps: f64,
    /// A wanted point older than this is not carried on any more (0.25 s).
    pub stale_s: f64,
    /// Speed per metre of difference (2).
    pub position_gain_per_s: f64,
    /// Acceleration per m/s of difference (8: with the gain above the difference dies out as `e^-4t`, without overshoot).
    pub velocity_gain_per_s: f64,
}

impl Default for StreamConfig {
    fn default() -> Self {
        Self {
            max_speed_mps: 3.0,
            max_climb_mps: 0.8,
            max_accel_mps2: 6.0,
            max_yaw_rate_radps: 1.5,
            stale_s: 0.25,
            position_gain_per_s: 2.0,
            velocity_gain_per_s: 8.0,
        }
    }
}

impl StreamConfig {
    /// Whether every number is positive and finite.
    pub fn is_sound(&self) -> bool {
        let numbers = [
            self.max_speed_mps,
            self.max_climb_mps,
            self.max_accel_mps2,
            self.max_yaw_rate_radps,
            self.stale_s,
            self.position_gain_per_s,
            self.velocity_gain_per_s,
        ];
        numbers.iter().all(|x| x.is_finite() && *x > 0.0)
    }
}

/// Longest step of the integration.
const STEP_S: f64 = 0.02;
/// After a longer silence of the caller the reference has stood still.
const LONGEST_S: f64 = 1.0;

/// The reference that is streamed.
#[derive(Debug, Clone)]
pub struct SetPointStream {
    config: StreamConfig,
    now_ns: i64,
    reference: Reference,
    floor_z_m: f64,
}

impl SetPointStream {
    /// A stream that begins at rest where the vehicle is. It never goes below `floor_z_m`.
    pub fn new(config: StreamConfig, now_ns: i64, start: Reference, floor_z_m: f64) -> Self {
        Self { config, now_ns, reference: start, floor_z_m }
    }

    /// The reference as it was at the last step.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Begins again where the vehicle is found, moving as it moves; the heading stays.
    pub fn restart_at(&mut self, now_ns: i64, position_in_world: Vector3<f64>, velocity_in_world_mps: Vector3<f64>) {
        let start = Reference::resting_at(position_in_world, self.reference.yaw_rad);
        self.reference = Reference { velocity_in_world_mps, ..start };
        self.now_ns = now_ns;
    }

    /// Goes on to `now_ns` toward what is wanted: a point with the time it was meant for. Without one the reference brakes.
    pub fn advance(&mut self, now_ns: i64, wanted: Option<&(i64, Reference)>) -> &Reference {
        let whole_s = seconds(now_ns, self.now_ns).clamp(0.0, LONGEST_S);
        let steps = (whole_s / STEP_S).ceil().max(1.0);
        for step in 0..steps as i64 {
            // Differences are taken at the start of a step, where the reference is.
            let left_s = whole_s * (1.0 - step as f64 / steps);
            let target = match wanted {
                Some((stamp_ns, point)) => self.carried_on(point, seconds(now_ns, *stamp_ns) - left_s),
                None => self.at_rest(),
            };
            self.step(whole_s / steps, &target);
        }
        self.now_ns = now_ns.max(self.now_ns);
        &self.reference
    }

    /// The wanted point `age_s` after its time.
    fn carried_on(&self, point: &Reference, age_s: f64) -> Reference {
        // A step looks back at its start, which may lie before the time of a fresh point.
        let t = age_s.clamp(-STEP_S, self.config.stale_s);
        let (v, a) = (point.velocity_in_world_mps, point.acceleration_in_world_mps2);
        let there = point.position_in_world + v * t + a * (t * t / 2.0);
        let yaw_rad = point.yaw_rad + point.yaw_rate_radps * t;
        if age_s > self.config.stale_s {
            return Reference::resting_at(there, yaw_rad);
        }
        Reference { position_in_world: there, velocity_in_world_mps: v + a * t, yaw_rad, ..*point }
    }

    /// Where the reference would come to rest by itself.
    fn at_rest(&self) -> Reference {
        let reach_s = 1.0 / self.config.position_gain_per_s;
        let here = &self.reference;
        Reference::resting_at(here.position_in_world + here.velocity_in_world_mps * (reach_s / 2.0), here.yaw_rad)
    }

    fn step(&mut self, dt_s: f64, target: &Reference) {
        let (config, now) = (&self.config, &mut self.reference);
        let off = target.position_in_world - now.position_in_world;
        let mut velocity = target.velocity_in_world_mps + off * config.position_gain_per_s;
        let level = velocity.xy().norm();
        if level > config.max_speed_mps {
            velocity.x *= config.max_speed_mps / level;
            velocity.y *= config.max_speed_mps / level;
        }
        let climb = config.max_climb_mps.max(target.velocity_in_world_mps.z.abs());
        velocity.z = velocity.z.clamp(-climb, climb);
        let mut acceleration =
            target.acceleration_in_world_mps2 + (velocity - now.velocity_in_world_mps) * config.velocity_gain_per_s;
        let size = acceleration.norm();
        if size > config.max_accel_mps2 {
            acceleration *= config.max_accel_mps2 / size;
        }
        now.position_in_world += now.velocity_in_world_mps * dt_s + acceleration * (dt_s * dt_s / 2.0);
        now.velocity_in_world_mps += acceleration * dt_s;
        now.acceleration_in_world_mps2 = acceleration;
        if now.position_in_world.z < self.floor_z_m {
            now.position_in_world.z = self.floor_z_m;
            now.velocity_in_world_mps.z = now.velocity_in_world_mps.z.max(0.0);
            now.acceleration_in_world_mps2.z = now.acceleration_in_world_mps2.z.max(0.0);
        }
        let turn = wrapped(target.yaw_rad - now.yaw_rad);
        let rate = (target.yaw_rate_radps + turn * config.velocity_gain_per_s)
            .clamp(-config.max_yaw_rate_radps, config.max_yaw_rate_radps);
        now.yaw_rad = wrapped(now.yaw_rad + rate * dt_s);
        now.yaw_rate_radps = rate;
    }
}

fn seconds(later_ns: i64, earlier_ns: i64) -> f64 {
    (later_ns as f64 - earlier_ns as f64) * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: i64 = 20_000_000;

    /// A circle of 2 m at 1.6 m/s.
    fn circle(now_ns: i64) -> Reference {
        let (r, w) = (2.0, 0.8);
        let (s, c) = (w * now_ns as f64 * 1e-9).sin_cos();
        Reference {
            position_in_world: Vector3::new(r * c, r * s, 1.0),
            velocity_in_world_mps: Vector3::new(-s, c, 0.0) * (r * w),
            acceleration_in_world_mps2: Vector3::new(-c, -s, 0.0) * (r * w * w),
            yaw_rad: 0.0,
            yaw_rate_radps: 0.0,
        }
    }

    #[test]
    fn a_planner_in_time_is_streamed_as_it_is() {
        let mut stream = SetPointStream::new(StreamConfig::default(), 0, circle(0), 0.0);
        let mut worst: f64 = 0.0;
        for tick in 1..500 {
            let now_ns = tick * TICK_NS;
            // Handed over 13 ms ago.
            let wanted = (now_ns - 13_000_000, circle(now_ns - 13_000_000));
            let sent = *stream.advance(now_ns, Some(&wanted));
            worst = worst.max((sent.position_in_world - circle(now_ns).position_in_world).norm());
        }
        assert!(worst < 1e-3, "{worst}");
    }

    #[test]
    fn a_planner_that_falls_silent_is_braked_for_and_caught_up_with() {
        let mut stream = SetPointStream::new(StreamConfig::default(), 0, circle(0), 0.0);
        let last = (0, circle(0));
        for tick in 1..=150 {
            stream.advance(tick * TICK_NS, Some(&last));
        }
        assert!(stream.reference().velocity_in_world_mps.norm() < 1e-3, "three seconds later it stands");
        for tick in 151..=400 {
            let now_ns = tick * TICK_NS;
            stream.advance(now_ns, Some(&(now_ns, circle(now_ns))));
        }
        let left = stream.reference().position_in_world - circle(400 * TICK_NS).position_in_world;
        assert!(left.norm() < 0.01, "{left}");
    }

    #[test]
    fn it_stays_above_the_floor() {
        let start = Reference::resting_at(Vector3::new(0.0, 0.0, 1.0), 0.0);
        let mut stream = SetPointStream::new(StreamConfig::default(), 0, start, 0.2);
        let below = (0, Reference::resting_at(Vector3::new(0.0, 0.0, -1.0), 0.0));
        for tick in 1..300 {
            assert!(stream.advance(tick * TICK_NS, Some(&below)).position_in_world.z >= 0.2);
        }
        assert_eq!(stream.reference().position_in_world.z, 0.2);
        assert_eq!(stream.reference().velocity_in_world_mps.z, 0.0);
    }
}
