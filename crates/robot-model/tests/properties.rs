//! Laws of robot models.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use robot_model::envelope::{convex_hull, envelope};
use robot_model::{
    CollisionShape, Geometry, Joint, JointKind, KinematicTree, Link, MassProperties, RobotModel, merged_bodies,
    quadrotor_texts, quadruped_texts,
};
use std::sync::LazyLock;

/// Parsed once: the XML reader is not optimised in test builds.
static QUADRUPED: LazyLock<RobotModel> = LazyLock::new(RobotModel::builtin_quadruped);

/// Double rounding over a dozen products of numbers of size 1 to 10.
const TOL: f64 = 1e-10;

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    let angle = prop_oneof![Just(0.0), Just(std::f64::consts::FRAC_PI_2), Just(std::f64::consts::PI), -3.2..3.2f64];
    let position = prop_oneof![Just(0.0), -2.0..2.0f64];
    ([position.clone(), position.clone(), position], [angle.clone(), angle.clone(), angle]).prop_map(|(p, a)| {
        Isometry3::from_parts(Translation3::new(p[0], p[1], p[2]), UnitQuaternion::from_euler_angles(a[0], a[1], a[2]))
    })
}

fn geometry() -> impl Strategy<Value = Geometry> {
    let size = || 0.01..1.0f64;
    prop_oneof![
        [size(), size(), size()].prop_map(|half| Geometry::Box { half: Vector3::from(half) }),
        [size(), size()].prop_map(|[radius, half_length]| Geometry::Cylinder { radius, half_length }),
        size().prop_map(|radius| Geometry::Sphere { radius }),
        prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -1.0..1.0], 4..12)
            .prop_map(|points| { Geometry::ConvexHull(points.into_iter().map(Point3::from).collect()) }),
    ]
}

/// A point of the shape for each triple of numbers in [0, 1].
fn point_in(geometry: &Geometry, [a, b, c]: [f64; 3]) -> Point3<f64> {
    let angle = a * std::f64::consts::TAU;
    match geometry {
        Geometry::Box { half } => {
            Point3::from(Vector3::new(2.0 * a - 1.0, 2.0 * b - 1.0, 2.0 * c - 1.0).component_mul(half))
        }
        Geometry::Cylinder { radius, half_length } => {
            Point3::new(radius * b * angle.cos(), radius * b * angle.sin(), half_length * (2.0 * c - 1.0))
        }
        Geometry::Sphere { radius } => {
            let z = 2.0 * b - 1.0;
            let ring = (1.0 - z * z).sqrt();
            Point3::from(Vector3::new(ring * angle.cos(), ring * angle.sin(), z) * (radius * c))
        }
        Geometry::ConvexHull(points) => {
            let pick = |t: f64| points[((t * points.len() as f64) as usize).min(points.len() - 1)].coords;
            Point3::from(pick(a) * c + pick(b) * (1.0 - c))
        }
    }
}

/// Mass properties of a few point masses: always possible ones.
fn mass() -> impl Strategy<Value = MassProperties> {
    prop::collection::vec((0.0..5.0f64, [-1.0..1.0f64, -1.0..1.0, -1.0..1.0]), 0..4).prop_map(|points| {
        let parts: Vec<MassProperties> = points
            .into_iter()
            .map(|(mass_kg, p)| MassProperties { mass_kg, center_of_mass: Point3::from(p), inertia: Matrix3::zeros() })
            .collect();
        MassProperties::combined(&parts)
    })
}

/// A random tree: link `i + 1` hangs on a link before it.
fn tree() -> impl Strategy<Value = KinematicTree> {
    let kind = prop_oneof![
        2 => Just(JointKind::Fixed), 1 => Just(JointKind::Revolute), 1 => Just(JointKind::Continuous), 1 => Just(JointKind::Prismatic)
    ];
    let below = prop::collection::vec((any::<prop::sample::Index>(), kind, pose(), 0..3usize, mass()), 0..8);
    (mass(), below).prop_map(|(root_mass, below)| {
        let link = |index: usize, mass| Link { name: format!("link{index}"), mass, shapes: Vec::new() };
        let mut links = vec![link(0, root_mass)];
        let mut joints = Vec::new();
        for (index, (parent, kind, parent_from_joint, axis, mass)) in below.into_iter().enumerate() {
            links.push(link(index + 1, mass));
            joints.push(Joint {
                name: format!("joint{index}"),
                kind,
                parent: parent.index(index + 1),
                child: index + 1,
                parent_from_joint,
                axis: [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][axis],
                lower: None,
                upper: None,
                max_effort: None,
                max_velocity: None,
            });
        }
        KinematicTree::new(links, joints).expect("a tree by construction")
    })
}

fn close(a: &MassProperties, b: &MassProperties) -> bool {
    (a.mass_kg - b.mass_kg).abs() < TOL
        && (a.mass_kg < TOL || (a.center_of_mass - b.center_of_mass).norm() < 1e-8)
        && (a.inertia - b.inertia).norm() < TOL * 100.0 * (1.0 + a.mass_kg)
}

mod inertia {
    use super::*;
    proptest! {
        #[test]
        fn combining_is_independent_of_grouping_and_order(a in mass(), b in mass(), c in mass()) {
            let left = MassProperties::combined(&[MassProperties::combined(&[a, b]), c]);
            let right = MassProperties::combined(&[c, MassProperties::combined(&[b, a])]);
            prop_assert!(close(&left, &right), "{left:?} {right:?}");
        }

        #[test]
        fn moving_and_combining_commute(a in mass(), b in mass(), pose in pose()) {
            let moved_last = MassProperties::combined(&[a, b]).in_frame(&pose);
            let moved_first = MassProperties::combined(&[a.in_frame(&pose), b.in_frame(&pose)]);
            prop_assert!(close(&moved_last, &moved_first));
        }

        #[test]
        fn possible_bodies_pass_the_check(a in mass(), pose in pose()) {
            prop_assert_eq!(a.in_frame(&pose).check(), Ok(()));
        }

        #[test]
        fn principal_moments_do_not_depend_on_the_frame(a in mass(), pose in pose()) {
            let (before, after) = (a.principal_moments(), a.in_frame(&pose).principal_moments());
            prop_assert!(before.iter().zip(after).all(|(x, y)| (x - y).abs() < 1e-8), "{before:?} {after:?}");
        }
    }
}

mod shapes {
    use super::*;
    proptest! {
        #[test]
        fn the_envelope_holds_every_point(
            shapes in prop::collection::vec((pose(), geometry()), 1..5), samples in prop::collection::vec([0.0..=1.0f64, 0.0..=1.0, 0.0..=1.0], 8)
        ) {
            let shapes: Vec<CollisionShape> = shapes
                .into_iter().map(|(body_from_shape, geometry)| CollisionShape { link: "a".into(), body_from_shape, geometry }).collect();
            let found = envelope(&shapes).expect("shapes");
            for shape in &shapes {
                for sample in &samples {
                    let p = shape.body_from_shape * point_in(&shape.geometry, *sample);
                    prop_assert!(p.z >= found.height_span_m.0 - TOL && p.z <= found.height_span_m.1 + TOL);
                    prop_assert!(p.coords.norm() <= found.bounding_sphere_radius_m + TOL);
                    prop_assert!(p.xy().coords.norm() <= found.circumscribed_radius_m + TOL);
                    let next = found.footprint.iter().cycle().skip(1);
                    for (a, b) in found.footprint.iter().zip(next) {
                        prop_assert!((b - a).perp(&(p.xy() - a)) >= -1e-9, "{p} is outside the edge {a} {b}");
                    }
                }
            }
            prop_assert!(found.inscribed_radius_m <= found.circumscribed_radius_m);
        }

        #[test]
        fn support_is_the_largest_reach(
            geometry in geometry(), pose in pose(), d in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0], sample in [0.0..=1.0f64, 0.0..=1.0, 0.0..=1.0]
        ) {
            let d = Vector3::from(d);
            prop_assert!((pose * point_in(&geometry, sample)).coords.dot(&d) <= geometry.support(&pose, &d) + TOL);
            // The polygon round the shape reaches as far, and at most 0.5 % of the size of the shape further.
            let in_plane = Vector3::new(d.x, d.y, 0.0);
            let outline = geometry.outline(&pose).iter().map(|p| p.coords.dot(&in_plane)).fold(f64::NEG_INFINITY, f64::max);
            let exact = geometry.support(&pose, &in_plane);
            prop_assert!(outline >= exact - TOL && outline <= exact + 0.005 * in_plane.norm() + TOL, "{outline} for {exact}");
        }

        #[test]
        fn a_swept_shape_holds_every_turn_of_it(
            geometry in geometry(), pose in pose(), turn in -4.0..4.0f64, sample in [0.0..=1.0f64, 0.0..=1.0, 0.0..=1.0], axis in 0..3usize
        ) {
            let axis = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][axis];
            let swept = geometry.swept_about(&axis, &pose);
            let p = UnitQuaternion::from_axis_angle(&axis, turn) * (pose * point_in(&geometry, sample)).coords;
            let height = p.dot(&axis);
            prop_assert!(height >= swept.low - TOL && height <= swept.high + TOL);
            prop_assert!((p - axis.scale(height)).norm() <= swept.radius + TOL);
        }

        #[test]
        fn the_hull_of_a_hull_is_itself(points in prop::collection::vec([-2..3i32, -2..3], 0..20)) {
            let points: Vec<_> = points.into_iter().map(|[x, y]| nalgebra::Point2::new(f64::from(x), f64::from(y))).collect();
            let hull = convex_hull(points.clone());
            prop_assert_eq!(convex_hull(hull.clone()), hull.clone());
            prop_assert!(hull.iter().all(|corner| points.contains(corner)));
        }
    }
}

mod trees {
    use super::*;

    fn with_angles() -> impl Strategy<Value = (KinematicTree, Vec<f64>)> {
        tree().prop_flat_map(|tree| {
            let count = tree.moving_joints().len();
            (Just(tree), prop::collection::vec(-4.0..4.0f64, count))
        })
    }

    proptest! {
        #[test]
        fn merging_keeps_mass_and_frames((tree, angles) in with_angles()) {
            let poses = tree.body_from_links(&angles).expect("finite angles");
            let bodies = merged_bodies(&tree);
            prop_assert_eq!(bodies.len(), 1 + tree.moving_joints().len());
            let mut body_poses: Vec<Isometry3<f64>> = Vec::new();
            for body in &bodies {
                let pose = body.joint.zip(body.parent).map_or(Isometry3::identity(), |(joint, (parent, parent_from_joint))| {
                    let slot = tree.moving_joints().iter().position(|moving| *moving == joint).expect("a moving joint");
                    let at_body = Joint { parent_from_joint, ..tree.joints()[joint].clone() };
                    body_poses[parent] * at_body.parent_from_child(angles[slot])
                });
                for (link, body_from_link) in &body.links {
                    let expected = (pose * body_from_link).to_homogeneous();
                    prop_assert!((expected - poses[*link].to_homogeneous()).norm() < 1e-9);
                }
                body_poses.push(pose);
            }
            let parts: Vec<_> = bodies.iter().zip(&body_poses).map(|(body, pose)| body.mass.in_frame(pose)).collect();
            prop_assert!(close(&MassProperties::combined(&parts), &tree.mass_properties(&angles).expect("finite angles")));
        }

        #[test]
        fn a_full_turn_changes_nothing((tree, mut angles) in with_angles(), which in any::<prop::sample::Index>()) {
            let before = tree.body_from_links(&angles).expect("finite angles");
            if !angles.is_empty() {
                let slot = which.index(angles.len());
                if tree.joints()[tree.moving_joints()[slot]].kind != JointKind::Prismatic {
                    angles[slot] += std::f64::consts::TAU;
                }
            }
            let after = tree.body_from_links(&angles).expect("finite angles");
            prop_assert!(before.iter().zip(&after).all(|(a, b)| (a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-9));
        }
    }
}

mod legs {
    use super::*;
    proptest! {
        /// A few millimetres from the stretched leg the angles lose digits as the square root; 1e-7 rad is far below any encoder.
        #[test]
        fn inverse_undoes_forward(hip in -1.0..1.0f64, thigh in -0.5..1.5f64, calf in -2.7..-0.84f64, leg in 0..4usize) {
            let robot = &*QUADRUPED;
            let leg = &robot.legs[leg];
            let mut angles = robot.stance.clone();
            for (slot, angle) in leg.slots.iter().zip([hip, thigh, calf]) {
                angles[*slot] = angle;
            }
            let foot = robot.tree.link_named(&leg.foot).expect("the foot");
            let foot_in_body = Point3::from(robot.tree.body_from_links(&angles).expect("finite")[foot].translation.vector);
            // With the foot above the hip axis another hip angle reaches it too; only the leg below is the law's subject.
            let below = -leg.thigh_length_m * thigh.cos() - leg.calf_length_m * (thigh + calf).cos();
            prop_assume!(below < -1e-3);
            let found = leg.inverse(&foot_in_body).expect("within reach and limits");
            let error = found.iter().zip([hip, thigh, calf]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            prop_assert!(error < 1e-7, "{found:?} for {:?}", [hip, thigh, calf]);
        }

        #[test]
        fn far_points_are_out_of_reach(x in 0.5..5.0f64, leg in 0..4usize) {
            let robot = &*QUADRUPED;
            prop_assert_eq!(robot.legs[leg].inverse(&(robot.legs[leg].hip_in_body + Vector3::new(x, 0.0, 0.0))), None);
        }
    }
}

mod hostile_text {
    use super::*;

    /// The text with a few bytes cut, doubled or replaced.
    fn damaged(text: &'static str) -> impl Strategy<Value = String> {
        let piece = prop_oneof![
            Just(""),
            Just("<"),
            Just(">"),
            Just("\""),
            Just("nan"),
            Just("-1"),
            Just("1e400"),
            Just("<link name='x'/>"),
            Just("</link>"),
            Just("&a;"),
            Just("\u{fffd}"),
            Just("[[rotors]]\n"),
            Just("=")
        ];
        prop::collection::vec((any::<prop::sample::Index>(), 0..30usize, piece), 1..4).prop_map(move |edits| {
            let mut text = text.to_owned();
            for (at, cut, piece) in edits {
                let mut start = at.index(text.len() + 1);
                while !text.is_char_boundary(start) {
                    start -= 1;
                }
                let mut end = (start + cut).min(text.len());
                while !text.is_char_boundary(end) {
                    end += 1;
                }
                text.replace_range(start..end, piece);
            }
            text
        })
    }

    fn is_finite(robot: &RobotModel) -> bool {
        robot.mass_kg > 0.0
            && robot.inertia.iter().all(|v| v.is_finite())
            && robot.footprint.iter().all(|p| p.coords.iter().all(|v| v.is_finite()))
            && robot.circumscribed_radius_m.is_finite()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        #[test]
        fn damaged_urdf_never_panics(urdf in prop_oneof![damaged(quadruped_texts().0), damaged(quadrotor_texts().0)]) {
            let toml = robot_model::robot_name(&urdf).and_then(|name| robot_model::builtin_toml(&name)).unwrap_or("");
            match RobotModel::parse(&urdf, toml, &|_| None) {
                Ok(robot) => prop_assert!(is_finite(&robot)),
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
        }

        #[test]
        fn damaged_toml_never_panics(toml in damaged(quadrotor_texts().1)) {
            match RobotModel::parse(quadrotor_texts().0, &toml, &|_| None) {
                Ok(robot) => prop_assert!(is_finite(&robot)),
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
        }

        #[test]
        fn any_text_never_panics(urdf in ".{0,200}", toml in ".{0,100}") {
            prop_assert!(RobotModel::parse(&urdf, &toml, &|_| None).is_err());
        }

        #[test]
        fn any_mesh_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..400), name in "[a-c]\\.(stl|obj|STL|dae)?") {
            let _ = robot_model::mesh::vertices(&name, &bytes, &Vector3::repeat(1.0));
        }
    }

    #[test]
    fn deep_nesting_and_entity_bombs_do_no_harm() {
        let deep = format!("<robot name='r'>{}{}</robot>", "<a>".repeat(100_000), "</a>".repeat(100_000));
        assert!(RobotModel::parse(&deep, "", &|_| None).is_err());
        let bomb =
            "<!DOCTYPE r [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]><robot name='&b;'><link name='&b;'/></robot>";
        assert!(RobotModel::parse(bomb, "", &|_| None).is_err());
        let huge = " ".repeat(17 << 20);
        assert!(matches!(RobotModel::parse(&huge, "", &|_| None), Err(robot_model::ModelError::TooLarge { .. })));
    }

    /// A chain of links as long as a file may be is walked without recursion.
    #[test]
    fn a_long_chain_is_read_in_reasonable_time() {
        let mut body = String::from(
            "<link name='l0'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial><collision><geometry><sphere radius='1'/></geometry></collision></link>",
        );
        for i in 1..2000 {
            body += &format!(
                "<link name='l{i}'/><joint name='j{i}' type='fixed'><parent link='l{}'/><child link='l{i}'/></joint>",
                i - 1
            );
        }
        let urdf = format!("<robot name='chain'>{body}</robot>");
        assert!(matches!(RobotModel::parse(&urdf, "", &|_| None), Err(robot_model::ModelError::MissingKeys { .. })));
    }
}
