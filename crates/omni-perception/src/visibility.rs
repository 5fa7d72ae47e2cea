//! What the camera can see of a cloud, without any mask: the range buffer alone.

use nalgebra::Point3;

use crate::fast_projection::View;
use crate::range_buffer::{Tolerance, WholeView};
use crate::{Equirectangular, LabelConfig, LabelError};

/// For each point, in the camera frame, whether it is in the panorama and nothing nearer stands before it.
///
/// Of `config` only the cell's edge and what hides a point are used (`cell_px`, `hidden_step_m`, `hidden_step_share`,
/// `max_slope`). Points that are not finite, or in the camera's origin, are not visible. An empty cloud gives an empty answer.
///
/// ```
/// use nalgebra::Point3;
/// use omni_perception::*;
/// // A wall behind a post, and a wall beside it.
/// let points = [Point3::new(2.0, 0.0, 0.0), Point3::new(4.0, 0.0, 0.0), Point3::new(0.0, 4.0, 0.0)];
/// let visible = visible_points(&points, &Equirectangular::default(), &LabelConfig::default())?;
/// assert_eq!(visible, [true, false, true]);
/// # Ok::<(), LabelError>(())
/// ```
///
/// # Errors
/// [`LabelError`] for an unsound camera or configuration.
pub fn visible_points(
    points_in_camera: &[Point3<f32>],
    camera: &Equirectangular,
    config: &LabelConfig,
) -> Result<Vec<bool>, LabelError> {
    let mut visible = Vec::new();
    Visibility::new(camera, config)?.see(points_in_camera, &mut visible);
    Ok(visible)
}

/// [`visible_points`] for cloud after cloud, in the same memory.
#[derive(Debug, Clone)]
pub struct Visibility {
    view: WholeView,
    tolerance: Tolerance,
}

impl Visibility {
    /// Takes about 30 bytes for each cell of the image.
    ///
    /// # Errors
    /// [`LabelError`] for an unsound camera or configuration.
    pub fn new(camera: &Equirectangular, config: &LabelConfig) -> Result<Visibility, LabelError> {
        camera.validate()?;
        config.validate()?;
        let tolerance =
            Tolerance { step_m: config.hidden_step_m, step_share: config.hidden_step_share, slope: config.max_slope };
        Ok(Visibility { view: WholeView::new(camera, config.cell_px), tolerance })
    }

    /// Writes for each point, in the camera frame, whether the camera sees it. After the first cloud of a size nothing is
    /// allocated.
    pub fn see(&mut self, points_in_camera: &[Point3<f32>], visible: &mut Vec<bool>) {
        visible.clear();
        visible.resize(points_in_camera.len(), false);
        self.view.fill(points_in_camera, &View::Camera);
        self.view.see(&self.tolerance, visible);
    }
}
