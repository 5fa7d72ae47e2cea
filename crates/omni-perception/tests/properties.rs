//! Laws of time, motion, projection and masks.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::*;
use proptest::prelude::*;

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    (vector(5.0), vector(3.0)).prop_map(|(position, axis)| {
        Isometry3::from_parts(Translation3::from(position), UnitQuaternion::from_scaled_axis(axis))
    })
}

fn estimate() -> impl Strategy<Value = OdometryEstimate> {
    (pose(), vector(3.0), vector(8.0)).prop_map(|(pose, velocity, rate)| OdometryEstimate {
        velocity_in_world_mps: velocity,
        angular_velocity_in_body_radps: rate,
        ..OdometryEstimate::at_rest(Stamp(7_000_000_000), pose)
    })
}

fn scan() -> impl Strategy<Value = RawScan> {
    let point = (prop::array::uniform3(-20.0..20.0_f32), 0..100_000_000_u32, 0..32_u16)
        .prop_map(|(p, offset_ns, ring)| RawPoint { position: Point3::from(p), offset_ns, ring });
    prop::collection::vec(point, 0..60).prop_map(|points| RawScan { start: Stamp(7_000_000_000), points })
}

fn mount() -> impl Strategy<Value = RotatingMount> {
    (pose(), pose())
        .prop_map(|(body_from_stator, rotor_from_sensor)| RotatingMount { body_from_stator, rotor_from_sensor })
}

/// Encoder at 500 Hz over the time of [`scan`], turning at a constant rate below half a turn a sample.
fn encoder(rate_radps: f64) -> EncoderTrack {
    let sample = |k: i64| EncoderSample {
        stamp: Stamp(7_000_000_000 + 2_000_000 * k),
        angle_rad: (rate_radps * 0.002 * k as f64).rem_euclid(std::f64::consts::TAU),
    };
    EncoderTrack::from_samples(&(0..=50).map(sample).collect::<Vec<_>>()).expect("advances")
}

mod motion {
    use super::*;

    /// Single precision at 40 m.
    const POINT_TOL_M: f32 = 5e-5;
    /// The table blends turns of up to 14 rad/s (body and motor) over 0.25 ms: 1.5e-6 of 40 m, and single precision.
    const TABLE_TOL_M: f32 = 2e-4;

    proptest! {
        #[test]
        fn fast_deskew_equals_the_plain_one(
            scan in scan(), start in estimate(), mount in mount(), rate in -6.0..6.0_f64
        ) {
            let trajectory = Trajectory::from_constant_twist(&start, 0.1).expect("finite");
            let (config, encoder) = (DeskewConfig::default(), encoder(rate));
            let run = |f: DeskewFn| f(&scan, &encoder, &mount, &trajectory, ReferenceTime::Mid, &config).expect("inside");
            let (fast, plain) = (run(deskew), run(deskew_exactly));
            prop_assert_eq!(&fast.offsets_ns, &plain.offsets_ns);
            prop_assert_eq!(fast.dropped, plain.dropped);
            for (a, b) in fast.points_in_body.iter().zip(&plain.points_in_body) {
                prop_assert!((a - b).norm() < TABLE_TOL_M, "{} {}", a, b);
            }
        }

        #[test]
        fn eq_1_deskew_undoes_a_constant_twist(
            start in estimate(), mount in mount(), world in prop::collection::vec(vector(15.0), 1..30), rate in -6.0..6.0_f64
        ) {
            // World points seen from the moving sensor, each at its own time, come back as the same world points.
            let sensed = |(k, p): (usize, &Vector3<f64>)| {
                let dt_s = 0.003 * k as f64;
                let turn = UnitQuaternion::from_scaled_axis(start.angular_velocity_in_body_radps * dt_s);
                let position = start.world_from_body.translation.vector + start.velocity_in_world_mps * dt_s;
                let world_from_body =
                    Isometry3::from_parts(Translation3::from(position), start.world_from_body.rotation * turn);
                let world_from_sensor = world_from_body * mount.body_from_sensor(rate * dt_s);
                let position = world_from_sensor.inverse() * Point3::from(*p);
                RawPoint { position: position.cast(), offset_ns: 3_000_000 * k as u32, ring: 0 }
            };
            let scan = RawScan { start: start.stamp, points: world.iter().enumerate().map(sensed).collect() };
            let trajectory = Trajectory::from_constant_twist(&start, 0.1).expect("finite");
            let config = DeskewConfig { min_range_m: 0.0, ..DeskewConfig::default() };
            for reference in [ReferenceTime::Start, ReferenceTime::Mid, ReferenceTime::End] {
                let result = deskew_exactly(&scan, &encoder(rate), &mount, &trajectory, reference, &config).expect("inside");
                for (back, truth) in result.points_in_world().iter().zip(&world) {
                    prop_assert!((back.coords - truth.cast::<f32>()).norm() < POINT_TOL_M);
                }
            }
        }

        #[test]
        fn moving_the_world_moves_the_pose_and_not_the_scan(scan in scan(), start in estimate(), mount in mount(), moved in pose()) {
            let shifted = OdometryEstimate {
                world_from_body: moved * start.world_from_body,
                velocity_in_world_mps: moved.rotation * start.velocity_in_world_mps,
                ..start
            };
            let run = |start: &OdometryEstimate| {
                let trajectory = Trajectory::from_constant_twist(start, 0.1).expect("finite");
                let config = DeskewConfig::default();
                deskew(&scan, &EncoderTrack::fixed(), &mount, &trajectory, ReferenceTime::Start, &config).expect("inside")
            };
            let (here, there) = (run(&start), run(&shifted));
            prop_assert!((moved * here.world_from_body).rotation.angle_to(&there.world_from_body.rotation) < 1e-9);
            for (a, b) in here.points_in_body.iter().zip(&there.points_in_body) {
                prop_assert!((a - b).norm() < POINT_TOL_M);
            }
        }

        #[test]
        fn every_point_is_kept_or_counted(scan in scan(), start in estimate(), duration_s in 0.0..0.1_f64, min in 0.0..20.0_f32) {
            let trajectory = Trajectory::from_constant_twist(&start, duration_s.max(1e-6)).expect("finite");
            let identity = RotatingMount { body_from_stator: Isometry3::identity(), rotor_from_sensor: Isometry3::identity() };
            let config = DeskewConfig { min_range_m: min, max_range_m: 25.0 };
            let result = deskew(&scan, &EncoderTrack::fixed(), &identity, &trajectory, ReferenceTime::Start, &config);
            let result = result.expect("the start is inside");
            let dropped = result.dropped;
            let sum = dropped.non_finite + dropped.outside_time + dropped.too_near + dropped.too_far;
            prop_assert_eq!(sum + result.points_in_body.len(), scan.points.len());
            prop_assert_eq!(result.rings.len(), result.points_in_body.len());
        }

        #[test]
        fn the_trajectory_passes_through_its_knots(a in estimate(), b in estimate(), ns in 1..200_000_000_i64) {
            let b = OdometryEstimate { stamp: a.stamp.plus_ns(ns), ..b };
            let trajectory = Trajectory::from_estimates(&[a, b]).expect("advances");
            for knot in [a, b] {
                let pose = trajectory.world_from_body(knot.stamp).expect("a knot");
                prop_assert!((pose.translation.vector - knot.world_from_body.translation.vector).norm() < 1e-9);
                prop_assert!(pose.rotation.angle_to(&knot.world_from_body.rotation) < 1e-7);
            }
        }
    }

    type DeskewFn = fn(
        &RawScan,
        &EncoderTrack,
        &RotatingMount,
        &Trajectory,
        ReferenceTime,
        &DeskewConfig,
    ) -> Result<DeskewedScan, DeskewError>;
}

mod projection {
    use super::*;

    fn camera() -> impl Strategy<Value = Equirectangular> {
        (1..3000_u32, 1..1000_u32, -1.57..1.5_f64, 0.01..3.0_f64).prop_map(|(width_px, height_px, bottom, span)| {
            let phi_top_rad = (bottom + span).min(1.57);
            Equirectangular { width_px, height_px, phi_top_rad, phi_bottom_rad: bottom }
        })
    }

    proptest! {
        #[test]
        fn a_pixel_sees_the_direction_that_falls_on_it(camera in camera(), across in 0.0..1.0_f64, down in 0.001..0.999_f64, range in 0.1..50.0_f64) {
            prop_assert_eq!(camera.validate(), Ok(()));
            let (width, height) = (f64::from(camera.width_px), f64::from(camera.height_px));
            let (u, v) = (across * width, down * height);
            let direction = camera.unproject(u, v);
            let pixel = camera.project(&Point3::from(direction.into_inner() * range)).expect("inside");
            // Near the poles a tiny rounding turns far: compare directions, not columns.
            let back = camera.unproject(pixel.u, pixel.v);
            prop_assert!(direction.angle(&back) < 1e-7);
            prop_assert!((0.0..width).contains(&pixel.u) && (0.0..height).contains(&pixel.v));
        }

        #[test]
        fn turning_left_by_a_column_moves_the_picture_right(across in 0.0..1.0_f64, v in 1.0..639.0_f64, columns in 0..1920_u32) {
            let camera = Equirectangular::default();
            let point = Point3::from(camera.unproject(across * 1920.0, v).into_inner());
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, camera.column_angle_rad() * f64::from(columns));
            let (before, after) = (camera.project(&point).expect("inside"), camera.project(&(turn.inverse() * point)).expect("inside"));
            let moved = (after.u - before.u - f64::from(columns)).rem_euclid(1920.0);
            prop_assert!(moved.min(1920.0 - moved) < 1e-6);
            prop_assert!((after.v - before.v).abs() < 1e-6);
        }
    }
}

mod masks {
    use super::*;

    fn bitmap() -> impl Strategy<Value = (u32, u32, Vec<bool>)> {
        (1..12_u32, 1..12_u32).prop_flat_map(|(width, height)| {
            let pixels = (width * height) as usize;
            let rows = prop_oneof![
                prop::collection::vec(any::<bool>(), pixels),
                prop::collection::vec(prop::bool::weighted(0.85), pixels),
                Just(vec![false; pixels]),
                Just(vec![true; pixels]),
            ];
            (Just(width), Just(height), rows)
        })
    }

    fn mask(rle: Rle) -> Mask {
        Mask::new(rle, "thing", 0.5)
    }

    proptest! {
        #[test]
        fn every_form_of_a_mask_says_the_same((width, height, rows) in bitmap()) {
            let rle = Rle::from_rows(width, height, &rows).expect("sound");
            prop_assert_eq!(&Rle::from_counts(width, height, &rle.counts()).expect("sound"), &rle);
            prop_assert_eq!(&Rle::from_coco_string(width, height, &rle.to_coco_string()).expect("sound"), &rle);
            let mut painted = vec![false; rows.len()];
            for span in rle.spans() {
                for row in span.top..span.bottom {
                    let pixel = &mut painted[(row * width + span.column) as usize];
                    prop_assert!(!*pixel);
                    *pixel = true;
                }
            }
            prop_assert_eq!(&painted, &rows);
            // In any order, and each span given twice.
            let spans: Vec<Span> = rle.spans().chain(rle.spans()).collect();
            let again = Rle::from_spans(width, height, spans.into_iter().rev().collect()).expect("inside");
            prop_assert_eq!(again.counts(), Rle::from_rows(width, height, &rows).expect("sound").counts());
            if let Some([left, top, right, bottom]) = rle.bounds() {
                let inside = (top..bottom).flat_map(|row| (left..right).map(move |column| (column, row)));
                prop_assert_eq!(inside.filter(|&(column, row)| rle.contains(column, row)).count() as u64, rle.area());
            } else {
                prop_assert_eq!(rle.area(), 0);
            }
            for row in 0..height {
                for column in 0..width {
                    prop_assert_eq!(rle.contains(column, row), rows[(row * width + column) as usize]);
                }
            }
            prop_assert_eq!(rle.area(), rows.iter().filter(|set| **set).count() as u64);
        }

        #[test]
        fn hostile_strings_never_panic(width in 0..40_000_u32, height in 0..40_000_u32, text in "[ -~]{0,40}") {
            let _ = Rle::from_coco_string(width, height, &text);
        }

        #[test]
        fn hostile_counts_never_panic(width in 0..9_u32, height in 0..9_u32, counts in prop::collection::vec(any::<u32>(), 0..6)) {
            let _ = Rle::from_counts(width, height, &counts);
        }

        #[test]
        fn a_label_means_that_the_pixel_is_in_the_eroded_mask(
            (width, height, rows) in bitmap(), radius in 0..3_u32,
            pixels in prop::collection::vec((0.0..1.0_f64, 0.0..1.0_f64), 0..20)
        ) {
            let camera = Equirectangular { width_px: width, height_px: height, ..Default::default() };
            // All points at one range; nothing hides, nothing is behind.
            let config = LabelConfig {
                erosion_px: radius, min_kept_share: 0.0, link_spacings: 1e3, near_share: 0.0, depth_ratio: 1e3, ..Default::default()
            };
            let points: Vec<Point3<f32>> = pixels
                .iter()
                .map(|(u, v)| camera.unproject(u * f64::from(width), v * f64::from(height)).into_inner() * 3.0)
                .map(|p| Point3::from(p).cast())
                .collect();
            let masks = [mask(Rle::from_rows(width, height, &rows).expect("sound"))];
            let labels = label_points(&points, &camera, &masks, &config);
            let is_set = |u: i64, v: i64| {
                let (width, height) = (i64::from(width), i64::from(height));
                // Above and below the image nothing is known; columns wrap.
                !(0..height).contains(&v) || rows[(v * width + u.rem_euclid(width)) as usize]
            };
            let reach = i64::from(radius).min(i64::from(width) - 1);
            let survives = |radius: i64, u: i64, v: i64| {
                (-reach..=reach).all(|du| {
                    let reach = ((radius * radius - du * du).max(0) as f64).sqrt() as i64;
                    du.abs() > radius || (-reach..=reach).all(|dv| is_set(u + du, v + dv))
                })
            };
            let all = || (0..i64::from(width)).flat_map(|u| (0..i64::from(height)).map(move |v| (u, v)));
            // The largest radius that leaves anything.
            let used = (0..=i64::from(radius)).rev().find(|&r| all().any(|(u, v)| survives(r, u, v))).unwrap_or(0);
            for ((point, label), pixel) in points.iter().zip(&labels).zip(&pixels) {
                let Some(at) = camera.project(&point.cast()) else { continue };
                // On the border between two pixels either may win.
                let off = |x: f64| (x - x.round()).abs() < 1e-3;
                if off(at.u) || off(at.v) || off(pixel.0 * f64::from(width)) {
                    continue;
                }
                prop_assert_eq!(label.is_some(), survives(used, at.u as i64, at.v as i64), "{:?}", at);
            }
        }

        #[test]
        fn the_order_of_the_points_does_not_matter(
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f32), 0..60), seed in any::<u64>()
        ) {
            let camera = Equirectangular { width_px: 24, height_px: 8, ..Default::default() };
            let rows: Vec<bool> = (0..24 * 8).map(|i| seed >> (i % 61) & 3 != 0).collect();
            let masks = [mask(Rle::from_rows(24, 8, &rows).expect("sound"))];
            let points: Vec<Point3<f32>> = points.into_iter().map(Point3::from).collect();
            let reversed: Vec<Point3<f32>> = points.iter().rev().copied().collect();
            let forward = label_points(&points, &camera, &masks, &LabelConfig::default());
            let mut backward = label_points(&reversed, &camera, &masks, &LabelConfig::default());
            backward.reverse();
            prop_assert_eq!(forward, backward);
        }
    }
}
