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
    camera.validate()?;
    config.validate()?;
    let tolerance =
        Tolerance { step_m: config.hidden_step_m, step_share: config.hidden_step_share, slope: config.max_slope };
    let view = WholeView::new(points_in_camera, &View::Camera, camera, config.cell_px);
    Ok(view.visible(points_in_camera.len(), &tolerance))
}
