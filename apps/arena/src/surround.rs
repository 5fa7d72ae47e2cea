//! Several lenses in place of one panoramic camera: the world's side takes their pictures, the robot's side stitches them,
//! and the simulated segmenter says what the stitched picture shows.
//!
//! The pictures come from the simulator's own lens mathematics ([`omni_sim::fisheye`]); where they go in the panorama is
//! the robot's business ([`Stitcher`]). A segmenter works on the stitched picture, so what it can find in a pixel is what
//! the lens behind that pixel truly saw: if the robot stitches wrongly, its masks lie wrong against its points, as they
//! would in life. Where no lens looks there is nothing to find.

use anyhow::{Context, Result, bail};
use mission::omni_perception::{Camera, LensPixel, RgbImage, Stitcher};
use mission::rig::{Rig, RigCamera};
use nalgebra::Isometry3;
use omni_sim::equirect::Equirect;
use omni_sim::fisheye::{Curve, Fisheye, FisheyeConfig, FisheyeTruth, photograph};
use omni_sim::mesh::InstanceId;
use omni_sim::motion::Motion;
use omni_sim::panorama::PanoramaRecord;
use omni_sim::render::Rendering;
use omni_sim::segmenter::{SegmenterConfig, segment};
use omni_sim::world::World;

/// Lenses, and what is done with their pictures.
pub struct Surround {
    eyes: Vec<(Fisheye, Isometry3<f64>)>,
    stitcher: Stitcher,
    /// The lens pixel behind each pixel of the panorama.
    sources: Vec<Option<LensPixel>>,
    body_from_panorama: Isometry3<f64>,
}

/// The pictures of all lenses at one time.
pub struct Pictures {
    /// What the robot gets.
    pub images: Vec<RgbImage>,
    /// What truly is in each pixel, which it does not.
    truth: Vec<FisheyeTruth>,
}

impl Surround {
    /// `None` if the rig's camera takes the panorama itself.
    ///
    /// # Errors
    /// If a camera is of a kind that the simulator has no lens for.
    pub fn new(rig: &Rig, max_range_m: f64) -> Result<Option<Surround>> {
        let Some(stitcher) = rig.stitcher().context("joining the cameras to a panorama")? else { return Ok(None) };
        let eye = |camera: &RigCamera| {
            let fisheye = Fisheye::new(fisheye_config(camera, max_range_m)?);
            let fisheye = fisheye.with_context(|| format!("simulating the camera \"{}\"", camera.name))?;
            Ok((fisheye, camera.body_from_camera))
        };
        Ok(Some(Surround {
            eyes: rig.cameras.iter().map(eye).collect::<Result<_>>()?,
            sources: stitcher.sources(),
            stitcher,
            body_from_panorama: rig.panorama.body_from_panorama,
        }))
    }

    /// Takes a picture with every lens.
    pub fn photograph(&self, world: &World, motion: &dyn Motion, stamp_ns: i64) -> Result<Pictures> {
        let mut pictures = Pictures { images: Vec::new(), truth: Vec::new() };
        for (fisheye, body_from_camera) in &self.eyes {
            let (record, truth) =
                photograph(world, motion, body_from_camera, fisheye, stamp_ns).context("taking a picture")?;
            pictures.images.push(RgbImage { width: record.width, height: record.height, rgb: record.rgb });
            pictures.truth.push(truth);
        }
        Ok(pictures)
    }

    /// The robot's part: one panorama of all pictures.
    pub fn stitch(&self, pictures: &Pictures) -> Result<RgbImage> {
        self.stitcher.stitch(&pictures.images).context("stitching a panorama")
    }

    /// What the segmenter says about the stitched picture.
    pub fn segment(
        &self,
        pictures: &Pictures,
        panorama: RgbImage,
        world: &World,
        motion: &dyn Motion,
        segmenter: &SegmenterConfig,
        stamp_ns: i64,
    ) -> Result<PanoramaRecord> {
        segmenter.validate().context("segmenting a panorama")?;
        let world_from_panorama = motion.at(stamp_ns).world_from_body * self.body_from_panorama;
        let (width, height) = (panorama.width, panorama.height);
        let instances = self.instances(pictures);
        let rendering = Rendering { view: self.view(), rgb: panorama.rgb, instances, rays: 0 };
        let masks = segment(&world.at(stamp_ns), &rendering, &world_from_panorama, stamp_ns, segmenter);
        Ok(PanoramaRecord { stamp_ns, width, height, rgb: rendering.rgb, masks })
    }

    /// The thing that each pixel of the stitched panorama shows, column by column; 0 for the structure and where no lens
    /// looks.
    pub fn instances(&self, pictures: &Pictures) -> Vec<InstanceId> {
        let view = self.view();
        let (width, height) = (view.width as usize, view.height as usize);
        let mut instances = vec![0; width * height];
        for (index, source) in self.sources.iter().enumerate() {
            if let Some(source) = source {
                let (lens, column, row) =
                    (usize::from(source.lens), usize::from(source.column), usize::from(source.row));
                let rows = pictures.images[lens].height as usize;
                instances[index % width * height + index / width] = pictures.truth[lens][column * rows + row];
            }
        }
        instances
    }

    fn view(&self) -> Equirect {
        let panorama = self.stitcher.panorama();
        Equirect {
            width: panorama.width_px,
            height: panorama.height_px,
            phi_top_rad: panorama.phi_top_rad,
            phi_bottom_rad: panorama.phi_bottom_rad,
        }
    }
}

/// Whether the simulator has lenses for all cameras of a rig; quick, for the time before anything is built.
///
/// # Errors
/// The first camera that it has none for.
pub fn check(rig: &Rig) -> Result<()> {
    match rig.cameras[..] {
        [RigCamera { model: Camera::Equirectangular(_), .. }] => Ok(()),
        _ => rig.cameras.iter().try_for_each(|camera| fisheye_config(camera, 1.0).map(|_| ())),
    }
}

/// A rig's camera as the simulator describes lenses.
fn fisheye_config(camera: &RigCamera, max_range_m: f64) -> Result<FisheyeConfig> {
    let domain = camera.model.domain();
    let (curve, focal_px, center_px, slant) = match &camera.model {
        Camera::KannalaBrandt(lens) => {
            let i = lens.intrinsics();
            (Curve::OddPolynomial { k: *lens.k() }, [i.fx_px, i.fy_px], [i.cx_px, i.cy_px], [0.0, 0.0])
        }
        Camera::DoubleSphere(lens) => {
            let i = lens.intrinsics();
            let curve = Curve::DoubleSphere { xi: lens.xi(), alpha: lens.alpha() };
            (curve, [i.fx_px, i.fy_px], [i.cx_px, i.cy_px], [0.0, 0.0])
        }
        Camera::Ocam(lens) => {
            // (row, column) = [[c, d], [e, 1]] (down, right) + centre
            let calibration = lens.calibration();
            let ([c, d, e], [row, column]) = (calibration.affine, calibration.centre_row_column_px);
            (Curve::Rays { c: calibration.polynomial.clone() }, [1.0, c], [column, row], [d, e])
        }
        Camera::PinholeRadtan(_) | Camera::Equirectangular(_) => bail!(
            "the simulator has lenses for kannala-brandt, double-sphere and ocam cameras, and \"{}\" is none of them",
            camera.name
        ),
    };
    Ok(FisheyeConfig {
        width: domain.width_px,
        height: domain.height_px,
        curve,
        focal_px,
        slant,
        center_px,
        max_angle_rad: domain.max_angle_rad,
        max_range_m,
    })
}
