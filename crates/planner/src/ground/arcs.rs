//! The arcs that the local policy tries: a lattice of speeds and turn rates round pure pursuit, rolled out and scored.

use nalgebra::Point2;

use super::local_policy::{LocalPolicy, wrap};
use super::motion::{Twist, advance};
use super::obstacles::Pose;
use super::path::Path;

impl LocalPolicy {
    /// The lattice of arcs round pure pursuit.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn follow(
        &self,
        pose: &Pose,
        now: &Twist,
        path: &Path,
        s: f64,
        error: f64,
        remaining: f64,
        clearance_m: f64,
    ) -> Twist {
        let c = &self.config;
        let nearness = ((clearance_m - c.margin_m) / c.slow_clearance_m).clamp(0.3, 1.0);
        let straightness = (1.0 - error.abs() / 1.3).max(0.15);
        let limit = self.speed_limit_mps(pose);
        let wanted = (c.max_speed_mps * nearness * straightness)
            .min((1.4 * c.max_accel_mps2 * remaining).sqrt())
            .max(0.05)
            .min(limit);
        let mut ways: Vec<(f64, Twist)> = Vec::with_capacity(64);
        for share in [1.0, 0.6, 0.3] {
            for offset in [0.0, 0.2, -0.2, 0.45, -0.45, 0.8, -0.8, 1.2, -1.2] {
                ways.push((0.0, self.steer(wanted * share, error, offset)));
            }
        }
        let vy = 0.7 * c.max_lateral_speed_mps;
        if vy > 0.0 {
            for share in [0.0, 0.4] {
                for side in [vy, -vy] {
                    ways.push((0.0, Twist { vy: side, ..self.steer(wanted * share, error, 0.0) }));
                }
            }
        }
        for w in [0.6, -0.6] {
            ways.push((0.0, Twist { w: w * c.max_yaw_rate_radps, ..Twist::default() }));
        }
        ways.push((0.0, Twist::default()));
        for way in &mut ways {
            way.0 = self.cost(pose, now, &way.1, path, s, wanted);
        }
        // Stable: ties keep the order of the lattice, pure pursuit first.
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        let list: Vec<Twist> = ways.into_iter().map(|(_, twist)| twist).collect();
        self.first_safe(pose, now, &list)
    }

    /// Lower is better; all terms are about 1 when bad.
    fn cost(&self, pose: &Pose, now: &Twist, way: &Twist, path: &Path, s: f64, wanted: f64) -> f64 {
        let c = &self.config;
        let roll = self.roll_out(pose, now, way, c.horizon_s, Some(path));
        let end = Point2::new(roll.end.x, roll.end.y);
        let (s_end, off_path) = path.project(&end);
        let progress = (s_end - s) / (wanted * c.horizon_s);
        let onward = path.toward(&end, s_end, c.lookahead_m);
        let heading = if onward.norm() > 0.1 { wrap(onward.y.atan2(onward.x) - roll.end.yaw).abs() } else { 0.0 };
        let near = ((c.slow_clearance_m - roll.clearance_bound_m) / c.slow_clearance_m).clamp(0.0, 1.5);
        let hit = roll.hit_s.map_or(0.0, |t| 2.0 + 2.0 * (1.0 - t / c.horizon_s));
        let change = (way.w - self.last.w).abs() / c.max_yaw_rate_radps + (way.vy - self.last.vy).abs();
        3.0 * (1.0 - progress.clamp(-1.0, 1.0))
            + 1.0 * off_path
            + 0.4 * heading
            + 0.8 * near * near
            + hit
            + 0.08 * change
    }

    /// Where `way` leads within `time_s`, up to the first contact. With a path: `way` for the first half, then back to
    /// the path by pure pursuit, which tells a detour from a wrong way.
    pub(super) fn roll_out(&self, pose: &Pose, now: &Twist, way: &Twist, time_s: f64, path: Option<&Path>) -> RollOut {
        let c = &self.config;
        let steps = 16;
        let dt_s = time_s / f64::from(steps);
        let mut roll = RollOut { end: *pose, hit_s: None, clearance_bound_m: f64::INFINITY };
        let mut twist = *now;
        for k in 0..steps {
            let target = match path {
                Some(path) if 2 * k >= steps => self.pursuit(&roll.end, path, way.vx.max(0.0)),
                _ => *way,
            };
            let before = twist;
            twist = self.ramp.toward(&twist, &target, dt_s);
            let mean = Twist {
                vx: 0.5 * (before.vx + twist.vx),
                vy: 0.5 * (before.vy + twist.vy),
                w: 0.5 * (before.w + twist.w),
            };
            let next = advance(&roll.end, &mean, dt_s);
            let bound = self.field.clearance_bound(&self.footprint, &next);
            if bound <= c.margin_m && !self.field.is_free(&self.footprint, &next, c.margin_m) {
                roll.hit_s = Some(f64::from(k) * dt_s);
                return roll;
            }
            let t_s = f64::from(k + 1) * dt_s;
            if !self.traffic.is_free(&self.footprint, &next, t_s) {
                roll.hit_s = Some(f64::from(k) * dt_s);
                return roll;
            }
            let apart_m = self.traffic.clearance_m(&self.footprint, &next, t_s);
            roll.clearance_bound_m = roll.clearance_bound_m.min(bound).min(apart_m);
            roll.end = next;
        }
        roll
    }

    /// Pure pursuit of the path at a given speed.
    fn pursuit(&self, pose: &Pose, path: &Path, vx: f64) -> Twist {
        let p = Point2::new(pose.x, pose.y);
        let carrot = path.toward(&p, path.project(&p).0, self.config.lookahead_m);
        let error = if carrot.norm() > 0.05 { wrap(carrot.y.atan2(carrot.x) - pose.yaw) } else { 0.0 };
        self.steer(vx, error, 0.0)
    }

    /// The turn rate of pure pursuit plus an offset. At low speed pure pursuit hardly turns; the heading error helps.
    fn steer(&self, vx: f64, error: f64, offset: f64) -> Twist {
        let most = self.config.max_yaw_rate_radps;
        let w = 2.0 * error.sin() / self.config.lookahead_m * vx + 0.8 * error + offset * most;
        Twist { vx, vy: 0.0, w: w.clamp(-most, most) }
    }
}

/// The outcome of one arc.
#[derive(Debug, Clone, Copy)]
pub(super) struct RollOut {
    end: Pose,
    pub hit_s: Option<f64>,
    clearance_bound_m: f64,
}
