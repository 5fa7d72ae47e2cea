//! How do legs know where to step?
//!
//! A body glides through the world and each of its feet stands still for half of the time: that is what walking is, seen from the body.
//! Raibert's rule says where a foot must come down so that this can go on: where the body will be above it when half of its stance is
//! over. Everything else follows. We push the built-in quadruped forwards, let it turn and stop, and draw what the legs make of it:
//! who stands when, the robot from the side, its footprints from above, and the angles of one leg.
//!
//! `cargo run -p robot-model --example 02_a_robot_walks [FILE.svg]`

use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector2};
use robot_model::{BaseMotion, Gait, GaitConfig, RobotModel};
use std::fmt::Write as _;

const DT_S: f64 = 0.005;
/// Speed, turn and for how long.
const PARTS: [(f64, f64, f64); 4] = [(0.0, 0.0, 0.3), (0.8, 0.0, 1.5), (0.5, 1.0, 1.6), (0.0, 0.0, 1.4)];

/// One moment: where the body is, where the legs' joints are in the world (hip axis, thigh axis, knee, foot), who stands, the angles.
struct Moment {
    t_s: f64,
    world_from_body: Isometry3<f64>,
    legs: Vec<[Point3<f64>; 4]>,
    stands: Vec<bool>,
    angles: Vec<f64>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. A robot that stands: every foot in its place.
    let robot = RobotModel::builtin_quadruped();
    let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let mut gait = Gait::new(GaitConfig::default(), &robot, &start, 0.0)?;
    println!("1. {} stands on {} feet, {:.2} m high", robot.name, gait.feet().len(), robot.stance_height_m);

    // 2. Its base is pushed about. Nobody asks the legs; they see where the base is and how fast, two hundred times a second.
    let (mut at, mut yaw, mut speed, mut turn, mut t_s) = (Vector2::zeros(), 0.0_f64, 0.0_f64, 0.0_f64, 0.0);
    let mut moments: Vec<Moment> = Vec::new();
    for (wanted_speed, wanted_turn, seconds) in PARTS {
        for _ in 0..(seconds / DT_S) as usize {
            speed += (wanted_speed - speed).clamp(-2.0 * DT_S, 2.0 * DT_S);
            turn += (wanted_turn - turn).clamp(-4.0 * DT_S, 4.0 * DT_S);
            yaw += turn * DT_S;
            let ahead = Vector2::new(yaw.cos(), yaw.sin());
            at += ahead * speed * DT_S;
            t_s += DT_S;
            let world_from_body = Isometry3::from_parts(
                Translation3::new(at.x, at.y, robot.stance_height_m),
                UnitQuaternion::from_euler_angles(0.0, 0.0, yaw),
            );
            gait.step(
                DT_S,
                &BaseMotion {
                    world_from_body,
                    velocity_in_world_mps: ahead * speed,
                    yaw_rate_radps: turn,
                    excess_velocity_in_world_mps: ahead * (speed - wanted_speed),
                },
            )?;
            moments.push(moment(&robot, &gait, t_s, world_from_body)?);
        }
    }

    // 3. What came of it. A foot that stands at two moments must be where it was, by the angles of its joints.
    let mut slid_m: f64 = 0.0;
    for pair in moments.windows(2) {
        for leg in (0..robot.legs.len()).filter(|leg| pair[0].stands[*leg] && pair[1].stands[*leg]) {
            slid_m = slid_m.max((pair[1].legs[leg][3] - pair[0].legs[leg][3]).norm());
        }
    }
    let steps: usize = (0..robot.legs.len()).map(|leg| footprints(&moments, leg).len() - 1).sum();
    let way_m: f64 = moments.windows(2).map(|pair| (place(&pair[1]) - place(&pair[0])).norm()).sum();
    println!(
        "2. in {t_s:.1} s the body went {way_m:.2} m, with {steps} steps; no standing foot slid more than {slid_m:.0e} m"
    );
    let mut fastest = (0.0, String::new());
    for (slot, joint) in robot.tree.moving_joints().iter().enumerate() {
        let joint = &robot.tree.joints()[*joint];
        for pair in moments.windows(2) {
            let share = (pair[1].angles[slot] - pair[0].angles[slot]).abs()
                / DT_S
                / joint.max_velocity.unwrap_or(f64::INFINITY);
            if share > fastest.0 {
                fastest = (share, joint.name.clone());
            }
        }
    }
    println!("3. the fastest joint, {}, came to {:.0} % of the speed its URDF allows", fastest.1, 100.0 * fastest.0);

    // 4. Draw it.
    let file =
        std::env::args().nth(1).unwrap_or_else(|| std::env::temp_dir().join("walk.svg").to_string_lossy().into_owned());
    std::fs::write(&file, picture(&robot, &moments)?)?;
    println!("4. drawn: {file}");

    assert!(slid_m < 1e-9 && gait.missed_by_m() == 0.0 && fastest.0 < 1.0);
    assert!(gait.feet().iter().all(|foot| foot.is_standing), "who has stopped stands");
    Ok(())
}

fn moment(
    robot: &RobotModel,
    gait: &Gait,
    t_s: f64,
    world_from_body: Isometry3<f64>,
) -> Result<Moment, Box<dyn std::error::Error>> {
    let poses = robot.tree.body_from_links(gait.angles())?;
    let origin = |link: usize| world_from_body * Point3::from(poses[link].translation.vector);
    let child = |slot: usize| robot.tree.joints()[robot.tree.moving_joints()[slot]].child;
    let legs = robot.legs.iter().map(|leg| {
        let foot = robot.tree.link_named(&leg.foot).unwrap_or(robot.tree.root());
        let [hip, thigh, calf] = leg.slots.map(child);
        [hip, thigh, calf, foot].map(origin)
    });
    let stands = gait.feet().iter().map(|foot| foot.is_standing).collect();
    Ok(Moment { t_s, world_from_body, legs: legs.collect(), stands, angles: gait.angles().to_vec() })
}

fn place(moment: &Moment) -> Point2<f64> {
    Point2::from(moment.world_from_body.translation.vector.xy())
}

/// Where a foot stood, one after the other.
fn footprints(moments: &[Moment], leg: usize) -> Vec<Point2<f64>> {
    let mut prints: Vec<Point2<f64>> = Vec::new();
    for moment in moments.iter().filter(|moment| moment.stands[leg]) {
        let foot = moment.legs[leg][3].xy();
        if prints.last().is_none_or(|last| (last - foot).norm() > 1e-6) {
            prints.push(foot);
        }
    }
    prints
}

/// Colours of the two diagonal pairs: front left with rear right, front right with rear left.
const PAIRS: [&str; 2] = ["#1f6feb", "#d1642a"];

fn color(robot: &RobotModel, leg: usize) -> &'static str {
    let hip = robot.legs[leg].hip_in_body;
    let is_left = robot.legs[leg].hip_offset_m > 0.0;
    PAIRS[usize::from((hip.x > 0.0) != is_left)]
}

fn picture(robot: &RobotModel, moments: &[Moment]) -> Result<String, std::fmt::Error> {
    let (width, left) = (1180.0, 70.0);
    let end_s = moments.last().map_or(1.0, |moment| moment.t_s);
    let x_of = |t_s: f64| left + (width - left - 20.0) * t_s / end_s;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} 960\" font-family=\"sans-serif\" font-size=\"13\">\n"
    );
    writeln!(svg, "<rect width=\"{width}\" height=\"960\" fill=\"white\"/>")?;
    let title = |y: f64, text: &str| format!("<text x=\"14\" y=\"{y}\" font-weight=\"bold\">{text}</text>");

    // Who stands when.
    writeln!(svg, "{}", title(22.0, "Who stands when (s)"))?;
    for (leg, name) in robot.legs.iter().map(|leg| &leg.name).enumerate() {
        let y = 36.0 + 24.0 * leg as f64;
        writeln!(svg, "<text x=\"30\" y=\"{}\">{name}</text>", y + 14.0)?;
        let mut from = 0;
        for to in 1..=moments.len() {
            if to == moments.len() || moments[to].stands[leg] != moments[from].stands[leg] {
                if moments[from].stands[leg] {
                    let (a, b) = (x_of(moments[from].t_s - DT_S), x_of(moments[to - 1].t_s));
                    writeln!(
                        svg,
                        "<rect x=\"{a:.1}\" y=\"{y}\" width=\"{:.1}\" height=\"18\" fill=\"{}\"/>",
                        b - a,
                        color(robot, leg)
                    )?;
                }
                from = to;
            }
        }
    }
    time_axis(&mut svg, 136.0, end_s, &x_of)?;

    // From the side, as long as it goes straight on; seen from the right, so the right legs are near.
    writeln!(svg, "{}", title(186.0, "From the side, a stride in seven pictures (near legs dark, far legs light)"))?;
    for (k, moment) in moments.iter().skip(200).step_by(17).take(7).enumerate() {
        let center = 110.0 + 160.0 * k as f64;
        let at = |p: &Point3<f64>| {
            let x = center + 210.0 * (p.x - moment.world_from_body.translation.x);
            format!("{x:.1},{:.1}", 400.0 - 210.0 * p.z)
        };
        let corner = |x: f64, z: f64| at(&(moment.world_from_body * Point3::new(x, 0.0, z)));
        writeln!(
            svg,
            "<polygon points=\"{} {} {} {}\" fill=\"#ddd\" stroke=\"#888\"/>",
            corner(-0.19, -0.05),
            corner(0.19, -0.05),
            corner(0.19, 0.05),
            corner(-0.19, 0.05)
        )?;
        for near in [false, true] {
            for (leg, joints) in moment.legs.iter().enumerate() {
                let is_near = robot.legs[leg].hip_offset_m < 0.0;
                if is_near == near {
                    let points: Vec<String> = joints[1..].iter().map(at).collect();
                    let opacity = if near { 1.0 } else { 0.4 };
                    writeln!(
                        svg,
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"5\" stroke-linecap=\"round\" stroke-linejoin=\"round\" opacity=\"{opacity}\"/>",
                        points.join(" "),
                        color(robot, leg)
                    )?;
                }
            }
        }
        writeln!(svg, "<text x=\"{center:.0}\" y=\"424\" text-anchor=\"middle\">{:.2} s</text>", moment.t_s)?;
    }
    writeln!(svg, "<line x1=\"20\" x2=\"{}\" y1=\"406\" y2=\"406\" stroke=\"#444\"/>", width - 20.0)?;

    // Footprints.
    writeln!(svg, "{}", title(460.0, "Footprints from above, and the way of the body"))?;
    let scale = 300.0;
    let at = |p: &Point2<f64>| (120.0 + scale * p.x, 720.0 - scale * p.y);
    let way: Vec<String> =
        moments.iter().map(|moment| at(&place(moment))).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    writeln!(svg, "<polyline points=\"{}\" fill=\"none\" stroke=\"#999\" stroke-width=\"2\"/>", way.join(" "))?;
    for leg in 0..robot.legs.len() {
        let is_front = robot.legs[leg].hip_in_body.x > 0.0;
        for print in footprints(moments, leg) {
            let (x, y) = at(&print);
            let fill = if is_front { color(robot, leg) } else { "white" };
            writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{fill}\" stroke=\"{}\" stroke-width=\"2\"/>",
                color(robot, leg)
            )?;
        }
    }
    writeln!(
        svg,
        "<text x=\"{}\" y=\"560\">filled: front feet</text><text x=\"{}\" y=\"580\">open: rear feet</text>",
        width - 150.0,
        width - 150.0
    )?;

    // Angles of the first leg.
    writeln!(svg, "{}", title(790.0, &format!("Angles of {} (rad)", robot.legs[0].name)))?;
    let y_of = |angle: f64| 860.0 - 26.0 * (angle + 0.4);
    let curves = [("hip", "#2a8a4a"), ("thigh", "#1f6feb"), ("calf", "#8a2a6a")];
    for (k, (slot, (joint, stroke))) in robot.legs[0].slots.iter().zip(curves).enumerate() {
        writeln!(svg, "<text x=\"{}\" y=\"790\" fill=\"{stroke}\">{joint}</text>", 220 + 60 * k)?;
        let points: Vec<String> =
            moments.iter().map(|m| format!("{:.1},{:.1}", x_of(m.t_s), y_of(m.angles[*slot]))).collect();
        writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"2\"/>",
            points.join(" ")
        )?;
    }
    for angle in [-2.0, -1.0, 0.0, 1.0] {
        writeln!(svg, "<text x=\"36\" y=\"{:.0}\">{angle}</text>", y_of(angle) + 4.0)?;
    }
    time_axis(&mut svg, 925.0, end_s, &x_of)?;
    svg += "</svg>\n";
    Ok(svg)
}

fn time_axis(svg: &mut String, y: f64, end_s: f64, x_of: &dyn Fn(f64) -> f64) -> std::fmt::Result {
    for half in 0..=(2.0 * end_s) as usize {
        let t_s = 0.5 * half as f64;
        let x = x_of(t_s);
        writeln!(svg, "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{y}\" y2=\"{}\" stroke=\"#444\"/>", y + 5.0)?;
        writeln!(svg, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{t_s}</text>", y + 19.0)?;
    }
    Ok(())
}
