//! An ideal base: it does at once what it is told.

use planner::LocalCommand;

/// x, y, yaw in the world.
pub type Pose = (f64, f64, f64);

/// Where it is after so many seconds.
pub fn step(pose: Pose, command: &LocalCommand, seconds: f64) -> Pose {
    const PARTS: u32 = 8;
    let h = seconds / f64::from(PARTS);
    (0..PARTS).fold(pose, |(x, y, yaw), _| {
        let (sin, cos) = (yaw + 0.5 * command.yaw_rate * h).sin_cos();
        let (dx, dy) = (cos * command.vx - sin * command.vy, sin * command.vx + cos * command.vy);
        (x + dx * h, y + dy * h, yaw + command.yaw_rate * h)
    })
}
