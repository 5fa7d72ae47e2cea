//! Stitching: the fast form against the plain one, against the panorama that one camera would have taken, and labels on
//! what was stitched.

mod support;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::camera::{DoubleSphere, KannalaBrandt, Ocam, OcamCalibration, PinholeRadtan};
use omni_perception::*;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use support::{Moment, render, segment};

const SIZE_PX: u32 = 768;

/// Back to back, 3 cm apart, looking to the left and to the right.
fn two_fisheyes(camera: &Camera) -> [Lens; 2] {
    [1.0, -1.0].map(|side| Lens {
        camera: camera.clone(),
        panorama_from_lens: Isometry3::from_parts(
            Translation3::new(0.0, 0.015 * side, 0.0),
            UnitQuaternion::from_euler_angles(0.02, -0.01, side * FRAC_PI_2),
        ),
    })
}

fn fisheye() -> Camera {
    let focal_px = 220.0;
    let intrinsics = Intrinsics {
        width_px: SIZE_PX,
        height_px: SIZE_PX,
        fx_px: focal_px,
        fy_px: focal_px * 1.002,
        cx_px: 385.2,
        cy_px: 381.7,
    };
    let lens = KannalaBrandt::new(intrinsics, [0.004, -0.002, 0.0005, -0.0001], 97_f64.to_radians());
    Camera::KannalaBrandt(lens.expect("sound"))
}

/// What a lens sees: a colour for each direction of the panorama's frame, on the sphere about its centre.
fn photograph(lens: &Lens, distance_m: f64, color: impl Fn(&Vector3<f64>) -> [f64; 3]) -> RgbImage {
    let domain = lens.camera.domain();
    let (width, height) = (domain.width_px, domain.height_px);
    let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
    for row in 0..height {
        for column in 0..width {
            let pixel = Pixel { u: f64::from(column) + 0.5, v: f64::from(row) + 0.5 };
            let seen = lens.camera.unproject(pixel).map_or([0.0; 3], |direction| {
                let along = lens.panorama_from_lens.rotation * direction.into_inner();
                let from = lens.panorama_from_lens.translation.vector;
                // From the lens along the ray to the sphere: |from + t along| = distance.
                let half = from.dot(&along);
                let t = -half + (half * half - from.norm_squared() + distance_m * distance_m).sqrt();
                color(&((from + along * t) / distance_m))
            });
            rgb.extend(seen.map(|value| value.round().clamp(0.0, 255.0) as u8));
        }
    }
    RgbImage { width, height, rgb }
}

/// A smooth world: waves of up to 60 periods a turn, that is 32 pixels of the panorama or 23 of the fisheye.
fn waves(d: &Vector3<f64>) -> [f64; 3] {
    let wave = |k: f64, n: [f64; 3]| (k * Vector3::from(n).normalize().dot(d)).sin();
    [
        128.0 + 50.0 * wave(60.0, [1.0, 0.3, 0.2]) + 40.0 * wave(9.0, [0.1, 1.0, -0.4]),
        128.0 + 50.0 * wave(45.0, [-0.2, 1.0, 0.5]) + 40.0 * wave(7.0, [1.0, 0.0, 1.0]),
        120.0 + 50.0 * wave(50.0, [0.3, -0.2, 1.0]) + 40.0 * wave(11.0, [0.7, 0.7, 0.1]),
    ]
}

/// The panorama that one camera in its centre would have taken.
fn direct(panorama: &Equirectangular, color: impl Fn(&Vector3<f64>) -> [f64; 3]) -> RgbImage {
    let (width, height) = (panorama.width_px, panorama.height_px);
    let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    let rgb = pixels
        .flat_map(|(column, row)| {
            let direction = panorama.unproject(f64::from(column) + 0.5, f64::from(row) + 0.5);
            color(&direction).map(|value| value.round().clamp(0.0, 255.0) as u8)
        })
        .collect();
    RgbImage { width, height, rgb }
}

/// Peak signal to noise ratio in decibels over the columns that are wanted.
fn psnr_db(a: &RgbImage, b: &RgbImage, is_wanted: impl Fn(u32) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (index, (x, y)) in a.rgb.iter().zip(&b.rgb).enumerate() {
        if is_wanted((index / 3) as u32 % a.width) {
            sum += (f64::from(*x) - f64::from(*y)).powi(2);
            count += 1.0;
        }
    }
    10.0 * (255.0 * 255.0 * count / f64::max(sum, 1e-9)).log10()
}

fn is_away_from_seams(column: u32) -> bool {
    // The lenses meet ahead and behind; their bands are 0.1 rad, 31 columns, wide.
    (40..920).contains(&column) || (1000..1880).contains(&column)
}

#[test]
fn a_stitched_panorama_is_the_one_that_one_camera_would_have_taken() {
    let config = StitchConfig { distance_m: 4.0, ..StitchConfig::default() };
    let lenses = two_fisheyes(&fisheye());
    let stitcher = Stitcher::new(&lenses, &config).expect("sound");
    assert_eq!(stitcher.covered_share(), 1.0);
    let truth = direct(&config.panorama, waves);
    // Joined where the walls are, and with the walls nearer: then only the lenses' offset is left.
    for (range_m, away_db, all_db) in [(4.0, 42.0, 42.0), (2.0, 35.0, 35.0)] {
        let images: Vec<RgbImage> = lenses.iter().map(|lens| photograph(lens, range_m, waves)).collect();
        let stitched = stitcher.stitch(&images).expect("fits");
        let (away, all) = (psnr_db(&stitched, &truth, is_away_from_seams), psnr_db(&stitched, &truth, |_| true));
        println!("walls at {range_m} m: {away:.1} dB away from the seams, {all:.1} dB everywhere");
        assert!(away > away_db && all > all_db, "{range_m} m: {away} dB, {all} dB");
    }
}

#[test]
fn the_table_is_the_plain_text() {
    let config = StitchConfig {
        panorama: Equirectangular { width_px: 480, height_px: 160, ..Equirectangular::default() },
        ..StitchConfig::default()
    };
    let lenses = two_fisheyes(&fisheye());
    let images: Vec<RgbImage> = lenses.iter().map(|lens| photograph(lens, 4.0, waves)).collect();
    let gains = [[0.9, 1.0, 1.1], [1.05, 0.95, 1.0]];
    let plain = stitch_plainly(&lenses, &config, &images, &gains).expect("fits");
    let mut fast = RgbImage { width: 7, height: 1, rgb: vec![9; 3] };
    let stitcher = Stitcher::new(&lenses, &config).expect("sound");
    stitcher.stitch_into(&images, &gains, &mut fast).expect("fits");
    assert_eq!((fast.width, fast.height), (480, 160));
    // The waves are as steep as 17 grey levels a pixel of the fisheye; a place is right to 1/32 pixel each way, and both
    // ways round twice.
    let differences: Vec<i32> =
        plain.rgb.iter().zip(&fast.rgb).map(|(a, b)| (i32::from(*a) - i32::from(*b)).abs()).collect();
    assert!(differences.iter().all(|d| *d <= 2), "{:?}", differences.iter().max());
    let mean = f64::from(differences.iter().sum::<i32>()) / differences.len() as f64;
    assert!(mean < 0.3, "{mean}");
    // Twice the same.
    let mut again = fast.clone();
    stitcher.stitch_into(&images, &gains, &mut again).expect("fits");
    assert_eq!(again, fast);
}

#[test]
fn lenses_of_different_brightness_agree_after_their_gains() {
    let config = StitchConfig::default();
    let lenses = two_fisheyes(&fisheye());
    let stitcher = Stitcher::new(&lenses, &config).expect("sound");
    let dark = |d: &Vector3<f64>| {
        let [r, g, b] = waves(d);
        [0.6 * r, 0.8 * g, b]
    };
    let images = [photograph(&lenses[0], 4.0, waves), photograph(&lenses[1], 4.0, dark)];
    let gains = stitcher.gains(&images).expect("fits");
    for (channel, expected) in [(0, 0.6), (1, 0.8), (2, 1.0)] {
        let ratio = f64::from(gains[0][channel] / gains[1][channel]);
        assert!((ratio / expected - 1.0).abs() < 0.02, "{gains:?}");
        assert!((gains[0][channel] * gains[1][channel] - 1.0).abs() < 1e-4, "their product is 1");
    }
    let alone = Stitcher::new(&lenses[..1], &config).expect("sound");
    assert_eq!(alone.gains(&images[..1]).expect("fits"), [[1.0; 3]]);
    assert!(alone.covered_share() > 0.5 && alone.covered_share() < 0.6);
}

#[test]
fn every_model_can_be_stitched() {
    let intrinsics = |focal_px: f64| Intrinsics {
        width_px: 400,
        height_px: 400,
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: 199.5,
        cy_px: 199.5,
    };
    let wide = 95_f64.to_radians();
    let sphere = DoubleSphere::new(intrinsics(75.0), -0.2, 0.6, wide).expect("sound");
    let calibration = OcamCalibration {
        width_px: 400,
        height_px: 400,
        polynomial: vec![-110.0, 0.0, 0.0038, 0.0, 0.0],
        inverse_polynomial: vec![],
        centre_row_column_px: [199.5, 199.5],
        affine: [1.0, 0.001, -0.002],
    };
    let ocam = Ocam::new(calibration, wide).expect("sound");
    let panorama = Equirectangular { width_px: 480, height_px: 160, ..Equirectangular::default() };
    let config = StitchConfig { panorama, ..StitchConfig::default() };
    let slow =
        |d: &Vector3<f64>| [128.0 + 100.0 * (5.0 * d.x).sin(), 128.0 + 100.0 * (5.0 * d.y).sin(), 128.0 + 100.0 * d.z];
    let truth = direct(&panorama, slow);
    let check = |lenses: &[Lens], least_db: f64| {
        let images: Vec<RgbImage> = lenses.iter().map(|lens| photograph(lens, 4.0, slow)).collect();
        let stitcher = Stitcher::new(lenses, &config).expect("sound");
        assert_eq!(stitcher.covered_share(), 1.0);
        let stitched = stitcher.stitch(&images).expect("fits");
        let db = psnr_db(&stitched, &truth, |_| true);
        assert!(db > least_db, "{db} dB");
    };
    check(&two_fisheyes(&Camera::DoubleSphere(sphere)), 45.0);
    check(&two_fisheyes(&Camera::Ocam(ocam)), 45.0);
    // Four normal lenses of 2 x 62 degrees all round.
    let pinhole = PinholeRadtan::new(intrinsics(90.0), [0.02, -0.003, 0.0005, -0.0002, 0.0], PI).expect("sound");
    let normal: Vec<Lens> = (0..4)
        .map(|k| Lens {
            camera: Camera::PinholeRadtan(pinhole),
            panorama_from_lens: Isometry3::rotation(Vector3::z() * FRAC_PI_2 * f64::from(k)),
        })
        .collect();
    check_share_and_colour(&normal, &config, &truth, slow);
}

/// Four normal lenses leave their upper corners open: what they do see is right.
fn check_share_and_colour(
    lenses: &[Lens],
    config: &StitchConfig,
    truth: &RgbImage,
    color: impl Fn(&Vector3<f64>) -> [f64; 3],
) {
    let images: Vec<RgbImage> = lenses.iter().map(|lens| photograph(lens, 4.0, &color)).collect();
    let stitcher = Stitcher::new(lenses, config).expect("sound");
    assert!(stitcher.covered_share() > 0.85, "{}", stitcher.covered_share());
    let stitched = stitcher.stitch(&images).expect("fits");
    let mut worst = 0;
    for (index, source) in stitcher.sources().iter().enumerate() {
        let of = |image: &RgbImage| [image.rgb[3 * index], image.rgb[3 * index + 1], image.rgb[3 * index + 2]];
        match source {
            None => assert_eq!(of(&stitched), [0; 3]),
            Some(_) => worst = worst.max((0..3).map(|k| of(&stitched)[k].abs_diff(of(truth)[k])).max().unwrap_or(0)),
        }
    }
    assert!(worst <= 4, "{worst} grey levels");
}

#[test]
fn labels_on_a_stitched_panorama_are_as_right_as_on_one_camera() {
    // The furnished room; the segmenter sees the stitched picture, so its masks are in the stitched geometry.
    let moment = Moment::new(3, 0.015, 2);
    let lenses = two_fisheyes(&fisheye());
    let config = StitchConfig::default();
    let stitcher = Stitcher::new(&lenses, &config).expect("sound");
    let things: Vec<Vec<usize>> = lenses
        .iter()
        .map(|lens| {
            let world_from_lens = moment.world_from_camera * lens.panorama_from_lens;
            let origin = world_from_lens * Point3::origin();
            let pixels = (0..SIZE_PX).flat_map(|row| (0..SIZE_PX).map(move |column| (column, row)));
            let look = |(column, row): (u32, u32)| {
                let pixel = Pixel { u: f64::from(column) + 0.5, v: f64::from(row) + 0.5 };
                let direction = lens.camera.unproject(pixel)?;
                moment.scene.cast(&origin, &(world_from_lens.rotation * direction.into_inner()))
            };
            pixels.map(|pixel| look(pixel).map_or(0, |hit| hit.1)).collect()
        })
        .collect();
    let image: Vec<usize> = stitcher
        .sources()
        .iter()
        .map(|source| {
            source.map_or(0, |s| {
                things[usize::from(s.lens)][usize::from(s.row) * SIZE_PX as usize + usize::from(s.column)]
            })
        })
        .collect();
    let masks = segment(&moment.scene, &image, stitcher.panorama(), 2);
    // What one camera sees differs in pixels at borders only.
    let one = render(&moment.scene, &moment.world_from_camera, stitcher.panorama());
    let different = image.iter().zip(&one).filter(|(a, b)| a != b).count() as f64 / one.len() as f64;
    assert!(different < 0.01, "{different}");
    let share = |masks: Vec<Mask>| {
        let panorama = MaskedPanorama { stamp: Stamp(0), masks, image: None };
        let config = ObservationConfig::default();
        let (points, camera) = (&moment.points_in_world, stitcher.panorama());
        let seen = observe_panorama(&panorama, points, &moment.world_from_camera, camera, &config).expect("sound");
        let (mut right, mut labelled) = (0, 0);
        for (mask, thing) in seen.mask_of_point.iter().zip(&moment.things) {
            if let Some(mask) = mask {
                labelled += 1;
                right += usize::from(panorama.masks[usize::from(*mask)].label == moment.scene.names[*thing]);
            }
        }
        (right as f64 / f64::from(labelled), labelled)
    };
    let ((stitched, labelled), (single, of_single)) = (share(masks), share(moment.masks.clone()));
    println!("right labels: stitched {stitched:.4} of {labelled}, one camera {single:.4} of {of_single}");
    assert!(stitched > 0.985 && stitched > single - 0.005, "{stitched} {single}");
    assert!(f64::from(labelled) > 0.97 * f64::from(of_single), "{labelled} {of_single}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// However lenses lie: weights are right (grey stays grey), black is black, sources are pixels of their lenses.
    #[test]
    fn grey_stays_grey_wherever_the_lenses_look(
        turns in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 1..5),
        half_view in 0.3..2.5_f64,
        feather_rad in 0.001..1.0_f64,
        value in 0..=255_u8,
    ) {
        let intrinsics =
            Intrinsics { width_px: 90, height_px: 70, fx_px: 20.0, fy_px: 21.0, cx_px: 44.0, cy_px: 36.0 };
        let lenses: Vec<Lens> = turns.iter().map(|axis| Lens {
            camera: Camera::KannalaBrandt(KannalaBrandt::new(intrinsics, [0.0; 4], half_view).expect("sound")),
            panorama_from_lens: Isometry3::from_parts(
                Translation3::new(0.05, 0.0, -0.02),
                UnitQuaternion::from_scaled_axis(Vector3::from(*axis)),
            ),
        }).collect();
        let panorama = Equirectangular { width_px: 120, height_px: 40, ..Equirectangular::default() };
        let config = StitchConfig { panorama, feather_rad, ..StitchConfig::default() };
        let stitcher = Stitcher::new(&lenses, &config).expect("sound");
        let grey = RgbImage { width: 90, height: 70, rgb: vec![value; 3 * 90 * 70] };
        let images = vec![grey; lenses.len()];
        let gains = stitcher.gains(&images).expect("fits");
        prop_assert!(gains.iter().flatten().all(|gain| (gain - 1.0).abs() < 1e-4), "{gains:?}");
        let stitched = stitcher.stitch(&images).expect("fits");
        let sources = stitcher.sources();
        prop_assert_eq!(sources.len(), 120 * 40);
        for (pixel, source) in stitched.rgb.chunks_exact(3).zip(&sources) {
            let expected = if source.is_some() { value } else { 0 };
            prop_assert_eq!(pixel, &[expected; 3][..]);
            if let Some(source) = source {
                prop_assert!(usize::from(source.lens) < lenses.len() && source.column < 90 && source.row < 70);
            }
        }
        let seen = sources.iter().flatten().count() as f64 / sources.len() as f64;
        prop_assert!((seen - stitcher.covered_share()).abs() < 1e-12);
    }
}
