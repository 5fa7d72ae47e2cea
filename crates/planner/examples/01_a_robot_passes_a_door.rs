//! Two rooms, a wall with a door of a metre, and a robot as long as a dog.
//!
//! The map says where the walls are; the visibility graph says how to go; the local policy drives, and looks only at
//! the points of its last scan. We put a box in the way that the map does not know: the policy will not touch it, and twice
//! a second the map learns what was seen nearby and the route is made anew, so the robot goes round.
//!
//! Run: `cargo run -p planner --example 01_a_robot_passes_a_door`

use nalgebra::Point2;
use planner::{GridView, LocalPolicy, LocalPolicyConfig, LocalStatus, VisibilityGraph};

fn main() {
    // 1. The map: 6 x 4 m at 5 cm; a wall at x = 3 with a door between y = 1.5 and 2.5.
    let (width, height, resolution_m) = (120, 80, 0.05);
    let mut blocked = vec![false; width * height];
    for y in (0..height).filter(|y| !(30..50).contains(y)) {
        blocked[y * width + 60] = true;
        blocked[y * width + 61] = true;
    }
    let grid = GridView { origin: Point2::origin(), resolution_m, width, height, blocked: &blocked };

    // 2. The route keeps the circumscribed radius (0.386 m) from every wall.
    let graph = VisibilityGraph::build(&grid, 0.386).expect("a good grid");
    let (start, goal) = (Point2::new(1.0, 0.8), Point2::new(5.0, 3.2));
    let mut route = graph.route(&start, &goal).expect("the door is wide enough");
    println!("graph: {} vertices, {} edges", graph.vertex_count(), graph.edge_count());
    println!(
        "route: {:.2} m through {} points (straight: {:.2} m)",
        route.length_m,
        route.points.len(),
        (goal - start).norm()
    );

    // 3. What the scan shows: the walls, and a box of 30 cm that nobody mapped, on the route behind the door.
    let mut scan: Vec<Point2<f32>> = Vec::new();
    for y in (0..height).filter(|y| !(30..50).contains(y)) {
        scan.push(Point2::new(3.0, y as f32 * 0.05));
        scan.push(Point2::new(3.1, y as f32 * 0.05));
    }
    for k in 0..=15 {
        let t = k as f32 * 0.02;
        let (x, y) = (3.9, 2.2);
        scan.extend([
            Point2::new(x + t, y),
            Point2::new(x + t, y + 0.3),
            Point2::new(x, y + t),
            Point2::new(x + 0.3, y + t),
        ]);
    }

    // 4. Drive at 50 Hz.
    let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).expect("the defaults hold");
    let (mut x, mut y, mut yaw) = (start.x, start.y, 1.5);
    let mut velocity = (0.0, 0.0, 0.0);
    let mut least = f64::INFINITY;
    let mut arrived_s = None;
    for cycle in 0..3000 {
        if cycle % 25 == 0 {
            // What was seen within 2 m goes into the map, and the route is made anew.
            for p in scan.iter().map(|p| Point2::new(f64::from(p.x), f64::from(p.y))) {
                if (p - Point2::new(x, y)).norm() < 2.0 {
                    blocked[(p.y / resolution_m) as usize * width + (p.x / resolution_m) as usize] = true;
                }
            }
            let grid = GridView { origin: Point2::origin(), resolution_m, width, height, blocked: &blocked };
            let graph = VisibilityGraph::build(&grid, 0.386).expect("a good grid");
            route = graph.route(&Point2::new(x, y), &goal).unwrap_or(route);
        }
        let c = policy.command((x, y, yaw), velocity, &route.points, None, &scan, &[]);
        least = least.min(c.clearance_m);
        if cycle % 150 == 0 {
            println!(
                "{:5.1} s at ({x:.2}, {y:.2}): {:?}, {:.2} m/s, clearance {:.2} m",
                cycle as f64 * 0.02,
                c.status,
                c.vx,
                c.clearance_m
            );
        }
        if c.status == LocalStatus::Arrived {
            arrived_s = Some(f64::from(cycle) * 0.02);
            break;
        }
        let middle = yaw + 0.01 * c.yaw_rate;
        x += 0.02 * (c.vx * middle.cos() - c.vy * middle.sin());
        y += 0.02 * (c.vx * middle.sin() + c.vy * middle.cos());
        yaw += 0.02 * c.yaw_rate;
        velocity = (c.vx, c.vy, c.yaw_rate);
    }
    let arrived_s = arrived_s.expect("the robot arrives");
    println!("arrived after {arrived_s:.1} s; never nearer than {:.0} mm to anything", least * 1000.0);
    assert!(least > 0.0);
}
