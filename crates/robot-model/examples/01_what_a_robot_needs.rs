//! What must a planner know of a robot, and where does it come from?
//!
//! A door is 0.80 m wide and a table top hangs at 0.70 m. Whether a robot fits is decided by its own description: the URDF gives
//! collision shapes, masses and joints, a small TOML gives what a URDF has no words for. We ask two robots the same questions and
//! then give one of them a taller mast, without touching any code.

use robot_model::{ModelError, RobotModel, quadruped_texts};

const DOOR_WIDTH_M: f64 = 0.80;
const TABLE_HEIGHT_M: f64 = 0.70;

fn main() -> Result<(), ModelError> {
    // 1. A URDF alone is refused, with a sentence that says what to write.
    let (urdf, toml) = quadruped_texts();
    let refusal = RobotModel::parse(urdf, "kind = \"ground\"", &|_mesh| None)
        .expect_err("no speeds, stance or sensors are known");
    println!("1. without a TOML: {refusal}\n");

    // 2. With it the whole robot is known.
    let walker = RobotModel::parse(urdf, toml, &|_mesh| None)?;
    let flyer = RobotModel::builtin_quadrotor();
    for robot in [&walker, &flyer] {
        println!(
            "2. {} weighs {:.2} kg; centre of mass {:.3} m above the body origin",
            robot.name, robot.mass_kg, robot.center_of_mass.z
        );
        println!(
            "   footprint of {} corners, turns in place within {:.3} m",
            robot.footprint.len(),
            robot.circumscribed_radius_m
        );
        println!(
            "   camera {:.2} m above the floor",
            robot.stance_height_m + robot.sensors.body_from_camera.translation.z
        );
    }

    // 3. The door: a robot that turns while it passes needs twice its circumscribed radius.
    for robot in [&walker, &flyer] {
        let swept_m = 2.0 * robot.circumscribed_radius_m;
        println!(
            "3. {} sweeps {swept_m:.3} m: {} the door",
            robot.name,
            if swept_m < DOOR_WIDTH_M { "fits through" } else { "must turn before" }
        );
    }

    // 4. The table: the mast counts.
    let height_m = walker.height_span_m.1 - walker.height_span_m.0;
    println!("4. the walker is {height_m:.2} m high and the table top hangs at {TABLE_HEIGHT_M:.2} m: it goes round");

    // 5. Another description is another robot: a bag on a stick makes it taller and heavier.
    let bag = "\n[[payload]]\nname = \"bag\"\nlink = \"trunk\"\nxyz_m = [-0.1, 0.0, 0.6]\nshape = { sphere = { radius_m = 0.1 } }\nmass_kg = 1.0\n";
    let loaded = RobotModel::parse(urdf, &format!("{toml}{bag}"), &|_mesh| None)?;
    println!("5. with a bag: {:.2} kg, {:.2} m high", loaded.mass_kg, loaded.height_span_m.1 - loaded.height_span_m.0);

    // 6. Legs: lower the trunk by 5 cm with the feet where they are.
    let leg = &walker.legs[0];
    let foot = walker.frames[&leg.foot].translation.vector;
    let crouched =
        leg.inverse(&nalgebra::Point3::from(foot + nalgebra::Vector3::new(0.0, 0.0, 0.05))).expect("within reach");
    println!(
        "6. {} leg crouches with hip {:.2}, thigh {:.2}, calf {:.2} rad",
        leg.name, crouched[0], crouched[1], crouched[2]
    );

    assert!(height_m > TABLE_HEIGHT_M && loaded.mass_kg > walker.mass_kg + 0.99);
    assert!(crouched[2] < walker.stance[leg.slots[2]], "the knee bends more");
    Ok(())
}
